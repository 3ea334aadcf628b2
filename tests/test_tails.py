"""Tails: the fit on known distributions, how often the interval holds the truth, and when a fit must not be believed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from landing_sim.campaign.tails import NoTailError, exceedance, fit_pareto, survival

KNOWN = {
    "normal": stats.norm(),
    "exponential": stats.expon(),
    "t4": stats.t(4),
    "uniform": stats.uniform(),
    "gumbel": stats.gumbel_r(),
    "lognormal": stats.lognorm(0.5),
}


@pytest.mark.parametrize("xi", [-0.4, -0.1, 0.0, 0.2, 0.6])
def test_fit_finds_shape_and_scale(xi: float) -> None:
    """The mean of 200 fits to 100 excesses; their scatter is near the theory's (1 + xi)/sqrt(k)."""
    y = stats.genpareto(xi, scale=3.0).rvs((200, 100), random_state=np.random.default_rng(1))
    shape, scale = fit_pareto(np.sort(y, axis=1))
    assert np.mean(shape) == pytest.approx(xi, abs=0.04)
    assert np.mean(scale) == pytest.approx(3.0, rel=0.05)
    assert np.std(shape) < 1.25 * (1 + xi) / math.sqrt(100) + 0.03


def test_fit_is_nearly_maximum_likelihood() -> None:
    """Its likelihood is within a hair of what scipy's maximum likelihood reaches."""
    rng = np.random.default_rng(2)
    for xi in (-0.3, 0.0, 0.4):
        y = np.sort(stats.genpareto(xi).rvs(120, random_state=rng))
        (shape,), (scale,) = fit_pareto(y[None])
        ours = stats.genpareto(shape, scale=scale).logpdf(y).sum()
        best = stats.genpareto(*stats.genpareto.fit(y, floc=0.0)).logpdf(y).sum()
        assert best - 0.5 < ours <= best + 1e-3


def test_survival_is_scipys() -> None:
    x = np.linspace(0, 10, 50)
    for xi in (-0.5, -1e-12, 0.0, 0.3):
        np.testing.assert_allclose(survival(x, xi, 2.0), stats.genpareto(xi, scale=2.0).sf(x), rtol=1e-6, atol=1e-300)


def _misses(dist, p: float, repeats: int, n: int, resamples: int) -> tuple[int, int]:
    rng = np.random.default_rng(11)
    results = [exceedance(dist.rvs(n, random_state=rng), dist.isf(p), resamples=resamples) for _ in range(repeats)]
    return sum(r.lower > p for r in results), sum(r.upper < p for r in results)


@pytest.mark.parametrize("name", ["normal", "exponential", "t4", "uniform"])
def test_interval_holds_the_truth(name: str) -> None:
    """Once in ten thousand, from 1,000 values: missed about 5 times in 100 at most."""
    low, high = _misses(KNOWN[name], 1e-4, 60, 1000, 200)
    assert low + high <= stats.binom.ppf(0.999, 60, 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("p", [1e-3, 1e-6])
def test_interval_holds_the_truth_often_enough(name: str, p: float) -> None:
    low, high = _misses(KNOWN[name], p, 200, 2000, 300)
    assert low + high <= stats.binom.ppf(0.999, 200, 0.05)
    assert high <= stats.binom.ppf(0.999, 200, 0.05)


def test_upper_bound_is_never_zero() -> None:
    """A bounded distribution, the limit far beyond its end: found impossible, bounded by an exponential tail."""
    x = np.random.default_rng(3).uniform(size=2000)
    result = exceedance(x, 3.0)
    assert result.probability == result.lower == 0.0
    assert result.tails[0].shape < -0.5
    assert 0.0 < result.upper < 1e-10
    k, mean = result.tails[0].excesses, np.sort(x)[-result.tails[0].excesses :].mean() - result.tails[0].threshold
    assert result.upper > k / 2000 * math.exp(-(3.0 - result.tails[0].threshold) / mean)


def test_the_farther_the_rarer() -> None:
    x = np.random.default_rng(4).normal(size=1500)
    results = [exceedance(x, limit) for limit in (2.5, 3.0, 4.0, 6.0, 9.0)]
    for field in ("probability", "lower", "upper"):
        values = [getattr(result, field) for result in results]
        assert all(a >= b for a, b in zip(values, values[1:])), field
    assert results[0].lower < stats.norm.sf(2.5) < results[0].upper


def test_both_sides() -> None:
    """|y| > 3: the sum of both tails, whose interval holds twice the one-sided truth; the mirror image is the same."""
    x = np.random.default_rng(5).normal(size=4000)
    both, up, down = exceedance(x, 3.0, -3.0), exceedance(x, 3.0), exceedance(x, None, -3.0)
    assert both.probability == pytest.approx(up.probability + down.probability)
    assert both.lower < 2 * stats.norm.sf(3.0) < both.upper < up.upper + down.upper
    assert [tail.side for tail in both.tails] == [1, -1]
    assert down.tails[0].threshold < 0 and exceedance(-x, 3.0).probability == pytest.approx(down.probability)


def test_interval_lies_around_the_estimate() -> None:
    """Near the threshold, where counting is nearly all there is to it: as wide as a count of its excesses."""
    x = stats.t(3).rvs(4000, random_state=np.random.default_rng(10))
    result = exceedance(x, stats.t(3).isf(0.02))
    assert result.probability == pytest.approx(0.02, rel=0.2)
    assert math.sqrt(result.lower * result.upper) == pytest.approx(result.probability, rel=0.06)
    excesses = result.tails[0].excesses
    assert math.log(result.upper / result.lower) == pytest.approx(2 * 1.96 / math.sqrt(excesses), rel=0.35)


def test_goodness_of_fit() -> None:
    """Passes a normal's tail about 95 times in 100, finds a lump of landings that belong to something else."""
    rng = np.random.default_rng(6)
    good = [exceedance(rng.normal(size=1000), 5.0, resamples=200).good for _ in range(60)]
    assert sum(good) >= stats.binom.ppf(0.001, 60, 0.95)
    x = np.concatenate([rng.normal(size=1000), rng.normal(4.0, 0.05, size=25)])
    lump = exceedance(x, 6.0)
    assert not lump.good
    assert "proves nothing" in lump.warnings[0]


def test_heavy_tails_are_said_so() -> None:
    x = stats.t(1).rvs(3000, random_state=np.random.default_rng(7))
    assert any("no variance" in text for text in exceedance(x, 100.0).warnings)


def test_same_data_same_bits() -> None:
    x = np.random.default_rng(8).normal(size=500)
    assert exceedance(x, 4.0) == exceedance(x, 4.0)
    assert exceedance(x, 4.0) != exceedance(x, 4.0, seed=1)


@pytest.mark.parametrize(
    ("values", "above", "why"),
    [
        (np.arange(100.0), 120.0, "wants 30"),
        (np.arange(1000.0), 500.0, "within the data"),
        (np.zeros(1000), 1.0, "no spread"),
        (np.array([]), 1.0, "wants 30"),
    ],
)
def test_what_cannot_be_fitted(values: np.ndarray, above: float, why: str) -> None:
    with pytest.raises(NoTailError, match=why):
        exceedance(values, above)


def test_the_curve_for_drawing_meets_the_probability() -> None:
    x = np.random.default_rng(9).normal(size=1000)
    result = exceedance(x, 4.0, -5.0)
    for tail in result.tails:
        assert tail.exceedance(np.array([tail.limit]))[0] == pytest.approx(tail.probability)
        assert tail.exceedance(np.array([tail.threshold]))[0] == pytest.approx(tail.excesses / 1000)
