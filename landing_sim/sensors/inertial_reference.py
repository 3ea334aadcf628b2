"""The inertial reference unit of a transport: attitude, rates and velocity against the local level and true north."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.earth import level_at
from landing_sim.geometry.so3 import to_euler
from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings, draw_bias
from landing_sim.signals import CameraTruth, InertialReading, Sample, Truth


@dataclass(frozen=True, slots=True)
class InertialReferenceConfig:
    """Errors of the unit; rad, m/s, s. Biases are constant over a run: on an approach of two minutes they are."""

    period: float = 0.04
    attitude_bias_sigma: float = math.radians(0.05)  # of roll and of pitch
    heading_bias_sigma: float = math.radians(0.3)
    velocity_bias_sigma: float = 0.1  # of each axis
    velocity_bias: tuple[float, float, float] | None = (
        None  # forward, right, down along the track: instead of a drawn one
    )
    attitude_noise: float = math.radians(0.01)
    rate_noise: float = math.radians(0.02)
    velocity_noise: float = 0.02
    latency: float = 0.0
    name: str = "inertial"

    def __post_init__(self) -> None:
        check_settings(
            self.name,
            self.period,
            self.latency,
            attitude_bias_sigma=self.attitude_bias_sigma,
            heading_bias_sigma=self.heading_bias_sigma,
            velocity_bias_sigma=self.velocity_bias_sigma,
            attitude_noise=self.attitude_noise,
            rate_noise=self.rate_noise,
            velocity_noise=self.velocity_noise,
        )


class InertialReference:
    """interfaces.Sensor: an InertialReading each period.

    The level at the aircraft is not the runway's: it turns by distance over the Earth's radius, 0.045 degrees in 5 km.
    `attitude_bias` (3,) [rad] and `velocity_bias` (3,) [m/s], along the runway's axes, are this run's.
    """

    channels = 0  # a record, not numbers that a fault could scale or shift

    def __init__(self, config: InertialReferenceConfig, runway_heading: float, noise: NoiseStream) -> None:
        """runway_heading [rad]: true course of frame R's x axis."""
        self.name = config.name
        self.period = config.period
        sigma = np.array([config.attitude_bias_sigma, config.attitude_bias_sigma, config.heading_bias_sigma])
        self.attitude_bias = sigma * noise.normal(3)
        self.velocity_bias = draw_bias(config.name, config.velocity_bias, config.velocity_bias_sigma, 3, noise)
        self._config, self._noise = config, noise
        c, s = math.cos(runway_heading), math.sin(runway_heading)
        self._R_NR = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        self._t, self._p_R = math.nan, np.zeros(3)

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        config = self._config
        R_NR = self._R_NR @ level_at(truth.p_RB)
        draws = self._noise.normal(9)
        euler = to_euler(R_NR @ truth.R_RB) + self.attitude_bias + config.attitude_noise * draws[:3]
        rates = truth.w_RB_B + config.rate_noise * draws[3:6]
        bias = self._R_NR @ self.velocity_bias
        v_N = R_NR @ truth.v_RB_R + bias + config.velocity_noise * draws[6:]
        moved = np.zeros(3)
        if not math.isnan(self._t):
            moved = R_NR @ (truth.p_RB - self._p_R) + bias * (truth.t - self._t)
        self._t, self._p_R = truth.t, truth.p_RB
        return Sample(self.name, truth.t, truth.t + config.latency, InertialReading(euler, rates, v_N, moved))
