"""The lunar landing on optic flow: names the concrete parts, joins both sides, and decides when the descent is over."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from landing_sim import loop, paths
from landing_sim.control.descent import DescentController, DescentGuidance, DescentSettings
from landing_sim.estimators.optic_flow.contract import FlowObserver
from landing_sim.estimators.optic_flow.dynamics import Lander
from landing_sim.estimators.optic_flow.estimator import ContactFrontEnd, FlowEstimator, FlowFrontEnd
from landing_sim.estimators.optic_flow.kalman import FlowEkf, FlowUkf, Spreads
from landing_sim.estimators.optic_flow.lpv_observer import SPARSE, LpvObserver
from landing_sim.estimators.optic_flow.reference import Reference, reference
from landing_sim.interfaces import FrontEnd, NoiseStream
from landing_sim.missions.flight import Outcome, Parts, flown
from landing_sim.noise import Noise
from landing_sim.plants.lander import LanderPlant, Start
from landing_sim.sections.lunar import Deviation, LunarScenario
from landing_sim.sensors.optic_flow import FootSwitch, MotionSensor, MotionSensorConfig
from landing_sim.sensors.optic_flow_edges import EdgeConfig
from landing_sim.signals import Command, Step
from landing_sim.signals import Estimate as Believed
from landing_sim.signals import Reference as Wanted
from landing_sim.types import Array
from landing_sim.world.terrain import Terrain, TerrainConfig

UPSET = math.radians(85.0)  # beyond this it is falling over, not flying
SETTLED = 2.0  # [s] after the first touch
RANGE = 1250.0  # [m] from the target to which the terrain is made


class NoAir:
    """interfaces.World of a body without atmosphere."""

    def wind(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0


@dataclass(frozen=True, slots=True)
class OpenLoop:
    """interfaces.Controller of the paper's simulation: the reference's inputs, whatever is estimated."""

    plan: Reference
    full_thrust: float
    full_attitude: float

    def init(self) -> None:
        return None

    def step(self, memory: None, estimate: Believed, wanted: Wanted) -> tuple[None, Command]:
        if wanted.mode == "stopped":
            return None, Command()
        thrust, attitude = self.plan.inputs(estimate.t)
        return None, Command(elevator=attitude / self.full_attitude, throttle=thrust / self.full_thrust)


class Mission:
    """One descent, ready to be flown once."""

    def __init__(self, scenario: LunarScenario, parts: Parts[LanderPlant, NoAir], terrain: Terrain) -> None:
        self.parts, self.terrain = parts, terrain
        self._limit = scenario.time.limit_s
        self._outcome: Outcome | None = None

    def steps(self) -> Iterator[Step]:
        """Fly to the end, a Step a control cycle. The last Step is the one that ended it."""
        self._outcome = yield from flown(self.parts, self.parts.plant.trimmed, self._ended)

    def outcome(self) -> Outcome:
        """Raises RuntimeError before the descent is over."""
        if self._outcome is None:
            raise RuntimeError("the descent is not over: exhaust steps() first")
        return self._outcome

    def _ended(self, step: Step) -> str:
        now, touchdown = step.truth, self.parts.plant.touchdown
        if abs(now.euler[0]) > UPSET or abs(now.euler[1]) > UPSET or abs(float(now.p_RB[0])) > RANGE:
            return "crash"
        if touchdown is not None and now.t >= touchdown.t + SETTLED:
            return "stopped"
        return "time" if now.t >= self._limit else ""


def build(
    scenario: LunarScenario, seed: int, run: int = 0, noise: Callable[[str], NoiseStream] | None = None
) -> Mission:
    """Everything one descent needs. `run` selects independent random streams under the same seed; `noise`, where given,
    hands out the streams instead.
    """
    streams = noise or (lambda name: Noise(seed, name, run))
    plan, folder = reference(), paths.data_folder("aircraft") / "lander"
    clock = loop.Clock.of(scenario.time.step_s, scenario.time.cycle_s, scenario.time.step_s)
    g = scenario.terrain
    sun = math.radians(g.sun_elevation_deg), math.radians(g.sun_azimuth_deg)
    terrain = Terrain(TerrainConfig(*sun, math.radians(g.slope_deg), g.crater_m, g.flat), streams("terrain"))
    plant = LanderPlant(folder, _start(plan, scenario.initial), terrain.height, scenario.time.step_s)
    control = scenario.control
    settings = DescentSettings(
        flow_x=control.flow_bandwidth_radps,
        flow_z=control.flow_bandwidth_radps,
        attitude=control.attitude_bandwidth_radps,
        patience=control.patience_s,
        rate=control.rate,
        gravity=plan.lander.gravity,
        inertia=1.0 / plan.lander.agility,
    )
    mass, first = float(plan.at(0.0)[7]), plan.state(0.0) + deviation(scenario.believed)
    eyes, front_ends = _eyes(scenario, terrain, streams)
    full = settings.full_thrust, settings.full_attitude
    return Mission(
        scenario,
        Parts(
            clock,
            plant,
            NoAir(),
            (FootSwitch(scenario.time.cycle_s), *eyes),
            {"squat": ContactFrontEnd(), **front_ends},
            FlowEstimator(_observer(scenario, plan), plan.lander, first, mass, *full),
            DescentGuidance(plan.at, plan.duration, settings),
            OpenLoop(plan, *full) if control.loop == "open" else DescentController(settings, mass, plan.lander.burn),
        ),
        terrain,
    )  # fmt: skip


def deviation(d: Deviation) -> Array:
    """(5,) of X, SI."""
    return np.array([d.height_m, *np.radians([d.pitch_rate_dps, d.flow_x_dps, d.flow_z_dps, d.pitch_deg])], dtype=float)


def _start(plan: Reference, off: Deviation) -> Start:
    h, q, wx, wz, theta = (plan.state(0.0) + deviation(off)).tolist()
    thrust, attitude = plan.inputs(0.0)
    full = DescentSettings()
    x = -float(plan.table[-1, 8])
    return Start(
        x, h, wx * h, wz * h, theta, q, float(plan.at(0.0)[7]), thrust / full.full_thrust, attitude / full.full_attitude
    )


def _observer(scenario: LunarScenario, plan: Reference) -> FlowObserver:
    lander: Lander = plan.lander
    if scenario.filter.kind == "lpv":
        return LpvObserver(plan, SPARSE, Spreads().first)
    return FlowEkf(lander) if scenario.filter.kind == "ekf" else FlowUkf(lander)


def _eyes(
    scenario: LunarScenario, terrain: Terrain, streams: Callable[[str], NoiseStream]
) -> tuple[list[MotionSensor], dict[str, FrontEnd]]:
    """The sensors where they are, and their front ends where they are believed to be."""
    s, f = scenario.sensors, scenario.filter
    eyes: list[MotionSensor] = []
    front_ends: dict[str, FrontEnd] = {}
    for i, angle in enumerate(s.angles_deg):
        name = f"flow_{i + 1}"
        config = MotionSensorConfig(
            scenario.time.cycle_s,
            math.radians(angle + s.mounting_error_deg),
            acceptance=math.radians(s.acceptance_deg),
            noise=s.noise_dn,
            edges=EdgeConfig(spacing=math.radians(s.spacing_deg)),
        )
        eyes.append(MotionSensor(name, config, terrain, streams(name)))
        front_ends[name] = FlowFrontEnd(name, math.radians(angle), math.radians(f.floor_dps), f.share)
    return eyes, front_ends
