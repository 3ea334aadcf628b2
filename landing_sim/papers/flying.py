"""Flies what a paper's claims ask for, and takes the time of the onboard work while it does."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from landing_sim import scenario, vehicle
from landing_sim.interfaces import Controller, Estimator, FrontEnd, Guidance
from landing_sim.missions import runway_landing
from landing_sim.noise import Noise
from landing_sim.papers.flights import Flown, Run
from landing_sim.papers.pilot import Eyes, PilotController, PilotGuidance
from landing_sim.record.builder import LogBuilder
from landing_sim.record.log import FlightLog
from landing_sim.sensors.reference import (
    DifferentialGps,
    DifferentialGpsConfig,
    RadarAltimeter,
    RadarAltimeterConfig,
)
from landing_sim.signals import CameraSample, Command, Estimate, Frame, Measurement, Reference, Sample


def fly(run: Run) -> Flown:
    """One flight. A pilot's flight also carries the readings of a differential GPS and a radar altimeter.

    Raises ScenarioError if the run's changes do not fit its scenario.
    """
    wanted = scenario.load(run.scenario, [*run.changes, f"seed={run.seed}"])
    craft = vehicle.load(wanted.aircraft.model)
    mission = runway_landing.build(wanted, craft, run.seed)
    parts = mission.parts
    guidance: Guidance = parts.guidance
    controller: Controller = parts.controller
    references: tuple[DifferentialGps | RadarAltimeter, ...] = ()
    if run.pilot:
        eyes = Eyes(parts.plant, Noise(run.seed, "pilot"))
        camera = craft.control.camera
        guidance = PilotGuidance(guidance, eyes)
        most = math.radians(camera.max_deg)
        controller = PilotController(controller, eyes, math.radians(camera.elevation_deg), most)
        references = (
            DifferentialGps(DifferentialGpsConfig(), Noise(run.seed, "dgps")),
            RadarAltimeter(RadarAltimeterConfig(), Noise(run.seed, "radar_altimeter")),
        )
    watch = Stopwatch()
    timed: dict[str, Any] = {
        "front_ends": {name: TimedFrontEnd(part, watch) for name, part in parts.front_ends.items()},
        "estimator": TimedEstimator(parts.estimator, watch),
        "guidance": TimedPart(guidance, watch),
        "controller": TimedPart(controller, watch),
    }
    mission.parts = replace(parts, **timed)
    builder = LogBuilder()
    readings: dict[str, list[Any]] = {reference.name: [] for reference in references}
    onboard, estimator = [], []
    for k, step in enumerate(mission.steps()):
        builder.add(step)
        for reference in references:
            every = max(1, round(reference.period / wanted.time.cycle_s))
            sample = reference.sense(step.truth, step.camera) if k % every == 0 else None
            readings[reference.name].append(None if sample is None else sample.data)
        onboard.append(watch.onboard)
        estimator.append(watch.estimator)
        watch.reset()
    outcome = mission.outcome()
    log = builder.finish(
        scenario=scenario.dump(wanted),
        seed=run.seed,
        touchdown=outcome.touchdown,
        end=outcome.end,
        runway={"width_m": wanted.runway.width_m, "length_m": wanted.runway.length_m},
    )
    columns = dict(log.columns)
    for name, values in readings.items():
        columns |= _reference_columns(name, values)
    return Flown(FlightLog(columns, log.meta), 1e3 * float(np.median(onboard)), 1e3 * float(np.median(estimator)))


def _reference_columns(name: str, values: list[Any]) -> dict[str, np.ndarray]:
    if name == "dgps":
        rows = np.array([[math.nan] * 3 if v is None else v for v in values])
        return {"dgps_x_m": rows[:, 0], "dgps_y_m": rows[:, 1], "dgps_H_m": -rows[:, 2]}
    return {"radar_H_m": np.array([math.nan if v is None else v for v in values])}


class Stopwatch:
    """Seconds of onboard work since the last reset; drawing the world's pixels is not onboard work."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.onboard = self.estimator = self.drawing = 0.0


class TimedFrame:
    """signals.Frame that takes the time its pixels need."""

    def __init__(self, frame: Frame, watch: Stopwatch) -> None:
        self._frame, self._watch = frame, watch
        self.width, self.height = frame.width, frame.height

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        return self._drawn(lambda: self._frame.window(u0, v0, width, height))

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
        return self._drawn(lambda: self._frame.windows(corners, width, height, looked))

    def full(self) -> np.ndarray:
        return self._drawn(self._frame.full)

    def _drawn(self, draw: Callable[[], np.ndarray]) -> np.ndarray:
        start = time.perf_counter()
        pixels = draw()
        self._watch.drawing += time.perf_counter() - start
        return pixels


class TimedFrontEnd:
    """interfaces.FrontEnd."""

    def __init__(self, part: FrontEnd, watch: Stopwatch) -> None:
        self.sensor, self._part, self._watch = part.sensor, part, watch

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        watch = self._watch
        if isinstance(sample.data, CameraSample):
            sample = replace(sample, data=replace(sample.data, frame=TimedFrame(sample.data.frame, watch)))
        start, drawing, onboard = time.perf_counter(), watch.drawing, watch.onboard
        found = self._part.process(sample, estimate)
        # the estimate it asked for is in here already
        watch.onboard = onboard + time.perf_counter() - start - (watch.drawing - drawing)
        return found


class TimedEstimator:
    """interfaces.Estimator."""

    def __init__(self, part: Estimator, watch: Stopwatch) -> None:
        self._part, self._watch = part, watch

    def init(self, t: float) -> Any:
        return self._part.init(t)

    def predict(self, memory: Any, command: Command, t: float) -> Any:
        return self._timed(self._part.predict, memory, command, t)

    def update(self, memory: Any, measurement: Measurement) -> Any:
        return self._timed(self._part.update, memory, measurement)

    def read(self, memory: Any, t: float | None = None) -> Estimate:
        found: Estimate = self._timed(self._part.read, memory, t)
        return found

    def _timed(self, call: Callable[..., Any], *arguments: Any) -> Any:
        start = time.perf_counter()
        found = call(*arguments)
        spent = time.perf_counter() - start
        self._watch.onboard += spent
        self._watch.estimator += spent
        return found


class TimedPart:
    """interfaces.Guidance and interfaces.Controller."""

    def __init__(self, part: Guidance | Controller, watch: Stopwatch) -> None:
        self._part, self._watch = part, watch

    def init(self) -> Any:
        return self._part.init()

    def step(self, memory: Any, estimate: Estimate, *reference: Reference) -> Any:
        start = time.perf_counter()
        found = self._part.step(memory, estimate, *reference)
        self._watch.onboard += time.perf_counter() - start
        return found
