"""Gibert, Burlion, Chriette, Boada-Bauxell, Plestan 2015: an observer in the coordinates y1, y1', y2.

    x_hat' = A x_hat + B + [dPsi/dx]^-1 kappa(y, x_hat)                                       (10)

Published: eqs. (3)-(13), with the corrections that `perspective` names. Checked: the gain. With xi = 0.99, omega = 7 and
lambda = 1 the example of section 4.1 settles to 5 % in 0.56 s, not in the 1 s of the text, which takes lambda = 2.04; that
the text also calls its tuning equal to 30 in Karagiannis & Astolfi's observer, 0.61 s, speaks for lambda = 1.
Ours: the discrete form, the fade where d vanishes, and sliding mode's gains (the paper only names it).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.estimators.ranging.advance import advance
from landing_sim.estimators.ranging.contract import Motion, State, arrive, begin, coast
from landing_sim.estimators.ranging.gains import HighGain, SuperTwisting
from landing_sim.estimators.ranging.perspective import drift, pulled_back
from landing_sim.jit import kernel
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class Gibert:
    """contract.RangeObserver: eq. (10), integrated.

    output : 1 or 2, the image coordinate whose derivative carries the range (remark 1)
    floor : [m/s] below |d| = floor the correction fades and the flag says so; the published form is that above
    limit : largest share of the range that one step may correct
    longest : [s] integration step
    """

    kappa: HighGain | SuperTwisting = field(default_factory=HighGain)
    output: int = 1
    floor: float = 0.05
    limit: float = math.inf
    longest: float = 1e-3

    def start(self, y: Array, range_guess: float) -> State:
        return begin(y, range_guess)

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        if not np.isfinite(y).all():
            return coast(state, motion)
        gains = _gains(self.kappa)

        def rates(x: Array, y1: float, y2: float, A: Array, B: Array) -> Array:
            return _rates(x, y1, y2, A, B, self.output, gains, self.floor)

        x = advance(rates, state.x, state.y, y, motion, dt, self.longest)
        return _arrive(self, state, x, y, motion)

    def estimate(self, state: State) -> Array:
        return state.x


@dataclass(frozen=True, slots=True)
class GibertDiscrete:
    """contract.RangeObserver: the same in exact discrete form, for any step that the poles allow.

        x- = R x_hat + t,   e = y - C(x-),   x_hat = x- + [dPsi/dx(x-)]^-1 (l1 e1, l2 e1, l3 e2)

    with the gains of `HighGain.discrete`: no bias from sampling, the poles where the continuous form has them.
    """

    kappa: HighGain = field(default_factory=HighGain)
    output: int = 1
    floor: float = 0.05
    limit: float = math.inf

    def start(self, y: Array, range_guess: float) -> State:
        return begin(y, range_guess)

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        if not np.isfinite(y).all():
            return coast(state, motion)
        x = motion.R @ state.x + motion.t
        if x[2] > 0.0:
            e1, e2 = y[0] - x[0] / x[2], y[1] - x[1] / x[2]
            own, other = (e1, e2) if self.output == 1 else (e2, e1)
            l1, l2, l3 = self.kappa.discrete(dt)
            x = x + pulled_back(x, motion.A, motion.B, self.output, l1 * own, l2 * own, l3 * other, self.floor)
        return _arrive(self, state, x, y, motion)

    def estimate(self, state: State) -> Array:
        return state.x


def _arrive(observer: Gibert | GibertDiscrete, state: State, x: Array, y: Array, motion: Motion) -> State:
    _, _, _, d1, d2 = drift(float(y[0]), float(y[1]), motion.A, motion.B)
    d = d1 if observer.output == 1 else d2
    # a sign that changed between two samples was a passage, however large |d| is on both sides
    before = state.d1 if observer.output == 1 else state.d2
    seen = abs(d) >= observer.floor and not d * before < 0.0
    return arrive(state, x, y, motion, state.inner, (d1, d2), seen, observer.limit)


def _gains(kappa: HighGain | SuperTwisting) -> tuple[float, float, float, float, float, float]:
    """Linear gains of y_output, its derivative and the other output; sliding gains of the first two; layer."""
    if isinstance(kappa, SuperTwisting):
        return 0.0, 0.0, kappa.alpha, 1.5 * math.sqrt(kappa.L), 1.1 * kappa.L, kappa.layer
    return (*kappa.continuous(), 0.0, 0.0, 1.0)


@kernel
def _rates(
    x: Array,
    y1: float,
    y2: float,
    A: Array,
    B: Array,
    output: int,
    gains: tuple[float, float, float, float, float, float],
    floor: float,
) -> Array:
    k1, k2, k3, s1, s2, layer = gains
    e1, e2 = y1 - x[0] / x[2], y2 - x[1] / x[2]
    own, other = (e1, e2) if output == 1 else (e2, e1)
    sign = min(1.0, max(-1.0, own / layer))
    first = k1 * own + s1 * math.sqrt(abs(own)) * sign
    out = pulled_back(x, A, B, output, first, k2 * own + s2 * sign, k3 * other, floor)
    for i in range(3):
        out[i] += A[i, 0] * x[0] + A[i, 1] * x[1] + A[i, 2] * x[2] + B[i]
    return out
