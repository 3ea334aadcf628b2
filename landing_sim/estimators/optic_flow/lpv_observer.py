"""The paper's observer in a discrete form that cannot lose definiteness, with all flows at once or each when it comes.

With P = S^-1 and N = 1/2 M^-1 Theta M, the Riccati-like equation (19) in the coordinates of X is that of a Kalman filter
that forgets: over one step F = exp((A + N) dt), P- = F P F'; a look weighs in by Joseph's form. dX moves with exp(A dt).

Published: the fusion and the observer (eqs. 5-19, corrected in `geometry` and `lpv`). Ours: the discrete form, updates by
single sensors in place of a held least squares, the gate, and Theta and S(0) of `SHIPPED`: with the published ones the
height's gain is so high that 0.1 deg/s of noise throws h by kilometres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from landing_sim.estimators.optic_flow.contract import FlowState, Push
from landing_sim.estimators.optic_flow.dynamics import exponential, state_jacobian, state_rates
from landing_sim.estimators.optic_flow.geometry import WZ, flow, flow_row, left_inverse, outputs
from landing_sim.estimators.optic_flow.lpv import SCALE, c2, output_matrix
from landing_sim.estimators.optic_flow.reference import Reference
from landing_sim.jit import kernel
from landing_sim.types import Array

HOVER = math.radians(
    0.5
)  # [rad/s] of |omega_z*| below which C2 is as good as singular: nothing forgotten, nothing learnt


@dataclass(frozen=True, slots=True)
class Gains:
    """Diagonals of Theta [1/s] and S(0), in the order h, q, xbar_1..3; S(0) for h in metres."""

    Theta: tuple[float, float, float, float, float]
    S0: tuple[float, float, float, float, float]


PUBLISHED = Gains((20.0, 0.05, 20.0, 20.0, 0.3), (1.0, 0.2, 1.0, 1.0, 0.2))
SHIPPED = Gains((0.2, 0.05, 5.0, 5.0, 0.3), (1e-3, 1.0, 1.0, 1.0, 1.0))
SPARSE = Gains((0.2, 0.05, 1.0, 1.0, 0.3), (1e-3, 1.0, 1.0, 1.0, 1.0))
"""For looks of a few a second: nothing may be forgotten before the next one comes."""


@dataclass(frozen=True, slots=True)
class LpvObserver:
    """contract.FlowObserver on the linearised reference.

    spread : one sigma of the first [h, q, omega_x, omega_z, theta] in SI, where looks come with variances of their own;
        None starts from S(0) as the paper does, for `fuse`
    gate : [sigma] beyond which a single look is not believed
    """

    reference: Reference
    gains: Gains = SHIPPED
    spread: tuple[float, float, float, float, float] | None = None
    gate: float = 3.5

    def start(self, t: float, X: Array) -> FlowState:
        if self.spread is not None:
            return FlowState(t, np.array(X, dtype=float), np.diag((np.array(self.spread) * SCALE) ** 2))
        M = np.eye(5)
        M[2:, 2:] = c2(self.reference.state(t))
        back = np.linalg.inv(M)
        return FlowState(t, np.array(X, dtype=float), back @ np.diag(SCALE**2 / self.gains.S0) @ back.T)

    def predict(self, state: FlowState, push: Push, dt: float) -> FlowState:
        ref = self.reference
        before, middle, after = (ref.at(state.t + share * dt) for share in (0.0, 0.5, 1.0))
        over = state.t + 0.5 * dt > ref.duration
        dX, P = _predict(
            state.X - before[:5], state.P, middle, push.a, push.spin, ref.lander.gravity, np.array(self.gains.Theta),
            dt, over,
        )  # fmt: skip
        return FlowState(state.t + dt, after[:5] + dX, P, state.used)

    def fuse(self, state: FlowState, alpha: Array, flows: Array, dt: float) -> FlowState:
        """All flows (n,) [rad/s] of the sensors at alpha (n,) [rad] as Y (7), with the weight of dt [s].

        Called with half a step before and after `predict`, the equations (18), (19) are solved to second order.
        """
        X = self.reference.state(state.t)
        if abs(X[WZ]) < HOVER:
            return replace(state, used=False)
        C = np.empty((3, 5))
        output_matrix(X, C)
        error = left_inverse(alpha) @ flows - outputs(X) - C @ (state.X - X)
        dX, P = _correct(state.P, C / SCALE, error, np.eye(3) / dt)
        return FlowState(state.t, state.X + dX / SCALE, P)

    def look(self, state: FlowState, alpha: float, flow: float, sigma: float) -> FlowState:
        X = self.reference.state(state.t)
        if abs(X[WZ]) < HOVER:
            return replace(state, used=False)
        dX, P, used = _look(X, state.X - X, state.P, alpha, flow, sigma * sigma, self.gate)
        return FlowState(state.t, state.X + dX, P, used)

    def barred_information(self, state: FlowState) -> Array:
        """S (5, 5) of eq. (19), with h in km."""
        M = np.eye(5)
        M[2:, 2:] = c2(self.reference.state(state.t))
        P = M @ state.P @ M.T
        return np.asarray(np.linalg.inv(0.5 * (P + P.T)))


@kernel
def _predict(
    dX: Array, P: Array, row: Array, a: float, spin: float, g: float, Theta: Array, dt: float, over: bool
) -> tuple[Array, Array]:
    """One step about the reference's row [X*, a*, spin*, ...] in its middle. `over`: the reference stands still there."""
    X, a0, spin0 = row[:5], row[5], row[6]
    A = np.empty((5, 5))
    state_jacobian(X, a0, g, A)
    drive = np.zeros(5)
    if over:
        state_rates(X, a0, spin0, g, drive)
    drive[1] += spin - spin0
    drive[2] += math.sin(X[4]) / X[0] * (a - a0)
    drive[3] += math.cos(X[4]) / X[0] * (a - a0)
    step = exponential(A, dt)
    out = step @ dX + dt * (drive + 0.5 * dt * (A @ drive))
    A[0, :] *= 1e-3  # h in km
    A[:, 0] *= 1e3
    if abs(X[3]) >= HOVER:
        C = np.empty((3, 5))
        output_matrix(X, C)
        M = np.eye(5)
        M[2:, 2:] = C[:, 2:]
        A = A + 0.5 * (np.linalg.inv(M) * Theta) @ M
    F = exponential(A, dt)
    P = F @ P @ F.T
    return out, 0.5 * (P + P.T)


@kernel
def _correct(P: Array, C: Array, error: Array, R: Array) -> tuple[Array, Array]:
    """dX (5,) with h in km and P after a look at `error` (m,): Joseph's form."""
    K = np.linalg.solve(C @ P @ C.T + R, C @ P).T
    keep = np.eye(5) - K @ C
    return K @ error, keep @ P @ keep.T + K @ R @ K.T


@kernel
def _look(
    X: Array, dX: Array, P: Array, alpha: float, seen: float, variance: float, gate: float
) -> tuple[Array, Array, bool]:
    """Correction (5,) in SI and P after one flow, linear about the reference state X."""
    row = np.empty(5)
    flow_row(X, alpha, row)
    error = seen - flow(X, alpha) - float(row @ dX)
    return scalar_update(P, row, error, variance, gate)


@kernel
def scalar_update(P: Array, row: Array, error: float, variance: float, gate: float) -> tuple[Array, Array, bool]:
    """Joseph's form for one scalar: correction in SI, P with h in km, and whether the gate let it in. row (5,) in SI."""
    c = row.copy()
    c[0] *= 1e3
    Pc = P @ c
    s = c @ Pc + variance
    if error * error > gate * gate * s:
        return np.zeros(5), P, False
    K = Pc / s
    keep = np.eye(5) - np.outer(K, c)
    after = keep @ P @ keep.T + variance * np.outer(K, K)
    out = K * error
    out[0] *= 1e3
    return out, 0.5 * (after + after.T), True
