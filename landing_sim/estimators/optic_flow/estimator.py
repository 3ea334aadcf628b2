"""A flow observer behind the loop's Estimator contract, and the front ends that bring it the sensors' words.

Here the paper's signs end: outside, pitch and its rate are nose up, as everywhere else in landing-sim.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from landing_sim.estimators.optic_flow.contract import FlowObserver, FlowState, Push
from landing_sim.estimators.optic_flow.dynamics import Lander, advance
from landing_sim.estimators.optic_flow.geometry import flow
from landing_sim.estimators.optic_flow.lpv import SCALE
from landing_sim.signals import Command, Estimate, Measurement, Sample
from landing_sim.types import Array

NAMES = ("H", "q", "flow_x", "flow_z", "theta")
"""[m, rad/s, rad/s, rad/s, rad] H above the ground that is seen; V_x/H, V_z/H with V_z > 0 upwards; q, theta nose up."""
_SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0])
STRIDE = 0.02  # [s] longest step of a prediction


REST = Push(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class FlowMemory:
    """What the observer knows, the mass left, what pushed last, and whether a foot has touched: nothing moves then."""

    state: FlowState
    mass: float  # [kg] by what was commanded
    push: Push = REST
    on_ground: bool = False


@dataclass(frozen=True, slots=True)
class FlowEstimator:
    """interfaces.Estimator: predicts with the commands, corrects with each flow when it comes.

    first : (5,) X believed at t = 0, paper's signs; mass [kg] then
    full_thrust, full_attitude : [N] of a command of 1
    """

    observer: FlowObserver
    lander: Lander
    first: Array
    mass: float
    full_thrust: float
    full_attitude: float

    def init(self, t: float) -> FlowMemory:
        return FlowMemory(self.observer.start(t, self.first), self.mass)

    def predict(self, memory: FlowMemory, command: Command, t: float) -> FlowMemory:
        dt = t - memory.state.t
        if dt < 1e-9 or memory.on_ground:
            return memory if dt < 1e-9 else replace(memory, state=replace(memory.state, t=t))
        thrust = self.full_thrust * min(1.0, max(0.0, command.throttle))
        attitude = self.full_attitude * min(1.0, max(-1.0, command.elevator))
        count = math.ceil(dt / STRIDE - 1e-9)
        state, mass, step = memory.state, memory.mass, dt / count
        for _ in range(count):
            mass -= step * self.lander.burn(thrust, attitude)
            push = Push(thrust / mass, self.lander.agility * attitude)
            state = self.observer.predict(state, push, step)
        return FlowMemory(replace(state, t=t), mass, push)

    def update(self, memory: FlowMemory, measurement: Measurement) -> FlowMemory:
        """Kinds "flow": z (2,) alpha, omega; R (2,) of which the second is omega's variance; "on_ground": z (1,).

        A flow is as old as half the edge's passage, some tenths of a second: what eq. (2) makes of it meanwhile is added.
        """
        if measurement.kind == "on_ground":
            return replace(memory, on_ground=memory.on_ground or bool(measurement.z[0] > 0.5))
        if measurement.kind != "flow":
            raise ValueError(f"a flow estimator knows no measurement {measurement.kind!r}")
        alpha, seen = measurement.z.tolist()
        state, push, age = memory.state, memory.push, memory.state.t - measurement.t_valid
        if age > 1e-6:
            then = advance(state.X, push.a, push.spin, self.lander.gravity, -age)
            seen += flow(state.X, alpha) - flow(then, alpha)
        return replace(memory, state=self.observer.look(state, alpha, seen, math.sqrt(measurement.R[1])))

    def read(self, memory: FlowMemory, t: float | None = None) -> Estimate:
        """The estimate now; no past is kept."""
        factor = _SIGNS / SCALE
        flags = {"on_ground": memory.on_ground, "believed": memory.state.used}
        cov = memory.state.P * np.outer(factor, factor)
        return Estimate(memory.state.t, NAMES, memory.state.X * _SIGNS, cov, True, flags)


@dataclass(slots=True)
class FlowFrontEnd:
    """interfaces.FrontEnd of one motion sensor, mounted at alpha [rad] as is believed.

    floor [rad/s], share : one sigma of a reading is floor + share |omega|; slower than `slowest` none is used
    """

    sensor: str
    alpha: float
    floor: float = math.radians(0.1)
    share: float = 0.05
    slowest: float = math.radians(0.5)

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        out = []
        for seen, t in zip(sample.data.flows, sample.data.times):
            if abs(seen) >= self.slowest:
                sigma = self.floor + self.share * abs(seen)
                z, R = np.array([self.alpha, seen]), np.array([0.0, sigma * sigma])
                out.append(Measurement("flow", t, sample.t_arrival, z, R))
        return tuple(out)


@dataclass(slots=True)
class ContactFrontEnd:
    """The switch in the feet: on the ground or not."""

    sensor: str = "squat"

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        z = np.array([float(sample.data)])
        return (Measurement("on_ground", sample.t_valid, sample.t_arrival, z, np.zeros(1)),)
