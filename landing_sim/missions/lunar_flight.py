"""One lunar descent from a scenario to a log and a verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.interfaces import NoiseStream
from landing_sim.missions.flight import Flight, finished, ready
from landing_sim.missions.lunar_landing import Mission, build
from landing_sim.record import judge, log
from landing_sim.record.builder import LogBuilder
from landing_sim.sections.lunar import LunarScenario
from landing_sim.sensors.optic_flow import FlowReading
from landing_sim.sensors.optic_flow_picture import picture
from landing_sim.signals import Step

if TYPE_CHECKING:
    from landing_sim.record.lunar_replay import LunarScene

PICTURE = (320, 240, 280.0)  # width, height, focal length [px] of a recording's camera
JUDGED_FROM = 5.0  # [s] errors before are the first guess's
ERRORS = {"H": (1.0, "m"), "q": (math.degrees(1.0), "deg/s"), "theta": (math.degrees(1.0), "deg")}
FLOWS = {"flow_x": (math.degrees(1.0), "deg/s"), "flow_z": (math.degrees(1.0), "deg/s")}


def fly(
    scenario: LunarScenario,
    watch: Callable[[Step], None] | None = None,
    recording: Path | None = None,
    live: bool = False,
    noise: Callable[[str], NoiseStream] | None = None,
    other: log.FlightLog | None = None,
) -> Flight:
    """Fly it to its end; `other` is not shown: a lunar recording has no place for a second flight.

    Raises ScenarioError where it cannot begin, ReplayError from the recording.
    """
    started = time.perf_counter()
    mission = ready(scenario.name, lambda: build(scenario, scenario.seed, scenario.run, noise))
    builder, readings = LogBuilder(), []
    recorder, due = None, 0.0
    camera = Intrinsics.centred(*PICTURE)
    if recording is not None:
        from landing_sim.record.lunar_replay import LunarRecorder

        recorder = LunarRecorder(recording, scene(scenario, mission), live)
    for step in mission.steps():
        builder.add(step)
        readings.append({s.sensor: s.data for s in step.samples if isinstance(s.data, FlowReading)})
        if watch is not None:
            watch(step)
        if recorder is not None and scenario.record.frames_hz > 0.0 and step.truth.t >= due - 1e-9:
            due = step.truth.t + 1.0 / scenario.record.frames_hz
            seen = picture(mission.terrain, camera, step.camera.p_RC, step.camera.R_CR)
            recorder.picture(step.truth.t, seen, step.camera.p_RC, step.camera.R_CR)
    flown = finished(builder, scenario, mission.outcome())
    _add_flows(flown, readings, len(scenario.sensors.angles_deg))
    if recorder is not None:
        recorder.close(flown)
    return Flight(flown, verdict(flown, scenario), time.perf_counter() - started)


def scene(scenario: LunarScenario, mission: Mission) -> LunarScene:
    """What stands still in a recording."""
    from landing_sim.record.lunar_replay import LunarScene

    ground = mission.terrain.layers[0]
    return LunarScene(
        heights=ground.heights,
        light=ground.light[0],
        cell=ground.cell,
        angles=tuple(math.radians(a) for a in scenario.sensors.angles_deg),
        camera=PICTURE,
        title=f"{scenario.name}, seed {scenario.seed}",
    )


def _add_flows(flown: log.FlightLog, readings: list[dict[str, FlowReading]], count: int) -> None:
    """Columns of the true flows, and of what each sensor saw and where it looked."""
    columns = flown.columns
    assert isinstance(columns, dict)
    columns["true_flow_x"] = columns["true_vx_mps"] / columns["true_H_m"]
    columns["true_flow_z"] = -columns["true_vz_mps"] / columns["true_H_m"]
    for i in range(1, count + 1):
        rows = [now.get(f"flow_{i}") for now in readings]
        columns[f"meas_flow_{i}_radps"] = np.array([r.flows[-1] if r and r.flows else np.nan for r in rows])
        for axis, name in enumerate("xyz"):
            columns[f"sight_{i}_{name}_m"] = np.array([r.hit[axis] if r else np.nan for r in rows])


def verdict(flown: log.FlightLog, scenario: LunarScenario) -> judge.Verdict:
    """Landed means: stands at the end, and touched within the scenario's limits."""
    touch, errors = flown.touchdown, _errors(flown)
    tilt = math.nan if touch is None else math.degrees(math.hypot(touch.pitch, touch.bank))
    metrics = {
        "touchdown_x_m": math.nan if touch is None else touch.x,
        "sink_rate_mps": math.nan if touch is None else touch.sink_rate,
        "touchdown_groundspeed_mps": math.nan if touch is None else touch.groundspeed,
        "touchdown_tilt_deg": tilt,
        **{f"{name}_rms": error["rms"] for name, error in errors.items()},
    }
    limits = scenario.criteria
    criteria = tuple(
        judge.Criterion(name, metrics[name], limit, bool(abs(metrics[name]) <= limit), source)
        for name, limit, source in (
            ("sink_rate_mps", limits.sink_rate_mps, "a soft landing"),
            ("touchdown_groundspeed_mps", limits.groundspeed_mps, "a soft landing"),
            ("touchdown_tilt_deg", limits.tilt_deg, "a soft landing"),
        )
    )
    return judge.Verdict(_outcome(flown), metrics, errors, criteria)


def _outcome(flown: log.FlightLog) -> judge.Outcome:
    if flown.meta["end"] == "numeric_error":
        return "numeric_error"
    if flown.meta["end"] == "crash":
        return "crash"
    touch = flown.touchdown
    if touch is None:
        return "timeout"
    upright = math.hypot(float(flown["true_theta_rad"][-1]), float(flown["true_phi_rad"][-1])) < math.radians(25.0)
    return "landed" if upright and touch.sink_rate < judge.CRASH_SINK else "crash"


def _errors(flown: log.FlightLog) -> dict[str, dict[str, Any]]:
    """Estimate minus truth until a foot touches, heights above the landing site's mean."""
    end = math.inf if flown.touchdown is None else flown.touchdown.t
    use = (flown["t_s"] >= JUDGED_FROM) & (flown["t_s"] < end)
    found: dict[str, dict[str, Any]] = {}
    for name, (factor, unit) in {**ERRORS, **FLOWS}.items():
        error = (
            factor * flown.error(name) if name in ERRORS else factor * (flown[f"est_{name}"] - flown[f"true_{name}"])
        )
        if use.any():
            values = error[use]
            found[name] = {
                "max": float(np.abs(values).max()),
                "rms": float(np.sqrt(np.mean(values**2))),
                "unit": unit,
            }
    return found
