"""Visual localisation as a sensor of its own, for campaigns in which nobody looks at pixels.

What a map-based localisation says of the camera's image: the position at exposure, late, with white noise, a wrong scale
and an error that wanders as the map is a little bent. The figures are those of the rendered one (vision/slam), noise added.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.signals import CameraTruth, Sample, Truth


@dataclass(frozen=True, slots=True)
class PositionFixConfig:
    """[m] and s, 1 sigma of each axis."""

    period: float = 0.07
    latency: LatencyConfig = field(default_factory=LatencyConfig)
    noise: float = 0.004
    wander: float = 0.004
    wander_time: float = 10.0
    scale: float = 0.003  # share: the map is larger or smaller by this, constant over a run
    name: str = "position_fix"

    def __post_init__(self) -> None:
        check_settings(self.name, self.period, 0.0, noise=self.noise, wander=self.wander, scale=self.scale)
        if not self.wander_time > 0.0:
            raise ValueError(f"{self.name}: wander_time must be > 0 s, not {self.wander_time}")


class PositionFix:
    """interfaces.Sensor: p_RB (3,) [m] at the time of the image, as the map has it.

    noise : white and wandering; delays : arrivals. Separate streams, so that neither disturbs the other
    """

    channels = 3

    def __init__(self, config: PositionFixConfig, noise: NoiseStream, delays: NoiseStream) -> None:
        self.name, self.period = config.name, config.period
        self._config, self._noise = config, noise
        self._latency = Latency(config.latency, delays)
        drawn = noise.normal(4)
        self.scale = 1.0 + config.scale * float(drawn[0])
        self._wander = config.wander * drawn[1:]
        self._keep = math.exp(-config.period / config.wander_time)
        self._new = config.wander * math.sqrt(-math.expm1(-2.0 * config.period / config.wander_time))

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        drawn = self._noise.normal(6)
        self._wander = self._keep * self._wander + self._new * drawn[3:]
        z = np.asarray(self.scale * truth.p_RB + self._wander + self._config.noise * drawn[:3])
        return Sample(self.name, truth.t, self._latency.arrival(truth.t), z)
