"""Gusts that push a small vehicle about: moving air, given by the force it exerts through linear drag.

    F = c (v_air - v)

Source     the disturbance is ours: Brockers et al. 2012 names none, and in a room without any there is nothing to control.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from landing_sim.noise import NoiseStream
from landing_sim.world.first_order import FirstOrder, FirstOrderTurbulence


@dataclass(frozen=True, slots=True)
class DriftConfig:
    """force [N] rms along each level axis, on a vehicle at rest; the vertical one is `vertical` times that.

    drag [N/(m/s)] of the vehicle; time [s] in which a gust loses its memory; mean (3,) [m/s] of the air in R.
    """

    force: float = 0.23
    drag: float = 0.16
    vertical: float = 0.7
    time: float = 1.0
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.drag) and self.drag > 0.0):
            raise ValueError(f"drift: drag must be > 0 N/(m/s), not {self.drag}")
        if not all(math.isfinite(v) for v in self.mean):
            raise ValueError(f"drift: the mean must be finite numbers, not {self.mean}")


class Drift:
    """interfaces.World: mean plus first-order gusts, the same everywhere."""

    def __init__(self, config: DriftConfig, noise: NoiseStream) -> None:
        level = config.force / config.drag
        gust = FirstOrder(level, config.vertical * level, config.time, config.time)
        self._gust = FirstOrderTurbulence(gust, noise)
        self._mean = config.mean

    def wind(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        u, v, w = self._gust.velocity(t, x, y, height, airspeed)
        a, b, c = self._mean
        return a + u, b + v, c + w
