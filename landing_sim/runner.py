"""One flight from a scenario to files: what `run`, `replay --set` and the paper reports share."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from landing_sim.errors import Mark, Problem, ScenarioError
from landing_sim.missions import runway_flight
from landing_sim.missions.flight import Flight
from landing_sim.noise import NoiseStream
from landing_sim.record import judge, log, parquet
from landing_sim.scenario import Scenario, dump
from landing_sim.signals import Step
from landing_sim.vehicle import Vehicle

RESULT, LOG, RECORDING, SCENARIO = "result.json", "log.parquet", "recording.rrd", "scenario.json"
_OURS = (RESULT, LOG, RECORDING, SCENARIO)
_MISSIONS = {"lunar_landing": "lunar_flight", "quadrotor_landing": "quadrotor_flight"}
"""Where a mission without a vehicle file is flown, in landing_sim.missions: each loads what only it needs."""


def fly(
    scenario: Scenario,
    vehicle: Vehicle | None,
    watch: Callable[[Step], None] | None = None,
    recording: Path | None = None,
    live: bool = False,
    noise: Callable[[str], NoiseStream] | None = None,
    other: log.FlightLog | None = None,
) -> Flight:
    """Fly it to its end.

    vehicle : of a mission that lets the scenario choose one; of others None
    watch : called with every step
    recording : where to write one for the viewer; None leaves it out
    live : show it in the viewer while it flies; needs a recording
    noise : the stream of a named component, instead of those of the scenario's seed and run
    other : a flight that the recording shows beside this one

    Raises ScenarioError where the aircraft cannot fly what the scenario wants at the start, ReplayError from the recording.
    """
    if scenario.mission == "runway_landing":
        if vehicle is None:
            raise ValueError(f"{scenario.name}: this mission needs a vehicle")
        return runway_flight.fly(scenario, vehicle, watch, recording, live, noise, other)
    mission = import_module(f"landing_sim.missions.{_MISSIONS[scenario.mission]}")
    flight: Flight = mission.fly(scenario, watch, recording, live, noise, other)
    return flight


def check_out(folder: Path, ours: Container[str] = _OURS) -> None:
    """Raise ScenarioError if `folder` holds anything, but no earlier run of ours, whose files are named in `ours`."""

    def refuse(message: str) -> ScenarioError:
        return ScenarioError([Problem(Mark(f"--out {folder}"), (), message)])

    try:
        if os.path.lexists(folder) and not folder.is_dir():
            raise refuse("is a file, not a folder" if folder.exists() else "is a link to nowhere")
        others = folder.is_dir() and not _is_ours(folder, ours)
    except OSError as error:
        raise refuse(f"cannot be used: {error.strerror}") from None
    if others:
        raise refuse("is not empty and holds no earlier run: name another folder, or empty it")


def _is_ours(folder: Path, ours: Container[str]) -> bool:
    """Nothing but files of ours, or a result of ours and what others have put beside it."""
    names = [entry.name for entry in folder.iterdir()]
    if all(name in ours for name in names):
        return True
    try:
        result = json.loads((folder / RESULT).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(result, dict) and {"scenario", "seed", "outcome"} <= result.keys()


@contextmanager
def out_folder(folder: Path) -> Iterator[Path]:
    """A temporary folder whose files move to `folder` together when all of them are complete; else it vanishes."""
    absolute = folder.absolute()
    made = next((p for p in reversed(absolute.parents) if not p.exists()), None)
    try:
        absolute.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=absolute.parent, prefix=f".{absolute.name}."))
    except OSError as error:
        raise ScenarioError([Problem(Mark(f"--out {folder}"), (), f"cannot be made: {error.strerror}")]) from None
    try:
        yield work
        absolute.mkdir(exist_ok=True)
        for name in _OURS:
            (absolute / name).unlink(missing_ok=True)
        for file in sorted(work.iterdir(), key=lambda p: p.name == RESULT):  # the result last: it marks a whole run
            os.replace(file, absolute / file.name)
    finally:
        shutil.rmtree(work, ignore_errors=True)
        _remove_empty(absolute.parent, made)


def _remove_empty(folder: Path, top: Path | None) -> None:
    """Remove folders made on the way to results that never came, from `folder` up to `top`, as far as they are empty."""
    if top is None:
        return
    for path in (folder, *folder.parents):
        try:
            path.rmdir()
        except OSError:  # not empty: somebody's results, ours or another run's
            return
        if path == top:
            return


def write(flight: Flight, scenario: Scenario, label: str, work: Path, folder: Path) -> dict[str, Any]:
    """Log, scenario as flown and result into `work`; the result as `run --json` prints it, naming files in `folder`.

    label : the scenario as the user named it
    """
    parquet.write(flight.log, work / LOG)
    (work / SCENARIO).write_text(json.dumps(dump(scenario), indent=1) + "\n")
    files = {file.name.split(".")[0]: str(folder / file.name) for file in sorted(work.iterdir())}
    files["result"] = str(folder / RESULT)
    result = judge.to_json(flight.log, flight.verdict, scenario=label, wall_s=flight.wall_s, files=files)
    (work / RESULT).write_text(json.dumps(result, indent=1, allow_nan=False) + "\n")
    return result
