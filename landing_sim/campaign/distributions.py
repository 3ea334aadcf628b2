"""Distributions of dispersed values as a campaign file has them, and their quantiles.

Every value is a function of one standard normal z: u = Phi(z) is what it is the quantile of. So correlation is one of the
normals (a Gaussian copula), and a rare-event method moves all values by moving their normals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from landing_sim.config import Section
from landing_sim.types import Array

Unit = Annotated[str | None, Field(description="kt, ft, t, ...; null = the unit at the end of the value's name")]
Word = float | int | bool | str | None
EXTREME = 8.0  # [sigma] as far as a standard normal is taken to reach: beyond it once in 1e15


class Normal(Section):
    """Gaussian."""

    mean: float = Field(description="mean")
    sd: float = Field(gt=0, description="standard deviation")
    unit: Unit = None


class TruncatedNormal(Section):
    """Gaussian, cut at both limits and scaled up to 1 again."""

    mean: float = Field(description="of the Gaussian before it is cut")
    sd: float = Field(gt=0, description="of the Gaussian before it is cut")
    low: float = Field(description="lowest value")
    high: float = Field(description="highest value")
    unit: Unit = None

    @model_validator(mode="after")
    def _consistent(self) -> TruncatedNormal:
        _ordered(self.low, self.high)
        if not max((self.low - self.mean) / self.sd, (self.mean - self.high) / self.sd) < 6.0:
            raise ValueError("low ... high lies 6 or more sd beside the mean: hardly anything is left")
        return self


class Uniform(Section):
    """Every value between the limits alike."""

    low: float = Field(description="lowest value")
    high: float = Field(description="highest value")
    unit: Unit = None

    @model_validator(mode="after")
    def _consistent(self) -> Uniform:
        _ordered(self.low, self.high)
        return self


class Table(Section):
    """Bins [low, high, weight], uniform within each. Weights are scaled to 1 together."""

    bins: tuple[tuple[float, float, Annotated[float, Field(ge=0)]], ...] = Field(
        min_length=1, max_length=1000, description="[low, high, weight] each, in ascending order"
    )
    unit: Unit = None

    @model_validator(mode="after")
    def _consistent(self) -> Table:
        for low, high, _ in self.bins:
            _ordered(low, high)
        for (_, high, _), (low, _, _) in zip(self.bins, self.bins[1:]):
            if low < high:
                raise ValueError(f"bins overlap or are not in ascending order: {low:g} follows {high:g}")
        if not sum(weight for *_, weight in self.bins) > 0.0:
            raise ValueError("all weights are 0")
        return self


class Choice(Section):
    """One of several values: numbers, words, truth values."""

    values: tuple[Word, ...] = Field(min_length=1, max_length=1000, description="what is chosen from")
    weights: tuple[Annotated[float, Field(ge=0)], ...] | None = Field(None, description="null = all alike")

    @model_validator(mode="after")
    def _consistent(self) -> Choice:
        if self.weights is not None and len(self.weights) != len(self.values):
            raise ValueError(f"{len(self.weights)} weights for {len(self.values)} values")
        if self.weights is not None and not sum(self.weights) > 0.0:
            raise ValueError("all weights are 0")
        return self


class Derived(Section):
    """Made from what stands above it: offset + scale * value, or * the root of the sum of squares of several values."""

    of: str | tuple[str, ...] = Field(description="a variable or dispersed path that stands above, or a list of them")
    scale: float = Field(1.0, description="factor")
    offset: float = Field(0.0, description="added")

    @property
    def parts(self) -> tuple[str, ...]:
        return (self.of,) if isinstance(self.of, str) else self.of


class Distribution(Section):
    """Exactly one of its keys, which says what kind it is."""

    normal: Normal | None = Field(None, description="Gaussian")
    truncated_normal: TruncatedNormal | None = Field(None, description="Gaussian within limits")
    uniform: Uniform | None = Field(None, description="between limits")
    table: Table | None = Field(None, description="weighted bins")
    choice: Choice | None = Field(None, description="one of several")
    derived: Derived | None = Field(None, description="made from other values")

    @model_validator(mode="after")
    def _one(self) -> Distribution:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            kinds = ", ".join(type(self).model_fields)
            raise ValueError(f"needs exactly one of {kinds}, not {' and '.join(given) or 'none'}")
        return self

    @property
    def kind(self) -> Normal | TruncatedNormal | Uniform | Table | Choice | Derived:
        return next(getattr(self, name) for name in type(self).model_fields if getattr(self, name) is not None)

    @property
    def unit(self) -> str | None:
        return getattr(self.kind, "unit", None)


class Correlation(Section):
    """Of the normals behind several values: their own correlation where both are normal, else a Gaussian copula."""

    of: tuple[str, ...] = Field(min_length=2, max_length=100, description="variables or dispersed paths that are drawn")
    matrix: tuple[tuple[Annotated[float, Field(ge=-1, le=1)], ...], ...] = Field(
        description="symmetric, 1 on the diagonal, positive definite"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Correlation:
        n = len(self.of)
        if len(set(self.of)) < n:
            raise ValueError("a name stands twice in `of`")
        if [len(row) for row in self.matrix] != [n] * n:
            raise ValueError(f"the matrix must be {n} by {n}, as `of` has {n} names")
        C = np.array(self.matrix)
        if not np.array_equal(C, C.T) or not (C.diagonal() == 1.0).all():
            raise ValueError("the matrix must be symmetric with 1 on its diagonal")
        if not np.linalg.eigvalsh(C)[0] > 1e-9:
            raise ValueError("no values have such correlations: the matrix is not positive definite")
        return self

    def factor(self) -> Array:
        """(n, n) lower triangular L with L L' = matrix."""
        return np.linalg.cholesky(np.array(self.matrix))


def quantile(distribution: Distribution, z: float) -> Any:
    """The value below which a share Phi(z) lies, in the unit the file gives it in. Not for derived values."""
    from scipy.special import ndtr, ndtri

    match distribution.kind:
        case Normal() as d:
            return d.mean + d.sd * z
        case TruncatedNormal() as d:
            # in the tail that is nearer, where probabilities are small numbers and not 1 minus small numbers
            a, b = (d.low - d.mean) / d.sd, (d.high - d.mean) / d.sd
            below, above = ndtr(a), ndtr(-b)
            share = 1.0 - below - above
            x = ndtri(below + share * ndtr(z)) if z < 0.0 else -ndtri(above + share * ndtr(-z))
            return float(min(max(d.mean + d.sd * x, d.low), d.high))
        case Uniform() as d:
            return d.low + (d.high - d.low) * float(ndtr(z))
        case Table() as d:
            weights = np.array([weight for *_, weight in d.bins])
            k, within = _pick(weights, float(ndtr(z)))
            low, high, _ = d.bins[k]
            return low + (high - low) * within
        case Choice() as d:
            weights = np.ones(len(d.values)) if d.weights is None else np.array(d.weights)
            return d.values[_pick(weights, float(ndtr(z)))[0]]
    raise TypeError(f"{distribution.kind} is not drawn")


def derive(distribution: Derived, known: Mapping[str, Any]) -> float:
    """From values that are known."""
    parts = [known[name] for name in distribution.parts]
    value = parts[0] if isinstance(distribution.of, str) else math.hypot(*parts)
    return float(distribution.offset + distribution.scale * value)


def extremes(distribution: Distribution) -> tuple[Any, ...]:
    """Values at the ends of what can be drawn, all values of a choice; in the unit the file gives them in."""
    kind = distribution.kind
    if isinstance(kind, Choice):
        return kind.values
    return quantile(distribution, -EXTREME), quantile(distribution, EXTREME)


def _pick(weights: Array, u: float) -> tuple[int, float]:
    """Which bin holds a share u of the weight, and how far in it lies, 0 .. 1."""
    edges = np.concatenate([[0.0], np.cumsum(weights)]) / weights.sum()
    k = min(int(np.searchsorted(edges, u, side="right")) - 1, len(weights) - 1)
    while weights[k] == 0.0:  # u = 1 falls behind the last bin
        k -= 1
    return k, min(max((u - edges[k]) / (edges[k + 1] - edges[k]), 0.0), 1.0)


def _ordered(low: float, high: float) -> None:
    if not low < high:
        raise ValueError(f"low = {low:g} must be below high = {high:g}")
