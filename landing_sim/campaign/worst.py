"""Which variable is worst for which risk: each in turn is held at the ends of what it takes, all else dispersed as ever."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landing_sim.campaign import run, store
from landing_sim.campaign.distributions import Choice, quantile
from landing_sim.campaign.plan import Campaign, Plan, Sweep
from landing_sim.campaign.units import factor
from landing_sim.campaign.verdict import Risk, events

EDGE = 2.3263478740408408  # [sigma] of the normal behind a variable: its 1st and 99th percentile


@dataclass(frozen=True, slots=True)
class Held:
    """A risk while a variable was held."""

    name: str
    value: float  # in the unit that the variable's name ends in
    risk: str
    count: int
    n: int
    sigmas: float  # from the metric's mean to its limit, in standard deviations: less is worse; NaN without two figures

    @property
    def share(self) -> float:
        """Of landings that were the event."""
        return self.count / self.n if self.n else 0.0


def ends(campaign: Campaign, name: str) -> tuple[float, ...]:
    """Where a drawn variable is held, in the unit that its name ends in. Raises ValueError for a choice of words."""
    distribution = campaign.drawn()[name]
    kind = distribution.kind
    if isinstance(kind, Choice):
        if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in kind.values):
            raise ValueError(f"{name} is chosen from words: there is no end to hold it at")
        return tuple(sorted({float(value) for value in kind.values}))  # type: ignore[arg-type]
    scale = factor(name, distribution.unit)
    return tuple(float(scale * quantile(distribution, z)) for z in (-EDGE, EDGE))


def holding(plan: Plan, name: str, values: Iterable[float], runs: int) -> Plan:
    """The same campaign with a variable held at values in the unit that its name ends in, `runs` landings each."""
    sweep = Sweep(path=name, values=tuple(values))
    campaign = plan.campaign.model_copy(
        update={
            "sweep": sweep,
            "runs": runs * len(sweep.values),
            "keep": "none",
            "name": f"{plan.campaign.name}-{name}",
        }
    )
    groups = tuple(group for group in campaign.correlations if name not in group.of)  # what is held goes with nothing
    return Plan(campaign.model_copy(update={"correlations": groups}), plan.scenario, plan.label)


def worst(
    plan: Plan,
    folder: Path,
    runs: int,
    names: Iterable[str] | None = None,
    workers: int | None = None,
    told: Callable[[str, tuple[float, ...]], None] | None = None,
) -> list[Held]:
    """Fly it: every drawn variable but words, or those in `names`; resumes in `folder`. Worst first, risk by risk.

    told : hears which variable is held next, and where
    """
    found = []
    for name in plan.campaign.drawn() if names is None else names:
        try:
            values = ends(plan.campaign, name)
        except ValueError:
            if names is not None:
                raise
            continue
        if told is not None:
            told(name, values)
        held = holding(plan, name, values, runs)
        run.fly(held, folder / name, workers)
        results = store.read(folder / name)
        for value in values:
            use = results.columns[name] == value
            for risk in plan.campaign.risks:
                found.append(_held(name, value, risk, results.columns[risk.metric][use], results.outcome[use]))
    order = [risk.name for risk in plan.campaign.risks]
    return sorted(found, key=lambda h: (order.index(h.risk), -h.share, math.isnan(h.sigmas), h.sigmas))


def _held(name: str, value: float, risk: Risk, metric: np.ndarray, outcome: np.ndarray) -> Held:
    counted, happened = events(risk, metric, outcome)
    known = metric[np.isfinite(metric)]
    sigmas = math.nan
    if len(known) > 1 and known.std(ddof=1) > 0.0:
        mean, sd = known.mean(), known.std(ddof=1)
        above = math.inf if risk.above is None else (risk.above - mean) / sd
        below = math.inf if risk.below is None else (mean - risk.below) / sd
        sigmas = float(min(above, below))
    return Held(name, value, risk.name, int(happened.sum()), int(counted.sum()), sigmas)
