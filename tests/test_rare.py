"""Subset simulation against known answers, chains of noise, and the search for the mildest gust."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import stats

from landing_sim.campaign.falsify import Gust, falsify
from landing_sim.campaign.rare import ChainNoise, RareError, simulate
from landing_sim.noise import Noise


class Vectors:
    """States of 20 normals in one array; the performance is a function of all of them at once."""

    def __init__(self, g, seed: int, d: int = 20) -> None:
        self.g, self.d, self.noise, self.flown = g, d, Noise(seed, "test"), 0

    def first(self, n: int) -> list[np.ndarray]:
        return list(self.noise.normal(n * self.d).reshape(n, self.d))

    def moved(self, states: Sequence[np.ndarray], rho: float) -> list[np.ndarray]:
        fresh = self.noise.normal(len(states) * self.d).reshape(len(states), self.d)
        return list(rho * np.array(states) + math.sqrt(1 - rho * rho) * fresh)

    def performance(self, states: Sequence[np.ndarray]) -> np.ndarray:
        self.flown += len(states)
        return self.g(np.array(states))


P = 1e-6
PROBLEMS = {
    "sum": lambda x: x.sum(axis=1) / math.sqrt(x.shape[1]) - stats.norm.isf(P),
    "two sided": lambda x: np.abs(x[:, 0]) - stats.norm.isf(P / 2),
    "radius": lambda x: (x[:, :3] ** 2).sum(axis=1) - stats.chi2.isf(P, 3),
    "skewed": lambda x: stats.norm.logsf(x[:, 1]) * -1 - stats.norm.logsf(x[:, 0]) - stats.gamma.isf(P, 2),
}


def _held(problem: str, repeats: int, **settings) -> tuple[int, float]:
    results = [simulate(Vectors(PROBLEMS[problem], seed), **settings) for seed in range(repeats)]
    assert all(r.reached for r in results)
    return sum(r.lower <= P <= r.upper for r in results), np.mean([r.evaluations for r in results])


def test_one_in_a_million_is_held_in_90_of_100() -> None:
    """The acceptance figure: the truth inside the 95 % interval, from 6,000 evaluations."""
    held, evaluations = _held("sum", 100)
    assert held >= 90
    assert evaluations < 7000


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("n", [500, 1000])
def test_other_shapes_are_held_as_well(problem: str, n: int) -> None:
    assert _held(problem, 100, n=n)[0] >= 90


def test_interval_is_of_use_and_unbiased() -> None:
    """Within a factor of 4 of the truth to either side, and the mean of 40 estimates is the truth."""
    results = [simulate(Vectors(PROBLEMS["sum"], 1000 + seed)) for seed in range(40)]
    assert np.median([r.upper / r.probability for r in results]) < 4.0
    mean, error = np.mean([r.probability for r in results]), np.std([r.probability for r in results]) / math.sqrt(40)
    assert abs(mean - P) < 4 * error


def test_one_in_a_hundred_million() -> None:
    limit = stats.norm.isf(1e-8)
    result = simulate(Vectors(lambda x: x[:, 0] - limit, 5))
    assert result.lower < 1e-8 < result.upper
    assert result.evaluations < 9000
    assert result.worst_performance > 0 and result.worst[0] > limit


def test_frequent_events_are_counted() -> None:
    """Where the first level meets the event often enough, it is plain counting with the exact interval."""
    result = simulate(Vectors(lambda x: x[:, 0] - stats.norm.isf(0.3), 1))
    assert (len(result.levels), result.evaluations) == (1, 1000)
    hits = round(result.probability * 1000)
    interval = stats.binomtest(hits, 1000).proportion_ci(0.95, method="exact")
    assert (result.lower, result.upper) == (pytest.approx(interval.low), pytest.approx(interval.high))
    assert abs(result.probability - 0.3) < 0.06


def test_levels_that_run_out_still_bound() -> None:
    result = simulate(Vectors(PROBLEMS["sum"], 3), most_levels=3)
    assert not result.reached
    assert (result.probability, result.lower) == (0.0, 0.0)
    assert P < result.upper < 1e-2


def test_crashes_and_go_arounds() -> None:
    """Without a performance: a crash is infinitely bad, a go-around infinitely good. The answer is that of the rest."""

    def g(x: np.ndarray) -> np.ndarray:
        value = x[:, 0] - stats.norm.isf(1e-4)
        value = np.where(x[:, 0] > stats.norm.isf(1e-4) + 0.3, math.inf, value)
        return np.where(x[:, 0] < -1.0, -math.inf, value)

    result = simulate(Vectors(g, 2))
    assert result.lower < 1e-4 < result.upper


def test_what_cannot_go_on() -> None:
    with pytest.raises(RareError, match="no slope"):
        simulate(Vectors(lambda x: np.full(len(x), -1.0), 1))
    with pytest.raises(RareError, match="no state has"):
        simulate(Vectors(lambda x: np.full(len(x), -math.inf), 1))
    with pytest.raises(RareError, match="not a number"):
        simulate(Vectors(lambda x: np.full(len(x), math.nan), 1))
    with pytest.raises(ValueError, match="whole part"):
        simulate(Vectors(PROBLEMS["sum"], 1), n=1000, share=0.3)
    with pytest.raises(ValueError, match="10 or more"):
        simulate(Vectors(PROBLEMS["sum"], 1), n=50)


def test_same_seed_same_bits() -> None:
    a, b, c = (simulate(Vectors(PROBLEMS["sum"], seed), n=200) for seed in (7, 7, 8))
    assert (
        (a.probability, a.upper, a.levels[1:]) == (b.probability, b.upper, b.levels[1:]) != (c.probability, c.upper, 0)
    )
    assert np.array_equal(a.worst, b.worst)


# --------------------------------------------------------------------------------------------------------------- chains


def test_a_chain_of_one_is_the_run_itself() -> None:
    chain, run = ChainNoise(4, "gyro", [(17, 0.0)]), Noise(4, "gyro", 17)
    assert chain.key() == run.key()
    assert chain.normal(100).tobytes() == run.normal(100).tobytes()


def test_chain_blends_whatever_size_is_asked_for() -> None:
    links = [(3, 0.0), (1_000_000, 0.8), (1_000_001, 0.6)]
    u = Noise(4, "gyro", 3).normal(50)
    for run, rho in links[1:]:
        u = rho * u + math.sqrt(1 - rho**2) * Noise(4, "gyro", run).normal(50)
    chain = ChainNoise(4, "gyro", links)
    np.testing.assert_array_equal(np.concatenate([chain.normal(1), chain.normal(30), chain.normal(19)]), u)
    assert chain.key() == Noise(4, "gyro", 1_000_001).key()


def test_chain_stays_standard_normal_and_correlated_as_told() -> None:
    before, after = ChainNoise(1, "a", [(0, 0.0), (9, 0.9)]), ChainNoise(1, "a", [(0, 0.0), (9, 0.9), (10, 0.7)])
    x, y = before.normal(40_000), after.normal(40_000)
    assert np.var(y) == pytest.approx(1.0, abs=0.03)
    assert np.corrcoef(x, y)[0, 1] == pytest.approx(0.7, abs=0.02)


def test_a_link_without_memory_begins_anew() -> None:
    chain, fresh = (
        ChainNoise(1, "a", [(0, 0.0), (9, 0.9), (5, 0.0), (6, 0.5)]),
        ChainNoise(1, "a", [(5, 0.0), (6, 0.5)]),
    )
    assert chain.normal(10).tobytes() == fresh.normal(10).tobytes()
    assert len(chain._links) == 2  # what is forgotten is not drawn


# ------------------------------------------------------------------------------------------------------------ falsifier


def _weak_spot(gust: Gust) -> float:
    """Breaks from 3 m/s on for a gust of 80 m to the left at -400 m; every 100 m and 40 m beside that costs 1 m/s."""
    if gust.direction != "left" or gust.shape != "pulse":
        return gust.size - 9.0
    return gust.size - 3.0 - abs(gust.at_x + 400.0) / 100.0 - abs(gust.gradient - 80.0) / 40.0


def test_falsifier_finds_the_weak_spot() -> None:
    found = falsify(_weak_spot, [-900.0, -600.0, -300.0, 0.0], [30.0, 90.0, 150.0], 12.0)
    assert found.gust is not None
    assert (found.gust.direction, found.gust.shape) == ("left", "pulse")
    # within half a halved grid step in place and length, 0.1 m/s in size
    assert 3.0 <= found.gust.size < 3.0 + 37.5 / 100 + 7.5 / 40 + 0.2
    assert abs(found.gust.at_x + 400.0) <= 75.0
    assert 0.0 < found.margin <= 0.1
    assert _weak_spot(found.gust) == found.margin
    assert found.flights == len(found.tried) < 200


def test_falsifier_says_when_nothing_breaks() -> None:
    found = falsify(_weak_spot, [-900.0], [30.0, 90.0], 2.0)
    assert (found.gust, found.flights) == (None, 20)
    assert {(g.direction, g.shape) for g, _ in found.tried if g.shape == "ramp"} == {
        (level, "ramp") for level in ("headwind", "tailwind", "left", "right")
    }
    assert found.margin == max(m for _, m in found.tried) < 0.0
    with pytest.raises(ValueError, match="grid"):
        falsify(_weak_spot, [], [30.0], 2.0)


@pytest.mark.parametrize("direction", ["headwind", "tailwind", "left", "right", "up", "down"])
def test_a_found_gust_is_a_scenarios_gust(direction: str) -> None:
    """What it writes for --set blows where it says: tailwind +x, right +y, up -z."""
    from landing_sim.missions import truth
    from landing_sim.scenario import load

    gust = Gust(direction, "ramp", -900.0, 60.0, 5.0)
    wind = truth.wind(load("do128/calm", gust.changes()), Noise(1, "turbulence"))
    for k in range(400):
        now = wind.wind(0.005 * k, -899.0, 0.0, 40.0, 50.0)
    wanted = {"headwind": (-5, 0, 0), "tailwind": (5, 0, 0), "left": (0, -5, 0), "right": (0, 5, 0), "up": (0, 0, -5)}
    np.testing.assert_allclose(now, wanted.get(direction, (0, 0, 5)), atol=1e-12)


@pytest.mark.parametrize("breaks_at", [0.3, 1.234, 5.5, 9.99])
def test_the_size_is_found_to_the_tolerance(breaks_at: float) -> None:
    found = falsify(lambda gust: gust.size - breaks_at, [0.0], [30.0], 10.0, directions=("up",), shapes=("pulse",))
    assert found.gust is not None
    assert 0.0 < found.gust.size - breaks_at <= 0.1
