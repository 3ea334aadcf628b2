"""An approach flown by hand: a scripted pilot who sees the world, not the filter, and sees it imperfectly.

The analogue of the flight tests of Dickmanns & Schell 1992, section 7.2: the filter runs open loop while somebody else
flies. The pilot steers as the autopilot would, by what he thinks he sees; his misjudgements wander slowly and shrink as
the runway comes near.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from landing_sim.control.pointing import look_along
from landing_sim.interfaces import Controller, Guidance, Plant
from landing_sim.noise import NoiseStream
from landing_sim.signals import Command, Estimate, Reference

NAMES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz")
BY_EYE = {"y": 5.0, "H": 3.0, "u": 1.5, "psi": math.radians(0.8)}  # 1 sigma of the misjudgement at FAR
FAR, OVER_RUNWAY = 800.0, 0.08  # [m] where it is that; the share that remains over the runway
WANDER = 4.0  # [s] correlation time


class Eyes:
    """What the pilot thinks the state of the aircraft is."""

    def __init__(self, plant: Plant, noise: NoiseStream) -> None:
        self._plant, self._noise = plant, noise
        self._sigma = np.array([BY_EYE.get(name, 0.0) for name in NAMES])
        self._error = noise.normal(len(NAMES))
        self._t = 0.0

    def look(self, t: float) -> Estimate:
        """At time t [s], never earlier than the last look; the same look twice sees the same."""
        keep = math.exp(-(t - self._t) / WANDER)
        if t > self._t:
            self._error = keep * self._error + math.sqrt(1.0 - keep * keep) * self._noise.normal(len(NAMES))
            self._t = t
        truth = self._plant.truth()
        x, y, z = truth.p_RB
        true = np.concatenate([truth.R_RB.T @ truth.v_RB_R, truth.w_RB_B, truth.euler, [x, y, -z], truth.wind_R])
        nearness = min(max(-float(x) / FAR, OVER_RUNWAY), 1.5)
        on_ground = bool(truth.on_ground[0] or truth.on_ground[1])
        return Estimate(t, NAMES, true + nearness * self._sigma * self._error, None, True, {"on_ground": on_ground})


class PilotGuidance:
    """interfaces.Guidance: what the pilot wants to do. The filter's estimate is not used."""

    def __init__(self, guidance: Guidance, eyes: Eyes) -> None:
        self._guidance, self._eyes = guidance, eyes

    def init(self) -> Any:
        return self._guidance.init()

    def step(self, memory: Any, estimate: Estimate) -> tuple[Any, Reference]:
        return self._guidance.step(memory, self._eyes.look(estimate.t))


class PilotController:
    """interfaces.Controller: stick and rudder by eye; the filter points only its own camera.

    elevation, most : [rad] above the horizontal where the camera looks; how far the platform is asked to turn
    """

    def __init__(self, controller: Controller, eyes: Eyes, elevation: float, most: float) -> None:
        self._controller, self._eyes = controller, eyes
        self._elevation, self._most = elevation, most

    def init(self) -> Any:
        return self._controller.init()

    def step(self, memory: Any, estimate: Estimate, reference: Reference) -> tuple[Any, Command]:
        seen = self._eyes.look(estimate.t)
        memory, command = self._controller.step(memory, seen, reference)
        believed = estimate if estimate.valid else seen
        angles = look_along(believed["phi"], believed["theta"], believed["psi"], 0.0, self._elevation)
        pan, tilt = (min(max(angle, -self._most), self._most) for angle in angles)
        return memory, replace(command, pan=pan, tilt=tilt)
