"""A paper's claims as data: what it says, how that is measured, and what then is the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

Outcome = Literal["met", "not_met", "not_comparable"]


class Job(Protocol):
    """Something to carry out once for all claims that need it: a flight, a simulation. Hashable by what it does."""

    def told(self) -> str:
        """One line for whoever waits."""

    def setting(self) -> tuple[str, str]:
        """What it is, and what was changed or chosen: the report's list of them, but for the seeds."""

    def seeds(self) -> tuple[int, ...]: ...


@dataclass(frozen=True, slots=True)
class Measured:
    """A figure of ours, and what to say about it."""

    value: float
    note: str = ""


Measure = Callable[[Sequence[Any]], Measured]
"""From the results of a claim's jobs, in their order."""


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of a paper.

    how : what is measured, in words
    measure : does so; it gets the results of `runs` in that order
    met : whether a value agrees with the paper; None where nothing can be compared, and `reason` says why
    """

    id: str
    statement: str
    where: str
    paper_value: float | None
    unit: str
    how: str
    runs: tuple[Job, ...]
    measure: Measure
    met: Callable[[float], bool] | None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """A claim with its verdict."""

    claim: Claim
    value: float
    verdict: Outcome
    note: str


def at_most(limit: float) -> Callable[[float], bool]:
    return lambda value: abs(value) <= limit


def about(value: float, tolerance: float) -> Callable[[float], bool]:
    return lambda ours: abs(ours - value) <= tolerance


def at_least(limit: float) -> Callable[[float], bool]:
    return lambda value: value >= limit


def runs_of(claims: Iterable[Claim]) -> tuple[Job, ...]:
    """Every job that any claim needs, once, in order of first mention."""
    return tuple(dict.fromkeys(run for claim in claims for run in claim.runs))


def evaluate(claims: Iterable[Claim], flown: Mapping[Any, Any]) -> list[Row]:
    """The verdict on each claim. A value that does not exist (NaN) meets nothing."""
    rows = []
    for claim in claims:
        found = claim.measure([flown[run] for run in claim.runs])
        note = "; ".join(text for text in (found.note, claim.reason) if text)
        if claim.met is None:
            rows.append(Row(claim, found.value, "not_comparable", note))
        else:
            agrees = math.isfinite(found.value) and claim.met(found.value)
            rows.append(Row(claim, found.value, "met" if agrees else "not_met", note))
    return rows


def to_json(paper: str, rows: Iterable[Row]) -> dict[str, Any]:
    """The object that `reproduce --json` prints."""
    return {
        "paper": paper,
        "claims": [
            {
                "id": row.claim.id,
                "statement": row.claim.statement,
                "where": row.claim.where,
                "paper_value": row.claim.paper_value,
                "our_value": row.value if math.isfinite(row.value) else None,
                "unit": row.claim.unit,
                "verdict": row.verdict,
                "note": row.note,
            }
            for row in rows
        ],
    }
