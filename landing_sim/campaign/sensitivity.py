"""Which dispersions explain a figure's scatter, from the campaign's own landings: no flight is flown for it.

Regression   standardised rank regression coefficients: least squares of the figure's rank on the inputs' ranks, each scaled
             to unit variance. Squared they are, for inputs that do not depend on each other, the shares of the ranks'
             variance; R^2 says how much of it monotonic effects explain at all. Intervals by bootstrap over landings.
Sobol        first-order indices Var(E[y | x]) / Var(y), effects that rise and fall included, estimated from the given
             sample by binning x into equally filled bins: the variance of the bins' means, less what chance alone gives,
                 S = 1 - (n - 1) / (n - m) SSW / SST,       m bins, SSW within them, SST in all,
             the adjusted R^2 of a step function (epsilon squared, Kelley 1935): its mean is 0 where x explains nothing.
             Intervals by bootstrap. sqrt(n)/2 bins: finer ones resolve more and add noise.
Only what was drawn is asked for: correlated inputs share their effect between them, in regression by the least squares,
in the indices each with all of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr
from scipy.stats import rankdata

from landing_sim.noise import Noise
from landing_sim.types import Array

FEWEST = 50  # landings to say anything about
RESAMPLES = 200


@dataclass(frozen=True, slots=True)
class Effect:
    """One input's part in a figure's scatter, each with its two-sided 95 % interval."""

    name: str
    srrc: float  # standardised rank regression coefficient; its sign is the effect's
    srrc_low: float
    srrc_high: float
    first_order: float  # Sobol index
    first_order_low: float
    first_order_high: float


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Of one figure, the strongest effect first."""

    metric: str
    n: int
    r_squared: float  # of the rank regression
    effects: tuple[Effect, ...]


def sensitivity(
    metric: str,
    values: Array,
    inputs: Mapping[str, Array],
    *,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Sensitivity | None:
    """What explains `values` (n,); landings without a finite value or input are left out. None if too few are left.

    inputs : (n,) each, by name; one that never varies explains nothing and is left out
    """
    y = np.asarray(values, float)
    columns = {name: np.asarray(x, float) for name, x in inputs.items()}
    use = np.isfinite(y)
    for x in columns.values():
        use &= np.isfinite(x)
    columns = {name: x[use] for name, x in columns.items() if len(np.unique(x[use])) > 1}
    y, n = y[use], int(use.sum())
    if n < max(FEWEST, 3 * len(columns)) or not columns or np.ptp(y) == 0.0:
        return None
    X = np.column_stack(list(columns.values()))
    ranks, target, bins = rankdata(X, axis=0), rankdata(y), _bins(X, _bin_count(n))
    found, r_squared = _regression(ranks, target)
    index = _explained(bins, y)
    picks = (ndtr(Noise(seed, f"sensitivity {metric}").normal(resamples * n)) * n).astype(int).reshape(resamples, n)
    picks = np.minimum(picks, n - 1)
    # ranks and bins stay those of the sample: of a resample, where landings stand several times, they would be others
    again = np.array([_regression(ranks[pick], target[pick])[0] for pick in picks])
    indices = np.array([_explained(bins[pick], y[pick]) for pick in picks])
    # standing several times looks like an effect to bins: centred on the sample's own
    indices += index - indices.mean(axis=0)
    low, high = np.quantile(again, [0.025, 0.975], axis=0)
    index_low, index_high = np.clip(np.quantile(indices, [0.025, 0.975], axis=0), 0.0, 1.0)
    effects = [
        Effect(
            name,
            float(found[i]),
            float(low[i]),
            float(high[i]),
            float(np.clip(index[i], 0.0, 1.0)),
            float(index_low[i]),
            float(index_high[i]),
        )
        for i, name in enumerate(columns)
    ]
    strength = sorted(effects, key=lambda e: -max(e.first_order, e.srrc**2))
    return Sensitivity(metric, n, r_squared, tuple(strength))


def _regression(ranks: Array, target: Array) -> tuple[Array, float]:
    """Coefficients (k,) of standardised ranks (n, k) for the target's, and R^2."""
    spread = ranks.std(axis=0)
    ranks = (ranks - ranks.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    target = (target - target.mean()) / (target.std() or 1.0)
    coefficients = np.asarray(np.linalg.lstsq(ranks.T @ ranks, ranks.T @ target, rcond=None)[0], np.float64)
    return coefficients, 1.0 - float(np.mean((target - ranks @ coefficients) ** 2))


def first_order(X: Array, y: Array, bins: int | None = None) -> Array:
    """First-order Sobol indices (k,) of y (n,) to the columns of X (n, k), from any sample; may fall a little below 0."""
    return _explained(_bins(X, bins or _bin_count(len(y))), y)


def _bin_count(n: int) -> int:
    return max(2, round(0.5 * math.sqrt(n)))


def _bins(X: Array, m: int) -> np.ndarray:
    """(n, k) which of m equally filled bins; equal values share one: a word or a switch has as many bins as values."""
    return np.minimum(((rankdata(X, method="min", axis=0) - 1.0) * m / len(X)).astype(int), m - 1)


def _explained(bins: np.ndarray, y: Array) -> Array:
    """(k,) share of y's variance that lies between the bins, less what chance alone puts there."""
    n, m = len(y), int(bins.max()) + 1
    centred = y - y.mean()
    total = float(centred @ centred)
    if total == 0.0:
        return np.zeros(bins.shape[1])
    found = []
    for column in bins.T:
        count = np.bincount(column, minlength=m)
        sums = np.bincount(column, weights=centred, minlength=m)
        between = float(np.sum(sums**2 / np.maximum(count, 1)))
        found.append(1.0 - (n - 1) / (n - np.count_nonzero(count)) * (1.0 - between / total))
    return np.array(found)


def strongest(
    metrics: Sequence[str], columns: Mapping[str, Array], inputs: Sequence[str], seed: int = 0
) -> tuple[Sensitivity, ...]:
    """Of every metric that has a column and enough landings."""
    wanted = {name: columns[name] for name in inputs if name in columns}
    found = (sensitivity(metric, columns[metric], wanted, seed=seed) for metric in metrics if metric in columns)
    return tuple(one for one in found if one is not None)
