"""Rate gyros strapped to the body axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings, draw_bias
from landing_sim.signals import CameraTruth, Sample, Truth


@dataclass(frozen=True, slots=True)
class GyroConfig:
    """A three-axis rate gyro; rad/s and s."""

    period: float = 0.06
    noise: float = math.radians(0.1)  # 1 sigma of white noise, per sample and axis
    bias_sigma: float = math.radians(0.1)  # constant over a run
    bias: tuple[float, float, float] | None = None  # this bias instead of a drawn one
    quantum: float = 0.0  # step of the output; 0 is continuous
    latency: float = 0.0
    name: str = "gyro"

    def __post_init__(self) -> None:
        check_settings(
            self.name, self.period, self.latency, noise=self.noise, bias_sigma=self.bias_sigma, quantum=self.quantum
        )


class Gyro:
    """interfaces.Sensor: p, q, r + bias + white noise, (3,) [rad/s] in body axes.

    `bias` (3,) [rad/s] is this run's, for the log and the judge.
    """

    channels = 3

    def __init__(self, config: GyroConfig, noise: NoiseStream) -> None:
        self.name = config.name
        self.period = config.period
        self.bias = draw_bias(config.name, config.bias, config.bias_sigma, 3, noise)
        self._config = config
        self._noise = noise

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        config = self._config
        rates = truth.w_RB_B + self.bias + config.noise * self._noise.normal(3)
        if config.quantum > 0.0:
            rates = config.quantum * np.rint(rates / config.quantum)
        return Sample(self.name, truth.t, truth.t + config.latency, rates)
