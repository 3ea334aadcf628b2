"""A scenario: everything about one flight, from a YAML file into frozen, checked values.

Units stand in the keys (height_m, heading_deg). Defaults are the setting that the project's acceptance figures are
stated for, so a file says only what is its own. What is true of the world and what is believed on board are separate
sections; a key that nothing implements does not exist, so a wish can never be silently ignored.

The key `mission` says which model a file is checked against: `MODELS`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from landing_sim import config, paths, yamlfile
from landing_sim.config import inconsistent
from landing_sim.errors import ConfigError, Location, Problem, ScenarioError, did_you_mean
from landing_sim.sections import faults, wind
from landing_sim.sections.faults import Fault
from landing_sim.sections.head import Head
from landing_sim.sections.judged import LANDING, Criterion, Record
from landing_sim.sections.lunar import LunarScenario
from landing_sim.sections.onboard import Believed, Control, Filter, Guidance, Observer, Vision
from landing_sim.sections.quadrotor import QuadrotorScenario
from landing_sim.sections.sensors import Camera, Sensors
from landing_sim.sections.wind import Wind
from landing_sim.sections.world import Aircraft, Atmosphere, Initial, Runway, Time

__all__ = ["MODELS", "Scenario", "Time", "dump", "load", "schema", "schema_text"]


class Scenario(Head):
    """One flight."""

    mission: Literal["runway_landing"] = Field(description="what is flown")
    time: Time = Field(Time(), description="clock")
    aircraft: Aircraft = Field(Aircraft(), description="vehicle")
    initial: Initial = Field(Initial(), description="start of the flight")
    runway: Runway = Field(Runway(), description="the true runway")
    atmosphere: Atmosphere = Field(Atmosphere(), description="still air")
    wind: Wind = Field(Wind(), description="moving air")
    camera: Camera = Field(Camera(), description="the true camera")
    sensors: Sensors = Field(Sensors(), description="other sensors")
    vision: Vision = Field(Vision(), description="front end")
    filter: Filter = Field(Filter(), description="estimator")
    observer: Observer = Field(Observer(), description="range observer, where filter.kind says so")
    believed: Believed = Field(Believed(), description="onboard models against the truth")
    guidance: Guidance = Field(Guidance(), description="path")
    control: Control = Field(Control(), description="controller")
    record: Record = Field(Record(), description="outputs")
    faults: tuple[Fault, ...] = Field((), max_length=20, description="what fails, how and when")
    criteria: tuple[Criterion, ...] = Field(
        LANDING, max_length=100, description="what makes it pass; a safe landing if left out"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        problems: list[tuple[Location, str]] = []
        step, cycle = self.time.step_s, self.time.cycle_s
        periods: tuple[tuple[Location, float, float, str], ...] = (
            (("time", "cycle_s"), cycle, step, "time.step_s"),
            (("camera", "period_s"), self.camera.period_s, cycle, "time.cycle_s"),
            (("control", "delay_s"), self.control.delay_s, step, "time.step_s"),
        )
        for where, period, unit, name in periods:
            if not _whole(period, unit):
                problems.append((where, f"{period:g} is not a whole multiple of {name} = {unit:g}"))
        problems += wind.problems(self.wind)
        problems += _failing(self)
        length = self.runway.length_m
        for i, taxiway in enumerate(self.runway.taxiways):
            half = 0.5 * taxiway.width_m + taxiway.flare_m
            if not half <= taxiway.x_m <= length - half:
                problems.append(
                    (("runway", "taxiways", i, "x_m"), f"its mouth reaches past the runway (0 ... {length:g})")
                )
        if self.camera.exposure_s > 0 and self.camera.renderer != "exact":
            problems.append(
                (("camera", "exposure_s"), f"renderer {self.camera.renderer!r} has no motion blur: must be 0")
            )
        for i, limit in enumerate(self.criteria):
            if limit.low is None and limit.high is None:
                problems.append((("criteria", i), "needs low, high or both"))
            elif limit.low is not None and limit.high is not None and limit.low > limit.high:
                problems.append((("criteria", i, "low"), f"is above high = {limit.high:g}"))
        inconsistent(problems)
        return self


def _failing(s: Scenario) -> list[tuple[Location, str]]:
    """What does not fit together in faults and optic-flow sensors."""
    flow, observer = s.sensors.optic_flow, s.filter.kind == "observer"
    eyes = [f"flow_{i + 1}" for i in range(len(flow.angles_deg))]
    names = ["inertial", "gyro", "airspeed", "squat", "camera", *eyes, *["flow_angles"] * observer]
    found = faults.problems(s.faults, names, [*eyes, *["inertial"] * observer], ["camera"])
    if eyes and observer:
        found.append((("sensors", "optic_flow", "angles_deg"), "filter.kind observer has no use for them"))
    if eyes and not _whole(s.time.cycle_s, 1.0 / flow.rate_hz):
        message = f"a cycle of {s.time.cycle_s:g} s is not a whole number of samples"
        found.append((("sensors", "optic_flow", "rate_hz"), message))
    if flow.slowest_dps >= flow.fastest_dps:
        found.append((("sensors", "optic_flow", "slowest_dps"), "is not below fastest_dps"))
    return found


def _whole(period: float, unit: float) -> bool:
    count = round(period / unit)
    return abs(period - count * unit) <= 1e-9 * max(period, unit) and (count > 0 or period == 0)


MODELS: dict[str, Any] = {
    "runway_landing": Scenario,
    "lunar_landing": LunarScenario,
    "quadrotor_landing": QuadrotorScenario,
}
"""What each word of `mission` is checked against."""


def load(name: str | Path, overrides: Iterable[str] = ()) -> Scenario:
    """Read, override and check a scenario.

    Parameters
    ----------
    name : a path, or the name of a shipped scenario such as ``do128/gust``
    overrides : ``path.to.key=value`` strings, as given with ``--set``

    Raises ScenarioError holding every problem with its place.
    """
    try:
        path = paths.scenario_file(str(name))
        document = yamlfile.load(path)
        config.override(document, overrides)
        if document.data.get("name") in (None, ""):
            document.data["name"] = path.stem
        return check(document)
    except ConfigError as error:
        raise ScenarioError(error.problems) from None


def check(document: yamlfile.Document) -> Scenario:
    """A document as the scenario its mission asks for, by MODELS.

    Raises ConfigError holding every problem with its place.
    """
    mission = document.data.get("mission")
    scenario = config.validate(document, MODELS.get(mission, Scenario) if isinstance(mission, str) else Scenario)
    if isinstance(scenario, Scenario) and scenario.aircraft.model not in paths.aircraft_names():
        where: Location = ("aircraft", "model")
        near = did_you_mean(scenario.aircraft.model, paths.aircraft_names())
        message = f"no aircraft {scenario.aircraft.model!r}{near}"
        raise ConfigError([Problem(document.mark(where), where, message)])
    found: Scenario = scenario
    return found


def schema(mission: str = "runway_landing") -> dict[str, Any]:
    """The JSON Schema of a mission's scenario files, for editors."""
    out: dict[str, Any] = MODELS[mission].model_json_schema()
    out["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    out["title"] = "landing-sim scenario"
    return out


def schema_text(mission: str = "runway_landing") -> str:
    """`schema()` as it is shipped in scenarios/schema.json; of other missions, schema_lunar.json, schema_quadrotor.json."""
    return json.dumps(schema(mission), indent=1, ensure_ascii=False) + "\n"


def dump(scenario: Scenario) -> dict[str, Any]:
    """Every value, resolved, as plain data that loads again."""
    return scenario.model_dump(mode="json")
