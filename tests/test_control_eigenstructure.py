"""The eigenstructure LQ: what was asked for comes out, exactly where it can and with the residual it claims."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from landing_sim.control.eigenstructure import (
    DesignError,
    Mode,
    achieved,
    follow,
    loop_poles,
    margins,
    prescribed_gain,
)

# Lateral motion of a light aircraft near 50 m/s, rounded: v p r phi psi y; aileron, rudder.
NAMES = ("v", "p", "r", "phi", "psi", "y")
A = np.array(
    [
        [-0.28, 2.2, -49.0, 9.8, 0.0, 0.0],
        [-0.06, -3.4, 1.2, 0.0, 0.0, 0.0],
        [0.05, -0.35, -0.5, 0.0, 0.0, 0.0],
        [0.0, 1.0, -0.05, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 50.0, 0.0],
    ]
)
B = np.array([[0.0, 1.6], [7.0, 0.6], [-0.3, -2.5], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
SCALE = np.array([2.0, 0.2, 0.1, 0.1, 0.1, 5.0])
MODES = (
    Mode("dutch roll", -1.4 + 1.5j, {"v": 1.0, "phi": 0.0}),
    Mode("roll", -4.5, {"p": 1.0, "v": 0.0}),
    Mode("heading", -0.9, {"psi": 1.0, "v": 0.0}),
    Mode("localizer", -0.6 + 0.35j, {"y": 1.0, "v": 0.0}),
)
AUTHORITY = np.radians([8.0, 6.0])
R = np.diag(AUTHORITY**-2)
Q0 = np.diag(SCALE**-2)


def spectrum(K: np.ndarray) -> np.ndarray:
    return np.sort_complex(np.linalg.eigvals(A - B @ K))


def test_prescribed_eigenvalues_and_eigenvectors_are_met() -> None:
    K = prescribed_gain(A, B, MODES, NAMES, SCALE)
    wanted = np.sort_complex([v for m in MODES for v in {m.eigenvalue, m.eigenvalue.conjugate()}])
    np.testing.assert_allclose(spectrum(K), wanted, atol=1e-9)
    # Two inputs: one component beside the scale can be had exactly, and it was asked to be zero.
    values, vectors = np.linalg.eig(A - B @ K)
    for mode, (kept, zero) in zip(MODES, (("v", "phi"), ("p", "v"), ("psi", "v"), ("y", "v"))):
        v = vectors[:, np.argmin(np.abs(values - mode.eigenvalue))] / SCALE
        assert abs(v[NAMES.index(zero)]) < 1e-9 * abs(v[NAMES.index(kept)])


def test_one_input_leaves_no_choice_of_shape() -> None:
    """With one input the gain follows from the eigenvalues alone: Ackermann's, here by hand for a double integrator."""
    double = np.array([[0.0, 1.0], [0.0, 0.0]])
    modes = (Mode("both", -2.0 + 1.0j, {"x": 1.0}),)
    K = prescribed_gain(double, np.array([[0.0], [1.0]]), modes, ("x", "v"), np.array([3.0, 0.1]))
    np.testing.assert_allclose(K, [[5.0, 4.0]], atol=1e-12)  # (s + 2)² + 1


def test_shape_is_the_nearest_in_scaled_states() -> None:
    """More components than inputs: the residual is the least-squares one over the attainable subspace."""
    mode = Mode("roll", -4.5, {"p": 1.0, "v": 0.0, "phi": 0.0})
    modes = (MODES[0], mode, *MODES[2:])
    K = prescribed_gain(A, B, modes, NAMES, SCALE)
    (found,) = (m for m in achieved(A, B, K, modes, NAMES, SCALE) if m.name == "roll")
    space = np.linalg.solve(mode.eigenvalue.real * np.eye(6) - A, B) / SCALE[:, None]
    rows = [NAMES.index(n) for n in mode.shape]
    target = np.array([1.0 / SCALE[1], 0.0, 0.0])
    best = space[rows] @ np.linalg.lstsq(space[rows], target, rcond=None)[0]
    direction = (found.vector / SCALE)[rows].real
    assert abs(direction @ best) == pytest.approx(np.linalg.norm(direction) * np.linalg.norm(best), rel=1e-9)
    assert found.shape_error > 0.1


def test_rho_zero_is_the_prescribed_gain_and_the_limit_is_continuous() -> None:
    K_d = prescribed_gain(A, B, MODES, NAMES, SCALE)
    np.testing.assert_allclose(follow(A, B, K_d, R, Q0, R, 0.0).K, K_d, rtol=1e-12)
    distance = [np.abs((follow(A, B, K_d, R, Q0, R, rho).K - K_d) * SCALE).max() for rho in (1e-2, 1e-3, 1e-4)]
    assert distance[0] > 5 * distance[1] > 25 * distance[2] > 0.0


def test_large_rho_is_the_plain_regulator() -> None:
    K_d = prescribed_gain(A, B, MODES, NAMES, SCALE)
    plain = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q0, R))
    np.testing.assert_allclose(follow(A, B, K_d, R, Q0, R, 1e7).K, plain, rtol=1e-5)


@pytest.mark.parametrize("rho", [1e-3, 0.1, 3.0])
def test_riccati_equation_holds(rho: float) -> None:
    K_d = prescribed_gain(A, B, MODES, NAMES, SCALE)
    found = follow(A, B, K_d, R, Q0, R, rho)
    P, G = found.P, (1.0 + rho) * R
    # Without the cross term: u' = u + G^-1 N' x turns it into a standard equation.
    N = K_d.T @ R
    F = A - B @ np.linalg.solve(G, N.T)
    Q = K_d.T @ R @ K_d + rho * Q0 - N @ np.linalg.solve(G, N.T)
    zero = F.T @ P + P @ F + Q - P @ B @ np.linalg.solve(G, B.T @ P)
    assert np.abs(zero).max() < 1e-8 * np.abs(Q).max()
    assert found.residual < 1e-9
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_modes_are_paired_by_eigenvalue_and_shape() -> None:
    K = follow(A, B, prescribed_gain(A, B, MODES, NAMES, SCALE), R, Q0, R, 0.05).K
    found = {m.name: m for m in achieved(A, B, K, MODES, NAMES, SCALE)}
    assert list(found) == [m.name for m in MODES]
    for mode in found.values():
        assert abs(mode.eigenvalue - mode.wanted) < 0.2 * abs(mode.wanted)
        residual = (A - B @ K) @ mode.vector - mode.eigenvalue * mode.vector
        assert np.abs(residual / SCALE).max() < 1e-9 * np.abs(mode.vector / SCALE).max()
    assert found["roll"].vector[1] == pytest.approx(1.0, rel=1e-2)


def test_margins_of_an_integrator_by_hand() -> None:
    """L = k e^-sT / s: crossover k, phase margin 90 deg - kT, gain margin pi / (2 k T), delay margin pi / (2 k) - T."""
    k, T = 2.0, 0.1
    found = margins(np.zeros((1, 1)), np.ones((1, 1)), np.array([[k]]), T, [0.0], ["u"], np.ones(1))
    loop, alike = found.loops
    assert found.stable
    assert loop.crossover == pytest.approx(k, rel=1e-3)
    assert loop.phase == pytest.approx(math.pi / 2 - k * T, rel=1e-3)
    assert loop.gain_up == pytest.approx(math.pi / (2 * k * T), rel=1e-3)
    assert loop.gain_down == 0.0
    assert loop.delay == pytest.approx(math.pi / (2 * k) - T, rel=1e-3)
    assert (alike.gain_up, alike.delay) == pytest.approx((loop.gain_up, loop.delay))


def test_sensitivity_of_a_state_regulator_never_exceeds_one() -> None:
    """Kalman's inequality: an LQ loop without cross term and delay, inputs scaled by R^-1/2."""
    K = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q0, R))
    found = margins(A, B, K, 0.0, [0.0, 0.0], ["aileron", "rudder"], AUTHORITY)
    assert found.max_sensitivity == pytest.approx(1.0, abs=1e-3)
    assert all(loop.phase > math.radians(60.0) for loop in found.loops)


def test_delay_margin_is_where_the_closed_loop_turns_unstable() -> None:
    K = follow(A, B, prescribed_gain(A, B, MODES, NAMES, SCALE), R, Q0, R, 0.1).K
    lags = [0.08, 0.08]
    alike = margins(A, B, K, 0.06, lags, ["aileron", "rudder"], AUTHORITY).loops[-1]
    assert 0.1 < alike.delay < 1.0
    assert loop_poles(A, B, K, 0.06 + 0.97 * alike.delay, lags).real.max() < 0.0
    assert loop_poles(A, B, K, 0.06 + 1.03 * alike.delay, lags).real.max() > 0.0


@pytest.mark.parametrize(
    ("modes", "message"),
    [
        (MODES[:3], "4 of 6 states"),
        ((MODES[0], Mode("roll", -4.5, {"bank": 1.0}), *MODES[2:]), "no state 'bank'"),
        ((MODES[0], Mode("roll", -4.5, {"p": 0.0}), *MODES[2:]), "must not be zero"),
        ((MODES[0], MODES[1], Mode("again", -4.5, {"p": 1.0, "v": 0.0}), MODES[3]), "nearly dependent"),
    ],
)
def test_impossible_wishes_say_so(modes: tuple[Mode, ...], message: str) -> None:
    with pytest.raises(DesignError, match=message):
        prescribed_gain(A, B, modes, NAMES, SCALE)


def test_unstable_wish_is_refused() -> None:
    modes = (MODES[0], Mode("roll", 0.5, {"p": 1.0, "v": 0.0}), *MODES[2:])
    K_d = prescribed_gain(A, B, modes, NAMES, SCALE)
    with pytest.raises(DesignError, match="not stable"):
        follow(A, B, K_d, R, Q0, R, 0.0)
    with pytest.raises(DesignError, match="rho"):
        follow(A, B, K_d, R, Q0, R, -1.0)


def test_shape_tells_apart_what_eigenvalues_do_not() -> None:
    """x decays with -1.2 and y with -1.0; the mode wanted at -1.05 is the one of x."""
    loop = np.diag([-1.2, -1.0])
    modes = (Mode("x", -1.05, {"x": 1.0, "y": 0.0}), Mode("y", -1.15, {"x": 0.0, "y": 1.0}))
    found = achieved(loop, np.eye(2), np.zeros((2, 2)), modes, ("x", "y"), np.ones(2))
    assert [(m.name, m.eigenvalue, m.shape_error) for m in found] == [("x", -1.2, 0.0), ("y", -1.0, 0.0)]
