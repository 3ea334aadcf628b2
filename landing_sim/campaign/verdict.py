"""What a campaign proves: PASS, FAIL or NOT ENOUGH EVIDENCE for every risk, by which method, with bounds.

Event      the risk's metric above or below its limits. A landing without the metric that ended otherwise than in a
           go-around counts as the event whatever the risk: a crash before touchdown, an aircraft off the runway, a
           timeout, a numeric error, a draw that no trim exists for. A numeric error, a landing that took its worker down
           and one that failed for our own fault count even where the metric exists. A go-around is no landing: it is
           neither an event nor counted in n, and is reported.
Bounds     the two ends of the two-sided 95 % interval: `upper95` alone holds with 97.5 %, and so does `lower95`.
Methods    "count": exact (Clopper & Pearson 1934), for independent landings. Zero events pass 1e-6 after 3.7 million.
           "tail": a generalised Pareto tail (`tails`), only where its goodness of fit passes and every landing has the
           metric: a tail of those that touched down says nothing of those that did not.
           "rare-event": a subset simulation of this risk (`rare`), where one was flown; the tail is then not asked.
Verdict    PASS where a method's upper bound lies below the risk, FAIL where a method's lower bound lies above it, in the
           order count, rare-event, tail: the first that decides. Else NOT ENOUGH EVIDENCE, with the narrowest bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from scipy.stats import binomtest

from landing_sim.campaign.tails import NoTailError, TailResult, exceedance
from landing_sim.types import Array

PASS, FAIL, OPEN = "PASS", "FAIL", "NOT ENOUGH EVIDENCE"
Method = Literal["count", "rare-event", "tail"]
ALWAYS_EVENTS = ("numeric_error", "worker_killed", "error")


class Risk(Protocol):
    """What must be rare; `campaign.plan.Risk` is one."""

    @property
    def name(self) -> str: ...
    @property
    def metric(self) -> str: ...
    @property
    def above(self) -> float | None: ...
    @property
    def below(self) -> float | None: ...
    @property
    def probability(self) -> float: ...


@dataclass(frozen=True, slots=True)
class Bounds:
    """Estimate and two-sided 95 % interval of a probability."""

    estimate: float
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class Judged:
    """One row of the verdict sheet; a Risk itself."""

    name: str
    metric: str
    above: float | None
    below: float | None
    probability: float  # that must be undercut
    count: int
    n: int
    go_arounds: int  # left out of n
    unmeasured: int  # events because the flight has no metric, part of count
    by_count: Bounds
    tail: TailResult | None
    no_tail: str  # why there is none
    rare: Bounds | None
    method: Method
    lower95: float
    upper95: float
    verdict: str
    notes: tuple[str, ...]

    @property
    def event(self) -> str:
        """The event in words: "sink_rate_mps > 3.05"."""
        parts = [f"{self.metric} < {self.below:g}"] if self.below is not None else []
        parts += [f"{self.metric} > {self.above:g}"] if self.above is not None else []
        return " or ".join(parts)


def events(risk: Risk, values: Array, outcome: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which landings count (n,) bool, and which are the event (n,) bool; see the module."""
    values = np.asarray(values, float)
    known = np.isfinite(values)
    counted = known | (outcome != "go_around")
    beyond = np.zeros(len(values), bool)
    if risk.above is not None:
        beyond |= known & (values > risk.above)
    if risk.below is not None:
        beyond |= known & (values < risk.below)
    return counted, (beyond | ~known | np.isin(outcome, ALWAYS_EVENTS)) & counted


def count_bounds(count: int, n: int) -> Bounds:
    """Clopper-Pearson, two-sided 95 %. Nothing seen of nothing flown is anything."""
    if n == 0:
        return Bounds(math.nan, 0.0, 1.0)
    interval = binomtest(count, n).proportion_ci(0.95, method="exact")
    return Bounds(count / n, float(interval.low), float(interval.high))


def judge(risk: Risk, values: Array, outcome: np.ndarray, rare: Bounds | None = None, seed: int = 0) -> Judged:
    """The verdict on one risk.

    values : (n,) its metric, NaN where a flight has none
    outcome : (n,) how each flight ended
    rare : what a rare-event run of this risk found
    seed : of the tail's bootstrap
    """
    counted, happened = events(risk, values, outcome)
    known = np.isfinite(values) & ~np.isin(outcome, ALWAYS_EVENTS)
    n, count = int(counted.sum()), int(happened.sum())
    unmeasured = int((happened & ~known).sum())
    by_count = count_bounds(count, n)
    tail, no_tail = None, ""
    try:
        tail = exceedance(np.asarray(values, float)[counted & known], risk.above, risk.below, seed=seed)
    except NoTailError as error:
        no_tail = str(error)
    notes: list[str] = [] if tail is None else list(tail.warnings)
    if unmeasured and tail is not None:
        notes.append(f"{unmeasured} flights have no {risk.metric}: they count as events, and the tail proves nothing")

    found: list[tuple[Method, Bounds]] = [("count", by_count)]
    if rare is not None:
        found.append(("rare-event", rare))
    elif tail is not None and tail.good and not unmeasured:
        found.append(("tail", Bounds(tail.probability, tail.lower, tail.upper)))
    method, bounds, verdict = _decide(found, risk.probability)
    return Judged(
        name=risk.name,
        metric=risk.metric,
        above=risk.above,
        below=risk.below,
        probability=risk.probability,
        count=count,
        n=n,
        go_arounds=int((~counted).sum()),
        unmeasured=unmeasured,
        by_count=by_count,
        tail=tail,
        no_tail=no_tail,
        rare=rare,
        method=method,
        lower95=bounds.lower,
        upper95=bounds.upper,
        verdict=verdict,
        notes=tuple(notes),
    )


def _decide(found: Sequence[tuple[Method, Bounds]], limit: float) -> tuple[Method, Bounds, str]:
    for method, bounds in found:
        if bounds.upper < limit:
            return method, bounds, PASS
        if bounds.lower > limit:
            return method, bounds, FAIL
    method, bounds = min(found, key=lambda item: item[1].upper)
    return method, bounds, OPEN


def sheet(
    risks: Iterable[Risk],
    columns: Mapping[str, Array],
    outcome: np.ndarray,
    rare: Mapping[str, Bounds] | None = None,
    seed: int = 0,
) -> tuple[Judged, ...]:
    """Every risk's verdict; `rare` by the risks' names. Raises KeyError where a metric has no column."""
    return tuple(judge(risk, columns[risk.metric], outcome, (rare or {}).get(risk.name), seed) for risk in risks)


@dataclass(frozen=True, slots=True)
class Swept:
    """A risk over a sweep: its verdict at each value, and the largest one up to which all are PASS (None if none is)."""

    name: str
    values: tuple[float, ...]
    judged: tuple[Judged, ...]
    largest_passing: float | None


def sweep(
    risks: Iterable[Risk],
    held: Array,
    columns: Mapping[str, Array],
    outcome: np.ndarray,
    seed: int = 0,
    rare: Mapping[str, Bounds] | None = None,
    rare_at: float | None = None,
) -> tuple[Swept, ...]:
    """The verdicts at every value that was held, by magnitude, smallest first.

    held : (n,) the swept column
    rare, rare_at : what rare-event runs found, by the risks' names, and the value that they held
    """
    values = sorted({float(v) for v in held}, key=lambda v: (abs(v), v))
    found = []
    for risk in risks:
        rows = []
        for v in values:
            known = (rare or {}).get(risk.name) if v == rare_at else None
            rows.append(judge(risk, columns[risk.metric][held == v], outcome[held == v], known, seed))
        passing = [v for i, v in enumerate(values) if all(row.verdict == PASS for row in rows[: i + 1])]
        found.append(Swept(risk.name, tuple(values), tuple(rows), passing[-1] if passing else None))
    return tuple(found)


def to_json(judged: Judged) -> dict[str, Any]:
    """A row as `campaign --json` prints it. `limit` is the probability; `above` and `below` are those of the metric."""
    return {
        "name": judged.name,
        "limit": judged.probability,
        "count": judged.count,
        "n": judged.n,
        "upper95": judged.upper95,
        "lower95": judged.lower95,
        "method": judged.method,
        "verdict": judged.verdict,
        "metric": judged.metric,
        "above": judged.above,
        "below": judged.below,
        "notes": list(judged.notes),
    }
