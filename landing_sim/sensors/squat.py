"""The weight-on-wheels switch."""

from __future__ import annotations

from landing_sim.signals import CameraTruth, Sample, Truth


class SquatSwitch:
    """1.0 while a main wheel carries weight, else 0.0 (interfaces.Sensor)."""

    name = "squat"
    channels = 1

    def __init__(self, period: float) -> None:
        self.period = period

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample:
        return Sample(self.name, truth.t, truth.t, float(truth.on_ground[0] or truth.on_ground[1]))
