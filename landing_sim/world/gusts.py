"""Discrete gusts of one-minus-cosine shape: met at a place, flown through with the air.

Shapes     "pulse": U/2 (1 - cos(pi s / H)) for 0 <= s <= 2 H, then nothing: 14 CFR 25.341(a)(2), CS 25.341(a)(2).
           "ramp":  U/2 (1 - cos(pi s / H)) for 0 <= s <= H, then U for good: MIL-F-8785C, section 3.7.1.3.
           s is the distance flown through the air since the gust was met, H the gust gradient distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

Shape = Literal["pulse", "ramp"]


def one_minus_cosine(s: float, gradient: float, shape: Shape) -> float:
    """The gust as a share of its full velocity after `s` [m], for the gradient distance `gradient` [m]."""
    if s <= 0.0:
        return 0.0
    if shape == "ramp" and s >= gradient:
        return 1.0
    if s >= 2.0 * gradient:
        return 0.0
    return 0.5 * (1.0 - math.cos(math.pi * s / gradient))


@dataclass(frozen=True, slots=True)
class DiscreteGust:
    """A gust met where x first passes at_x [m]; who starts beyond it meets it at once.

    headwind (on the nose), lateral (towards +y), vertical (updraught): its full velocity [m/s]; gradient [m] as above.
    """

    at_x: float
    headwind: float = 0.0
    lateral: float = 0.0
    vertical: float = 0.0
    gradient: float = 100.0
    shape: Shape = "pulse"

    def __post_init__(self) -> None:
        values = (self.at_x, self.headwind, self.lateral, self.vertical, self.gradient)
        if not all(math.isfinite(value) for value in values):
            raise ValueError(f"discrete gust: every value must be a finite number, got {values}")
        if self.gradient <= 0.0:
            raise ValueError(f"discrete gust: the gradient distance must be > 0 m, not {self.gradient}")
        if self.shape not in get_args(Shape):
            raise ValueError(f"discrete gust: shape must be one of {get_args(Shape)}, not {self.shape!r}")


class MetDiscreteGust:
    """A DiscreteGust that remembers how far into it the aircraft is."""

    __slots__ = ("_gust", "_s", "_t")

    def __init__(self, gust: DiscreteGust) -> None:
        self._gust = gust
        self._t = math.nan  # [s] last asked, once met
        self._s = 0.0  # [m] into it

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        """Raises ValueError when time runs backwards after the gust was met."""
        gust = self._gust
        if math.isnan(self._t):
            if x <= gust.at_x:
                return 0.0, 0.0, 0.0
        elif t < self._t:
            raise ValueError(f"discrete gust: time went back from {self._t} s to {t} s; make a new Wind for a new run")
        else:
            self._s += airspeed * (t - self._t)
        self._t = t
        share = one_minus_cosine(self._s, gust.gradient, gust.shape)
        return -gust.headwind * share, gust.lateral * share, -gust.vertical * share
