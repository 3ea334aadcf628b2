"""What a paper brings to its report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from landing_sim.papers.claims import Claim
from landing_sim.papers.drawing import Figure


@dataclass(frozen=True, slots=True)
class Paper:
    """Its claims, how a job of theirs is carried out, and how the figures are drawn from all results."""

    name: str
    title: str
    lead: str  # what the table compares
    figures_lead: str
    runs_title: str
    runs_lead: str
    claims: tuple[Claim, ...]
    perform: Callable[[Any], Any]  # a job of the claims -> its result
    figures: Callable[[Mapping[Any, Any]], list[Figure]]  # from job -> result
