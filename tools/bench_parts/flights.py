"""The same flight three ways: bare JSBSim, the plant on a tape of commands, and the closed loop.

Bare is JSBSim alone on the same trajectory, to the bit: FGFDMExec.run once a step, and every input property written when
its value has changed and not otherwise: control commands (once a control cycle), wind (while it varies), and what keeps
the trajectory the same, the elevation of the terrain below and, on the ground, the wheels' forces. Nothing is read.
Loading the model and putting it into its initial state are no part of it; that it ends where the closed loop did is
checked.

The plant's part is our plant and our wind under the recorded commands: flight model, wheels, camera platform, air.
The closed loop is what a landing costs from the end of the plant's reset to the judged log.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.missions import runway_flight, runway_landing
from landing_sim.missions.flight import finished
from landing_sim.missions.runway_landing import RunwayParts
from landing_sim.plants.aircraft import JsbsimPlant
from landing_sim.record import judge, log
from landing_sim.record.builder import LogBuilder
from landing_sim.scenario import Scenario
from landing_sim.signals import Command, Step
from landing_sim.vehicle import Vehicle

Write = tuple[int, float]  # input, value


@dataclass(frozen=True, slots=True)
class Cost:
    """Seconds."""

    cpu: float
    wall: float

    @staticmethod
    def now() -> Cost:
        return Cost(time.process_time(), time.perf_counter())

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.cpu + other.cpu, self.wall + other.wall)

    def __sub__(self, other: Cost) -> Cost:
        return Cost(self.cpu - other.cpu, self.wall - other.wall)


@dataclass(frozen=True, slots=True)
class Landing:
    """A closed-loop flight and its price."""

    setup: Cost  # building the parts and putting the plant into its initial state
    flight: Cost  # the rest, log, recording and verdict included
    frames: int  # of the camera
    recorded: int  # of them in the recording
    log: log.FlightLog
    outcome: str

    @property
    def seconds(self) -> float:
        """Flown."""
        return float(self.log["t_s"][-1])


def land(
    scenario: Scenario,
    vehicle: Vehicle,
    recording: Path | None = None,
    prepare: Callable[[RunwayParts], None] | None = None,
    watch: Callable[[Step], None] | None = None,
    builder: LogBuilder | None = None,
) -> Landing:
    """What `runner.fly` does, with a stop watch; `prepare` may look into the parts before they fly."""
    begun = Cost.now()
    mission = runway_landing.build(scenario, vehicle, scenario.seed)
    plant = mission.parts.plant
    reset, ready = plant.reset, begun

    def resetting() -> Any:
        nonlocal ready
        truth = reset()
        ready = Cost.now()
        return truth

    plant.reset = resetting  # type: ignore[method-assign]
    if prepare is not None:
        prepare(mission.parts)
    recorder, recorded = None, 0
    before = Cost.now()
    if recording is not None:
        from landing_sim.record.replay import Recorder

        recorder = Recorder(recording, runway_flight.scene(scenario, vehicle), scenario.record.frames_hz)
    opening = Cost.now() - before
    builder = LogBuilder() if builder is None else builder
    for step in mission.steps():
        builder.add(step)
        if watch is not None:
            watch(step)
        if recorder is not None:
            due = recorder._next_frame
            recorder.add(step)
            recorded += recorder._next_frame != due
    runway = {"width_m": scenario.runway.width_m, "length_m": scenario.runway.length_m}
    flown = finished(builder, scenario, mission.outcome(), runway)
    if recorder is not None:
        recorder.close(flown)
    verdict = judge.judge(flown, runway_flight.limits(scenario))
    flight = Cost.now() - ready
    if recording is not None:
        flight = flight + opening
    frames = int((flown["meas_frame"] >= 0).sum())
    return Landing(
        ready - begun - (opening if recording else Cost(0.0, 0.0)), flight, frames, recorded, flown, verdict.outcome
    )


@dataclass(frozen=True, slots=True)
class Tape:
    """What it takes to fly a flight again without anybody on board."""

    commands: tuple[Command, ...]  # one a step
    writes: tuple[tuple[Write, ...], ...]  # into JSBSim, one tuple a step
    end: tuple[float, ...]  # where it ended: position, attitude, velocity as JSBSim has them

    @property
    def steps(self) -> int:
        return len(self.commands)


def tape(scenario: Scenario, vehicle: Vehicle) -> Tape:
    """Fly the closed loop once for the commands, then the plant alone for what it writes into JSBSim."""
    commands: list[Command] = []
    ends: list[tuple[float, ...]] = []

    def listen(parts: RunwayParts) -> None:
        step, plant = parts.plant.step, parts.plant

        def stepping(command: Command, wind_R: Any) -> None:
            commands.append(command)
            step(command, wind_R)

        plant.step = stepping  # type: ignore[method-assign]
        ends.append(())
        parts_of.append(plant)

    parts_of: list[JsbsimPlant] = []
    land(scenario, vehicle, prepare=listen)
    end = state(parts_of[0])

    parts = runway_landing.build(scenario, vehicle, scenario.seed).parts
    parts.plant.reset()
    written: list[Write] = []
    _overhear(parts.plant, written)
    writes: list[tuple[Write, ...]] = []
    last: dict[int, float] = {}
    for tick, command in enumerate(commands):
        written.clear()
        parts.plant.step(command, parts.world.wind(tick * parts.clock.dt, *parts.plant.fast_truth()))
        writes.append(_news(written, last))
    if state(parts.plant) != end:
        raise RuntimeError(f"{scenario.name}: the plant alone does not repeat the closed loop's flight to the bit")
    return Tape(tuple(commands), _in_order(writes), end)


def state(plant: JsbsimPlant) -> tuple[float, ...]:
    """Where JSBSim says it is."""
    m = plant._model
    return tuple(read() for read in (*m.ecef_ft, *m.euler, *m.uvw_fps, *m.pqr))


def _inputs(plant: JsbsimPlant) -> list[Callable[[float], Any]]:
    """Everything that is written while flying: controls, wind, terrain, wheels."""
    m = plant._model
    return [*m.set_controls_norm, *m.set_wind_fps, m.set_terrain_ft, *m.set_wheels_lbs]


def _overhear(plant: JsbsimPlant, written: list[Write]) -> None:
    """Put an ear on every input and on the run itself, which is written as input -1."""
    m = plant._model

    def heard(i: int, write: Callable[[float], Any]) -> Callable[[float], Any]:
        def writing(value: float) -> Any:
            written.append((i, value))
            return write(value)

        return writing

    ears = [heard(i, write) for i, write in enumerate(_inputs(plant))]
    n = len(m.set_controls_norm)
    m.set_controls_norm, m.set_wind_fps, m.set_terrain_ft, m.set_wheels_lbs = (
        ears[:n],
        ears[n : n + 3],
        ears[n + 3],
        ears[n + 4 :],
    )
    run = m.run

    def running() -> None:
        written.append((-1, 0.0))
        run()

    m.run = running  # type: ignore[method-assign]


def _news(written: Sequence[Write], last: dict[int, float]) -> tuple[Write, ...]:
    """What has changed, the run (-1) where it was."""
    news = []
    for i, value in written:
        if i < 0 or last.get(i) != value:
            news.append((i, value))
            last[i] = value
    return tuple(news)


def _in_order(steps: Sequence[tuple[Write, ...]]) -> tuple[tuple[Write, ...], ...]:
    """Writes before each run: what a step wrote after its run belongs to the next one."""
    out, late = [], ()
    for writes in steps:
        at = next(k for k, (i, _) in enumerate(writes) if i < 0)
        out.append((*late, *writes[:at]))
        late = writes[at + 1 :]
    return tuple(out)


def fly_bare(scenario: Scenario, vehicle: Vehicle, tape: Tape, thin: bool = False) -> Cost:
    """JSBSim alone through the whole tape. Raises RuntimeError if it ends elsewhere; `thin`: runs only, no input."""
    plant = runway_landing.build(scenario, vehicle, scenario.seed).parts.plant
    inputs, run = _inputs(plant), plant._model._fdm.run
    program = [[(inputs[i], value) for i, value in writes] for writes in tape.writes]
    begun = Cost.now()
    if thin:
        for _ in program:
            run()
        return Cost.now() - begun
    for writes in program:
        for write, value in writes:
            write(value)
        run()
    cost = Cost.now() - begun
    if state(plant) != tape.end:
        raise RuntimeError(f"{scenario.name}: bare JSBSim does not repeat the closed loop's flight to the bit")
    return cost


def fly_plant(scenario: Scenario, vehicle: Vehicle, tape: Tape) -> Cost:
    """Our plant in our wind under the recorded commands, as the loop steps them."""
    parts = runway_landing.build(scenario, vehicle, scenario.seed).parts
    plant, world, dt = parts.plant, parts.world, parts.clock.dt
    begun = Cost.now()
    for tick, command in enumerate(tape.commands):
        plant.step(command, world.wind(tick * dt, *plant.fast_truth()))
    return Cost.now() - begun


def load_bare(scenario: Scenario, vehicle: Vehicle) -> Cost:
    """What JSBSim takes to load the model: the least that a bare flight needs before it can begin."""
    from landing_sim import paths
    from landing_sim.plants.jsbsim import FlightModel

    begun = Cost.now()
    FlightModel(paths.aircraft_folder(scenario.aircraft.model), scenario.time.step_s, scenario.aircraft.mass_kg)
    return Cost.now() - begun


def same(a: log.FlightLog, b: log.FlightLog) -> bool:
    """The same flight to the bit."""
    return all(np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f") for name in a.columns)
