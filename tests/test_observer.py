"""The range observer on an unknown runway: geometry, Jacobians, scale, observability, latency."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landing_sim.estimators.observer import scene as sc
from landing_sim.estimators.observer.bearings import bearings
from landing_sim.estimators.observer.gibert import Gibert, GibertConfig, correct_range
from landing_sim.estimators.observer.kinematic_ekf import EkfConfig, KinematicEkf
from landing_sim.estimators.observer.looking import Image
from landing_sim.estimators.observer.runway_observer import NAMES, ObserverConfig, RunwayObserver
from landing_sim.estimators.observer.scene import Carriage, Scene, carriage
from landing_sim.estimators.rewind import Rewind
from landing_sim.geometry.earth import level_at
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import displacement, image_line, plane_normal
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.noise import Noise
from landing_sim.signals import Command, EdgeSet, Feature, Measurement, Status
from landing_sim.types import Array

LENS = Intrinsics.centred(1280, 960, 1500.0)
TILT = math.radians(-3.0)
GLIDE = math.radians(3.0)
DT = 0.16  # slower than a camera, for the tests' sake


def edges_of(p_RC: Array, R_RB: Array, width: float, noise: Noise | None = None, sigma: float = 0.0) -> Measurement:
    """Windows along the runway's edges as seen from p_RC, displaced by some pixels from where the edges are."""
    R_CR = camera_from_body(0.0, TILT) @ R_RB.T
    feature, centre, direction, z = [], [], [], []

    def look(kind: Feature, point_R: Array, search: tuple[float, float]) -> None:
        q = R_CR @ (point_R - p_RC)
        if q[2] <= 1.0:
            return
        u, v = LENS.f * q[0] / q[2] + LENS.cx, LENS.f * q[1] / q[2] + LENS.cy
        if not (5.0 < u < 1275.0 and 5.0 < v < 955.0):
            return
        line = image_line(plane_normal(kind, p_RC, width, 0.0, 0.0), R_CR, LENS.f, LENS.cx, LENS.cy)
        s = np.array(search) / math.hypot(*search)
        c = np.array([u + 0.7, v - 0.4])
        feature.append(kind)
        centre.append(c)
        direction.append(s)
        z.append(displacement(line, c[0], c[1], s[0], s[1]))

    for kind, side in ((Feature.LEFT, -0.5), (Feature.RIGHT, 0.5)):
        for s in (0.0, 100.0, 300.0, 700.0, 1500.0, 2500.0):
            look(kind, np.array([s, side * width, 0.0]), (1.0, 0.1))
    for share in (-0.4, -0.2, 0.2, 0.4):
        look(Feature.THRESHOLD, np.array([0.0, share * width, 0.0]), (0.05, -1.0))
    n = len(z)
    out = np.array(z) + (sigma * noise.normal(n) if noise else 0.0)
    found = np.full(n, int(Status.FOUND))
    geometry = EdgeSet(np.array(feature, dtype=np.int64), np.array(centre), np.array(direction), found, 0.0, TILT)
    return Measurement("edges", 0.0, 0.0, out, np.full(n, max(sigma, 0.01) ** 2), geometry)


def test_bearings_of_a_clean_image_are_the_geometry() -> None:
    p_RC, width = np.array([-2000.0, 60.0, -120.0]), 45.0
    R_RB = from_euler(0.1, 0.07, -0.03)
    m = edges_of(p_RC, R_RB, width)
    assert m.geometry is not None
    got = bearings(m.z, m.R, m.geometry, LENS, R_RB, (0.0, 0.0), 120.0)
    assert got.threshold is not None and got.borders is not None and got.turned is not None
    np.testing.assert_allclose(got.threshold[0], [-60.0 / 2000.0, 120.0 / 2000.0, 45.0 / 2000.0], atol=1e-12)
    np.testing.assert_allclose(got.borders[0], [(-22.5 - 60.0) / 120.0, (22.5 - 60.0) / 120.0], atol=1e-10)
    assert np.abs(got.turned[0]).max() < 1e-12


def test_bearings_vary_as_their_variances_say() -> None:
    p_RC, R_RB = np.array([-2000.0, 60.0, -120.0]), from_euler(0.05, 0.07, -0.03)
    y, k, turn, said = [], [], [], []
    noise = Noise(3, "edges")
    for _ in range(300):
        m = edges_of(p_RC, R_RB, 45.0, noise, 0.3)
        assert m.geometry is not None
        got = bearings(m.z, m.R, m.geometry, LENS, R_RB, (0.0, 0.0), 120.0)
        assert got.threshold and got.borders and got.turned
        y.append(got.threshold[0])
        k.append(got.borders[0])
        turn.append(got.turned[0])
        said.append([*got.threshold[1], *got.borders[1], *np.diag(got.turned[1])])
    spread = np.var(np.column_stack([y, k, turn]), axis=0)
    np.testing.assert_allclose(spread, np.mean(said, axis=0), rtol=0.3)


def test_a_wrong_course_turns_the_vanishing_point() -> None:
    """Believed to point 2 degrees left of where it points: the runway appears to the right."""
    p_RC, R_RB = np.array([-2000.0, 0.0, -120.0]), from_euler(0.0, 0.07, 0.0)
    m = edges_of(p_RC, R_RB, 45.0)
    assert m.geometry is not None
    believed = from_euler(0.0, 0.07, math.radians(-2.0)).T  # any body that is believed to be 2 degrees left
    got = bearings(m.z, m.R, m.geometry, LENS, believed.T, (0.0, 0.0), 120.0)
    assert got.turned is not None
    assert math.degrees(got.turned[0][0]) == pytest.approx(-2.0, abs=1e-9)


def test_level_at_the_aircraft_is_not_the_runways() -> None:
    """5 km before the threshold the local level points up ahead by 5000 / 6378137 rad, seen from the runway."""
    forward_R = level_at(np.array([-5000.0, 0.0, -260.0])).T @ np.array([1.0, 0.0, 0.0])
    assert -forward_R[2] == pytest.approx(5000.0 / 6378137.0, rel=1e-6)


def test_an_inertial_reading_seen_from_the_runway() -> None:
    """Course 262 degrees, flying along it at 70 m/s, sinking at 3: straight ahead in R."""
    s = np.zeros(sc.N)
    s[sc.COURSE] = math.radians(262.0)
    c, w = math.cos(s[sc.COURSE]), math.sin(s[sc.COURSE])
    z = np.array([0.01, 0.02, math.radians(265.0), 0, 0, 0, 70.0 * c, 70.0 * w, 3.0, 0, 0, 0])
    got = carriage(z, s)
    np.testing.assert_allclose(got.v_R, [70.0, 0.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(got.R_RB, from_euler(0.01, 0.02, math.radians(3.0)), atol=1e-12)
    s[sc.BX :] = 1.0, 2.0, 0.5
    np.testing.assert_allclose(carriage(z, s).v_R, [69.0, -2.0, 2.5], atol=1e-12)


# ------------------------------------------------------------------------------------------------------------- EKF


def scene_at(p_RC: Array, width: float, scale: float = 1.0) -> Array:
    s = np.zeros(sc.N)
    s[[sc.X, sc.Y, sc.H, sc.WIDTH]] = scale * np.array([p_RC[0], p_RC[1], -p_RC[2], width])
    return s


def reading(v_R: Array, moved_R: Array, euler: tuple[float, float, float] = (0.0, 0.07, 0.0)) -> Array:
    return np.array([*euler, 0.0, 0.0, 0.0, *v_R, *moved_R])


def start_covariance() -> Array:
    P = np.zeros((sc.N, sc.N))
    P[[sc.X, sc.Y, sc.H], [sc.X, sc.Y, sc.H]] = 10.0, 2.0, 2.0
    for i in (sc.COURSE, sc.EPAN, sc.ETILT, sc.EROLL):
        P[i, i] = math.radians(0.1) ** 2
    return P


def test_the_image_says_nothing_of_the_scale_and_the_filter_knows() -> None:
    """However many images from one place: the range's spread stays what it was."""
    ekf = KinematicEkf(EkfConfig(), LENS)
    p_RC, R_RB = np.array([-3000.0, 40.0, -160.0]), from_euler(0.0, 0.07, 0.0)
    s = scene_at(p_RC, 45.0, 1.4)
    scene = ekf.start(s, start_covariance(), 0.0)
    noise = Noise(1, "edges")
    for k in range(50):
        z = reading(np.zeros(3), np.zeros(3))
        scene = ekf.look(scene, Image(k * DT, edges_of(p_RC, R_RB, 45.0, noise, 0.1), z), carriage(z, scene.s))
    assert scene.spread == pytest.approx(0.6, rel=0.02)
    assert abs(scene.s[sc.WIDTH] / (1.4 * 45.0) - 1.0) < 0.02


def test_a_runway_that_does_not_come_nearer_is_far_but_not_at_infinity() -> None:
    """The unit says 70 m/s, the image stands still: as far as the widest runway there is would be."""
    ekf = KinematicEkf(EkfConfig(widest=90.0), LENS)
    p_RC, R_RB, v = np.array([-3000.0, 40.0, -160.0]), from_euler(0.0, 0.07, 0.0), np.array([70.0, 0.0, 3.5])
    scene = ekf.start(scene_at(p_RC, 45.0), start_covariance(), 0.0)
    widths = []
    for k in range(100):
        z = reading(v, v * DT)
        scene = ekf.move(scene, v * DT, DT)
        scene = ekf.look(scene, Image(k * DT, edges_of(p_RC, R_RB, 45.0), z), carriage(z, scene.s))
        widths.append(float(scene.s[sc.WIDTH]))
    assert max(widths) == pytest.approx(90.0)


def own(s: Array) -> Array:
    """The filter's coordinates: lengths in widths, and the width's inverse; its own inverse."""
    out = s.copy()
    out[:3] /= s[sc.WIDTH]
    out[sc.WIDTH] = 1.0 / s[sc.WIDTH]
    return out


def test_the_filters_transition_against_differences() -> None:
    ekf = KinematicEkf(EkfConfig(q_position=0.0, q_course=0.0, q_camera=0.0, q_edge=0.0, q_bias=0.0), LENS)
    s = scene_at(np.array([-3000.0, 40.0, -160.0]), 45.0)
    s[sc.BX :] = 0.3, -0.2, 0.1
    way = np.array([2.8, 0.1, 0.15])
    got = ekf.move(Scene(s, np.zeros((sc.N, sc.N)), 0.5, 0.0, own=np.eye(sc.N)), way, DT).own
    J = np.empty((sc.N, sc.N))
    for i in range(sc.N):
        step = np.zeros(sc.N)
        step[i] = 1e-5

        def after(sign: float, step: Array = step) -> Array:
            turn = from_euler(0.0, 0.0, -sign * step[sc.COURSE])  # a larger course turns the way to the left
            return own(sc.moved(own(own(s) + sign * step), turn @ way, DT))

        J[:, i] = (after(1.0) - after(-1.0)) / 2e-5
    assert got is not None
    np.testing.assert_allclose(got, J @ J.T, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("scale", [0.5, 1.5])
def test_a_wrong_scale_is_wrong_in_proportion(scale: float) -> None:
    """In these coordinates motion is linear in 1 / W, however wrong W is."""
    s, way = scene_at(np.array([-3000.0, 40.0, -160.0]), 45.0), np.array([2.8, 0.1, 0.15])
    wrong = own(s)
    wrong[sc.WIDTH] *= scale
    np.testing.assert_allclose(
        (own(sc.moved(own(wrong), way, DT)) - wrong)[:3], scale * (own(sc.moved(s, way, DT)) - own(s))[:3], atol=1e-12
    )


# ------------------------------------------------------------------------------------------ on the glide, both


def glide(offset: float = 0.0, high: float = 0.0) -> Iterator[tuple[float, Array, Array]]:
    """t, p_RC and v_R of a camera that comes down the glide from 5 km; a correction of the offsets within 15 s."""
    p = np.array([-5000.0, offset, -5000.0 * math.tan(GLIDE) - high])
    t = 0.0
    while p[0] < -500.0:
        rest = max(15.0 - t, 0.0) / 15.0
        v = np.array([70.0, -offset * rest / 7.5, 70.0 * math.tan(GLIDE) + high * rest / 7.5])
        yield t, p, v
        p, t = p + v * DT, t + DT


def ranged(ranging: Gibert | KinematicEkf, scale: float, sigma: float, seed: int, offset: float, high: float) -> Array:
    """(n, 3) time [s], relative error of the range and believed spread."""
    noise, out, scene, last = Noise(seed, "edges"), [], None, np.zeros(3)
    R_RB = from_euler(0.0, 0.07, 0.0)
    for t, p, v in glide(offset, high):
        z = reading(v, p - last)
        m = edges_of(p, R_RB, 45.0, noise, sigma)
        if scene is None:
            scene = ranging.start(scene_at(p, 45.0, scale), start_covariance(), t)
        else:
            scene = ranging.move(scene, p - last, DT)
        level = carriage(z, scene.s)._replace(R_RB=R_RB, v_R=v)  # a flat Earth: what is tested is ranging
        scene = ranging.look(scene, Image(t, m, z), level)
        out.append((t, scene.s[sc.X] / p[0] - 1.0, scene.spread))
        last = p
    return np.array(out)


@pytest.mark.parametrize("make", [lambda: Gibert(GibertConfig(), LENS), lambda: KinematicEkf(EkfConfig(), LENS)])
@pytest.mark.parametrize("scale", [0.5, 1.5])
def test_a_wrong_first_range_is_found_out_on_an_intercept(make: object, scale: float) -> None:
    got = ranged(make(), scale, 0.12, 1, 300.0, 50.0)  # type: ignore[operator]
    assert np.abs(got[got[:, 0] > 16.0, 1]).max() < 0.05


@pytest.mark.parametrize(
    "make", [lambda: Gibert(GibertConfig(outputs="width"), LENS), lambda: KinematicEkf(EkfConfig(), LENS)]
)
def test_the_runways_width_ranges_on_the_glide_path(make: object) -> None:
    runs = [ranged(make(), scale, 0.15, seed, 0.0, 0.0) for scale in (0.5, 1.5) for seed in (1, 2, 3)]  # type: ignore[operator]
    for after, rms in ((10.0, 0.15), (20.0, 0.04), (30.0, 0.02), (60.0, 0.005)):
        errors = [run[np.searchsorted(run[:, 0], after), 1] for run in runs]
        assert math.sqrt(np.mean(np.square(errors))) <= rms, after


def test_what_the_velocity_is_wrong_by_across_the_way_is_found() -> None:
    """A unit that drifts 0.4 m/s to the right and 0.3 down."""
    g, wrong, last, scene = Gibert(GibertConfig(outputs="width"), LENS), np.array([0.0, 0.4, 0.3]), None, None
    R_RB = from_euler(0.0, 0.07, 0.0)
    for t, p, v in glide():
        z = reading(v + wrong, p * 0.0 if last is None else p - last + wrong * DT)
        if scene is None:
            scene = g.start(scene_at(p, 45.0), start_covariance(), t)
        else:
            scene = g.move(scene, z[9:12], DT)
        scene = g.look(scene, Image(t, edges_of(p, R_RB, 45.0), z), Carriage(R_RB, v + wrong - scene.s[sc.BX :]))
        last = p
    assert scene is not None and last is not None
    np.testing.assert_allclose(scene.s[sc.BX :], [0.0, 0.4, 0.3], atol=0.02)
    assert abs(scene.s[sc.Y] - last[1]) < 0.02 and abs(scene.s[sc.H] + last[2]) < 0.3


def test_the_aim_points_bearing_alone_does_not_range_on_the_glide_path() -> None:
    """d1 = d2 = 0: the range is carried, the flag stays up, nothing jumps."""
    got = ranged(Gibert(GibertConfig(outputs="point"), LENS), 1.5, 0.2, 1, 0.0, 0.0)
    assert got[-1, 2] > 0.5
    steps = np.abs(np.diff(np.log1p(got[:, 1])))
    assert np.isfinite(got).all() and steps.max() < 0.02 + 70.0 * DT / 500.0


def test_the_filter_is_as_sure_as_it_may_be() -> None:
    """Errors over believed spread at 20 s, 12 approaches: neither sure of what is wrong nor unsure of what is right."""
    normalised = []
    for seed in range(1, 7):
        for scale in (0.5, 1.5):
            got = ranged(KinematicEkf(EkfConfig(), LENS), scale, 0.2, seed, 0.0, 0.0)
            at = np.searchsorted(got[:, 0], 20.0)
            normalised.append(got[at, 1] / got[at, 2])
    assert 0.2 < np.mean(np.square(normalised)) < 3.0


@settings(max_examples=60, deadline=None)
@given(
    y=st.tuples(*[st.floats(-0.5, 0.5)] * 2, st.floats(1e-4, 0.5)),
    p=st.tuples(st.floats(40.0, 6000.0), st.floats(-500.0, 500.0), st.floats(1.0, 400.0), st.floats(5.0, 90.0)),
    v=st.tuples(*[st.floats(-90.0, 90.0)] * 3),
)
def test_whatever_is_seen_the_range_stays_finite_and_does_not_jump(
    y: tuple[float, float, float], p: tuple[float, float, float, float], v: tuple[float, float, float]
) -> None:
    g = Gibert(GibertConfig(), LENS)
    var = np.full(3, 1e-8)
    ahead = np.array(p[:3])
    width, d, spread = correct_range(ahead, p[3], np.array(y), var, np.array(v), 0.5, DT, 0.0, g._use, g._rule)
    assert np.isfinite([*ahead, width, *d, spread]).all()
    assert abs(ahead[0] / p[0] - 1.0) <= 0.0205 and ahead[0] >= 30.0


# ------------------------------------------------------------------------------------------------- the estimator


def inertial(t: float, v: Array, step: Array) -> Measurement:
    return Measurement("inertial", t, t, reading(v, step), np.zeros(12))


def pose(t: float, p: Array) -> Measurement:
    return Measurement(
        "pose", t, t, np.array([p[0], p[1], -p[2], 0.0, 0.07, 0.0]), np.diag([9.0, 1, 1, 1e-6, 1e-6, 1e-6])
    )


def flown(late: float, n: int = 60) -> tuple[float, float]:
    """x and W of an estimator whose images arrive `late` seconds late, after n cycles; R is level and flat enough."""
    inner = RunwayObserver(ObserverConfig(first_range=7000.0), KinematicEkf(EkfConfig(), LENS), 45.0, np.zeros(3))
    estimator = Rewind(inner, 1.0) if late else inner
    memory = estimator.init(0.0)
    noise, last, queue = Noise(5, "edges"), np.zeros(3), []
    R_RB = from_euler(0.0, 0.07, 0.0)
    path = list(zip(range(n), glide(100.0, 0.0)))
    for k, (t, p, v) in path:
        memory = estimator.predict(memory, Command(), t)
        memory = estimator.update(memory, inertial(t, v, p - last if k else np.zeros(3)))
        m = replace(edges_of(p, R_RB, 45.0, noise, 0.1), t_valid=t, t_arrival=t + late)
        queue.append(pose(t, p) if k == 0 else m)
        queue[-1] = replace(queue[-1], t_arrival=t + late)
        while queue and queue[0].t_arrival <= t + 1e-9:
            memory = estimator.update(memory, queue.pop(0))
        last = p
    for m in queue:  # what is still on its way
        memory = estimator.update(memory, m)
    got = estimator.read(memory)
    return got["x"], got["W"]


def test_late_images_come_to_the_same() -> None:
    now, late = flown(0.0), flown(0.48)
    assert late == pytest.approx(now, rel=1e-9)


def test_the_first_range_scales_the_acquired_pose() -> None:
    observer = RunwayObserver(
        ObserverConfig(first_range=7500.0), Gibert(GibertConfig(), LENS), 45.0, np.array([25.0, 0, 0])
    )
    memory = observer.init(0.0)
    memory = observer.update(memory, inertial(0.0, np.array([70.0, 0, 3.0]), np.zeros(3)))
    p = np.array([-5000.0 - 25.0 * math.cos(0.07), 0.0, -262.0 + 25.0 * math.sin(0.07)])
    memory = observer.update(memory, pose(0.0, p))
    got = observer.read(memory)
    assert got.valid and got.flags["range_valid"] is False
    assert got["x"] == pytest.approx(-7500.0 - 25.0 * math.cos(0.07), abs=0.01)  # the level there is not the runway's
    assert got["W"] == pytest.approx(67.5, abs=1e-9)
    assert got["H"] == pytest.approx(1.5 * 262.0 - 25.0 * math.sin(0.07), abs=0.05)
    assert got.names == NAMES and got.cov is not None and np.linalg.eigvalsh(got.cov).min() > 0.0


def test_wind_is_what_the_air_data_leave() -> None:
    """70 m/s over the ground at 65 m/s through the air, no angles: five from behind."""
    observer = RunwayObserver(ObserverConfig(), Gibert(GibertConfig(), LENS), 45.0, np.zeros(3))
    memory = observer.init(0.0)
    v, p = np.array([70.0, 0.0, 0.0]), np.array([-10.0, 0.0, -20.0])
    z = np.array([0.0, 0.0, 0.0, 0, 0, 0, *v, 0, 0, 0])
    memory = observer.update(memory, Measurement("inertial", 0.0, 0.0, z, np.zeros(12)))
    memory = observer.update(memory, replace(pose(0.0, p), z=np.array([p[0], p[1], -p[2], 0.0, 0.0, 0.0])))
    memory = observer.update(memory, Measurement("airspeed", 0.0, 0.0, np.array([65.0]), np.ones(1)))
    memory = observer.update(memory, Measurement("flow_angles", 0.0, 0.0, np.zeros(2), np.ones(2)))
    got = observer.read(memory)
    assert [got["wx"], got["wy"], got["wz"]] == pytest.approx([5.0, 0.0, 0.0], abs=1e-3)


def test_what_it_has_no_use_for_is_refused() -> None:
    observer = RunwayObserver(ObserverConfig(), Gibert(GibertConfig(), LENS), 45.0, np.zeros(3))
    with pytest.raises(ValueError, match="does not know"):
        observer.update(observer.init(0.0), Measurement("sonar", 0.0, 0.0, np.zeros(1), np.zeros(1)))
