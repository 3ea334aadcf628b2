"""The strapped-down inertial unit of a multirotor: specific force, and the attitude that its firmware believes in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings, draw_bias
from landing_sim.signals import CameraTruth, Sample, StrapdownReading, Truth
from landing_sim.types import Array


class Autopilot(Protocol):
    """What the unit is part of."""

    def specific_force(self) -> Array:
        """(3,) [m/s^2] body axes, the mean since it was last asked for."""

    def believed_euler(self) -> Array:
        """(3,) [rad] phi, theta, psi as its attitude filter has them."""


@dataclass(frozen=True, slots=True)
class StrapdownConfig:
    """period [s]; of the accelerometers: white noise of a reading and a bias, constant over a run [m/s^2]."""

    period: float = 0.01
    noise: float = 0.05
    bias_sigma: float = 0.08
    bias: tuple[float, float, float] | None = None  # this bias instead of a drawn one
    name: str = "imu"

    def __post_init__(self) -> None:
        check_settings(self.name, self.period, 0.0, noise=self.noise, bias_sigma=self.bias_sigma)


class Strapdown:
    """interfaces.Sensor: a StrapdownReading each period. `bias` (3,) [m/s^2] is this run's.

    It reads `autopilot`; of the truth it takes the time only.
    """

    channels = 0  # a record, not numbers that a fault could scale or shift

    def __init__(self, config: StrapdownConfig, autopilot: Autopilot, noise: NoiseStream) -> None:
        self.name, self.period = config.name, config.period
        self.bias = draw_bias(config.name, config.bias, config.bias_sigma, 3, noise)
        self._config, self._autopilot, self._noise = config, autopilot, noise
        self._before = math.nan

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        """None at the first call: there was no time to average over."""
        force, euler = self._autopilot.specific_force(), self._autopilot.believed_euler()
        first, self._before = math.isnan(self._before), truth.t
        if first:
            return None
        reading = StrapdownReading(force + self.bias + self._config.noise * self._noise.normal(3), euler)
        return Sample(self.name, truth.t, truth.t, reading)
