"""Position fixes fused with inertial readings: hand-computed numbers, derivatives, consistency, and lateness."""

from __future__ import annotations

import math
from dataclasses import replace

import filter_bench as bench
import numpy as np
import pytest

from landing_sim.estimators import states
from landing_sim.estimators.last_fix import LastFix, LastFixConfig
from landing_sim.estimators.readings import StrapdownFrontEnd
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_filter import FilterConfig
from landing_sim.estimators.strapdown_ekf import NAMES, StrapdownConfig, StrapdownEkf, propagate
from landing_sim.geometry.so3 import from_euler
from landing_sim.interfaces import Estimator
from landing_sim.noise import Noise
from landing_sim.signals import Command, Measurement, Sample, Status, StrapdownReading
from landing_sim.types import Array

G = StrapdownConfig().gravity
STILL = np.array([0.0, 0.0, -G])
Q = np.array([0.01**2, 0.35**2, 0.02**2])


def reading(t: float, a_B: Array = STILL, euler: Array | None = None) -> Measurement:
    z = np.concatenate([a_B, np.zeros(3) if euler is None else euler])
    return Measurement("strapdown", t, t, z, np.zeros(6))


def fix(t: float, z: object, late: float = 0.0, sigma: float = 0.004) -> Measurement:
    return Measurement("position", t, t + late, np.array(z, dtype=float), np.full(3, sigma**2))


def place(t: float, z: object) -> Measurement:
    return Measurement("way_point", t, t, np.array(z, dtype=float), np.full(3, 1e-4))


def run(estimator: Estimator, until: float, *arrivals: Measurement, a_B: Array = STILL, dt: float = 0.01) -> object:
    """Memory after readings every dt and the measurements when they arrive."""
    memory = estimator.init(0.0)
    waiting = sorted(arrivals, key=lambda m: m.t_arrival)
    for k in range(round(until / dt) + 1):
        t = k * dt
        memory = estimator.predict(memory, Command(), t)
        memory = estimator.update(memory, reading(t, a_B))
        while waiting and waiting[0].t_arrival <= t + 1e-9:
            memory = estimator.update(memory, waiting.pop(0))
    return memory


# ------------------------------------------------------------------------------------------------ strapdown (1)-(3)


def test_two_seconds_of_free_motion_by_hand() -> None:
    """1 m/s^2 forward and 0.5 up for 2 s: 2 m forward, 1 m up, 2 and -1 m/s."""
    x, P = np.zeros(9), np.zeros((9, 9))
    for _ in range(200):
        x, P = propagate(x, P, np.array([1.0, 0.0, -G - 0.5]), np.zeros(3), np.zeros(3), 0.01, Q, G)
    np.testing.assert_allclose(x[:6], [2.0, 0.0, -1.0, 2.0, 0.0, -1.0], atol=1e-12)


def test_heading_and_tilt_turn_what_is_felt() -> None:
    """Heading right by 90 deg, forward is R's y; nose down by 30 deg under one g along the body's up."""
    x, _ = propagate(
        np.zeros(9),
        np.zeros((9, 9)),
        np.array([1.0, 0.0, -G]),
        *[np.array([0.0, 0.0, math.pi / 2])] * 2,
        1.0,
        Q,
        G,
    )
    np.testing.assert_allclose(x[3:6], [0.0, 1.0, 0.0], atol=1e-12)
    x, _ = propagate(np.zeros(9), np.zeros((9, 9)), STILL, *[np.array([0.0, -math.pi / 6, 0.0])] * 2, 1.0, Q, G)
    np.testing.assert_allclose(x[3:6], [G / 2, 0.0, G * (1.0 - math.cos(math.pi / 6))], atol=1e-12)


def test_bias_is_taken_off() -> None:
    x = np.array([0.0, 0, 0, 0, 0, 0, 0.3, -0.2, 0.1])
    out, _ = propagate(x, np.zeros((9, 9)), STILL + x[6:], np.zeros(3), np.zeros(3), 1.0, Q, G)
    np.testing.assert_allclose(out, x, atol=1e-12)


def test_error_transition_against_differences() -> None:
    """P = e e' without noise shows Phi e; so do neighbouring states. (5)'s sign is in here."""
    rng = np.random.default_rng(3)
    x, a_B = rng.normal(size=9), STILL + rng.normal(size=3)
    euler_0, euler_1 = rng.normal(size=3) * 0.4, rng.normal(size=3) * 0.4
    for j in range(9):
        e = np.zeros(9)
        e[j] = 1.0
        up, P = propagate(x + 1e-4 * e, np.outer(e, e), a_B, euler_0, euler_1, 0.05, np.zeros(3), G)
        down, _ = propagate(x - 1e-4 * e, np.zeros((9, 9)), a_B, euler_0, euler_1, 0.05, np.zeros(3), G)
        column = (up - down) / 2e-4
        np.testing.assert_allclose(P, np.outer(column, column), atol=1e-9)
        np.testing.assert_allclose(P[j], column * column[j], atol=1e-9)


def test_noise_integrates_as_the_textbook_says() -> None:
    """Random walk of velocity: var v = q t, var p = q t^3 / 3, whatever the step; bias q t."""
    for n in (1, 10):
        x, P = np.zeros(9), np.zeros((9, 9))
        for _ in range(n):
            x, P = propagate(x, P, STILL, np.zeros(3), np.zeros(3), 0.5 / n, np.array([0.0, 0.1, 0.0]), G)
        np.testing.assert_allclose([P[0, 0], P[0, 3], P[3, 3]], [0.1 * 0.125 / 3, 0.1 * 0.125, 0.05], rtol=1e-12)
    _, P = propagate(np.zeros(9), np.zeros((9, 9)), STILL, np.zeros(3), np.zeros(3), 0.5, np.array([0.2, 0.0, 0.1]), G)
    np.testing.assert_allclose([P[0, 0], P[6, 6]], [0.1, 0.05], rtol=1e-12)


# ------------------------------------------------------------------------------------------------------------ fixes


def test_nothing_is_valid_before_the_first_fix_and_then_it_is_there() -> None:
    ekf = StrapdownEkf()
    memory = run(ekf, 0.5, a_B=STILL + [0.5, 0.0, 0.0])  # carried about by hand
    assert not ekf.read(memory).valid and not ekf.read(memory).flags["localised"]
    estimate = ekf.read(ekf.update(memory, fix(0.5, [1.0, 2.0, -3.0])))
    assert estimate.valid and estimate.flags["localised"] and not estimate.flags["platform"]
    assert [estimate[n] for n in ("x", "y", "H", "vx", "vy", "vz")] == [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]
    assert estimate.cov is not None
    np.testing.assert_allclose(np.sqrt(np.diag(estimate.cov)[:3]), 0.004)


def test_a_fix_is_weighed_as_by_hand() -> None:
    """One axis: variance P + q dt before, R = P: gain and variance follow."""
    ekf = StrapdownEkf(StrapdownConfig(accel=0.0, bias=0.0, position=0.0, first_velocity=0.0, first_bias=0.0))
    memory = ekf.update(ekf.init(0.0), fix(0.0, [0.0, 0.0, 0.0], sigma=0.02))
    memory = ekf.update(memory, fix(0.0, [0.03, 0.0, 0.0], sigma=0.01))
    estimate = ekf.read(memory)
    assert estimate["x"] == pytest.approx(0.03 * 4.0 / 5.0)
    assert estimate.cov is not None and estimate.cov[0, 0] == pytest.approx(1e-4 * 4.0 / 5.0)
    assert estimate.residuals is not None and estimate.residuals.nis == pytest.approx(0.03**2 / 5e-4)


def test_bias_is_found_with_the_right_sign() -> None:
    """A sensor that feels 0.2 too much forward, standing still: + C db in (5) would drive the bias away."""
    ekf = StrapdownEkf()
    fixes = [fix(0.07 * k, [0.0, 0.0, -1.0]) for k in range(285)]
    estimate = ekf.read(run(ekf, 20.0, *fixes, a_B=STILL + [0.2, 0.0, -0.1]))
    assert estimate["bax"] == pytest.approx(0.2, abs=0.02)
    assert estimate["baz"] == pytest.approx(-0.1, abs=0.02)


def test_gate_refuses_five_and_believes_the_sixth() -> None:
    ekf = StrapdownEkf()
    memory = run(ekf, 2.0, *[fix(0.07 * k, [0.0, 0.0, -1.0]) for k in range(28)])
    refused = []
    for _ in range(6):
        memory = ekf.update(memory, fix(2.0, [1.0, 0.0, -1.0]))
        estimate = ekf.read(memory)
        refused.append(estimate.residuals is not None and estimate.residuals.status[0] == Status.REJECTED)
    assert refused == [True] * 5 + [False]
    assert ekf.read(memory)["x"] == pytest.approx(1.0, abs=0.02)
    memory = ekf.update(memory, fix(2.0, [1.0, 0.0, -1.0]))
    assert memory.refused == 0


def test_refused_fixes_do_not_localise() -> None:
    ekf = StrapdownEkf(StrapdownConfig(lost_after=0.3, patience=100))
    good = [fix(0.07 * k, [0.0, 0.0, -1.0]) for k in range(15)]
    bad = [fix(0.07 * k, [5.0, 0.0, -1.0]) for k in range(15, 30)]
    assert ekf.read(run(ekf, 1.2, *good, *bad)).flags["localised"]
    assert not ekf.read(run(ekf, 1.4, *good, *bad)).flags["localised"]


def test_without_a_reading_the_last_one_holds_and_is_made_good_later() -> None:
    ekf = StrapdownEkf()
    memory = ekf.update(ekf.init(0.0), fix(0.0, [0.0, 0.0, 0.0]))
    memory = ekf.update(memory, reading(0.0, STILL + [1.0, 0.0, 0.0]))
    memory = ekf.predict(memory, Command(), 0.5)
    assert ekf.read(memory)["vx"] == pytest.approx(0.5)
    memory = ekf.update(memory, reading(0.5, STILL + [2.0, 0.0, 0.0]))
    assert ekf.read(memory)["vx"] == pytest.approx(1.0)


def test_a_fix_between_two_readings_splits_the_interval() -> None:
    """1 m/s^2 for 1 s, the readings at 0 and 1 s, a fix at 0.5 s where it is then: 0.125 m."""
    ekf = StrapdownEkf()
    memory = ekf.update(ekf.init(0.0), fix(0.0, [0.0, 0.0, 0.0]))
    memory = ekf.update(memory, reading(0.0, STILL + [1.0, 0.0, 0.0]))
    memory = ekf.update(ekf.predict(memory, Command(), 0.5), fix(0.5, [0.125, 0.0, 0.0]))
    memory = ekf.update(ekf.predict(memory, Command(), 1.0), reading(1.0, STILL + [1.0, 0.0, 0.0]))
    estimate = ekf.read(memory)
    assert estimate["x"] == pytest.approx(0.5) and estimate["vx"] == pytest.approx(1.0)


def test_way_point_is_kept_and_read_as_a_height() -> None:
    for estimator in (StrapdownEkf(), LastFix()):
        memory = estimator.init(0.0)
        assert math.isnan(estimator.read(memory)["lx"]) and not estimator.read(memory).flags["platform"]
        estimate = estimator.read(estimator.update(memory, place(0.0, [1.0, 2.0, -0.14])))
        assert [estimate[n] for n in ("lx", "ly", "lH")] == [1.0, 2.0, 0.14] and estimate.flags["platform"]


def test_unknown_measurements_are_refused() -> None:
    gyro = Measurement("gyro", 0.0, 0.0, np.zeros(3), np.zeros(3))
    for estimator in (StrapdownEkf(), LastFix()):
        with pytest.raises(ValueError, match="gyro"):
            estimator.update(estimator.init(0.0), gyro)


def test_front_end_passes_a_reading_on() -> None:
    said = StrapdownReading(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]))
    (m,) = StrapdownFrontEnd().process(Sample("imu", 1.0, 1.0, said), lambda: None)  # type: ignore[arg-type, return-value]
    assert m.kind == "strapdown" and m.z.tolist() == [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]


# ------------------------------------------------------------------------------------------------------ consistency


def flight(seed: int, seconds: float) -> tuple[Array, Array, list[Measurement], list[Measurement]]:
    """Truth p, v, b at 100 Hz by the filter's own model, readings, and fixes every 70 ms that come 150 ms late."""
    c, noise, dt = StrapdownConfig(), Noise(seed, "flight"), 0.01
    truth = np.zeros(9)
    truth[3:6], truth[6:] = 0.1 * noise.normal(3), 0.2 * noise.normal(3)
    states, readings, fixes = [truth.copy()], [reading(0.0)], [fix(0.0, truth[:3] + 0.004 * noise.normal(3), 0.15)]
    euler = np.zeros(3)
    for k in range(1, round(seconds / dt) + 1):
        before, t = euler, k * dt
        euler = np.array([0.1 * math.sin(2.0 * t), 0.08 * math.cos(1.7 * t), 0.4 * t])
        wanted = np.array([math.sin(1.3 * t), math.cos(t), 0.3 * math.sin(3.0 * t)]) - [0.0, 0.0, G]
        C = 0.5 * (from_euler(*before) + from_euler(*euler))
        felt = C.T @ wanted + truth[6:]  # what the reading says: the truth has white noise besides
        pushed = C @ (felt - truth[6:]) + [0.0, 0.0, G] + c.accel / math.sqrt(dt) * noise.normal(3)
        truth[:3] += dt * truth[3:6] + 0.5 * dt * dt * pushed + c.position * math.sqrt(dt) * noise.normal(3)
        truth[3:6] += dt * pushed
        truth[6:] += c.bias * math.sqrt(dt) * noise.normal(3)
        states.append(truth.copy())
        readings.append(reading(t, felt, euler))
        if k % 7 == 0:
            fixes.append(fix(t, truth[:3] + 0.004 * noise.normal(3), 0.15))
    return np.array(states), np.array([m.t_valid for m in readings]), readings, fixes


def follow(estimator: Estimator, readings: list[Measurement], fixes: list[Measurement], until: float) -> object:
    memory, waiting = estimator.init(0.0), list(fixes)
    for m in readings:
        if m.t_valid > until + 1e-9:
            break
        memory = estimator.update(estimator.predict(memory, Command(), m.t_valid), m)
        while waiting and waiting[0].t_arrival <= m.t_valid + 1e-9:
            memory = estimator.update(memory, waiting.pop(0))
    return memory


def test_normalised_error_is_what_nine_numbers_have() -> None:
    """NEES of p, v, b at the end of 20 flights of the filter's own model, fixes 150 ms late: mean 9, two-sided 1 ‰."""
    late = Rewind(StrapdownEkf(), 0.8)
    total = 0.0
    for seed in range(20):
        states, _, readings, fixes = flight(seed, 4.0)
        estimate = late.read(follow(late, readings, fixes, 4.0))
        truth = states[-1] * [1, 1, -1, 1, 1, 1, 1, 1, 1]
        assert estimate.cov is not None
        e = estimate.mean[:9] - truth
        total += float(e @ np.linalg.solve(estimate.cov[:9, :9], e))
    # chi2 with 180 degrees of freedom, 0.05 % and 99.95 % quantiles
    assert 120.8 < total < 250.9


def test_late_fixes_replayed_are_the_bits_of_fixes_in_order() -> None:
    _, _, readings, fixes = flight(3, 2.0)
    known = [m for m in fixes if m.t_arrival <= 2.0 + 1e-9]
    late, punctual = Rewind(StrapdownEkf(), 0.8), StrapdownEkf()
    a = punctual.read(follow(punctual, readings, [replace(m, t_arrival=m.t_valid) for m in known], 2.0))
    b = late.read(follow(late, readings, known, 2.0))
    np.testing.assert_array_equal(a.mean, b.mean)
    np.testing.assert_array_equal(a.cov, b.cov)


def test_fixes_that_overtake_each_other_are_put_in_order() -> None:
    _, _, readings, fixes = flight(5, 2.0)
    known = [replace(m, t_arrival=m.t_valid + (0.31 if k % 3 == 0 else 0.1)) for k, m in enumerate(fixes)]
    known = sorted([m for m in known if m.t_arrival <= 2.0 + 1e-9], key=lambda m: m.t_arrival)
    assert [m.t_valid for m in known] != sorted(m.t_valid for m in known)
    in_order = sorted([replace(m, t_arrival=m.t_valid) for m in known], key=lambda m: m.t_valid)
    late, punctual = Rewind(StrapdownEkf(), 0.8), StrapdownEkf()
    b = late.read(follow(late, readings, known, 2.0))
    a = punctual.read(follow(punctual, readings, in_order, 2.0))
    np.testing.assert_array_equal(a.mean, b.mean)
    np.testing.assert_array_equal(a.cov, b.cov)


def test_the_same_rewind_serves_the_aircraft_whose_images_overtake_each_other() -> None:
    """The 4D filter of the runway: every third image five cycles late, the others one; bits as if none had been late."""
    rng, ekf = np.random.default_rng(21), bench.filter_of(FilterConfig())
    late = Rewind(ekf, 0.5)
    x = bench.truth_at(rng)
    s = bench.settle(x, ekf._par)
    a, b = ekf.init(0.0), late.init(0.0)
    due: dict[int, list[Measurement]] = {}
    for k in range(24):
        t = k * 0.06
        a, b = ekf.predict(a, bench.COMMAND, t), late.predict(b, bench.COMMAND, t)
        for m in bench.inertial(x, t, rng, ekf.config):
            a, b = ekf.update(a, m), late.update(b, m)
        images = [bench.pose(x, t, rng)] if k == 0 else [bench.edges(x, t, rng)] if k < 19 else []
        for m in images:
            a = ekf.update(a, m)
        due.setdefault(k if k == 0 else k + (5 if k % 3 == 0 else 1), []).extend(images)
        for m in due.pop(k, []):
            b = late.update(b, m)
        bench.fly(x, s, ekf._par, np.zeros(states.N), 0.06, rng)
    assert not any(due.values())
    np.testing.assert_array_equal(late.read(b).mean, ekf.read(a).mean)
    np.testing.assert_array_equal(late.read(b).cov, ekf.read(a).cov)


def test_latency_is_compensated_only_inside_rewind() -> None:
    """At 1 m/s and 150 ms of latency the filter alone lags by 15 cm, inside Rewind by nothing."""
    fixes = [fix(0.07 * k, [0.07 * k, 0.0, -1.0], late=0.15) for k in range(60)]
    for estimator, lag in ((Rewind(StrapdownEkf(), 0.8), 0.0), (StrapdownEkf(), 0.15)):
        estimate = estimator.read(run(estimator, 4.0, *fixes))
        assert 4.0 - estimate["x"] == pytest.approx(lag, abs=0.005)
        assert estimate["vx"] == pytest.approx(1.0, abs=0.02)


def test_rewind_answers_for_the_time_of_an_image() -> None:
    late = Rewind(StrapdownEkf(), 0.8)
    memory = run(late, 1.0, fix(0.0, [0.0, 0.0, -1.0]), a_B=STILL + [1.0, 0.0, 0.0])
    assert late.read(memory, 0.5)["vx"] == pytest.approx(0.5, abs=1e-9)
    assert late.read(memory)["vx"] == pytest.approx(1.0, abs=1e-9)


# ---------------------------------------------------------------------------------------------------------- unfused


def test_last_fix_is_carried_on_from_its_arrival() -> None:
    """Two fixes 0.1 s and 5 cm apart: 0.5 m/s. 40 ms after the second arrived, 2 cm further; the latency stays."""
    estimator = LastFix()
    fixes = fix(0.0, [0.0, 0.0, -1.0], late=0.1), fix(0.1, [0.05, 0.0, -1.0], late=0.1)
    estimate = estimator.read(run(estimator, 0.24, *fixes))
    assert estimate["vx"] == pytest.approx(0.5)
    assert estimate["x"] == pytest.approx(0.05 + 0.5 * 0.04)
    assert estimate.cov is None and math.isnan(estimate["bax"])


def test_last_fix_stands_when_it_is_too_old_and_forgets_what_was_overtaken() -> None:
    estimator = LastFix(LastFixConfig(longest=0.2, lost_after=0.5))
    fixes = fix(0.0, [0.0, 0.0, -1.0]), fix(0.1, [0.1, 0.0, -1.0]), fix(0.05, [9.0, 0.0, -1.0], late=0.1)
    estimate = estimator.read(run(estimator, 0.7, *fixes))
    assert estimate["x"] == pytest.approx(0.1 + 0.2) and estimate["vx"] == 0.0 and not estimate.flags["localised"]
    assert estimator.read(run(estimator, 0.55, *fixes)).flags["localised"]


def test_last_fix_answers_for_the_time_of_an_image() -> None:
    """At 0.14 s, of an image taken at 0.12: 0.5 m/s since the one taken at 0.1, and what the attitude was then."""
    estimator = LastFix()
    memory = estimator.init(0.0)
    for m in (fix(0.0, [0.0, 0.0, -1.0]), fix(0.1, [0.05, 0.0, -1.0], late=0.03)):
        memory = estimator.update(memory, m)
    for k in range(15):
        memory = estimator.predict(memory, Command(), 0.01 * k)
        memory = estimator.update(memory, reading(0.01 * k, euler=np.array([0.1 * k, 0.0, 0.0])))
    then, now = estimator.read(memory, 0.12), estimator.read(memory)
    assert then.t == 0.12 and then["x"] == pytest.approx(0.05 + 0.5 * 0.02) and then["phi"] == pytest.approx(1.2)
    assert (
        now.t == pytest.approx(0.14)
        and now["x"] == pytest.approx(0.05 + 0.5 * 0.01)
        and now["phi"] == pytest.approx(1.4)
    )


def test_velocity_low_pass_by_hand() -> None:
    estimator = LastFix(LastFixConfig(smoothing=0.1))
    fixes = fix(0.0, [0.0, 0.0, 0.0]), fix(0.1, [0.1, 0.0, 0.0])
    assert estimator.read(run(estimator, 0.1, *fixes))["vx"] == pytest.approx(1.0 - math.exp(-1.0))


def test_both_name_the_same_states() -> None:
    for estimator in (StrapdownEkf(), LastFix()):
        assert estimator.read(estimator.init(0.0)).names == NAMES
