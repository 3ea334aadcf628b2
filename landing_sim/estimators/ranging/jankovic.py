"""Jankovic & Ghosh 1995: the identifier-based observer (IBO).

    y_hat' = -G (y_hat - y) + d y3_hat + p(y)
    y3_hat' = -G^2 d'(y_hat - y) - r3 y3_hat - b3 y3_hat^2,   reset to the bound M when |y3_hat| leaves gamma M

Reconstruction from its abstract, three parts in four sure; identity matrices for its weights. d is not normalised, so its
speed depends on the motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.ranging.advance import advance
from landing_sim.estimators.ranging.contract import Motion, State, arrive, coast, on_ray
from landing_sim.estimators.ranging.perspective import drift
from landing_sim.jit import kernel
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class JankovicGhosh:
    """contract.RangeObserver. gain G [1/s]; bound M [1/m] on nearness, gamma > 1; inner: y1_hat, y2_hat, y3_hat."""

    gain: float = 28.2
    bound: float = 10.0
    gamma: float = 1.5
    floor: float = 0.05
    limit: float = math.inf
    longest: float = 1e-3

    def start(self, y: Array, range_guess: float) -> State:
        y = np.asarray(y, dtype=float)
        return State(on_ray(y, range_guess), y, np.array([y[0], y[1], 1.0 / range_guess]))

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        if not np.isfinite(y).all():
            return coast(state, motion)

        def rates(s: Array, y1: float, y2: float, A: Array, B: Array) -> Array:
            return _rates(s, y1, y2, A, B, self.gain)

        s = advance(rates, state.inner, state.y, y, motion, dt, self.longest)
        if abs(s[2]) > self.gamma * self.bound:
            s = np.array([s[0], s[1], math.copysign(self.bound, s[2])])
        _, _, _, d1, d2 = drift(float(y[0]), float(y[1]), motion.A, motion.B)
        x = np.array([s[0], s[1], 1.0]) / s[2] if s[2] > 0.0 else np.full(3, np.nan)
        return arrive(state, x, y, motion, s, (d1, d2), math.hypot(d1, d2) >= self.floor, self.limit)

    def estimate(self, state: State) -> Array:
        return state.x


@kernel
def _rates(s: Array, y1: float, y2: float, A: Array, B: Array, gain: float) -> Array:
    p1, p2, r3, d1, d2 = drift(y1, y2, A, B)
    e1, e2 = s[0] - y1, s[1] - y2
    out = np.empty(3)
    out[0] = -gain * e1 + d1 * s[2] + p1
    out[1] = -gain * e2 + d2 * s[2] + p2
    out[2] = -gain * gain * (d1 * e1 + d2 * e2) - r3 * s[2] - B[2] * s[2] * s[2]
    return out
