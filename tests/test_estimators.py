"""The filter's mathematics: Jacobians, transition, covariance algebra, consistency, late measurements."""

from __future__ import annotations

import math

import filter_bench as bench
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from landing_sim.estimators import kalman, mismatch, states
from landing_sim.estimators.aircraft_model import dynamics, parameters, propagate
from landing_sim.estimators.belief import AircraftBelief
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.gusts import change as gusts_change
from landing_sim.estimators.inertial_model import airspeed_model, gyro_model
from landing_sim.estimators.reckoning import reckoned
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_filter import Blocks, FilterConfig
from landing_sim.geometry.runway_image import image_line, plane_normal
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.noise import Noise
from landing_sim.signals import Feature, Status
from landing_sim.world.dryden import DrydenTurbulence, Turbulence

PAR = parameters(AircraftBelief(), 0.01)
SHADOW = np.array([0.02, 0.01, -0.03, 0.5, 4000.0, 0.05])


def random_state(rng: np.random.Generator) -> np.ndarray:
    x = np.zeros(states.N)
    x[:9] = [50, 0, 1, 0, 0, 0, 0, 0.03, 0] + rng.normal(size=9) * [4, 2, 1, 0.1, 0.1, 0.1, 0.2, 0.05, 0.3]
    x[9:15] = [rng.uniform(-1000, -60), rng.normal() * 40, rng.uniform(2, 60), *rng.normal(size=3) * 3]
    x[15:25] = rng.normal(size=10) * 0.002
    x[states.WIDTH] = 29.0
    return x


def differences(function, x: np.ndarray, columns: int, h: float = 1e-5) -> np.ndarray:
    out = []
    for j in range(columns):
        up, down = x.copy(), x.copy()
        up[j] += h
        down[j] -= h
        out.append((function(up) - function(down)) / (2 * h))
    return np.array(out).T


def f_of(x: np.ndarray) -> np.ndarray:
    f = np.empty(12)
    dynamics(x, SHADOW, PAR, f, np.empty((12, 18)), False)
    return f


@pytest.mark.parametrize("seed", range(6))
def test_dynamics_jacobian_against_differences(seed: int) -> None:
    x = random_state(np.random.default_rng(seed))
    f, A = np.empty(12), np.empty((12, 18))
    dynamics(x, SHADOW, PAR, f, A, True)
    np.testing.assert_allclose(A, differences(f_of, x, 18), rtol=1e-6, atol=2e-7)


def test_steady_level_flight_by_hand() -> None:
    """With no aerodynamics, no thrust and no rotation the aircraft falls with g, and positions follow the velocity."""
    nothing = parameters(AircraftBelief(S=0.0), 0.0)
    x = np.zeros(states.N)
    x[0], x[states.THETA], x[states.H] = 50.0, 0.1, 30.0
    f = np.empty(12)
    dynamics(x, np.zeros(6), nothing, f, np.empty((12, 18)), False)
    np.testing.assert_allclose(f[:3], [-9.81 * np.sin(0.1), 0.0, 9.81 * np.cos(0.1)], atol=1e-12)
    np.testing.assert_allclose(f[9:12], [50 * np.cos(0.1), 0.0, 50 * np.sin(0.1)], atol=1e-12)


def test_transition_matrix_is_the_exponential() -> None:
    """Phi by its series to third order: the next term, |A dt|^4 / 24, bounds what is left out."""
    x = random_state(np.random.default_rng(3))
    A = np.zeros((18, 18))
    f, A12 = np.empty(12), np.empty((12, 18))
    shadow = SHADOW.copy()
    Phi = np.empty((18, 18))
    dt = 0.005
    u = np.array([SHADOW[0], SHADOW[1], SHADOW[2], 0.4, 0.5])
    start = x.copy()
    propagate(x, shadow, u, PAR, False, dt, Phi)
    dynamics(start, 0.5 * (SHADOW + shadow), PAR, f, A12, True)
    A[:12] = A12
    np.testing.assert_allclose(Phi, scipy.linalg.expm(A * dt), atol=2e-6)


def test_integration_converges_with_fourth_order() -> None:
    """Halving the step of propagate, shadow frozen by its own steady state, cuts the error 16-fold."""
    frozen = parameters(AircraftBelief(tau_surface=1e9, tau_engine=1e9, tau_downwash=1e9), 0.0)
    Phi = np.empty((18, 18))

    def end(n: int) -> np.ndarray:
        x, s = random_state(np.random.default_rng(5)), SHADOW.copy()
        for _ in range(n):
            propagate(x, s, np.array([0.0, 0, 0, 0, 0.5]), frozen, False, 0.48 / n, Phi)
        return x[:12]

    truth = end(512)
    errors = [np.abs(end(n) - truth).max() for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 3.6) & (orders < 4.6)), orders


@pytest.mark.parametrize("slope", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(4))
def test_edge_jacobian_against_differences(seed: int, slope: float) -> None:
    rng = np.random.default_rng(seed)
    x = random_state(rng)
    m = bench.edges(x, 0.0, rng, sigma=0.0)
    assert m.geometry is not None
    g = m.geometry
    args = (g.feature, g.centre, g.direction, g.pan, g.tilt, bench.LEVER, bench.focal(), slope)

    def h_of(y: np.ndarray) -> np.ndarray:
        h = np.empty(10)
        edge_model(y, *args, h, np.empty((10, states.N)))
        return h

    Hx = np.empty((10, states.N))
    edge_model(x, *args, np.empty(10), Hx)
    num = differences(h_of, x, states.N, 1e-5)
    # The horizon's azimuth is held while differentiating: a second-order term, largest in psi and pan.
    np.testing.assert_allclose(Hx[:8], num[:8], rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(Hx[8:], num[8:], rtol=2e-3, atol=2.0)


def test_the_horizon_says_nothing_of_a_height_below_the_ground_it_belongs_to() -> None:
    """A downhill runway leads below the level it starts from, where the horizon no longer dips."""
    x = random_state(np.random.default_rng(2))
    Hx = np.empty((1, states.N))
    for height, observable in ((20.0, True), (-5.0, False)):
        x[states.H] = height
        edge_model(
            x, np.array([3]), np.array([[100.0, 250.0]]), np.array([[0.0, 1.0]]), 0.0, 0.0, bench.LEVER, bench.focal(),
            -0.02, np.empty(1), Hx,
        )  # fmt: skip
        assert (abs(Hx[0, states.H]) > 1e-3) == observable


def test_edge_model_agrees_with_the_image_lines() -> None:
    """Points on the closed-form image line have zero displacement: two derivations of the same edge."""
    rng = np.random.default_rng(0)
    x = random_state(rng)
    x[states.EPAN : states.JTILT + 1] = 0.0
    R_RB = from_euler(*x[6:9])
    p = np.array([x[9], x[10], -x[11]]) + R_RB @ bench.LEVER
    R_CR = camera_from_body(-0.1, 0.02) @ R_RB.T
    for feature in (0, 1, 2):
        l = image_line(plane_normal(feature, p, 29.0, 0.01, 0.0), R_CR, 2000.0, 255.5, 255.5)
        v = 300.0 if feature < 2 else -(l[2] + l[0] * 250.0) / l[1]
        u = -(l[1] * v + l[2]) / l[0] if feature < 2 else 250.0
        h, Hx = np.empty(1), np.empty((1, states.N))
        s = l[:2] / np.hypot(l[0], l[1])
        edge_model(
            x, np.array([feature]), np.array([[u, v]]), s[None], -0.1, 0.02, bench.LEVER, bench.focal(), 0.01, h, Hx
        )  # fmt: skip
        assert abs(h[0]) < 1e-8


def test_inertial_jacobians_against_differences() -> None:
    x = random_state(np.random.default_rng(1))
    _, Hg = gyro_model(x, np.zeros(3))
    _, Ha = airspeed_model(x, 0.0)
    np.testing.assert_allclose(Hg, differences(lambda y: -gyro_model(y, np.zeros(3))[0], x, states.N), atol=1e-8)
    np.testing.assert_allclose(Ha, differences(lambda y: -airspeed_model(y, 0.0)[0], x, states.N), atol=1e-7)


# ------------------------------------------------------------------------------------------------ covariance algebra


def random_problem(seed: int, n: int, m: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    P = A @ A.T + 0.1 * np.eye(n)
    return P, rng.normal(size=(m, n)), rng.uniform(0.1, 2.0, m), rng.normal(size=m), rng.normal(size=(n, n))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 12))
def test_ud_factors_reproduce_the_matrix(seed: int, n: int) -> None:
    P = random_problem(seed, n, 1)[0]
    U, D = kalman.ud_factor(P)
    np.testing.assert_allclose(kalman.ud_product(U, D), P, rtol=1e-10, atol=1e-10)
    assert np.all(D >= 0) and np.allclose(np.tril(U, -1), 0) and np.allclose(np.diag(U), 1)


def test_sequential_update_is_the_batch_joseph_update() -> None:
    P, H, R, nu, _ = random_problem(7, 9, 5)
    S = H @ P @ H.T + np.diag(R)
    K = P @ H.T @ np.linalg.inv(S)
    I_KH = np.eye(9) - K @ H
    joseph = I_KH @ P @ I_KH.T + K @ np.diag(R) @ K.T
    use, whole = np.ones(5, dtype=bool), np.array([0, 9])
    P1, dx, nis = kalman.update_dense(P.copy(), H, R, nu, use, whole)
    np.testing.assert_allclose(P1, joseph, atol=1e-10)
    np.testing.assert_allclose(dx, K @ nu, atol=1e-10)
    assert nis == pytest.approx(nu @ np.linalg.solve(S, nu))


@pytest.mark.parametrize("starts", [(0, 10), (0, 5, 10), (0, 9, 10)])
def test_ud_equals_dense_step_by_step(starts: tuple[int, ...]) -> None:
    """For one block and for split filters, through several predictions and updates."""
    bounds = np.array(starts)
    P, H, R, nu, Phi = random_problem(11, 10, 6)
    mask = np.zeros((10, 10))
    for lo, hi in zip(bounds, bounds[1:]):
        mask[lo:hi, lo:hi] = 1.0
    P = P * mask
    Phi = np.eye(10) + 0.1 * Phi
    U, D = kalman.ud_factor(P)
    use = np.array([True, True, False, True, True, True])
    q = np.linspace(0.01, 0.1, 10)
    for _ in range(5):
        Qd = kalman.integrated_noise(Phi, q, 0.06, bounds)
        P = kalman.predict_dense(P, Phi, Qd, bounds)
        U, D = kalman.predict_ud(U, D, Phi, Qd, bounds)
        P, dx, nis = kalman.update_dense(P, H, R, nu, use, bounds)
        U, D, dx_ud, nis_ud = kalman.update_ud(U, D, H, R, nu, use, bounds)
        np.testing.assert_allclose(kalman.ud_product(U, D), P, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(dx_ud, dx, rtol=1e-10, atol=1e-12)
        assert nis == pytest.approx(nis_ud, rel=1e-10)
        assert np.all(P[mask == 0] == 0)


def test_split_update_weighs_with_the_total_variance() -> None:
    """One scalar on two one-state halves, by hand: s = 4 + 9 + 1, gains 4/14 and 9/14."""
    P = np.diag([4.0, 9.0])
    one = np.ones((1, 2))
    P1, dx, nis = kalman.update_dense(P, one, np.ones(1), np.array([7.0]), np.ones(1, dtype=bool), np.array([0, 1, 2]))
    np.testing.assert_allclose(dx, [2.0, 4.5])
    np.testing.assert_allclose(P1, np.diag([4 - 16 / 14, 9 - 81 / 14]))
    assert nis == pytest.approx(49 / 14)


def test_integrated_noise_against_van_loan() -> None:
    rng = np.random.default_rng(2)
    A, q, dt = rng.normal(size=(4, 4)), np.array([0.1, 0.5, 0.2, 0.0]), 0.02
    block = scipy.linalg.expm(np.block([[-A, np.diag(q)], [np.zeros((4, 4)), A.T]]) * dt)
    exact = block[4:, 4:].T @ block[:4, 4:]
    Qd = kalman.integrated_noise(scipy.linalg.expm(A * dt), q, dt, np.array([0, 4]))
    np.testing.assert_allclose(Qd, exact, atol=1e-5)


# ------------------------------------------------------------------------------------------------ the filter


@pytest.mark.parametrize("config", [FilterConfig(), FilterConfig(kind="split"), FilterConfig(kind="plain")])
def test_ud_filter_equals_dense_filter_over_an_approach(config: FilterConfig) -> None:
    from dataclasses import replace

    _, dense, ekf, _ = bench.run(config, 1, frames=60)
    _, ud, _, _ = bench.run(replace(config, factorisation="ud"), 1, frames=60)
    for a, b in zip(dense, ud):
        np.testing.assert_allclose(a.mean, b.mean, rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(a.cov, b.cov, rtol=1e-7, atol=1e-10)
    assert ekf.names[0] == "u"


def test_blocks_cover_what_the_kinds_promise() -> None:
    assert len(Blocks.of(FilterConfig(kind="plain")).index) == 12
    split = Blocks.of(FilterConfig(kind="split"))
    assert tuple(split.starts) == (0, 6, 12)
    assert [states.NAMES[i] for i in split.index[:6]] == ["u", "w", "q", "theta", "x", "H"]
    augmented = Blocks.of(FilterConfig())
    assert len(augmented.index) == 25
    with_width = Blocks.of(FilterConfig(width="state"))
    assert states.WIDTH in with_width.index and states.WX not in with_width.index


def test_filter_is_consistent_in_a_matched_world() -> None:
    """NEES per state and NIS over 16 approaches, model and noise matched: both must be 1 within sampling error."""
    all_nees, all_nis = [], []
    for seed in range(16):
        truth, estimates, ekf, _ = bench.run(FilterConfig(), seed, frames=120)
        all_nees.append(bench.nees(truth, estimates, ekf)[20:].mean())
        all_nis.append(np.mean([e.residuals.nis / e.residuals.dof for e in estimates[20:]]))
    assert 0.75 < np.mean(all_nees) < 1.3, np.mean(all_nees)
    assert 0.85 < np.mean(all_nis) < 1.15, np.mean(all_nis)


def test_offsets_of_the_believed_aircraft_are_narrowed_down_and_leave_the_velocities_clean() -> None:
    """Lift and pitching moment off by a constant: told from wind in part, and no longer taken for vertical velocity."""
    prior = FilterConfig().offset_sigma
    errors = []
    for seed in range(8):
        truth, estimates, _, _ = bench.run(FilterConfig(), seed, frames=150)
        at = [estimates[-1].names.index(name) for name in ("cX", "cZ", "cm", "w")]
        errors.append(estimates[-1].mean[at] - truth[-1][[states.CX, states.CZ, states.CM, states.W]])
        assert np.all(np.sqrt(np.diag(estimates[-1].cov))[at[:3]] < 0.75 * np.array(prior))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(rms[:3] < prior)
    assert rms[3] < 0.1


def test_offset_sigma_is_that_of_perturbed_aircraft() -> None:
    """To first order and analytic, against drawn aircraft at the believed one's trim."""
    belief = AircraftBelief()
    x, shadow = mismatch._level(belief, 46.0, 0.5)
    at_trim = mismatch._accelerations(belief, x, shadow)
    np.testing.assert_allclose(at_trim, 0.0, atol=1e-8)
    noise = Noise(1, "belief")
    drawn = np.array([mismatch._accelerations(belief.perturbed(noise, 0.08, 0.03), x, shadow) for _ in range(1500)])
    force = 0.5 * belief.rho * 46.0**2 * belief.S
    found = drawn.std(axis=0) * [belief.mass / force, belief.mass / force, belief.Iyy / (force * belief.c)]
    np.testing.assert_allclose(found, mismatch.offset_sigma(belief, 46.0, 0.5, 0.08, 0.03), rtol=0.08)


@pytest.mark.parametrize("height", [2.0, 15.0, 50.0])
def test_reported_turbulence_changes_the_wind_as_drydens_does(height: float) -> None:
    """The noise that the filter is given is the variance of what the simulated gusts change by in a cycle."""
    air = DrydenTurbulence(Turbulence(10.0), Noise(3, "air"))
    gusts = np.array([air.velocity(0.06 * k, 0.0, 0.0, height, 47.0) for k in range(20000)])
    found, told = np.diff(gusts, axis=0).var(axis=0), gusts_change(height, 10.0, 47.0, 0.06)
    assert found[0] == pytest.approx(told[0], rel=0.05)
    np.testing.assert_allclose(found[1:], told[1:], rtol=0.6)  # the transverse spectra are not first-order


def test_consistency_notices_an_overconfident_filter() -> None:
    """The control: edges twice as noisy as believed must fail the band above."""
    nis = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        _, _, ekf, memory = bench.run(FilterConfig(), seed, frames=60)
        truth, estimates, _, _ = bench.run(FilterConfig(gate_sigma=None), seed, frames=80, sigma=0.1)
        m = bench.edges(truth[-1], memory.t, rng, sigma=0.2)
        h, Hx = np.empty(10), np.empty((10, states.N))
        assert m.geometry is not None
        g = m.geometry
        x = np.zeros(states.N)
        x[ekf.blocks.index], x[states.WIDTH] = estimates[-1].mean, 29.0
        edge_model(x, g.feature, g.centre, g.direction, g.pan, g.tilt, bench.LEVER, bench.focal(), 0.0, h, Hx)
        Hn = Hx[:, ekf.blocks.index]
        S = Hn @ estimates[-1].cov @ Hn.T + 0.01 * np.eye(10)
        nis.append((m.z - h) @ np.linalg.solve(S, m.z - h) / 10)
    assert np.mean(nis) > 1.15, nis


def test_gate_rejects_a_wrong_edge_and_keeps_the_others() -> None:
    rng = np.random.default_rng(4)
    truth, _, ekf, memory = bench.run(FilterConfig(), 4, frames=60)
    x = truth[-1].copy()
    memory = ekf.predict(memory, bench.COMMAND, memory.t + 1e-6)  # another image: other noise of the encoders
    m = bench.edges(x, memory.t, rng)
    m.z[1] += 15.0
    after = ekf.update(memory, m)
    assert after.residuals is not None
    assert after.residuals.status[1] == Status.REJECTED
    assert after.residuals.dof == 9


def test_watchdog_reopens_a_locked_out_filter() -> None:
    """A filter that is confidently 30 m off in range rejects everything; without the watchdog it would do so for ever."""
    rng = np.random.default_rng(5)
    truth, _, ekf, memory = bench.run(FilterConfig(), 5, frames=60)
    wrong = memory.x.copy()
    wrong[states.X] += 60.0
    wrong[states.Y] += 6.0
    memory = memory._replace(x=wrong)
    par, x = ekf._par, truth[-1].copy()
    s = bench.settle(x, par)
    reinflated = False
    for _ in range(60):
        t = memory.t + 0.06
        bench.fly(x, s, par, np.zeros(states.N), 0.06, rng)
        memory = ekf.predict(memory, bench.COMMAND, t)
        for m in bench.inertial(x, t, rng, ekf.config):
            memory = ekf.update(memory, m)
        memory = ekf.update(memory, bench.edges(x, t, rng))
        reinflated |= memory.reinflated > 0
    assert reinflated
    assert abs(memory.x[states.Y] - x[states.Y]) < 0.5
    assert abs(memory.x[states.X] - x[states.X]) < 6.0


def test_missing_edges_are_not_used_and_say_so() -> None:
    rng = np.random.default_rng(6)
    truth, _, ekf, memory = bench.run(FilterConfig(), 6, frames=40)
    m = bench.edges(truth[-1], memory.t, rng)
    m.z[:] = np.nan
    after = ekf.update(memory, m)
    np.testing.assert_array_equal(after.x, memory.x)
    assert after.residuals is not None and after.residuals.dof == 0
    assert after.misses == memory.misses + 1


def test_a_horizon_alone_does_not_keep_the_runway() -> None:
    """What is left is searched for: without an edge of the runway for a while the filter says that it has lost it."""
    rng = np.random.default_rng(6)
    truth, _, ekf, memory = bench.run(FilterConfig(lost_after=3, gate_sigma=None), 6, frames=40)
    for k in range(3):
        assert not ekf.read(memory).flags["lost"], k
        m = bench.edges(truth[-1], memory.t, rng)
        assert m.geometry is not None
        m.z[m.geometry.feature != Feature.HORIZON] = np.nan
        memory = ekf.update(memory, m)
        assert memory.residuals is not None and memory.residuals.dof > 0
    assert ekf.read(memory).flags["lost"]


def test_late_measurements_replayed_equal_in_order_data() -> None:
    """120 ms late images through Rewind give the bits that punctual images give."""
    rng = np.random.default_rng(8)
    ekf = bench.filter_of(FilterConfig())
    late = Rewind(ekf, 0.5)
    x = bench.truth_at(rng)
    s = bench.settle(x, ekf._par)
    a, b = ekf.init(0.0), late.init(0.0)
    waiting: list = []
    for k in range(25):
        t = k * 0.06
        a, b = ekf.predict(a, bench.COMMAND, t), late.predict(b, bench.COMMAND, t)
        images = [bench.pose(x, t, rng)] if k == 0 else []
        readings = bench.inertial(x, t, rng, ekf.config)
        images.append(bench.edges(x, t, rng))
        for m in readings:
            a, b = ekf.update(a, m), late.update(b, m)
        for m in images:
            a = ekf.update(a, m)
        waiting.append(images)
        if k >= 2:
            for m in waiting[k - 2]:
                b = late.update(b, m)
        bench.fly(x, s, ekf._par, np.zeros(states.N), 0.06, rng)
    for images in waiting[-2:]:
        for m in images:
            b = late.update(b, m)
    np.testing.assert_array_equal(late.read(b).mean, ekf.read(a).mean)
    np.testing.assert_array_equal(late.read(b).cov, ekf.read(a).cov)


def test_rewind_refuses_what_is_older_than_its_horizon() -> None:
    ekf = bench.filter_of(FilterConfig())
    late = Rewind(ekf, 0.1)
    memory = late.init(0.0)
    for k in range(1, 10):
        memory = late.predict(memory, bench.COMMAND, 0.06 * k)
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="older than|reaches back"):
        late.update(memory, bench.inertial(bench.truth_at(rng), 0.1, rng, ekf.config)[0])


def test_rewind_splits_a_prediction_where_a_measurement_falls_between() -> None:
    ekf = bench.filter_of(FilterConfig())
    rng = np.random.default_rng(9)
    x = bench.truth_at(rng)
    late = Rewind(ekf, 1.0)
    memory = late.init(0.0)
    memory = late.update(memory, bench.pose(x, 0.0, rng))
    memory = late.predict(memory, bench.COMMAND, 0.06)
    reading = bench.inertial(x, 0.03, rng, ekf.config)[0]
    memory = late.update(memory, reading)
    assert [round(e.t, 3) for e in memory] == [0.0, 0.0, 0.03, 0.03, 0.06]
    at = late.read(memory, 0.045)
    assert at.t == pytest.approx(0.045)


def test_reckoned_attitude_by_hand() -> None:
    """A roll is integrated; a gyro that lies about the roll ends where the turn says; a turn is a bank."""
    x = np.zeros(states.N)
    x = reckoned(x, np.array([0.1, 0.02, 0.0]), 60.0, 0.5)
    assert x[states.PHI] == pytest.approx(0.05) and x[states.THETA] == pytest.approx(0.01)
    assert x[[states.P, states.Q, states.R, states.U]].tolist() == [0.1, 0.02, 0.0, 60.0]
    lies = np.zeros(states.N)
    for _ in range(4000):
        lies = reckoned(lies, np.array([math.radians(0.1), 0.0, 0.0]), 60.0, 0.04)
    assert math.degrees(lies[states.PHI]) == pytest.approx(1.5, abs=0.01)  # bias times 15 s
    # a level turn of 20 deg of bank: its rate splits into q and r
    phi, V = math.radians(20.0), 60.0
    rate = 9.80665 * math.tan(phi) / V
    banked = np.zeros(states.N)
    for _ in range(4000):
        banked = reckoned(banked, np.array([0.0, rate * math.sin(phi), rate * math.cos(phi)]), V, 0.04)
    assert math.degrees(banked[states.PHI]) == pytest.approx(20.0, abs=0.1)
