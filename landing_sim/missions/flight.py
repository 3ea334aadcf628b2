"""What every mission has: concrete parts, the loop flown with them until somebody ends it, how it ended, and its log."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from landing_sim import loop
from landing_sim.errors import Mark, Problem, ScenarioError
from landing_sim.interfaces import Controller, Estimator, FrontEnd, Guidance, Plant, Sensor, World
from landing_sim.plants.jsbsim import PlantError
from landing_sim.record import judge, log
from landing_sim.record.builder import LogBuilder
from landing_sim.signals import Command, Step, Touchdown

AnyPlant = TypeVar("AnyPlant", bound=Plant)
AnyWorld = TypeVar("AnyWorld", bound=World)
AnyMission = TypeVar("AnyMission")


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a flight ended, in its mission's words: "stopped", "crash", "go_around" ..., "time" or "numeric_error"."""

    end: str
    touchdown: Touchdown | None
    reason: str = ""  # what the flight model said when it could not go on


@dataclass(frozen=True, slots=True)
class Parts(Generic[AnyPlant, AnyWorld]):
    """The concrete parts of one flight, in the order of the loop's arguments."""

    clock: loop.Clock
    plant: AnyPlant
    world: AnyWorld
    sensors: tuple[Sensor, ...]
    front_ends: dict[str, FrontEnd]
    estimator: Estimator
    guidance: Guidance
    controller: Controller


def flown(p: Parts[AnyPlant, AnyWorld], trim: Command, ended: Callable[[Step], str]) -> Generator[Step, None, Outcome]:
    """Fly until `ended` names an end, or the flight model gives up. The last Step is the one that ended it."""
    try:
        for step in loop.simulate(
            p.clock, p.plant, p.world, p.sensors, p.front_ends, p.estimator, p.guidance, p.controller, trim
        ):
            yield step
            end = ended(step)
            if end:
                return Outcome(end, p.plant.touchdown)
    except (PlantError, FloatingPointError) as error:
        return Outcome("numeric_error", p.plant.touchdown, str(error))
    raise AssertionError("the loop flies for ever")


@dataclass(frozen=True, slots=True)
class Flight:
    """A flight that is over."""

    log: log.FlightLog
    verdict: judge.Verdict
    wall_s: float


def ready(name: str, build: Callable[[], AnyMission]) -> AnyMission:
    """What `build` makes. Raises ScenarioError where the vehicle cannot fly what the scenario `name` wants at the start."""
    try:
        return build()
    except (PlantError, ValueError) as error:
        raise ScenarioError([Problem(Mark(name), (), f"cannot be flown: {error}")]) from error


def finished(
    builder: LogBuilder, scenario: Any, outcome: Outcome, runway: Mapping[str, float] | None = None
) -> log.FlightLog:
    """The log of a flight that is over."""
    return builder.finish(
        scenario=scenario.model_dump(mode="json"),
        seed=scenario.seed,
        touchdown=outcome.touchdown,
        end=outcome.end,
        runway=runway,
        extra={"reason": outcome.reason} if outcome.reason else None,
    )
