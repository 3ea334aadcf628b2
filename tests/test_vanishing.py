"""Heading from the borders' vanishing point, roll and pitch from the horizon: exact, by hand, and both ways."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from landing_sim.geometry.pinhole import Intrinsics, project
from landing_sim.geometry.runway_image import HORIZON, LEFT, RIGHT, horizon_dip, image_line, plane_normal
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.geometry.vanishing import (
    distance_along_horizon,
    down_from_level_line,
    heading_from_distance,
    heading_from_point,
    heading_variance,
    horizon_distance,
    lifted,
    roll_and_pitch,
    vanishing_point,
)

LENS = Intrinsics.centred(1280, 960, 1500.0)
RAD = math.radians(1.0)
STRAIGHT = camera_from_body(0.0, 0.0)
rolls, pitches, headings = st.floats(-35.0, 35.0), st.floats(-20.0, 20.0), st.floats(-30.0, 30.0)


def level_line(phi: float, theta: float) -> np.ndarray:
    """Where level lines vanish, from the renderer's own projection of two far points at the camera's height."""
    R_CR = STRAIGHT @ from_euler(phi, theta, 0.0).T
    far = project(np.array([[1e3, -200.0, 0.0], [1e3, 200.0, 0.0]]) @ R_CR.T, LENS)
    l = np.cross([*far[0], 1.0], [*far[1], 1.0])
    above = project(np.array([[1e3, 0.0, -100.0]]) @ R_CR.T, LENS)[0]
    return l * np.sign(l @ [*above, 1.0])


def test_hand_computed() -> None:
    """phi 20, theta 5, dpsi 3 deg at f = 1000: tan phi tan theta = .0318434, tan dpsi / cos theta = .0526080."""
    d_F = horizon_distance(20.0 * RAD, 5.0 * RAD, 3.0 * RAD, 1000.0)
    assert d_F == pytest.approx(31.8434 + 52.6080, abs=2e-4)
    assert heading_from_distance(d_F, 20.0 * RAD, 5.0 * RAD, 1000.0) == pytest.approx(3.0 * RAD, abs=1e-15)
    # level wings, nose 3 deg up, runway dead ahead: below the centre by f tan 3 deg = 78.61 px
    assert vanishing_point(0.0, 3.0 * RAD, 0.0, LENS) == pytest.approx([639.5, 479.5 + 78.61], abs=5e-3)
    # the wrong reading of d_F, u_VP for it, gives 2.71 deg
    u = vanishing_point(20.0 * RAD, 5.0 * RAD, 3.0 * RAD, LENS)[0] - LENS.cx
    assert heading_from_distance(u, 20.0 * RAD, 5.0 * RAD, LENS.f) / RAD == pytest.approx(2.71, abs=5e-3)


@given(rolls, pitches, headings)
def test_exact_to_a_billionth_from_the_borders_of_a_runway_seen_anywhere(phi: float, theta: float, dpsi: float) -> None:
    phi, theta, dpsi = phi * RAD, theta * RAD, dpsi * RAD
    R_CR = STRAIGHT @ from_euler(phi, theta, -dpsi).T
    p_RC = np.array([-2000.0, 130.0, -110.0])
    borders = [image_line(plane_normal(k, p_RC, 45.0, 0.0, 0.0), R_CR, LENS.f, LENS.cx, LENS.cy) for k in (LEFT, RIGHT)]
    x = np.cross(*(b / np.linalg.norm(b[:2]) for b in borders))
    uv = x[:2] / x[2]
    assert uv == pytest.approx(vanishing_point(phi, theta, dpsi, LENS), abs=1e-6)
    heading, above = heading_from_point(uv, from_euler(phi, theta, 0.0) @ STRAIGHT.T, LENS)
    assert abs(heading - dpsi) < 1e-9
    assert abs(above) < 1e-9
    line = level_line(phi, theta)
    d_F = distance_along_horizon(uv, line, LENS)
    assert abs(d_F - horizon_distance(phi, theta, dpsi, LENS.f)) < 1e-6
    assert abs(heading_from_distance(d_F, phi, theta, LENS.f) - dpsi) < 1e-9
    assert roll_and_pitch(down_from_level_line(line, LENS), STRAIGHT) == pytest.approx((phi, theta), abs=1e-9)


@given(rolls, pitches, headings)
def test_mirrored_flight_mirrored_picture(phi: float, theta: float, dpsi: float) -> None:
    phi, theta, dpsi = phi * RAD, theta * RAD, dpsi * RAD
    a, b = vanishing_point(phi, theta, dpsi, LENS), vanishing_point(-phi, theta, -dpsi, LENS)
    assert a[0] + b[0] == pytest.approx(2.0 * LENS.cx, abs=1e-9)
    assert a[1] == pytest.approx(b[1], abs=1e-9)
    assert horizon_distance(phi, theta, dpsi, LENS.f) == pytest.approx(-horizon_distance(-phi, theta, -dpsi, LENS.f))


@given(rolls, pitches, headings, st.floats(-15.0, 15.0), st.floats(-10.0, 10.0))
def test_a_camera_on_a_platform_gives_the_body(phi: float, theta: float, dpsi: float, pan: float, tilt: float) -> None:
    phi, theta, dpsi = phi * RAD, theta * RAD, dpsi * RAD
    R_CB = camera_from_body(pan * RAD, tilt * RAD)
    R_CR = R_CB @ from_euler(phi, theta, -dpsi).T
    d = R_CR @ np.array([1.0, 0.0, 0.0])
    uv = np.array([LENS.cx + LENS.f * d[0] / d[2], LENS.cy + LENS.f * d[1] / d[2]])
    assert heading_from_point(uv, from_euler(phi, theta, 0.0) @ R_CB.T, LENS)[0] == pytest.approx(dpsi, abs=1e-12)
    assert roll_and_pitch(R_CR @ np.array([0.0, 0.0, 1.0]), R_CB) == pytest.approx((phi, theta), abs=1e-12)


@given(st.floats(-30.0, 30.0), st.floats(-8.0, 8.0), st.floats(20.0, 600.0))
def test_the_sea_horizon_raised_by_its_dip_is_the_level(phi: float, theta: float, height: float) -> None:
    phi, theta = phi * RAD, theta * RAD
    R_CR = STRAIGHT @ from_euler(phi, theta, 0.0).T
    dip, azimuth = horizon_dip(height), np.array([-20.0, -7.0, 4.0, 19.0]) * RAD
    rays = np.column_stack(
        [math.cos(dip) * np.cos(azimuth), math.cos(dip) * np.sin(azimuth), np.full(4, math.sin(dip))]
    )
    seen = project(rays @ R_CR.T, LENS)
    for k in range(4):  # the renderer's and the filter's horizon
        l = image_line(
            plane_normal(HORIZON, np.array([0, 0, -height]), 45.0, 0.0, azimuth[k]), R_CR, LENS.f, LENS.cx, LENS.cy
        )
        assert abs(l @ [*seen[k], 1.0]) / np.hypot(l[0], l[1]) < 1e-9
    level = lifted(seen, R_CR[:, 2], dip, LENS)
    line = level_line(phi, theta)
    assert level @ line[:2] + line[2] == pytest.approx(0.0, abs=1e-7 * float(np.hypot(line[0], line[1])))


def test_variance_is_that_of_scattered_points() -> None:
    phi, theta, dpsi = 10.0 * RAD, 3.0 * RAD, 30.0 * RAD
    R_LC = from_euler(phi, theta, 0.0) @ STRAIGHT.T
    uv, cov = vanishing_point(phi, theta, dpsi, LENS), np.array([[4.0, 1.0], [1.0, 9.0]])
    rng = np.random.default_rng(2)
    drawn = [heading_from_point(p, R_LC, LENS)[0] for p in rng.multivariate_normal(uv, cov, 4000)]
    assert heading_variance(uv, cov, R_LC, LENS) == pytest.approx(np.var(drawn), rel=0.08)


def test_a_horizon_on_edge_is_refused() -> None:
    with pytest.raises(ValueError, match="mid-line"):
        distance_along_horizon(np.array([600.0, 400.0]), np.array([1.0, 0.0, -600.0]), LENS)
