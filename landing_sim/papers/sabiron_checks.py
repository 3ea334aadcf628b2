"""What Sabiron et al. 2014 states as equations, checked against differences and projections, as printed and corrected."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from landing_sim.estimators.optic_flow import lpv
from landing_sim.estimators.optic_flow.dynamics import Lander, state_jacobian, state_rates
from landing_sim.estimators.optic_flow.geometry import flow, fusion, outputs
from landing_sim.estimators.optic_flow.lpv_observer import Gains
from landing_sim.estimators.optic_flow.reference import reference
from landing_sim.papers.sabiron_trials import ANGLES, BELIEVED, DEVIATION
from landing_sim.types import Array

STATES = [
    X + share * X[0] / 1496.0 * DEVIATION
    for X in (reference().state(t) for t in np.linspace(0.0, 45.0, 10))
    for share in (0.0, 1.0, -0.5)
]


def seen_by_projection(X: Array, alpha: float, step: float = 1e-4) -> float:
    """[rad/s] at which the ground point seen at alpha turns in body axes, from where it is a little before and after."""
    h, q, wx, wz, theta = X
    along = h / math.tan(alpha + theta)  # of the point, ahead of the lander

    def direction(t: float) -> float:
        return math.atan2(h + wz * h * t, along - wx * h * t) - (theta + q * t)

    return (direction(step) - direction(-step)) / (2.0 * step)


def flow_error() -> float:
    """[rad/s] of eq. (5), by differences that are good to 1e-9."""
    return max(abs(flow(X, a) - seen_by_projection(X, a)) for X in STATES for a in ANGLES if 0.02 < a + X[4] < 3.12)


PRINTED = {
    "corrected": (0.5, 0.5, 0.5),
    "(7)": (1.0, 1.0, 1.0),
    "(8)": (0.5, 1.0, 1.0),
}


def fusion_error(which: str) -> float:
    """Largest error of Y (6) by solving H Y = omega, relative to the largest |Y|; `which` of PRINTED is H."""
    H = 2.0 * fusion(ANGLES) * PRINTED[which]
    worst = 0.0
    for X in STATES:
        Y = outputs(X)
        found = np.linalg.solve(H, [flow(X, a) for a in ANGLES])
        worst = max(worst, float(np.max(np.abs(found - Y)) / np.max(np.abs(Y))))
    return worst


def differences(f: Callable[[Array], Array], X: Array) -> Array:
    """dF/dX by central differences, with steps that suit each state."""
    columns = []
    for i, step in enumerate((2e-5 * X[0], 1e-5, 1e-5, 1e-5, 1e-5)):
        d = np.zeros(5)
        d[i] = step
        columns.append((f(X + d) - f(X - d)) / (2.0 * step))
    return np.column_stack(columns)


def rates(X: Array, a: float = 2.8, spin: float = 1e-3) -> Array:
    """X' (5,) by eq. (2)."""
    out = np.empty(5)
    state_rates(X, a, spin, Lander().gravity, out)
    return out


def jacobian_error() -> float:
    """Of A (13), B (14) and C (10) from differences."""
    worst = 0.0
    for X in STATES:
        A, C = np.empty((5, 5)), np.empty((3, 5))
        state_jacobian(X, 2.8, Lander().gravity, A)
        lpv.output_matrix(X, C)
        B = lpv.input_matrix(X, 700.0, Lander().agility)
        thrust = (rates(X, 2.8 + 1e-4) - rates(X, 2.8 - 1e-4)) / 2e-4 / 700.0
        scale = np.outer(1.0 / lpv.SCALE, lpv.SCALE)  # h weighs as kilometres
        worst = max(worst, float(np.max(np.abs(A - differences(rates, X)) / scale)))
        worst = max(worst, float(np.max(np.abs(C - differences(outputs, X)))), float(np.max(np.abs(B[:, 0] - thrust))))
    return worst


def c2_rate_error() -> float:
    """Of C2' as section IV.B gives it, from differences along the motion."""
    step, worst = 1e-4, 0.0
    for X in STATES:
        X_dot = rates(X)
        by_differences = (lpv.c2(X + step * X_dot) - lpv.c2(X - step * X_dot)) / (2.0 * step)
        worst = max(worst, float(np.max(np.abs(lpv.c2_rate(X, X_dot) - by_differences))))
    return worst


def determinant_error() -> float:
    """Of det C2 = -2 omega_z."""
    return max(abs(float(np.linalg.det(lpv.c2(X))) + 2.0 * X[3]) for X in STATES)


def barred_model(t: float) -> tuple[Array, Array]:
    """M and Abar at time t of the reference, SI."""
    row = reference().at(t)
    A = np.empty((5, 5))
    state_jacobian(row[:5], row[5], reference().lander.gravity, A)
    return lpv.barred(row[:5], rates(row[:5], row[5], row[6]), A)


def observer_equations(
    gains: Gains, end: float, dX: Array | None = None, symmetric: bool = True, whole: bool = True, step: float = 1e-5
) -> tuple[Array, Array, float]:
    """dX_hat (5,) and S (5, 5) at `end` [s] by (18), (19) themselves, perfect flows, and when S lost definiteness (or inf).

    dX : the true deviation from the reference, constant outputs' part left to the linear model: it moves with A too
    symmetric : (19) with 1/2 (Theta S + S Theta), else Theta S as printed
    whole : Abar = (M' + M A) M^-1, else with I2 for its first two rows and columns, as the expanded equation has it
    """
    from scipy.linalg import expm

    Theta = np.diag(gains.Theta)
    M0, _ = barred_model(0.0)
    S = np.diag(gains.S0)
    x_hat, x = M0 @ BELIEVED, M0 @ (DEVIATION if dX is None else dX)
    C, lost = lpv.C_BAR, math.inf
    n = round(end / step)
    coarse = max(1, n // 400)  # Abar changes slowly: kept for a while
    for k in range(n):
        if k % coarse == 0:
            _, Abar = barred_model((k + 0.5 * coarse) * step)
            if not whole:
                block = np.zeros((5, 5))
                block[:2, :2], block[2:, 2:] = np.eye(2), Abar[2:, 2:]
                Abar = block
            move = expm(Abar * step)

        def slope(S: Array, Abar: Array = Abar) -> Array:
            forget = 0.5 * (Theta @ S + S @ Theta) if symmetric else Theta @ S
            return C.T @ C - forget - Abar.T @ S - S @ Abar

        x = move @ x
        x_hat = move @ x_hat - step * np.linalg.solve(S, C.T @ (C @ (x_hat - x)))
        middle = S + 0.5 * step * slope(S)
        S = S + step * slope(middle)
        if math.isinf(lost) and k % coarse == 0 and np.linalg.eigvalsh(0.5 * (S + S.T))[0] <= 0.0:
            lost = (k + 1) * step
    M_end, _ = barred_model(end)
    return np.linalg.solve(M_end, x_hat), S, lost
