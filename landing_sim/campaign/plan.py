"""What a campaign is: which scenario, what is dispersed how, how often it is flown, and which risks must be shown."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from landing_sim import paths
from landing_sim.campaign import figures
from landing_sim.campaign.distributions import Correlation, Derived, Distribution, Unit, derive, quantile
from landing_sim.campaign.units import factor
from landing_sim.config import Section
from landing_sim.errors import ConfigError


class CampaignError(ConfigError):
    """A campaign that cannot be flown as written."""


class Risk(Section):
    """An event that must be rare: a figure of the flight above or below a limit."""

    name: str = Field(min_length=1, max_length=100, description="what the event is called")
    metric: str = Field(description="a criterion's metric, touchdown_sideslip_deg or gear_height_60m_m")
    above: float | None = Field(None, description="the event is a value above this; null = none")
    below: float | None = Field(None, description="the event is a value below this; null = none")
    probability: float = Field(gt=0, lt=1, description="what must be shown: the event is rarer than this")
    source: str = Field("", max_length=200, description="where the limit comes from")


class Sweep(Section):
    """One value held in turn at each of several: landing k flies with values[k % n]. What a limit campaign does.

    Where it is dispersed as well, it is held instead.
    """

    path: str = Field(description="path of the scenario's value, or name of a variable")
    values: tuple[float, ...] = Field(min_length=1, max_length=1000, description="in the order they are tried")
    unit: Unit = None
    aim: float | None = Field(None, description="the one that the campaign's verdict is about; null = the last")


class Campaign(Section):
    """Many landings of one scenario."""

    schema_version: Literal[1] = Field(description="version of this format")
    scenario: str = Field(min_length=1, description="a shipped scenario, or a file beside this one")
    name: str = Field(
        "", max_length=100, pattern=r"^[^/\\\x00-\x1f\x7f]*$", description="short name; the file's own if left out"
    )
    description: str = Field("", max_length=2000, description="what it is for")
    runs: int = Field(1000, ge=1, le=10_000_000, description="landings")
    seed: int = Field(1, ge=0, lt=2**63, description="root of all random numbers")
    sampling: Literal["random", "sobol"] = Field(
        "random", description="independent draws, or a scrambled Sobol sequence over all that is drawn"
    )
    keep: Literal["all", "none", "failures"] = Field(
        "failures",
        description="time histories: of all landings, none, or those that did not land or met a risk's event",
    )
    set: dict[str, Any] = Field({}, description="values of the scenario that are other than in its file, by path")
    variables: dict[Annotated[str, Field(pattern=r"^[A-Za-z]\w*$")], Distribution] = Field(
        {}, max_length=500, description="drawn values that are none of the scenario's, for others to be derived from"
    )
    dispersions: dict[str, Distribution] = Field(
        {}, max_length=500, description="values of the scenario that are dispersed, by path"
    )
    correlations: tuple[Correlation, ...] = Field((), max_length=100, description="between what is drawn")
    sweep: Sweep | None = Field(None, description="null = everything is dispersed")
    risks: tuple[Risk, ...] = Field((), max_length=100, description="what the verdict is about")

    def drawn(self) -> dict[str, Distribution]:
        """What takes a random number, by name or path; in the file's order, which is that of Sobol dimensions."""
        held = None if self.sweep is None else self.sweep.path
        return {name: d for name, d in self._all().items() if d.derived is None and name != held}

    def names(self) -> list[str]:
        """Of all that is drawn, derived or held."""
        held = [] if self.sweep is None or self.sweep.path in self._all() else [self.sweep.path]
        return [*self._all(), *held]

    def dispersed_paths(self) -> list[str]:
        """Of the scenario's values that each landing has its own of."""
        return [name for name in self.names() if name not in self.variables]

    def _all(self) -> dict[str, Distribution]:
        return {**self.variables, **self.dispersions}


@dataclass(frozen=True, slots=True)
class Plan:
    """A campaign and the scenario it disperses, resolved: all that a worker on another machine needs."""

    campaign: Campaign
    scenario: Mapping[str, Any]  # as scenario.dump gives it, with the campaign's `set` in it
    label: str  # the campaign as the user named it

    def identity(self) -> str:
        """Changes with whatever would change a landing: not with the number of landings, risks or texts."""
        kept = self.campaign.model_dump(
            mode="json", exclude={"runs", "name", "description", "scenario", "set", "risks", "keep"}
        )
        scenario = {
            key: value for key, value in self.scenario.items() if key not in ("name", "description", "criteria")
        }
        digest = hashlib.sha256(json.dumps([kept, scenario], sort_keys=True).encode())
        folder = self._folder()
        for file in sorted(p for p in folder.rglob("*") if p.suffix in (".xml", ".yaml")):
            digest.update(file.relative_to(folder).as_posix().encode())
            digest.update(file.read_bytes())
        return digest.hexdigest()

    @property
    def mission(self) -> str:
        """The scenario's."""
        return str(self.scenario["mission"])

    def figures(self) -> tuple[str, ...]:
        """Columns of the results that every flight has."""
        return figures.figures(self.mission)

    def _folder(self) -> Path:
        if self.mission in figures.FOLDERS:
            return paths.data_folder("aircraft") / figures.FOLDERS[self.mission]
        return paths.aircraft_folder(str(self.scenario["aircraft"]["model"]))


def assemble(
    campaign: Campaign, z: Mapping[str, float], run: int, raw: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Every drawn, derived and swept value of a landing, by name or path, in the units of their names.

    z : (correlated) standard normal of everything drawn
    raw : values instead of quantiles, in the file's own units
    """
    values: dict[str, Any] = {}
    sweep = campaign.sweep
    if sweep is not None:
        values[sweep.path] = sweep.values[run % len(sweep.values)] * factor(sweep.path, sweep.unit)
    for name, distribution in {**campaign.variables, **campaign.dispersions}.items():
        if name in values:
            continue
        if isinstance(distribution.kind, Derived):
            values[name] = derive(distribution.kind, values)
            continue
        value = raw[name] if raw and name in raw else quantile(distribution, z[name])
        scale = factor(name, distribution.unit)
        values[name] = value if scale == 1.0 else scale * value
    return values
