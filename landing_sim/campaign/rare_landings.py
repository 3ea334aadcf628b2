"""Rare events on a campaign's own landings: subset simulation of one risk, and the gust that breaks it.

A state is a chain of (run, rho), see `rare.ChainNoise`: its first link alone is run k of the campaign (of one without
Sobol sampling), so the first level repeats landings that the campaign has. Every random number moves: dispersions,
turbulence, sensors. With a sweep, all states hold one of its values.
A go-around is no event, as in the verdict; but here it stays in the denominator: P(event) is that of an approach.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.campaign import landing
from landing_sim.campaign.falsify import Gust
from landing_sim.campaign.plan import Plan
from landing_sim.campaign.rare import ChainNoise, Estimate
from landing_sim.campaign.run import evaluate
from landing_sim.campaign.verdict import ALWAYS_EVENTS, Bounds, Risk
from landing_sim.errors import ConfigError
from landing_sim.noise import NoiseStream
from landing_sim.papers.report import write
from landing_sim.types import Array

FILE = "rare.json"
FRESH = 100_000_000  # the first run number that moves take, beyond any campaign's
Links = tuple[tuple[int, float], ...]


@dataclass(frozen=True, slots=True)
class Job:
    """One landing to fly, and the figure wanted of it."""

    at: int  # its place among those asked for together
    links: Links
    run: int  # says which of a sweep's values is held
    metric: str


def noise_of(seed: int, links: Links) -> Callable[[str], NoiseStream]:
    """Where a landing at the end of a chain takes its random numbers from."""
    return lambda name: ChainNoise(seed, name, links)


def fly(plan: Plan, job: Job) -> tuple[str, float]:
    """Outcome and figure: what a worker does."""
    try:
        wanted, flight = landing.fly(plan, job.run, noise=noise_of(plan.campaign.seed, job.links))
    except ConfigError:
        return "cannot_fly", math.nan
    return flight.verdict.outcome, landing.measure(flight, wanted)[job.metric]


def badness(risk: Risk, outcome: str, value: float) -> float:
    """By how much a landing is the risk's event, in the metric's unit, > 0 if it is; without the metric as in `verdict`."""
    if outcome in ALWAYS_EVENTS:
        return math.inf
    if not math.isfinite(value):
        return -math.inf if outcome == "go_around" else math.inf
    above = -math.inf if risk.above is None else value - risk.above
    below = -math.inf if risk.below is None else risk.below - value
    return max(above, below)


@dataclass(slots=True)
class Landings:
    """rare.Space of a campaign's landings.

    held : index of the sweep's value that is held
    """

    plan: Plan
    risk: Risk
    workers: int | None = None
    held: int = 0
    flown: int = 0
    _next: int = field(default=FRESH)

    def first(self, n: int) -> list[Links]:
        return [((k, 0.0),) for k in range(n)]

    def moved(self, states: Sequence[Links], rho: float) -> list[Links]:
        begin, self._next = self._next, self._next + len(states)
        return [(*links, (begin + k, rho)) for k, links in enumerate(states)]

    def performance(self, states: Sequence[Links]) -> Array:
        """Raises RuntimeError where a landing fails for a reason that is not the aircraft's."""
        jobs = [Job(at, links, self.held, self.risk.metric) for at, links in enumerate(states)]
        found = np.full(len(jobs), math.inf)  # of a landing that took its worker down twice
        for done in evaluate(self.plan, fly, jobs, self.workers):
            if done.error:
                raise RuntimeError(f"landing {done.job.links} failed:\n{done.error}")
            if done.value is not None:
                found[done.job.at] = badness(self.risk, *done.value)
            self.flown += 1
        return found


def gust_margin(plan: Plan, risk: Risk, run: int = 0) -> Callable[[Gust], float]:
    """By how much run `run` breaks the limit when it meets a gust: what `falsify.falsify` asks."""

    def margin(gust: Gust) -> float:
        wanted, flight = landing.fly(plan, run, changes=gust.changes())
        return badness(risk, flight.verdict.outcome, landing.measure(flight, wanted)[risk.metric])

    return margin


def save(folder: Path, plan: Plan, risk: Risk, estimate: Estimate[Links], **what: Any) -> Path:
    """Add what was found of a risk to the campaign's folder, in place of an earlier run of it."""
    kept = _read(folder, plan)
    kept[risk.name] = {
        **asdict(estimate),
        "metric": risk.metric,
        "above": risk.above,
        "below": risk.below,
        **what,
    }
    text = json.dumps({"identity": plan.identity(), "risks": kept}, indent=1, default=float)
    write(text.replace("Infinity", "1e999").replace("NaN", "null") + "\n", folder / FILE)
    return folder / FILE


def saved(folder: Path, plan: Plan) -> dict[str, Bounds]:
    """Bounds by the risks' names, of the runs of this very campaign and these very limits, at the value a sweep aims at."""
    limits = {risk.name: (risk.metric, risk.above, risk.below) for risk in plan.campaign.risks}
    return {
        name: Bounds(found["probability"], found["lower"], found["upper"])
        for name, found in _read(folder, plan).items()
        if limits.get(name) == (found["metric"], found["above"], found["below"]) and found.get("held") == aimed(plan)
    }


def aimed(plan: Plan) -> float | None:
    """The value of a sweep that the campaign's verdict is about, as the file gives it; None without a sweep."""
    sweep = plan.campaign.sweep
    return None if sweep is None else sweep.values[-1] if sweep.aim is None else sweep.aim


def details(folder: Path, plan: Plan) -> Mapping[str, Mapping[str, Any]]:
    """All that was kept of each rare-event run, for the report."""
    return _read(folder, plan)


def _read(folder: Path, plan: Plan) -> dict[str, Any]:
    try:
        found = json.loads((folder / FILE).read_text())
    except (OSError, ValueError):
        return {}
    return dict(found["risks"]) if found.get("identity") == plan.identity() else {}
