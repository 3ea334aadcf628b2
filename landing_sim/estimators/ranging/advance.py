"""Integration of observers that are published as differential equations, between samples of what they measure."""

from __future__ import annotations

import math
from collections.abc import Callable

from landing_sim.estimators.ranging.contract import Motion
from landing_sim.types import Array

Rates = Callable[[Array, float, float, Array, Array], Array]
"""(s, y1, y2, A, B) -> ds/dt."""


def advance(rates: Rates, s: Array, y_before: Array, y: Array, motion: Motion, dt: float, longest: float) -> Array:
    """s after dt [s], by the midpoint rule in steps of at most `longest` [s].

    y runs straight from its last value to the new one. Held at a sample instead, it would be dt/2 late on average, which
    biases the range: by 0.4 % at 10 ms, 1.4 % at 33 ms in the example of eqs. (14)-(16).
    """
    n = max(1, math.ceil(dt / longest - 1e-9))
    h, A, B = dt / n, motion.A, motion.B
    a1, a2 = float(y_before[0]), float(y_before[1])
    slope1, slope2 = (float(y[0]) - a1) / n, (float(y[1]) - a2) / n
    for i in range(n):
        k = rates(s, a1 + slope1 * i, a2 + slope2 * i, A, B)
        s = s + h * rates(s + 0.5 * h * k, a1 + slope1 * (i + 0.5), a2 + slope2 * (i + 0.5), A, B)
    return s
