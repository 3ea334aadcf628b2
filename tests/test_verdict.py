"""Verdicts: exact bounds against printed tables, what counts as an event, which method decides."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from landing_sim.campaign.verdict import FAIL, OPEN, PASS, Bounds, count_bounds, events, judge, sheet, sweep, to_json


def risk(probability: float = 1e-2, *, above: float | None = 3.0, below: float | None = None, metric: str = "sink"):
    return SimpleNamespace(name="hard landing", metric=metric, above=above, below=below, probability=probability)


def landed(n: int) -> np.ndarray:
    return np.full(n, "landed", dtype=object).astype(str)


def test_exact_bounds() -> None:
    """0 of 1,000: 1 - 0.025^(1/1000); 5 of 100: Clopper-Pearson as printed in textbooks, 1.64 % ... 11.28 %."""
    none = count_bounds(0, 1000)
    assert (none.lower, none.upper) == (0.0, pytest.approx(1 - 0.025 ** (1 / 1000)))
    five = count_bounds(5, 100)
    assert (five.lower, five.upper) == (pytest.approx(0.01643, abs=1e-5), pytest.approx(0.11284, abs=1e-5))
    assert count_bounds(7, 7).upper == 1.0
    assert count_bounds(0, 0).upper == 1.0 and math.isnan(count_bounds(0, 0).estimate)


@settings(max_examples=30, deadline=None)
@given(n=st.integers(1, 300), p=st.floats(0.001, 0.999))
def test_exact_bounds_hold_the_truth_at_least_as_often_as_they_say(n: int, p: float) -> None:
    k = np.arange(n + 1)
    missed = [not b.lower <= p <= b.upper for b in (count_bounds(int(i), n) for i in k)]
    assert stats.binom.pmf(k, n, p)[missed].sum() <= 0.05 + 1e-9


def test_what_counts_as_the_event() -> None:
    """Limits excluded; no metric counts unless the flight went around; numeric errors and killed workers always do."""
    values = np.array([3.0, 3.1, 1.0, np.nan, np.nan, np.nan, np.nan, 1.0, 1.0, 3.5])
    outcome = np.array(
        ["landed", "landed", "off_runway", "go_around", "crash", "timeout", "cannot_fly", "numeric_error"]
        + ["worker_killed", "go_around"]
    )
    counted, happened = events(risk(), values, outcome)
    assert counted.tolist() == [True, True, True, False, True, True, True, True, True, True]
    assert happened.tolist() == [False, True, False, False, True, True, True, True, True, True]
    row = judge(risk(), values, outcome)
    assert (row.count, row.n, row.go_arounds, row.unmeasured) == (7, 9, 1, 5)


def test_below_and_above() -> None:
    values = np.array([-16.0, -15.0, 0.0, 15.0, 16.0])
    happened = events(risk(above=15.0, below=-15.0), values, landed(5))[1]
    assert happened.tolist() == [True, False, False, False, True]
    assert judge(risk(above=15.0, below=-15.0, metric="y"), values, landed(5)).event == "y < -15 or y > 15"


def _sinks(n: int, bad: int = 0) -> np.ndarray:
    values = np.abs(np.random.default_rng(1).normal(0.5, 0.2, n))
    values[:bad] = 4.0
    return values


def test_pass_and_fail_by_count() -> None:
    """Zero of 1,000 passes 1e-2 and not 1e-3; 30 of 1,000 fail 1e-2; 10 of 1,000 leave it open."""
    assert (judge(risk(1e-2), _sinks(1000), landed(1000)).verdict) == PASS
    row = judge(risk(1e-2), _sinks(1000, 30), landed(1000))
    assert (row.verdict, row.method, row.count) == (FAIL, "count", 30)
    assert row.lower95 > 1e-2
    assert judge(risk(1e-2), _sinks(1000, 10), landed(1000)).verdict == OPEN


def test_pass_by_tail() -> None:
    """What 1,000 landings cannot count, the tail of a well-behaved figure far from its limit shows."""
    row = judge(risk(1e-6, above=4.0), _sinks(2000), landed(2000))
    assert (row.verdict, row.method, row.count) == (PASS, "tail", 0)
    assert 0 < row.upper95 < 1e-6 < row.by_count.upper
    near = judge(risk(1e-6, above=1.3), _sinks(2000), landed(2000))
    assert near.verdict in (OPEN, FAIL)
    assert near.method == "tail"


def test_tail_may_fail_a_risk() -> None:
    """No event in 2,000 landings, but the tail reaches the limit too often even at its lower bound."""
    x = np.random.default_rng(12).standard_t(3, size=2000)
    row = judge(risk(1e-6, above=float(x.max()) + 0.1), x, landed(2000))
    assert (row.count, row.verdict, row.method) == (0, FAIL, "tail")


def test_a_tail_that_does_not_fit_proves_nothing() -> None:
    values = _sinks(2000)
    values[:40] = np.linspace(1.50, 1.51, 40)
    row = judge(risk(1e-6, above=40.0), values, landed(2000))
    assert row.tail is not None and not row.tail.good
    assert (row.verdict, row.method) == (OPEN, "count")
    assert any("proves nothing" in note for note in row.notes)


def test_a_tail_of_survivors_proves_nothing() -> None:
    values, outcome = _sinks(2000), landed(2000).astype("<U14")
    values[7], outcome[7] = np.nan, "crash"
    row = judge(risk(1e-6, above=4.0), values, outcome)
    assert (row.verdict, row.method, row.count, row.unmeasured) == (FAIL, "count", 1, 1)  # 1 of 2,000: above 1.2e-5
    assert judge(risk(1e-4, above=4.0), values, outcome).verdict == OPEN
    assert "proves nothing" in row.notes[-1]


def test_rare_event_run_decides_before_the_tail() -> None:
    values = _sinks(2000)
    row = judge(risk(1e-6, above=4.0), values, landed(2000), Bounds(1e-8, 4e-9, 3e-8))
    assert (row.verdict, row.method, row.upper95) == (PASS, "rare-event", 3e-8)
    row = judge(risk(1e-6, above=4.0), values, landed(2000), Bounds(1e-5, 4e-6, 3e-5))
    assert (row.verdict, row.method) == (FAIL, "rare-event")
    row = judge(risk(1e-6, above=4.0), values, landed(2000), Bounds(1e-6, 4e-7, 3e-6))
    assert (row.verdict, row.method) == (OPEN, "rare-event")  # although the tail alone would pass


def test_too_few_landings() -> None:
    row = judge(risk(1e-2), _sinks(20), landed(20))
    assert (row.verdict, row.tail) == (OPEN, None)
    assert "wants 30" in row.no_tail
    assert judge(risk(1e-2), np.array([]), np.array([], dtype=str)).verdict == OPEN


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), shift=st.floats(0.0, 3.0), lost=st.integers(0, 3), exponent=st.integers(1, 8))
def test_verdict_follows_from_its_bounds(seed: int, shift: float, lost: int, exponent: int) -> None:
    values = np.random.default_rng(seed).normal(shift, 0.3, 300)
    outcome = landed(300).astype("<U14")
    values[:lost], outcome[:lost] = np.nan, "crash"
    row = judge(risk(10.0**-exponent), values, outcome)
    assert 0 <= row.lower95 <= row.upper95 <= 1
    wanted = PASS if row.upper95 < row.probability else FAIL if row.lower95 > row.probability else OPEN
    assert row.verdict == wanted
    if row.method == "count":
        assert row.lower95 <= row.count / row.n <= row.upper95


def test_sheet_and_json() -> None:
    columns = {"sink": _sinks(500), "y": np.zeros(500)}
    risks = [risk(), SimpleNamespace(name="off", metric="y", above=15.0, below=-15.0, probability=1e-6)]
    rows = sheet(risks, columns, landed(500), {"off": Bounds(1e-9, 1e-10, 1e-8)})
    assert [row.verdict for row in rows] == [PASS, PASS]
    line = to_json(rows[0])
    assert {"name", "limit", "count", "n", "upper95", "lower95", "method", "verdict"} <= set(line)
    assert (line["limit"], line["n"], line["above"]) == (1e-2, 500, 3.0)
    with pytest.raises(KeyError):
        sheet([risk(metric="nothing")], columns, landed(500))


def test_sweep_stops_at_the_first_that_is_not_shown() -> None:
    """PASS at 0, 5 and 15 m/s but not at 10: the largest shown is 5."""
    n = 4 * 500
    held = np.array([0.0, 5.0, 10.0, 15.0])[np.arange(n) % 4]
    values = _sinks(n)
    values[(held == 10.0)] += np.where(np.arange(500) < 30, 4.0, 0.0)
    (found,) = sweep([risk()], held, {"sink": values}, landed(n))
    assert found.values == (0.0, 5.0, 10.0, 15.0)
    assert [row.verdict for row in found.judged] == [PASS, PASS, FAIL, PASS]
    assert found.largest_passing == 5.0
    assert all(row.n == 500 for row in found.judged)
    (none,) = sweep([risk(1e-9)], held, {"sink": values}, landed(n))
    assert none.largest_passing is None


def test_rare_event_run_of_one_swept_value() -> None:
    """It speaks for the value that it held and for no other."""
    held = np.array([5.0, 10.0])[np.arange(1000) % 2]
    (found,) = sweep(
        [risk(1e-6)], held, {"sink": _sinks(1000)}, landed(1000), 0, {"hard landing": Bounds(1e-9, 0, 1e-8)}, 10.0
    )
    assert [row.method for row in found.judged] == ["tail", "rare-event"]
