"""Sensitivity: Ishigami's function and linear models, whose indices are known, and inputs that explain nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.campaign.sensitivity import first_order, sensitivity, strongest


def ishigami(n: int, seed: int, a: float = 7.0, b: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    x = np.random.default_rng(seed).uniform(-math.pi, math.pi, (n, 3))
    return x, np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_ishigami() -> None:
    """First order 0.314, 0.442, 0 (Ishigami & Homma 1990; a = 7, b = 0.1), from one plain random sample."""
    a, b = 7.0, 0.1
    v1, v2 = 0.5 * (1 + b * math.pi**4 / 5) ** 2, a**2 / 8
    total = v1 + v2 + b**2 * math.pi**8 * 8 / 225
    wanted = np.array([v1, v2, 0.0]) / total
    np.testing.assert_allclose(wanted, [0.3139, 0.4424, 0.0], atol=1e-4)
    np.testing.assert_allclose(first_order(*ishigami(20_000, 1)), wanted, atol=0.02)
    estimates = np.array([first_order(*ishigami(1000, seed)) for seed in range(30)])
    np.testing.assert_allclose(estimates.mean(axis=0), wanted, atol=0.025)  # too few bins for sin^2 cost a little


def test_intervals_hold_the_known_indices() -> None:
    held = np.zeros(2)
    for seed in range(30):
        x, y = ishigami(800, 100 + seed)
        found = {
            e.name: e for e in sensitivity("y", y, {"a": x[:, 0], "b": x[:, 1], "c": x[:, 2]}, resamples=100).effects
        }
        truth = {"a": 0.3139, "c": 0.0}
        held += [found[k].first_order_low <= v <= found[k].first_order_high for k, v in truth.items()]
    assert held.min() >= 25


def test_linear_model() -> None:
    """y = 3 a - 1 b + noise: coefficients with their signs, squares that share the variance, an R^2 below 1."""
    rng = np.random.default_rng(2)
    a, b, c = rng.normal(size=(3, 3000))
    y = 3 * a - b + rng.normal(size=3000)
    result = sensitivity("y", y, {"a": a, "b": b, "c": c})
    assert [e.name for e in result.effects][:2] == ["a", "b"]
    effects = {e.name: e for e in result.effects}
    for name, wanted in (("a", 3 / math.sqrt(11)), ("b", -1 / math.sqrt(11)), ("c", 0.0)):
        effect = effects[name]
        assert effect.srrc == pytest.approx(wanted, abs=0.04)
        assert effect.srrc_low < effect.srrc < effect.srrc_high
        assert effect.srrc_high - effect.srrc_low < 0.12
        assert effect.first_order == pytest.approx(wanted**2, abs=0.05)
    assert effects["c"].srrc_low < 0.0 < effects["c"].srrc_high
    assert effects["c"].first_order_low == 0.0
    assert result.r_squared == pytest.approx(10 / 11, abs=0.03)


def test_ranks_do_not_mind_monotonic_curves() -> None:
    rng = np.random.default_rng(3)
    x = rng.normal(size=1000)
    (effect,) = sensitivity("y", np.exp(3 * x), {"x": x}).effects
    assert effect.srrc == pytest.approx(1.0)


def test_an_effect_that_rises_and_falls() -> None:
    """|crosswind| moves the touchdown: regression is blind to it, the index is not."""
    rng = np.random.default_rng(4)
    x, other = rng.normal(size=(2, 1500))
    (first, _) = sensitivity("y", np.abs(x) + 0.1 * other, {"other": other, "crosswind": x}).effects
    assert first.name == "crosswind"
    assert abs(first.srrc) < 0.15
    assert first.first_order > 0.85


def test_what_explains_nothing_has_a_mean_of_zero() -> None:
    rng = np.random.default_rng(5)
    found = [first_order(rng.normal(size=(200, 4)), rng.normal(size=200)) for _ in range(100)]
    assert abs(np.mean(found)) < 4 * np.std(found) / math.sqrt(400)
    assert np.mean(found) < 0.01


def test_switches_and_words() -> None:
    """A column of two values has two bins, filled as they are."""
    rng = np.random.default_rng(6)
    switch = (rng.uniform(size=2000) < 0.2).astype(float)
    index = first_order(switch[:, None], 2.0 * switch + rng.normal(size=2000))
    assert index[0] == pytest.approx(4 * 0.16 / (1 + 4 * 0.16), abs=0.04)


def test_landings_without_the_figure_are_left_out() -> None:
    rng = np.random.default_rng(7)
    x = rng.normal(size=300)
    y = x.copy()
    y[:100] = np.nan
    result = sensitivity("y", y, {"x": x, "fixed": np.ones(300)})
    assert (result.n, [e.name for e in result.effects]) == (200, ["x"])
    y[:270] = np.nan
    assert sensitivity("y", y, {"x": x}) is None
    assert sensitivity("y", np.ones(300), {"x": x}) is None
    assert sensitivity("y", x, {"fixed": np.ones(300)}) is None


def test_same_data_same_bits() -> None:
    x, y = ishigami(300, 1)
    inputs = {"a": x[:, 0], "b": x[:, 1]}
    assert sensitivity("y", y, inputs) == sensitivity("y", y, inputs)
    assert [s.metric for s in strongest(["y", "none"], {"y": y, **inputs}, ["a", "b", "missing"])] == ["y"]
