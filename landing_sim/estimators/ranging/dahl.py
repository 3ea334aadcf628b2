"""Dahl, Nyberg, Holst, Heyden 2005: a change of output that makes the error dynamics linear.

With b constant and b3 not zero, w1 = b1 x3 - b3 x1 = d1 x3 has w1' = g w1, and g = (b1 a3 - b3 a1)(y1, y2, 1)/d1 is a
function of the image alone. eta = 1/d1 is measured, and with zeta = 1/w1

    eta' = r3/d1 - g eta + b3 zeta,   zeta' = -g zeta

is linear but for terms in y, so an observer of it has linear error dynamics:

    eta_hat' = r3/d1 - g eta + b3 zeta_hat + l1 (eta - eta_hat),   zeta_hat' = -g zeta_hat + l2 (eta - eta_hat)
    l1 = 2 xi omega - g,   l2 = (omega^2 - l1 g)/b3;   x3_hat = 1/(d1 zeta_hat)

Reconstruction: the abstract says "linear error dynamics by a transformation of the output"; that it is this one is an even
guess. It needs d1 as Gibert's needs it, and b3 besides: without motion along the axis it does not exist.
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
class Dahl:
    """contract.RangeObserver. omega [rad/s]; floor [m/s] on |d1| and on |b3|.

    inner: eta_hat - eta and y3_hat = d1 zeta_hat, so that a change of b between steps moves neither.
    """

    xi: float = 0.99
    omega: float = 9.62
    floor: float = 0.05
    limit: float = math.inf
    longest: float = 1e-3

    def start(self, y: Array, range_guess: float) -> State:
        y = np.asarray(y, dtype=float)
        return State(on_ray(y, range_guess), y, np.array([0.0, 1.0 / range_guess]))

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        if not np.isfinite(y).all():
            return coast(state, motion)
        A, B = motion.A, motion.B
        _, _, _, before, _ = drift(float(state.y[0]), float(state.y[1]), A, B)
        _, _, _, d1, d2 = drift(float(y[0]), float(y[1]), A, B)
        seen = min(abs(before), abs(d1)) >= self.floor and before * d1 > 0.0 and abs(B[2]) >= self.floor
        if not seen:  # dead reckoning: there is no eta to compare with
            x = motion.R @ state.x + motion.t
            return arrive(state, x, y, motion, np.array([0.0, 1.0 / x[2]]), (d1, d2), False, self.limit)

        def rates(s: Array, y1: float, y2: float, A: Array, B: Array) -> Array:
            return _rates(s, y1, y2, A, B, self.xi, self.omega)

        s = np.array([1.0 / before + state.inner[0], state.inner[1] / before])
        s = advance(rates, s, state.y, y, motion, dt, self.longest)
        y3 = d1 * s[1]
        x = np.array([y[0], y[1], 1.0]) / y3 if y3 > 0.0 else np.full(3, np.nan)
        return arrive(state, x, y, motion, np.array([s[0] - 1.0 / d1, y3]), (d1, d2), True, self.limit)

    def estimate(self, state: State) -> Array:
        return state.x


@kernel
def _rates(s: Array, y1: float, y2: float, A: Array, B: Array, xi: float, omega: float) -> Array:
    _, _, r3, d1, _ = drift(y1, y2, A, B)
    g = (B[0] * r3 - B[2] * (A[0, 0] * y1 + A[0, 1] * y2 + A[0, 2])) / d1
    e = 1.0 / d1 - s[0]
    l1 = 2.0 * xi * omega - g
    out = np.empty(2)
    out[0] = (r3 - g) / d1 + B[2] * s[1] + l1 * e
    out[1] = -g * s[1] + (omega * omega - l1 * g) / B[2] * e
    return out
