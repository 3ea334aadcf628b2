"""Chen & Kano 2002: a sliding-mode observer of the image with adaptive gains; the range from what holds it on the surface.

    y_hat_i' = p_i(y) + L_i e_i/(|e_i| + delta),   L_i' = rate max(|e_i| - delta, 0)
    v_i : the injection, low-passed with tau; on the surface v_i = d_i y3
    y3_hat = (d1 v1 + d2 v2)/(d1^2 + d2^2)

Reconstruction, one part in three sure: only "sliding mode", "adaptation" and the smoothing delta = 0.003 that Gibert et al.
quote are certain. The gains are ours: what comes out is no evidence against the paper.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.ranging.advance import advance
from landing_sim.estimators.ranging.contract import Motion, State, arrive, begin, coast
from landing_sim.estimators.ranging.perspective import drift
from landing_sim.jit import kernel
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class ChenKano:
    """contract.RangeObserver. gain: L_i at the start [1/s]; rate [1/s^2]; tau [s]; inner: y_hat, L, v (two each)."""

    gain: float = 0.5
    rate: float = 10.0
    delta: float = 0.003
    tau: float = 0.05
    floor: float = 0.05
    limit: float = math.inf
    longest: float = 1e-3

    def start(self, y: Array, range_guess: float) -> State:
        return begin(y, range_guess)

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        if not np.isfinite(y).all():
            return coast(state, motion)
        inner = state.inner
        if not len(inner):  # v starts as the guessed range would have it
            _, _, _, d1, d2 = drift(float(state.y[0]), float(state.y[1]), motion.A, motion.B)
            inner = np.array([state.y[0], state.y[1], self.gain, self.gain, d1 / state.x[2], d2 / state.x[2]])

        def rates(s: Array, y1: float, y2: float, A: Array, B: Array) -> Array:
            return _rates(s, y1, y2, A, B, self.rate, self.delta, self.tau)

        s = advance(rates, inner, state.y, y, motion, dt, self.longest)
        _, _, _, d1, d2 = drift(float(y[0]), float(y[1]), motion.A, motion.B)
        driven, power = d1 * s[4] + d2 * s[5], d1 * d1 + d2 * d2
        x = np.array([y[0], y[1], 1.0]) * (power / driven) if driven > 0.0 else np.full(3, np.nan)
        return arrive(state, x, y, motion, s, (d1, d2), math.sqrt(power) >= self.floor, self.limit)

    def estimate(self, state: State) -> Array:
        return state.x


@kernel
def _rates(s: Array, y1: float, y2: float, A: Array, B: Array, rate: float, delta: float, tau: float) -> Array:
    p1, p2, _, _, _ = drift(y1, y2, A, B)
    out = np.empty(6)
    for i in range(2):
        e = (y1 if i == 0 else y2) - s[i]
        injection = s[2 + i] * e / (abs(e) + delta)
        out[i] = (p1 if i == 0 else p2) + injection
        out[2 + i] = rate * max(abs(e) - delta, 0.0)
        out[4 + i] = (injection - s[4 + i]) / tau
    return out
