"""A campaign file into a `Plan`, every mistake in it with file:line:column before anything flies.

Every path is put into the scenario with the ends of its distribution, so a value that the scenario refuses is found now
and not in landing 1713.
"""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from landing_sim import config, paths, scenario, yamlfile
from landing_sim.campaign.distributions import extremes
from landing_sim.campaign.figures import METRICS, NEES_BANDS
from landing_sim.campaign.plan import Campaign, CampaignError, Plan, assemble
from landing_sim.campaign.units import factor
from landing_sim.errors import ConfigError, Location, Problem, did_you_mean

_EVERY = {name for names in METRICS.values() for name in names}
_TAKEN = {*_EVERY, *NEES_BANDS, "run", "outcome", "reason", "wall_s", "cpu_s", "peak_mb", "worker"}


def load(name: str | Path, runs: int | None = None) -> Plan:
    """Read and check a campaign; `runs` instead of the file's.

    name : a path, or the name of a shipped campaign such as ``do128/campaign_wind``

    Raises CampaignError holding every problem with its place.
    """
    try:
        path = paths.campaign_file(str(name))
        document = yamlfile.load(path)
        if runs is not None:
            config.override(document, [f"runs={runs}"])
        if document.data.get("name") in (None, ""):
            document.data["name"] = path.stem
        campaign = config.validate(document, Campaign)
        mission = str(_scenario_document(campaign, document, path).data.get("mission"))
        problems = [*_units(campaign), *_names(campaign), *_risks(campaign, mission)]
        if problems:
            raise ConfigError(_placed(document, problems))
        return Plan(campaign, _resolved(campaign, document, path), str(name))
    except ConfigError as error:
        raise CampaignError(error.problems) from None


def schema_text() -> str:
    """The JSON Schema of campaign files, as shipped in scenarios/schema_campaign.json."""
    out = Campaign.model_json_schema()
    out["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    out["title"] = "landing-sim campaign"
    return json.dumps(out, indent=1, ensure_ascii=False) + "\n"


# ---------------------------------------------------------------------------------------------------- checks

Wrong = tuple[Location, str]


def _placed(document: yamlfile.Document, problems: list[Wrong]) -> list[Problem]:
    return sorted(
        (Problem(document.mark(where), where, message) for where, message in problems),
        key=lambda problem: (problem.mark.line, problem.mark.column),
    )


def _units(campaign: Campaign) -> Iterator[Wrong]:
    for section in ("variables", "dispersions"):
        for name, distribution in getattr(campaign, section).items():
            kind = next(k for k in type(distribution).model_fields if getattr(distribution, k) is not None)
            yield from _unit(name, distribution.unit, (section, name, kind, "unit"))
    if campaign.sweep is not None:
        yield from _unit(campaign.sweep.path, campaign.sweep.unit, ("sweep", "unit"))


def _unit(name: str, unit: str | None, where: Location) -> Iterator[Wrong]:
    try:
        factor(name, unit)
    except ValueError as error:
        yield where, str(error)


def _names(campaign: Campaign) -> Iterator[Wrong]:
    above: list[str] = []
    for section in ("variables", "dispersions"):
        for name, distribution in getattr(campaign, section).items():
            if name in above:
                yield (section, name), "is a variable's name as well"
            if distribution.derived is not None:
                for part in distribution.derived.parts:
                    if part not in above:
                        near = did_you_mean(part, above)
                        yield (section, name, "derived", "of"), f"nothing above is called {part!r}{near}"
            above.append(name)
    for name in campaign.variables:
        if name.lower() in {taken.lower() for taken in _TAKEN}:
            yield ("variables", name), "is the name of a column of the results: choose another"
    paths_met = [*(("set", p) for p in campaign.set), *(("dispersions", p) for p in campaign.dispersions)]
    for where in paths_met:
        if where[1].partition(".")[0] in ("seed", "run", "schema_version", "mission"):
            yield where, "is the campaign's own business"
    for path in campaign.dispersions:
        if path in campaign.set:
            yield ("dispersions", path), "stands under `set` as well"
    drawn, met = campaign.drawn(), set[str]()
    for i, group in enumerate(campaign.correlations):
        for name in group.of:
            if name not in drawn:
                yield ("correlations", i, "of"), f"nothing that is drawn is called {name!r}{did_you_mean(name, drawn)}"
            if name in met:
                yield ("correlations", i, "of"), f"{name!r} stands in two groups: make them one"
            met.add(name)
    sweep = campaign.sweep
    if sweep is not None:
        held = {**campaign.variables, **campaign.dispersions}.get(sweep.path)
        if sweep.path in campaign.set or (held is not None and held.derived is not None):
            yield ("sweep", "path"), "is set or derived as well"
        if sweep.aim is not None and sweep.aim not in sweep.values:
            yield ("sweep", "aim"), f"is none of values = {', '.join(f'{v:g}' for v in sweep.values)}"
        if len(set(sweep.values)) < len(sweep.values):
            yield ("sweep", "values"), "a value stands there twice"


def _risks(campaign: Campaign, mission: str) -> Iterator[Wrong]:
    seen = set[str]()
    known = METRICS.get(mission, METRICS["runway_landing"])
    for i, risk in enumerate(campaign.risks):
        if risk.metric not in known:
            yield ("risks", i, "metric"), f"no such metric{did_you_mean(risk.metric, known)}"
        if risk.above is None and risk.below is None:
            yield ("risks", i), "needs above, below or both"
        elif risk.above is not None and risk.below is not None and risk.below >= risk.above:
            yield ("risks", i, "below"), f"must be below above = {risk.above:g}: the event lies outside"
        if risk.name in seen:
            yield ("risks", i, "name"), "another risk has this name"
        seen.add(risk.name)


def _resolved(campaign: Campaign, document: yamlfile.Document, path: Path) -> dict[str, Any]:
    """The scenario with `set` in it, checked with every value at the ends of what it may take. Raises ConfigError."""
    base = _scenario_document(campaign, document, path)
    _put(base, campaign.set, document, "set")
    resolved = scenario.dump(_check(base, campaign, document, dict.fromkeys(campaign.drawn(), 0.0), 0))
    problems: dict[tuple[str, int], Problem] = {}

    def attempt(z: Mapping[str, float], run: int, raw: Mapping[str, Any]) -> None:
        try:
            _check(base, campaign, document, z, run, raw)
        except ConfigError as error:
            for problem in error.problems:
                problems.setdefault((problem.mark.source, problem.mark.line), problem)

    middle = dict.fromkeys(campaign.drawn(), 0.0)
    for name, distribution in campaign.drawn().items():
        for value in extremes(distribution):
            attempt(middle, 0, {name: value})
    for k in range(len(campaign.sweep.values) if campaign.sweep else 0):
        attempt(middle, k, {})
    if problems:
        raise ConfigError(sorted(problems.values(), key=lambda p: (p.mark.line, p.mark.column)))
    return resolved


def _scenario_document(campaign: Campaign, document: yamlfile.Document, path: Path) -> yamlfile.Document:
    names, where = paths.scenario_names(), ("scenario",)
    beside = path.parent / campaign.scenario
    file = beside if campaign.scenario not in names and beside.is_file() else None
    try:
        found = yamlfile.load(file or paths.scenario_file(campaign.scenario))
    except ConfigError as error:
        if file is not None or any(p.mark.source.endswith((".yaml", ".yml")) and p.location for p in error.problems):
            raise
        raise ConfigError([Problem(document.mark(where), where, error.problems[0].message)]) from None
    if found.data.get("name") in (None, ""):
        found.data["name"] = Path(campaign.scenario).stem
    scenario.check(copy.deepcopy(found))  # what is wrong in it is its own
    return found


def _put(
    base: yamlfile.Document, values: Mapping[str, Any], document: yamlfile.Document, section: str | None = None
) -> None:
    """Values by path into a scenario's document, blamed on their place in the campaign's. Raises ConfigError."""
    problems = []
    for path, value in values.items():
        where: Location = ("sweep", "path") if section is None else (section, path)
        mark = document.mark(where, key=section is not None)
        keys = path.split(".")
        if not all(re.fullmatch(r"\w+", key) for key in keys):
            problems.append(Problem(mark, where, "is not a path of keys with dots between them"))
            continue
        problem = config.assign(base, keys, value, mark)
        if problem is not None:
            problems.append(problem)
    if problems:
        raise ConfigError(problems)


def _check(
    base: yamlfile.Document,
    campaign: Campaign,
    document: yamlfile.Document,
    z: Mapping[str, float],
    run: int,
    raw: Mapping[str, Any] | None = None,
) -> scenario.Scenario:
    """The scenario for these normals. `raw` are values instead of quantiles, in the file's own units."""
    trial = copy.deepcopy(base)
    values = assemble(campaign, z, run, raw or {})
    held = None if campaign.sweep is None else campaign.sweep.path
    _put(trial, {path: values[path] for path in campaign.dispersions if path != held}, document, "dispersions")
    if held is not None and held not in campaign.variables:
        _put(trial, {held: values[held]}, document)
    try:
        return scenario.check(trial)
    except ConfigError as error:
        problems = [
            Problem(p.mark, p.location, f"{p.message}: limit what is drawn" if raw else p.message)
            for p in error.problems
        ]
        raise ConfigError(problems) from None


__all__ = ["CampaignError", "load", "schema_text"]
