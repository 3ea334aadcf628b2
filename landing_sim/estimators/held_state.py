"""An estimator that believes what it was last told: a person at the controls, or a reference flown on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from landing_sim.estimators import states
from landing_sim.signals import Command, Estimate, Measurement
from landing_sim.types import Array

NAMES = tuple(states.NAMES[i] for i in states.PAPER)


@dataclass(frozen=True, slots=True)
class Held:
    """The last state told, (12,)."""

    t: float
    state: Array
    valid: bool = False


class HeldState:
    """interfaces.Estimator for measurements of kind "state": the twelve states of the paper, no uncertainty claimed."""

    def init(self, t: float) -> Held:
        return Held(t, np.zeros(12))

    def predict(self, memory: Held, command: Command, t: float) -> Held:
        return replace(memory, t=t)

    def update(self, memory: Held, measurement: Measurement) -> Held:
        return Held(memory.t, measurement.z, True) if measurement.kind == "state" else memory

    def read(self, memory: Held, t: float | None = None) -> Estimate:
        return Estimate(memory.t, NAMES, memory.state, None, memory.valid)
