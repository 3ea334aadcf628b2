"""One landing on a runway from a scenario to a log and a verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.interfaces import NoiseStream
from landing_sim.missions.flight import Flight, finished, ready
from landing_sim.missions.runway_landing import build
from landing_sim.record import judge, log
from landing_sim.record.builder import LogBuilder
from landing_sim.record.overlay import BelievedCamera
from landing_sim.scenario import Scenario
from landing_sim.signals import Step
from landing_sim.vehicle import Vehicle

if TYPE_CHECKING:
    from landing_sim.record.replay import Scene


def fly(
    scenario: Scenario,
    vehicle: Vehicle,
    watch: Callable[[Step], None] | None = None,
    recording: Path | None = None,
    live: bool = False,
    noise: Callable[[str], NoiseStream] | None = None,
    other: log.FlightLog | None = None,
) -> Flight:
    """Fly it to its end: see `runner.fly`."""
    started = time.perf_counter()
    mission = ready(scenario.name, lambda: build(scenario, vehicle, scenario.seed, scenario.run, noise))
    listeners = [] if watch is None else [watch]
    recorder = None
    if recording is not None:
        from landing_sim.record.replay import Recorder

        recorder = Recorder(recording, scene(scenario, vehicle), scenario.record.frames_hz, live)
        listeners.append(recorder.add)
    builder, eyes = LogBuilder(), _looks(scenario)
    sights = None
    if eyes:
        from landing_sim.record.sights import Sights

        sights = Sights(eyes)
        listeners.append(sights.add)
    for step in mission.steps():
        builder.add(step)
        for listener in listeners:
            listener(step)
    runway = {"width_m": scenario.runway.width_m, "length_m": scenario.runway.length_m}
    flown = finished(builder, scenario, mission.outcome(), runway)
    if sights is not None:
        sights.into(flown)
    if recorder is not None:
        recorder.close(flown, other)
    return Flight(flown, judge.judge(flown, limits(scenario)), time.perf_counter() - started)


def _looks(scenario: Scenario) -> tuple[float, ...]:
    """[rad] below the body's forward axis, where the optic-flow sensors truly look."""
    flow = scenario.sensors.optic_flow
    return tuple(math.radians(angle + flow.mounting_error_deg) for angle in flow.angles_deg)


def scene(scenario: Scenario, vehicle: Vehicle) -> Scene:
    """What stands still in a recording. Predicted edges are drawn as the onboard side believes them."""
    from landing_sim.record.replay import Scene

    camera, runway, believed = scenario.camera, scenario.runway, scenario.filter.believed_width_m
    slope = math.atan(runway.slope_percent / 100.0)
    start = scenario.initial
    return Scene(
        camera=BelievedCamera(
            Intrinsics.centred(camera.width_px, camera.height_px, camera.focal_px * scenario.believed.focal_scale),
            np.array(vehicle.camera.p_BC_m),
            runway.width_m if believed is None else believed,
            runway.length_m,
            slope,
        ),
        width=runway.width_m,
        length=runway.length_m,
        slope=slope,
        span=vehicle.size.span_m,
        fuselage=vehicle.size.length_m,
        markings=runway.markings,
        ranged=scenario.filter.kind == "observer",
        looks=_looks(scenario),
        start=(start.x_m, start.y_m, -start.height_m),
        title=f"{scenario.name}, seed {scenario.seed}",
    )


def limits(scenario: Scenario) -> tuple[judge.Limit, ...]:
    """The scenario's criteria as the judge takes them."""
    return tuple(judge.Limit(c.metric, c.low, c.high, c.source) for c in scenario.criteria)
