"""Dixon, Fang, Dawson, Flynn 2003: what drives the image is identified by a sign term, and range is its ratio to d.

    y_hat_i' = p_i(y) + f_i,   f_i' = -(k + alpha) f_i + gamma sgn(e_i) + alpha k e_i,   e_i = y_i - y_hat_i
    y3_hat = sqrt((f1^2 + f2^2)/(d1^2 + d2^2))

Reconstruction of the structure, five parts in six sure; gains k = alpha = 10, gamma = 8 are ours, the paper's are not
known: what comes out is no evidence against it. Across |e| < layer, sgn(e) is e / layer; the true sign (layer 0) chatters
when y is sampled. The root makes y3_hat positive whatever the motion.
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
class Dixon:
    """contract.RangeObserver. k, alpha [1/s], gamma [1/s^2]; inner: y1_hat, y2_hat, f1, f2."""

    k: float = 10.0
    alpha: float = 10.0
    gamma: float = 8.0
    layer: float = 0.003
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
        if not len(inner):  # f starts as the guessed range would have it
            _, _, _, d1, d2 = drift(float(state.y[0]), float(state.y[1]), motion.A, motion.B)
            inner = np.array([state.y[0], state.y[1], d1 / state.x[2], d2 / state.x[2]])

        def rates(s: Array, y1: float, y2: float, A: Array, B: Array) -> Array:
            return _rates(s, y1, y2, A, B, self.k, self.alpha, self.gamma, self.layer)

        s = advance(rates, inner, state.y, y, motion, dt, self.longest)
        _, _, _, d1, d2 = drift(float(y[0]), float(y[1]), motion.A, motion.B)
        drive, speed = math.hypot(s[2], s[3]), math.hypot(d1, d2)
        x = np.array([y[0], y[1], 1.0]) * (speed / drive) if drive > 0.0 and speed > 0.0 else np.full(3, np.nan)
        return arrive(state, x, y, motion, s, (d1, d2), speed >= self.floor, self.limit)

    def estimate(self, state: State) -> Array:
        return state.x


@kernel
def _rates(
    s: Array, y1: float, y2: float, A: Array, B: Array, k: float, alpha: float, gamma: float, layer: float
) -> Array:
    p1, p2, _, _, _ = drift(y1, y2, A, B)
    out = np.empty(4)
    for i in range(2):
        e = (y1 if i == 0 else y2) - s[i]
        if layer > 0.0:
            sign = min(1.0, max(-1.0, e / layer))
        else:
            sign = np.sign(e)
        out[i] = (p1 if i == 0 else p2) + s[2 + i]
        out[2 + i] = -(k + alpha) * s[2 + i] + gamma * sign + alpha * k * e
    return out
