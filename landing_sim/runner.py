"""One flight from a scenario to files: what `run`, `replay --set` and the paper reports share."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from landing_sim.errors import Mark, Problem, ScenarioError
from landing_sim.missions import runway_landing
from landing_sim.record import judge, log, parquet
from landing_sim.scenario import Scenario, dump
from landing_sim.signals import Step
from landing_sim.vehicle import Vehicle

RESULT, LOG, RECORDING, SCENARIO = "result.json", "log.parquet", "recording.rrd", "scenario.json"
_OURS = (RESULT, LOG, RECORDING, SCENARIO)


@dataclass(frozen=True, slots=True)
class Flight:
    """A flight that is over."""

    log: log.FlightLog
    verdict: judge.Verdict
    wall_s: float


def fly(scenario: Scenario, vehicle: Vehicle, seed: int, watch: Callable[[Step], None] | None = None) -> Flight:
    """Fly it to its end. `watch` is called with every step (progress, live view)."""
    started = time.perf_counter()
    builder = log.LogBuilder()
    mission = runway_landing.build(scenario, vehicle, seed)
    for step in mission.steps():
        builder.add(step)
        if watch is not None:
            watch(step)
    outcome = mission.outcome()
    flown = builder.finish(
        scenario=dump(scenario),
        seed=seed,
        touchdown=outcome.touchdown,
        end=outcome.end,
        runway={"width_m": scenario.runway.width_m, "length_m": scenario.runway.length_m},
    )
    return Flight(flown, judge.judge(flown, limits(scenario)), time.perf_counter() - started)


def limits(scenario: Scenario) -> tuple[judge.Limit, ...]:
    """The scenario's criteria as the judge takes them."""
    return tuple(judge.Limit(c.metric, c.low, c.high, c.source) for c in scenario.criteria)


def check_out(folder: Path) -> None:
    """Raise ScenarioError if writing results to `folder` would touch anything that is not an earlier run's."""

    def refuse(message: str) -> ScenarioError:
        return ScenarioError([Problem(Mark(f"--out {folder}"), (), message)])

    if folder.exists() and not folder.is_dir():
        raise refuse("is a file, not a folder")
    parent = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not os.access(parent, os.W_OK):
        raise refuse("cannot be written to")
    if folder.is_dir() and any(folder.iterdir()) and not _is_run(folder):
        raise refuse("is not empty and holds no earlier run: name another folder, or empty it")


def _is_run(folder: Path) -> bool:
    try:
        result = json.loads((folder / RESULT).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(result, dict) and {"scenario", "seed", "outcome"} <= result.keys()


@contextmanager
def out_folder(folder: Path) -> Iterator[Path]:
    """A temporary folder whose files move to `folder` together when all of them are complete; else it vanishes."""
    folder = folder.absolute()
    folder.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        yield work
        folder.mkdir(exist_ok=True)
        for name in _OURS:
            (folder / name).unlink(missing_ok=True)
        for file in sorted(work.iterdir(), key=lambda p: p.name == RESULT):  # the result last: it marks a whole run
            os.replace(file, folder / file.name)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def write(flight: Flight, scenario: Scenario, work: Path, folder: Path) -> dict[str, Any]:
    """Log, scenario as flown and result into `work`; the result as `run --json` prints it, naming files in `folder`."""
    parquet.write(flight.log, work / LOG)
    (work / SCENARIO).write_text(json.dumps(dump(scenario), indent=1) + "\n")
    files = {file.name.split(".")[0]: str(folder / file.name) for file in sorted(work.iterdir())}
    files["result"] = str(folder / RESULT)
    result = judge.to_json(flight.log, flight.verdict, scenario=scenario.name, wall_s=flight.wall_s, files=files)
    (work / RESULT).write_text(json.dumps(result, indent=1, allow_nan=False) + "\n")
    return result
