"""What a pilot makes of the view: the state of the aircraft, misjudged a little and slowly.

For an approach flown by hand. The errors wander (first-order Gauss-Markov) and shrink with the distance, as judgements
by angle do. Instruments (airspeed, attitude) are read well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.signals import CameraTruth, Sample, Truth
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class PilotConfig:
    """How well a pilot judges. 1 sigma values."""

    period: float = 0.06  # [s]
    lateral: float = 0.008  # [rad] of the offset seen from the aiming point
    vertical: float = 0.006  # [rad] of the glide path
    attitude: float = math.radians(0.5)
    rate: float = math.radians(0.3)  # [rad/s]
    speed: float = 0.7  # [m/s]
    time_constant: float = 6.0  # [s] over which a misjudgement lasts
    aim: float = 300.0  # [m] beyond the threshold, where errors by angle vanish
    closest: float = 60.0  # [m] distance below which they shrink no further


class PilotEye:
    """interfaces.Sensor "pilot": (12,) u v w p q r phi theta psi x y H as perceived."""

    name = "pilot"

    def __init__(self, config: PilotConfig, noise: NoiseStream) -> None:
        self.period = config.period
        self._config, self._noise = config, noise
        self._error = noise.normal(12)
        c = config
        self._scale = np.array([c.speed] * 3 + [c.rate] * 3 + [c.attitude] * 3 + [0.02, c.lateral, c.vertical])
        self._keep = math.exp(-config.period / config.time_constant)

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample:
        a = self._keep
        self._error = a * self._error + math.sqrt(1.0 - a * a) * self._noise.normal(12)
        distance = max(self._config.aim - float(truth.p_RB[0]), self._config.closest)
        error = self._error * self._scale
        error[9:] *= distance
        uvw = truth.R_RB.T @ truth.v_RB_R
        p = truth.p_RB
        state: Array = np.concatenate([uvw, truth.w_RB_B, truth.euler, [p[0], p[1], -p[2]]])
        return Sample(self.name, truth.t, truth.t, state + error)
