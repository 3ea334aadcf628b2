"""One quadrotor flight from a scenario to a log and a verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.interfaces import NoiseStream
from landing_sim.missions.flight import Flight, finished, ready
from landing_sim.missions.quadrotor_landing import Mission, build
from landing_sim.record import judge, log
from landing_sim.record.builder import LogBuilder
from landing_sim.sections.quadrotor import METRICS, QuadrotorScenario
from landing_sim.signals import Step
from landing_sim.types import Array
from landing_sim.world.planes import Box

HOVER_FROM = 5.0  # [s] after the hover began
LEAST_HOVER = 10.0  # [s] that is a hover
UPRIGHT = math.radians(10.0)
ROTORS = {
    "true_elevator_rad": "rotor_front_radps",
    "true_aileron_rad": "rotor_right_radps",
    "true_rudder_rad": "rotor_rear_radps",
    "true_flap": "rotor_left_radps",
}
"""Columns of the log that an aircraft has its surfaces in."""
ERRORS = {"x": "m", "y": "m", "H": "m", "vx": "m/s", "vy": "m/s", "vz": "m/s"}


def fly(
    scenario: QuadrotorScenario,
    watch: Callable[[Step], None] | None = None,
    recording: Path | None = None,
    live: bool = False,
    noise: Callable[[str], NoiseStream] | None = None,
    other: log.FlightLog | None = None,
) -> Flight:
    """Fly it to its end; the path of `other` is shown beside.

    Raises ScenarioError where it cannot begin, ReplayError from the recording.
    """
    started = time.perf_counter()
    mission = ready(scenario.name, lambda: build(scenario, scenario.seed, scenario.run, noise))
    builder, told = LogBuilder(), []
    camera = None
    if recording is not None:
        from landing_sim.missions.quadrotor_pictures import Pictures

        camera = Pictures(recording, scenario, mission, live)
    for step in mission.steps():
        builder.add(step)
        told.append(_told(step))
        if watch is not None:
            watch(step)
        if camera is not None:
            camera.add(step)
    flown = finished(builder, scenario, mission.outcome())
    _add(flown, np.array(told))
    if camera is not None:
        camera.close(flown, other)
    return Flight(flown, verdict(flown, scenario, mission), time.perf_counter() - started)


_TOLD = (
    *("fix_t_s", "fix_x_m", "fix_y_m", "fix_z_m"),
    *("place_x_m", "place_y_m", "place_z_m"),
    *("meas_roll_rad", "meas_pitch_rad", "meas_yaw_rad", "meas_sonar_m"),
)


def _told(step: Step) -> list[float]:
    """What the onboard side was told in this cycle, by _TOLD; NaN where nothing."""
    out = [math.nan] * len(_TOLD)
    for m in step.measurements:
        if m.kind == "position":
            out[0:4] = [m.t_valid, *m.z.tolist()]
        elif m.kind == "way_point":
            out[4:7] = m.z.tolist()
        elif m.kind == "strapdown":
            out[7:10] = m.z[3:].tolist()
    for sample in step.samples:
        if sample.sensor == "sonar":
            out[10] = sample.data
    return out


def _add(flown: log.FlightLog, told: Array) -> None:
    columns = flown.columns
    assert isinstance(columns, dict)
    for old, new in ROTORS.items():
        columns[new] = columns.pop(old)
    for i, name in enumerate(_TOLD):
        columns[name] = told[:, i]


def verdict(flown: log.FlightLog, scenario: QuadrotorScenario, mission: Mission) -> judge.Verdict:
    """Hovered: to the end of its time. Landed: stands on the box that was meant. Within the limits: passed."""
    box = mission.scene_boxes[0] if scenario.task == "land" else None
    metrics, limits = measure(flown, box), scenario.criteria
    wanted: tuple[tuple[str, float, str], ...]
    if scenario.task == "hover":
        wanted = (("hover_rms_m", limits.hover_rms_m, "Brockers 2012, 5.1: 3.44 cm"),)
    else:
        wanted = (
            ("miss_m", limits.miss_m, "well within the platform"),
            ("sink_rate_mps", limits.sink_rate_mps, "a soft landing"),
            ("touchdown_tilt_deg", limits.tilt_deg, "a soft landing"),
        )
    criteria = tuple(
        judge.Criterion(name, metrics[name], limit, bool(abs(metrics[name]) <= limit), source)
        for name, limit, source in wanted
    )
    return judge.Verdict(_outcome(flown, box), metrics, _errors(flown), criteria)


def _outcome(flown: log.FlightLog, box: Box | None) -> judge.Outcome:
    end = flown.meta["end"]
    if end == "numeric_error":
        return "numeric_error"
    if end == "crash":
        return "crash"
    if end == "refused":
        return "refused"
    if box is None:
        return "hovered" if end == "time" and _hovering(flown).any() else "crash" if end == "stopped" else "timeout"
    if flown.touchdown is None:
        return "timeout"
    p = [float(flown[f"true_{axis}_m"][-1]) for axis in "xyz"]
    tilt = math.hypot(float(flown["true_theta_rad"][-1]), float(flown["true_phi_rad"][-1]))
    above = -p[2] - box.top(p[0], p[1])
    if tilt > UPRIGHT + math.hypot(*box.slope):
        return "crash"
    return "landed" if 0.0 < above < 0.2 else "off_platform"


def _hovering(flown: log.FlightLog) -> np.ndarray:
    """(n,) bool: the part of a hover that counts; nothing if it is too short."""
    t, hover = flown["t_s"], flown["mode"] == "hover"
    if not hover.any():
        return np.zeros(len(flown), bool)
    count = hover & (t >= t[np.argmax(hover)] + HOVER_FROM)
    return count if count.any() and t[count][-1] - t[count][0] >= LEAST_HOVER else np.zeros(len(flown), bool)


def measure(flown: log.FlightLog, box: Box | None) -> dict[str, float]:
    """By METRICS. `box` is the true landing place."""
    found = dict.fromkeys(METRICS, math.nan)
    true = np.column_stack([flown["true_x_m"], flown["true_y_m"], flown["true_z_m"]])
    wanted = np.column_stack([flown["ref_x"], flown["ref_y_m"], -flown["ref_height_m"]])
    hover = _hovering(flown)
    if hover.any():
        off = (true - wanted)[hover]
        found["hover_rms_m"] = _rms(np.linalg.norm(off, axis=1))
        for i, axis in enumerate("xyz"):
            found[f"hover_{axis}_rms_m"] = _rms(off[:, i])
        found["hover_p99_m"] = float(np.percentile(np.linalg.norm(off, axis=1), 99.0))
    t, mode = flown["t_s"], flown["mode"]
    flying = ~np.isin(mode, ("wait", "cut"))
    error = np.column_stack([flown.error("x"), flown.error("y"), -flown.error("H")])
    use = flying & np.isfinite(error).all(axis=1)
    if use.any():
        found["position_error_rms_m"] = _rms(np.linalg.norm(error[use], axis=1))
    found["fix_error_rms_m"] = _fix_error(flown, true)
    if flying.any():
        found["unlocalised_s"] = float((t[1] - t[0]) * (flying & ~flown["flag_localised"]).sum())
    along = mode == "traverse"
    if along.any():
        way = wanted[along][-1, :2] - wanted[along][0, :2]
        length = float(np.hypot(*way))
        if length > 0.2:
            off = (true - wanted)[along]
            found["cross_track_rms_m"] = _rms((off[:, 0] * way[1] - off[:, 1] * way[0]) / length)
    if box is not None:
        _measure_landing(found, flown, box)
    return found


def _measure_landing(found: dict[str, float], flown: log.FlightLog, box: Box) -> None:
    known = np.isfinite(flown["place_x_m"])
    if known.any():
        x, y, z = (float(flown[f"place_{axis}_m"][known][-1]) for axis in "xyz")
        found["way_point_error_m"] = math.hypot(x - box.x, y - box.y)
        found["platform_height_m"], found["platform_height_error_m"] = -z, -z - box.height
    touch = flown.touchdown
    if touch is not None:
        found["miss_m"] = math.hypot(touch.x - box.x, touch.y - box.y)
        found["sink_rate_mps"] = touch.sink_rate
        found["touchdown_tilt_deg"] = math.degrees(math.hypot(touch.pitch, touch.bank))
        took_off = np.flatnonzero(~np.isin(flown["mode"], ("wait", "survey")))
        if len(took_off):
            found["flight_s"] = touch.t - float(flown["t_s"][took_off[0]])


def _fix_error(flown: log.FlightLog, true: Array) -> float:
    """[m] rms of fixes against where the vehicle was when their image was taken."""
    some = np.isfinite(flown["fix_t_s"])
    if not some.any():
        return math.nan
    at = flown["fix_t_s"][some]
    error = np.column_stack([
        flown[f"fix_{axis}_m"][some] - np.interp(at, flown["t_s"], true[:, i]) for i, axis in enumerate("xyz")
    ])  # fmt: skip
    return _rms(np.linalg.norm(error, axis=1))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _errors(flown: log.FlightLog) -> dict[str, dict[str, Any]]:
    """Estimate minus truth while it flies."""
    flying = ~np.isin(flown["mode"], ("wait", "cut"))
    found: dict[str, dict[str, Any]] = {}
    for name, unit in ERRORS.items():
        values = flown.error(name)[flying]
        values = values[np.isfinite(values)]
        if len(values):
            found[name] = {"max": float(np.abs(values).max()), "rms": _rms(values), "unit": unit}
    return found
