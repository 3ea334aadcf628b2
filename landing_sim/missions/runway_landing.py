"""The 1992 landing: names the concrete parts, joins the true and the onboard side, and decides when the flight is over."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from landing_sim import loop, paths
from landing_sim.control.landing_lq import LandingController
from landing_sim.interfaces import NoiseStream
from landing_sim.missions import onboard, truth
from landing_sim.missions.flight import Outcome, Parts, flown
from landing_sim.noise import Noise
from landing_sim.plants.aircraft import JsbsimPlant
from landing_sim.record.judge import CRASH_SINK
from landing_sim.scenario import Scenario
from landing_sim.signals import Step
from landing_sim.vehicle import Vehicle
from landing_sim.world.wind import Wind

STOPPED = 0.5  # [m/s] over the ground
GO_AROUND_ENDS = 300.0  # [m] beyond the threshold
UPSET_ROLL, UPSET_PITCH = 1.0, 0.8  # [rad] beyond these it is falling, not flying
UNDERGROUND = 30.0  # [m] below the threshold: where there is no ground

RunwayParts = Parts[JsbsimPlant, Wind]


class Mission:
    """One flight, ready to be flown once."""

    def __init__(self, scenario: Scenario, parts: RunwayParts) -> None:
        self.parts = parts
        self._limit = scenario.time.limit_s
        self._half_width, self._length = 0.5 * scenario.runway.width_m, scenario.runway.length_m
        self._rise = scenario.runway.slope_percent / 100.0
        self._outcome: Outcome | None = None

    def steps(self) -> Iterator[Step]:
        """Fly to the end, a Step a control cycle. The last Step is the one that ended it."""
        self._outcome = yield from flown(self.parts, self.parts.plant.trimmed, self._ended)

    def outcome(self) -> Outcome:
        """Raises RuntimeError before the flight is over."""
        if self._outcome is None:
            raise RuntimeError("the flight is not over: exhaust steps() first")
        return self._outcome

    def _ended(self, step: Step) -> str:
        now = step.truth
        x, y = float(now.p_RB[0]), float(now.p_RB[1])
        ground_speed = math.hypot(now.v_RB_R[0], now.v_RB_R[1])
        on_ground = bool(now.on_ground[0] or now.on_ground[1])
        touchdown = self.parts.plant.touchdown
        if touchdown is not None and touchdown.sink_rate > CRASH_SINK:
            return "crash"
        upset = abs(now.euler[0]) > UPSET_ROLL or abs(now.euler[1]) > UPSET_PITCH
        if upset or float(now.p_RB[2]) > UNDERGROUND + max(0.0, -self._rise * x):
            return "crash"
        if on_ground and (abs(y) > self._half_width or not 0.0 <= x <= self._length):
            return "off_runway"
        if on_ground and ground_speed < STOPPED:
            return "stopped"
        if step.reference.mode == "go_around" and x > GO_AROUND_ENDS and not on_ground:
            return "go_around"
        if now.t >= self._limit:
            return "time"
        return ""


def build(
    scenario: Scenario,
    vehicle: Vehicle,
    seed: int,
    run: int = 0,
    noise: Callable[[str], NoiseStream] | None = None,
) -> Mission:
    """Everything one flight needs. `run` selects independent random streams under the same seed.

    noise : the stream of a named component, instead of those of seed and run
    """
    if noise is None:

        def noise(name: str) -> Noise:
            return Noise(seed, name, run)

    vehicle = onboard.prepared(scenario, vehicle)
    clock = loop.Clock.of(scenario.time.step_s, scenario.time.cycle_s, scenario.control.delay_s)
    wind = truth.wind(scenario, noise("turbulence"))
    platform = truth.platform(scenario, vehicle, noise("operator"))
    plant = truth.plant(scenario, vehicle, platform, wind)
    camera = onboard.believed_camera(scenario, vehicle)
    settings = onboard.control_settings(scenario, vehicle)
    planned = onboard.planned_design(
        paths.aircraft_folder(scenario.aircraft.model), settings, vehicle.mass_kg, onboard.density_altitude(scenario)
    )
    return Mission(
        scenario,
        Parts(
            clock,
            plant,
            wind,
            truth.sensors(scenario, platform, noise),
            onboard.front_ends(scenario, camera),
            onboard.estimator(scenario, vehicle, camera, noise("believed")),
            onboard.guidance(scenario, vehicle),
            LandingController(planned, (platform.pan, platform.tilt), onboard.reported_wind(scenario)),
        ),
    )
