"""One landing of a campaign: from its index to a row of figures. What workers do; the same bits anywhere."""

from __future__ import annotations

import copy
import functools
import math
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim import config, runner, scenario, yamlfile
from landing_sim.campaign.dispersions import draw
from landing_sim.campaign.figures import GOOD, NEES_BANDS, figures
from landing_sim.campaign.plan import Campaign, Plan
from landing_sim.errors import ConfigError, Mark
from landing_sim.missions.flight import Flight
from landing_sim.noise import NoiseStream
from landing_sim.record import parquet
from landing_sim.record.judge import counted
from landing_sim.record.log import FlightLog
from landing_sim.scenario import Scenario
from landing_sim.vehicle import Vehicle
from landing_sim.vehicle import load as load_vehicle

GEAR_HEIGHT_AT = 60.0  # [m] past the threshold


@dataclass(frozen=True, slots=True)
class Landing:
    """A row of the results, and the flight's log in Parquet if it is kept."""

    run: int
    outcome: str  # that of the judge, "cannot_fly" or "worker_killed"
    reason: str = ""  # of an outcome that the figures do not explain
    figures: Mapping[str, float] | None = None  # by Plan.figures; None: all NaN
    values: Mapping[str, Any] | None = None  # drawn, derived, swept; by name or path
    wall_s: float = math.nan
    cpu_s: float = math.nan
    peak_mb: float = math.nan  # of the process so far
    worker: str = ""
    history: bytes | None = None


def land(plan: Plan, run: int) -> Landing:
    """Fly run `run`: the whole job of a worker. Raises nothing that the scenario or the aircraft can cause."""
    _prepare()
    wall, cpu = time.perf_counter(), time.process_time()
    values = draw(plan.campaign, run)
    history = None
    try:
        wanted, flight = fly(plan, run, values)
    except ConfigError as error:
        outcome, reason, found = "cannot_fly", str(error), None
    else:
        outcome, reason = flight.verdict.outcome, str(flight.log.meta.get("reason", ""))
        found = measure(flight, wanted)
        if kept(plan.campaign, outcome, found):
            history = _parquet(flight.log)
    return Landing(
        run,
        outcome,
        reason,
        found,
        values,
        time.perf_counter() - wall,
        time.process_time() - cpu,
        _peak_mb(),
        f"{os.uname().nodename}:{os.getpid()}",
        history,
    )


def fly(
    plan: Plan,
    run: int,
    values: Mapping[str, Any] | None = None,
    noise: Callable[[str], NoiseStream] | None = None,
    changes: Sequence[str] = (),
    recording: Path | None = None,
    other: FlightLog | None = None,
) -> tuple[Scenario, Flight]:
    """Fly run `run` of a campaign as it is flown there, bit for bit, unless something else is wanted.

    values : of `draw`, instead of drawing them here
    noise : where every random number of this landing comes from, dispersions included
    changes : ``path=value``, as given to --set, on top
    recording : where to write one for the viewer
    other : a flight that the recording shows beside it

    Raises ConfigError where the aircraft cannot fly what was drawn or changed.
    """
    if values is None:
        values = draw(plan.campaign, run, noise)
    wanted = scenario_of(plan, run, values, changes)
    return wanted, runner.fly(wanted, _vehicle(wanted), noise=noise, recording=recording, other=other)


def scenario_of(plan: Plan, run: int, values: Mapping[str, Any], changes: Sequence[str] = ()) -> Scenario:
    """The scenario of a run. `landing-sim run` flies the same landing from it. Raises ConfigError."""
    source = f"run {run} of {plan.label}"
    document = yamlfile.Document(source, copy.deepcopy(dict(plan.scenario)))
    for path in plan.campaign.dispersed_paths():
        problem = config.assign(document, path.split("."), values[path], Mark(source))
        if problem is not None:
            raise ConfigError([problem])
    document.data |= {"seed": plan.campaign.seed, "run": run}
    config.override(document, changes)
    return scenario.check(document)


def measure(flight: Flight, wanted: Scenario) -> dict[str, float]:
    """Every figure that a campaign keeps, by figures.figures."""
    log, touchdown = flight.log, flight.log.touchdown
    found, vehicle = dict(flight.verdict.metrics), _vehicle(wanted)
    if vehicle is None:
        return {name: found.get(name, math.nan) for name in figures(wanted.mission)}
    gear = vehicle.guidance.gear
    found["touchdown_sideslip_deg"] = math.nan if touchdown is None else math.degrees(touchdown.sideslip)
    found["gear_height_60m_m"] = gear_height(log, gear.forward_m, gear.down_m, GEAR_HEIGHT_AT)
    count, x = counted(log) & np.isfinite(log["nees"]) & (log["nees_dof"] > 0), log["true_x_m"]
    for name, (low, high) in NEES_BANDS.items():
        use = count & (x >= low) & (x < high)
        found[name] = float(log["nees"][use].sum() / log["nees_dof"][use].sum()) if use.any() else math.nan
    return {name: found[name] for name in figures(wanted.mission)}


def gear_height(log: FlightLog, forward: float, down: float, x: float) -> float:
    """[m] of the lower main wheel over the surface when the main wheels first pass x [m]; NaN if they never do.

    forward, down : [m] of the main wheels from the cg, body axes
    """
    wheel_x = log["true_x_m"] + forward * np.cos(log["true_theta_rad"]) + down * np.sin(log["true_theta_rad"])
    past = np.flatnonzero(wheel_x >= x)
    if len(past) == 0 or past[0] == 0:
        return math.nan
    k = slice(past[0] - 1, past[0] + 1)
    height = np.minimum(log["true_wheel_left_m"], log["true_wheel_right_m"])
    return float(np.interp(x, wheel_x[k], height[k]))


def kept(campaign: Campaign, outcome: str, figures: Mapping[str, float]) -> bool:
    """Whether this landing's time history is kept."""
    if campaign.keep != "failures":
        return campaign.keep == "all"
    met = (
        (risk.above is not None and figures[risk.metric] > risk.above)
        or (risk.below is not None and figures[risk.metric] < risk.below)
        for risk in campaign.risks
    )
    return outcome not in GOOD or any(met)


def _vehicle(wanted: Scenario) -> Vehicle | None:
    """Of missions that let the scenario choose one."""
    return _loaded(wanted.aircraft.model) if wanted.mission == "runway_landing" else None


@functools.cache
def _loaded(name: str) -> Vehicle:
    return load_vehicle(name)


@functools.cache
def _prepare() -> None:
    """Once a process: no threads inside a landing."""
    import cv2

    cv2.setNumThreads(1)


def _parquet(log: FlightLog) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "log.parquet"
        parquet.write(log, file)
        return file.read_bytes()


def _peak_mb() -> float:
    """Largest resident memory of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)
