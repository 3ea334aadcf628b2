"""A fault that begins where the vehicle is, not at a time known beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from landing_sim.interfaces import Sensor
from landing_sim.noise import NoiseStream
from landing_sim.sensors.faults import Fault, Faulty
from landing_sim.signals import CameraTruth, Sample, Truth

NOT_YET = 1e12  # [s] a start that no flight reaches


@dataclass(frozen=True, slots=True)
class Onset:
    """Begins where the cg first is lower than `below` [m] above the threshold or beyond `beyond` [m] along the runway.

    lasts : [s] from then
    """

    below: float = -math.inf
    beyond: float = math.inf
    lasts: float = math.inf

    def reached(self, truth: Truth) -> bool:
        """Whether it begins now at the latest."""
        return float(-truth.p_RB[2]) < self.below or float(truth.p_RB[0]) > self.beyond


class Struck(Faulty):
    """interfaces.Sensor: `sensor` with a fault whose own times do not count: it begins once, at its onset.

    Raises ValueError as Faulty does.
    """

    def __init__(self, sensor: Sensor, fault: Fault, onset: Onset, noise: NoiseStream) -> None:
        super().__init__(sensor, replace(fault, start=NOT_YET, end=math.inf), noise)
        self.onset = onset

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        if self.fault.start == NOT_YET and self.onset.reached(truth):
            self.fault = replace(self.fault, start=truth.t, end=truth.t + self.onset.lasts)
        return super().sense(truth, camera)
