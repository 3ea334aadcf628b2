"""Detection of a landing place as a sensor of its own, for campaigns in which nobody looks at pixels.

The place is told from the moment on that it has been seen whole in as many images as a detector's pool of way points needs;
what is told is off by a bias that is drawn once a flight. The figures are those of vision/landing_place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.signals import CameraTruth, Sample, Truth
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class PlaceFixConfig:
    """period [s] of images; cone [rad] half angle in which features are found; images: in the pool; bias [m] 1 sigma of
    x and y; bias_height [m].
    """

    period: float = 0.07
    latency: LatencyConfig = field(default_factory=LatencyConfig)
    cone: float = math.radians(55.0)
    images: int = 12
    bias: float = 0.01
    bias_height: float = 0.005
    name: str = "place_fix"

    def __post_init__(self) -> None:
        check_settings(self.name, self.period, 0.0, bias=self.bias, bias_height=self.bias_height)
        if not 0.0 < self.cone < 0.5 * math.pi or self.images < 1:
            raise ValueError(f"{self.name}: needs a cone of less than 90 deg and one image or more, not {self}")


class PlaceFix:
    """interfaces.Sensor: x, y, z (3,) [m] in R of the middle of the place whose top has these `corners` (4, 3) [m].

    noise : of the bias; delays : of arrivals
    """

    channels = 3

    def __init__(self, config: PlaceFixConfig, corners: Array, noise: NoiseStream, delays: NoiseStream) -> None:
        self.name, self.period, self._config, self._corners = config.name, config.period, config, corners
        self._latency = Latency(config.latency, delays)
        self._told = corners.mean(axis=0) + noise.normal(3) * [config.bias, config.bias, config.bias_height]
        self._seen = 0

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        arrival = self._latency.arrival(truth.t)
        rays = (self._corners - camera.p_RC) @ camera.R_CR.T
        inside = rays[:, 2] > math.cos(self._config.cone) * np.linalg.norm(rays, axis=1)
        self._seen += bool(inside.all())
        if self._seen < self._config.images:
            return None
        return Sample(self.name, truth.t, arrival, self._told.copy())
