"""A sonar looking along the body's down axis: the nearest surface within its beam."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings
from landing_sim.signals import CameraTruth, Sample, Truth


@dataclass(frozen=True, slots=True)
class SonarConfig:
    """[m] and s. Nothing is said beyond `high`; what is nearer than `low` reads `low`.

    Source     Brockers et al. 2012, section 4: MaxSonar EZ1, 2.5 cm resolution, 20 Hz, 0.12-6.45 m. Beam and noise: ours.
    """

    period: float = 0.05
    quantum: float = 0.025
    low: float = 0.12
    high: float = 6.45
    beam: float = math.radians(10.0)  # half angle of the cone
    noise: float = 0.005  # 1 sigma, before it is rounded
    loss: float = 0.0  # share of readings without an echo
    down: float = 0.05  # [m] of the sonar below the cg
    name: str = "sonar"

    def __post_init__(self) -> None:
        check_settings(self.name, self.period, 0.0, noise=self.noise, quantum=self.quantum, beam=self.beam)
        if not 0.0 <= self.low < self.high:
            raise ValueError(f"{self.name}: needs 0 <= low < high, not {self.low} and {self.high} m")
        if not 0.0 <= self.loss <= 1.0:
            raise ValueError(f"{self.name}: loss is a share between 0 and 1, not {self.loss}")


class Sonar:
    """interfaces.Sensor: the range [m], a float, to the nearest of the points that the axis and eight rays on the rim of
    the cone meet. `height(x, y)` [m] is the surface's height above z = 0.
    """

    channels = 1

    def __init__(self, config: SonarConfig, height: Callable[[float, float], float], noise: NoiseStream) -> None:
        self.name, self.period = config.name, config.period
        self._config, self._height, self._noise = config, height, noise
        s, c = math.sin(config.beam), math.cos(config.beam)
        rim = [(s * math.cos(a), s * math.sin(a), c) for a in np.arange(8) * 0.25 * math.pi]
        self._rays = np.array([(0.0, 0.0, 1.0), *rim])

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        c = self._config
        draws = self._noise.normal(2)
        p = truth.p_RB + c.down * truth.R_RB[:, 2]
        reach = min((self._range(p, d) for d in self._rays @ truth.R_RB.T), default=math.inf)
        lost = 0.5 * math.erfc(-draws[1] / math.sqrt(2.0)) < c.loss
        if reach > c.high or lost:
            return None
        heard = reach + c.noise * float(draws[0])
        rounded = c.quantum * round(heard / c.quantum) if c.quantum > 0.0 else heard
        return Sample(self.name, truth.t, truth.t, max(rounded, c.low))

    def _range(self, p: np.ndarray, d: np.ndarray) -> float:
        """[m] from p along the unit vector d to the surface, its tops and sides."""
        if d[2] < 0.1:
            return math.inf

        def beneath(reach: float) -> float:
            return self._height(float(p[0] + reach * d[0]), float(p[1] + reach * d[1]))

        level, before = beneath(0.0), 0.0
        for _ in range(3):
            reach = max(0.0, float((-p[2] - level) / d[2]))
            found = beneath(reach)
            if abs(found - level) < 1e-6:
                return reach
            if found > level:
                return self._side(p, d, before, reach)
            level, before = found, reach  # past an edge: on to what lies lower
        return reach

    def _side(self, p: np.ndarray, d: np.ndarray, outside: float, inside: float) -> float:
        """[m] where the ray enters what it is inside of at `inside`."""
        for _ in range(12):
            middle = 0.5 * (outside + inside)
            x, y, z = (float(v) for v in p + middle * d)
            outside, inside = (outside, middle) if self._height(x, y) > -z else (middle, inside)
        return inside
