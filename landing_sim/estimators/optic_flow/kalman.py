"""Extended and unscented Kalman filters on the same state: the comparison that the paper leaves to the future.

They predict with eq. (2) itself, about where they believe to be, so they need no reference and know how sure they are.

Source     textbook (Julier & Uhlmann 1997 for the sigma points: n + kappa = 6). The noises are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.estimators.optic_flow.contract import FlowState, Push
from landing_sim.estimators.optic_flow.dynamics import Lander, advance, exponential, state_jacobian
from landing_sim.estimators.optic_flow.geometry import flow, flow_row
from landing_sim.estimators.optic_flow.lpv import SCALE
from landing_sim.estimators.optic_flow.lpv_observer import scalar_update
from landing_sim.jit import kernel
from landing_sim.types import Array

LOWEST = 1.0  # [m] the ground is not below where the lander stands


@dataclass(frozen=True, slots=True)
class Spreads:
    """One sigma of the first [h, q, omega_x, omega_z, theta], and of their random walk in one second. SI."""

    first: tuple[float, float, float, float, float] = (
        *(100.0, math.radians(0.2), math.radians(0.3)),
        *(math.radians(0.3), math.radians(4.0)),
    )
    walk: tuple[float, float, float, float, float] = (
        *(0.5, math.radians(0.01), math.radians(0.005)),
        *(math.radians(0.005), math.radians(0.01)),
    )


@dataclass(frozen=True, slots=True)
class FlowEkf:
    """contract.FlowObserver: linearised at the estimate."""

    lander: Lander = field(default_factory=Lander)
    spreads: Spreads = field(default_factory=Spreads)
    gate: float = 3.5

    def start(self, t: float, X: Array) -> FlowState:
        return FlowState(t, np.array(X, dtype=float), np.diag((np.array(self.spreads.first) * SCALE) ** 2))

    def predict(self, state: FlowState, push: Push, dt: float) -> FlowState:
        Qd = (np.array(self.spreads.walk) * SCALE) ** 2 * dt
        X, P = _predict_ekf(state.X, state.P, push.a, push.spin, self.lander.gravity, Qd, dt)
        return FlowState(state.t + dt, X, P, state.used)

    def look(self, state: FlowState, alpha: float, flow: float, sigma: float) -> FlowState:
        X, P, used = _look_ekf(state.X, state.P, alpha, flow, sigma * sigma, self.gate)
        return FlowState(state.t, X, P, used)


@dataclass(frozen=True, slots=True)
class FlowUkf:
    """contract.FlowObserver: by sigma points."""

    lander: Lander = field(default_factory=Lander)
    spreads: Spreads = field(default_factory=Spreads)
    gate: float = 3.5

    def start(self, t: float, X: Array) -> FlowState:
        return FlowState(t, np.array(X, dtype=float), np.diag((np.array(self.spreads.first) * SCALE) ** 2))

    def predict(self, state: FlowState, push: Push, dt: float) -> FlowState:
        Qd = (np.array(self.spreads.walk) * SCALE) ** 2 * dt
        X, P = _predict_ukf(state.X, state.P, push.a, push.spin, self.lander.gravity, Qd, dt)
        return FlowState(state.t + dt, X, P, state.used)

    def look(self, state: FlowState, alpha: float, flow: float, sigma: float) -> FlowState:
        X, P, used = _look_ukf(state.X, state.P, alpha, flow, sigma * sigma, self.gate)
        return FlowState(state.t, X, P, used)


@kernel
def _predict_ekf(X: Array, P: Array, a: float, spin: float, g: float, Qd: Array, dt: float) -> tuple[Array, Array]:
    A = np.empty((5, 5))
    state_jacobian(X, a, g, A)
    A[0, :] *= 1e-3
    A[:, 0] *= 1e3
    F = exponential(A, dt)
    P = F @ P @ F.T
    for i in range(5):
        P[i, i] += Qd[i]
    X = advance(X, a, spin, g, dt)
    X[0] = max(X[0], LOWEST)
    return X, 0.5 * (P + P.T)


@kernel
def _look_ekf(X: Array, P: Array, alpha: float, seen: float, variance: float, gate: float) -> tuple[Array, Array, bool]:
    row = np.empty(5)
    flow_row(X, alpha, row)
    dX, P, used = scalar_update(P, row, seen - flow(X, alpha), variance, gate)
    X = X + dX
    X[0] = max(X[0], LOWEST)
    return X, P, used


@kernel
def _points(X: Array, P: Array) -> Array:
    """(11, 5) sigma points: weight 1/6 for the first, 1/12 each of the others. P has h in km."""
    L = np.linalg.cholesky(P) * math.sqrt(6.0)
    out = np.empty((11, 5))
    out[0] = X
    for i in range(5):
        d = L[:, i].copy()
        d[0] *= 1e3
        out[1 + i], out[6 + i] = X + d, X - d
    for k in range(11):
        out[k, 0] = max(out[k, 0], LOWEST)
    return out


@kernel
def _weight(k: int) -> float:
    return 1.0 / 6.0 if k == 0 else 1.0 / 12.0


@kernel
def _predict_ukf(X: Array, P: Array, a: float, spin: float, g: float, Qd: Array, dt: float) -> tuple[Array, Array]:
    points = _points(X, P)
    mean = np.zeros(5)
    for k in range(11):
        points[k] = advance(points[k], a, spin, g, dt)
        mean += _weight(k) * points[k]
    after = np.zeros((5, 5))
    for k in range(11):
        d = points[k] - mean
        d[0] *= 1e-3
        after += _weight(k) * np.outer(d, d)
    for i in range(5):
        after[i, i] += Qd[i]
    mean[0] = max(mean[0], LOWEST)
    return mean, after


@kernel
def _look_ukf(X: Array, P: Array, alpha: float, seen: float, variance: float, gate: float) -> tuple[Array, Array, bool]:
    points = _points(X, P)
    seen_by = np.empty(11)
    mean = 0.0
    for k in range(11):
        seen_by[k] = flow(points[k], alpha)
        mean += _weight(k) * seen_by[k]
    s, cross = variance, np.zeros(5)
    for k in range(11):
        d = points[k] - X
        d[0] *= 1e-3
        e = seen_by[k] - mean
        s += _weight(k) * e * e
        cross += _weight(k) * e * d
    error = seen - mean
    if error * error > gate * gate * s:
        return X, P, False
    K = cross / s
    after = P - s * np.outer(K, K)
    dX = K * error
    dX[0] *= 1e3
    X = X + dX
    X[0] = max(X[0], LOWEST)
    return X, 0.5 * (after + after.T), True
