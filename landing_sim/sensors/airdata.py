"""Air data: the true airspeed that a pitot-static system and its computer report, and the vanes for its direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings, draw_bias
from landing_sim.signals import CameraTruth, Sample, Truth


@dataclass(frozen=True, slots=True)
class AirspeedConfig:
    """An airspeed sensor; m/s and s."""

    period: float = 0.06
    noise: float = 0.5  # 1 sigma of white noise, per sample
    bias_sigma: float = 0.0  # constant over a run
    bias: float | None = None  # this bias instead of a drawn one
    lag: float = 0.0  # time constant of the pneumatic lines
    latency: float = 0.0
    name: str = "airspeed"

    def __post_init__(self) -> None:
        check_settings(self.name, self.period, self.latency, noise=self.noise, bias_sigma=self.bias_sigma, lag=self.lag)


class Airspeed:
    """interfaces.Sensor: true airspeed, lagged, + bias + white noise, float [m/s], never below 0.

    The lag is exact for an airspeed that varies linearly between samples. `bias` [m/s] is this run's.
    """

    channels = 1

    def __init__(self, config: AirspeedConfig, noise: NoiseStream) -> None:
        self.name = config.name
        self.period = config.period
        self.bias = float(draw_bias(config.name, config.bias, config.bias_sigma, 1, noise)[0])
        self._config = config
        self._noise = noise
        self._t = math.nan
        self._input = 0.0
        self._lagged = 0.0

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        config = self._config
        speed = self._lag(truth.t, truth.airspeed) if config.lag > 0.0 else truth.airspeed
        reading = speed + self.bias + config.noise * float(self._noise.normal(1)[0])
        return Sample(self.name, truth.t, truth.t + config.latency, max(0.0, reading))

    def _lag(self, t: float, speed: float) -> float:
        """y' = (u - y) / lag from the last sample to t, u linear in between; settled at the first sample."""
        dt = t - self._t
        if math.isnan(dt):
            self._lagged = speed
        elif dt > 0.0:
            held = math.exp(-dt / self._config.lag)
            slope = (speed - self._input) / dt
            behind = slope * self._config.lag  # a ramp is followed this far behind
            self._lagged = speed - behind + held * (self._lagged - self._input + behind)
        self._t, self._input = t, speed
        return self._lagged


@dataclass(frozen=True, slots=True)
class FlowAnglesConfig:
    """Two vanes; rad and s."""

    period: float = 0.06
    noise: float = math.radians(0.2)  # 1 sigma of white noise, per sample and vane
    bias_sigma: float = math.radians(0.1)  # constant over a run
    latency: float = 0.0
    name: str = "flow_angles"

    def __post_init__(self) -> None:
        check_settings(self.name, self.period, self.latency, noise=self.noise, bias_sigma=self.bias_sigma)


class FlowAngles:
    """interfaces.Sensor: angle of attack and sideslip + bias + white noise, (2,) [rad]. `bias` (2,) is this run's."""

    channels = 2

    def __init__(self, config: FlowAnglesConfig, noise: NoiseStream) -> None:
        self.name = config.name
        self.period = config.period
        self.bias = draw_bias(config.name, None, config.bias_sigma, 2, noise)
        self._config = config
        self._noise = noise

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        config = self._config
        angles = np.array([truth.alpha, truth.beta]) + self.bias + config.noise * self._noise.normal(2)
        return Sample(self.name, truth.t, truth.t + config.latency, angles)
