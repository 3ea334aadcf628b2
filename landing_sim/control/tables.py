"""Short tables, looked up in plain Python: a few of them per cycle cost less than one numpy call."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np


def interpolate(x: float, at: Sequence[float], values: Sequence[float]) -> float:
    """Linear in an increasing table, constant outside it."""
    if x <= at[0]:
        return values[0]
    if x >= at[-1]:
        return values[-1]
    i = bisect_right(at, x) - 1
    return values[i] + (values[i + 1] - values[i]) * (x - at[i]) / (at[i + 1] - at[i])


@dataclass(frozen=True, slots=True)
class Schedule:
    """A table of vectors over airspeed [m/s], linear in between, constant outside."""

    at: tuple[float, ...]
    rows: tuple[np.ndarray, ...]
    steps: tuple[np.ndarray, ...] = field(init=False)  # from each row to the next

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", tuple(b - a for a, b in pairwise(self.rows)))

    def __call__(self, airspeed: float) -> list[float]:
        if airspeed <= self.at[0]:
            return self.rows[0].tolist()
        if airspeed >= self.at[-1]:
            return self.rows[-1].tolist()
        i = bisect_right(self.at, airspeed) - 1
        part = (airspeed - self.at[i]) / (self.at[i + 1] - self.at[i])
        return (self.rows[i] + part * self.steps[i]).tolist()
