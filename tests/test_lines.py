"""Straight lines from edges: exact without noise, as uncertain as they say with it, one outlier left out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from landing_sim.estimators.lines import (
    Crossings,
    ImageLine,
    LineConfig,
    crossings,
    fit_line,
    held_to,
    runway_lines,
    threshold_direction,
)
from landing_sim.geometry.pinhole import Intrinsics, project
from landing_sim.geometry.runway_image import displacement, horizon_dip, image_line, plane_normal
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.geometry.vanishing import down_from_level_line, roll_and_pitch
from landing_sim.signals import EdgeSet, Feature, Status

LENS = Intrinsics.centred(1280, 960, 1500.0)
RAD = math.radians(1.0)
WIDTH = 45.0


def points_on(angle: float, at: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of a line through (100, 200) at `angle` to the u axis, searched along v, 0.1 px."""
    p = np.array([[100.0 + s * math.cos(angle), 200.0 + s * math.sin(angle)] for s in at])
    return p, np.tile([0.0, -1.0], (len(at), 1)), np.full(len(at), 0.01)


def test_two_points_by_hand() -> None:
    """(0, 0) and (4, 3), searched upwards: normal (.6, -.8), offset 0; 0.1 px each along v is .08 along the normal."""
    line = fit_line(np.array([[0.0, 0.0], [4.0, 3.0]]), np.tile([0.0, -1.0], (2, 1)), np.full(2, 0.01))
    assert line is not None
    assert line.n == pytest.approx([0.6, -0.8])
    assert line.offset == pytest.approx(0.0, abs=1e-12)
    assert line.centre == pytest.approx([2.0, 1.5])
    assert line.cov == pytest.approx(np.diag([0.08**2 / 2.0, 2.0 * 0.08**2 / 25.0]))
    assert line.sigma_at(np.array([4.0, 3.0])) == pytest.approx(0.08)
    level = fit_line(np.array([[0.0, 1.0], [9.0, 1.0]]), np.tile([0.0, 1.0], (2, 1)), np.full(2, 0.01))
    assert level is not None
    cross = crossings([(line, level)])
    assert cross is not None
    assert cross.uv[0] == pytest.approx([4.0 / 3.0, 1.0])


@given(st.floats(-1.2, 1.2), st.floats(0.0, 6.0))
def test_mirrored_points_mirrored_line(angle: float, shift: float) -> None:
    p, s, var = points_on(angle, [0.0, 7.0, 15.0 + shift])
    p[1] += [0.03, -0.05]
    var[2] *= 3.0
    a = fit_line(p, s, var)
    b = fit_line(p * [-1.0, 1.0], s * [-1.0, 1.0], var)
    assert a is not None
    assert b is not None
    assert b.n == pytest.approx(a.n * [-1.0, 1.0], abs=1e-9)
    assert b.centre == pytest.approx(a.centre * [-1.0, 1.0], abs=1e-7)
    assert b.cov == pytest.approx(a.cov * np.array([[1.0, -1.0], [-1.0, 1.0]]), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.7, -1.1])
def test_covariances_of_line_and_crossings_are_those_of_the_errors(angle: float) -> None:
    rng = np.random.default_rng(4)
    p, s, var = points_on(angle, [0.0, 10.0, 18.0, 40.0])
    var = var * np.array([1.0, 4.0, 1.0, 2.0])
    s[3] = math.sin(0.6), -math.cos(0.6)
    q, s_q, var_q = points_on(angle + 1.0, [5.0, 9.0, 30.0])
    r, s_r, var_r = points_on(angle - 0.8, [5.0, 9.0, 30.0])
    r[:, 0] += 12.0
    z_line, z_cross = [], []
    for _ in range(1500):
        lines = [
            fit_line(p_k + s_k * (np.sqrt(v_k) * rng.standard_normal(len(p_k)))[:, None], s_k, v_k)
            for p_k, s_k, v_k in ((p, s, var), (q, s_q, var_q), (r, s_r, var_r))
        ]
        a, b, c = (line for line in lines if line is not None)
        n = np.array([math.sin(angle), -math.cos(angle)])
        e = np.array([n @ (a.centre - p[0]), n[0] * a.n[1] - n[1] * a.n[0]])
        z_line.append(float(e @ np.linalg.solve(a.cov, e)) / 2.0)
        got = crossings([(a, b), (a, c)])
        assert got is not None
        truth = crossings([(exact(p, s), exact(q, s_q)), (exact(p, s), exact(r, s_r))])
        assert truth is not None
        d = (got.uv - truth.uv).ravel()
        z_cross.append(float(d @ np.linalg.solve(got.cov, d)) / 4.0)
    assert np.mean(z_line) == pytest.approx(1.0, abs=0.12)
    assert np.mean(z_cross) == pytest.approx(1.0, abs=0.12)


def exact(p: np.ndarray, s: np.ndarray) -> ImageLine:
    line = fit_line(p, s, np.full(len(p), 1.0))
    assert line is not None
    return line


def test_one_outlier_is_left_out_and_two_are_owned_up_to() -> None:
    p, s, var = points_on(0.3, [0.0, 10.0, 20.0, 30.0, 40.0])
    clean = fit_line(p, s, var)
    assert clean is not None
    assert (clean.used, clean.dropped) == (5, 0)
    for k in range(5):
        bad = p.copy()
        bad[k, 1] += 3.0
        line = fit_line(bad, s, var)
        assert line is not None
        assert (line.used, line.dropped) == (4, 1)
        assert line.homogeneous == pytest.approx(clean.homogeneous, abs=1e-6)
    bad = p.copy()
    bad[[1, 3], 1] += [3.0, -4.0]
    line = fit_line(bad, s, var)
    assert line is not None
    assert line.cov[0, 0] > 10.0 * clean.cov[0, 0]
    three = fit_line(p[:3] + [[0.0, 0.0], [0.0, 3.0], [0.0, 0.0]], s[:3], var[:3])  # which of them?
    honest = fit_line(p[:3], s[:3], var[:3])
    assert three is not None
    assert honest is not None
    assert three.dropped == 0
    assert three.cov[0, 0] > 50.0 * honest.cov[0, 0]


def test_too_little_gives_nothing_unless_the_direction_is_known() -> None:
    p, s, var = points_on(0.0, [0.0, 3.0])
    assert fit_line(p[:1], s[:1], var[:1]) is None
    assert fit_line(p, s, var) is None
    assert fit_line(p, s, var, LineConfig(min_baseline=2.0)) is not None
    line = fit_line(p[:1], s[:1], var[:1], expected=(np.array([0.0, -1.0]), 0.01))
    assert line is not None
    assert line.cov == pytest.approx(np.diag([0.01, 1e-4]))
    # one outlier of three is found out by the direction
    p, s, var = points_on(0.0, [0.0, 10.0, 20.0])
    p[2, 1] += 4.0
    line = fit_line(p, s, var, expected=(np.array([0.0, -1.0]), 0.01))
    assert line is not None
    assert (line.used, line.dropped) == (2, 1)


def edges_of(p_RC: np.ndarray, R_CR: np.ndarray, counts: int = 4) -> tuple[np.ndarray, EdgeSet]:
    """Windows a little beside the true edges, and their exact displacements."""
    feature, centre, direction, z = [], [], [], []

    def put(kind: Feature, at_R: np.ndarray, s: tuple[float, float], azimuth: float = 0.0) -> None:
        uv = project(np.array([at_R]) @ R_CR.T, LENS)[0] + [0.7, -0.4]
        l = image_line(plane_normal(kind, p_RC, WIDTH, 0.0, azimuth), R_CR, LENS.f, LENS.cx, LENS.cy)
        feature.append(int(kind))
        centre.append(uv)
        direction.append(s)
        z.append(displacement(l, *uv, *s))

    for x in np.linspace(50.0, 1500.0, counts):
        put(Feature.LEFT, np.array([x, -WIDTH / 2, 0.0]) - p_RC, (1.0, 0.0))
        put(Feature.RIGHT, np.array([x, WIDTH / 2, 0.0]) - p_RC, (-1.0, 0.0))
    for y in np.linspace(-20.0, 20.0, counts):
        put(Feature.THRESHOLD, np.array([0.0, y, 0.0]) - p_RC, (0.0, -1.0))
    dip = horizon_dip(-p_RC[2])
    for a in np.linspace(
        -0.3, 0.3, counts
    ):  # the edge is the cone itself: taken along its own normal, at its own azimuth
        ray = np.array([math.cos(dip) * math.cos(a), math.cos(dip) * math.sin(a), math.sin(dip)])
        feature.append(int(Feature.HORIZON))
        centre.append(project(np.array([ray]) @ R_CR.T, LENS)[0] - [0.0, -2.0])
        direction.append((0.0, -1.0))
        z.append(2.0)
    edges = EdgeSet(
        np.array(feature), np.array(centre), np.array(direction), np.zeros(len(feature), dtype=np.int64), 0.0, 0.0
    )
    return np.array(z), edges


@pytest.mark.parametrize("roll", [0.0, 12.0, -35.0])
def test_lines_of_a_runway_are_exact(roll: float) -> None:
    p_RC, phi, theta, psi = np.array([-2400.0, 60.0, -140.0]), roll * RAD, -1.0 * RAD, 4.0 * RAD
    R_CR = camera_from_body(0.0, 0.0) @ from_euler(phi, theta, psi).T
    z, edges = edges_of(p_RC, R_CR)
    got = runway_lines(z, np.full(len(z), 0.01), edges, LENS, horizon_dip(140.0))
    corners, vanishing = got.corners, got.vanishing
    assert corners is not None
    assert vanishing is not None
    assert got.horizon is not None
    true = project((np.array([[0.0, -WIDTH / 2, 0.0], [0.0, WIDTH / 2, 0.0]]) - p_RC) @ R_CR.T, LENS)
    assert corners.uv == pytest.approx(true, abs=1e-8)
    assert vanishing.uv == pytest.approx(project(R_CR[:, :1].T, LENS), abs=1e-6)
    down = down_from_level_line(got.horizon.homogeneous, LENS)
    assert roll_and_pitch(down, camera_from_body(0.0, 0.0)) == pytest.approx((phi, theta), abs=1e-10)
    # without the dip: too high a nose by about as much
    raw = runway_lines(z, np.full(len(z), 0.01), edges, LENS).horizon
    assert raw is not None
    _, theta_raw = roll_and_pitch(down_from_level_line(raw.homogeneous, LENS), camera_from_body(0.0, 0.0))
    assert theta_raw - theta == pytest.approx(horizon_dip(140.0), rel=0.08)
    # the threshold's direction, known from the attitude, is the one measured
    assert got.threshold is not None
    R_CL = camera_from_body(0.0, 0.0) @ from_euler(phi, theta, 0.0).T
    n = threshold_direction(got.threshold.centre, R_CL, -psi, LENS)
    assert n == pytest.approx(got.threshold.n, abs=1e-9)


def test_a_point_held_to_a_line_moves_there_by_as_much_as_it_may() -> None:
    """By hand: 2 px above a level line, 3 px against 4 px uncertain across it and correlated along."""
    level = ImageLine(np.array([0.0, -1.0]), np.array([5.0, 10.0]), np.diag([16.0, 0.0]), 2, 0)
    point = Crossings(np.array([[3.0, 8.0]]), np.array([[25.0, 6.0], [6.0, 9.0]]))
    got = held_to(point, level)
    assert got.uv[0] == pytest.approx([3.0 + 2.0 * 6.0 / 25.0, 8.0 + 2.0 * 9.0 / 25.0])
    assert got.cov == pytest.approx(
        np.array([[25.0 - 36.0 / 25.0, 6.0 * 16.0 / 25.0], [6.0 * 16.0 / 25.0, 144.0 / 25.0]])
    )
    assert held_to(point, level, 1e6).uv == pytest.approx(point.uv)


def test_what_is_missing_is_none() -> None:
    p_RC = np.array([-2400.0, 60.0, -140.0])
    z, edges = edges_of(p_RC, camera_from_body(0.0, 0.0) @ from_euler(0.0, -1.0 * RAD, 0.0).T)
    for feature, gone in ((Feature.LEFT, "left"), (Feature.THRESHOLD, "threshold"), (Feature.HORIZON, "horizon")):
        status = np.where(edges.feature == feature, int(Status.NO_CONTRAST), int(Status.FOUND))
        z_some = np.where(status == Status.FOUND, z, np.nan)
        some = EdgeSet(edges.feature, edges.centre, edges.direction, status, 0.0, 0.0)
        got = runway_lines(z_some, np.full(len(z), 0.01), some, LENS, 0.006)
        assert getattr(got, gone) is None
        assert (got.corners is None) == (feature != Feature.HORIZON)
        assert (got.vanishing is None) == (feature == Feature.LEFT)
