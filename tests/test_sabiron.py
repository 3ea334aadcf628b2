"""Sabiron et al. 2014 again: what its simulation gives with perfect and noisy flows, and the report's claims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landing_sim import papers
from landing_sim.papers import sabiron_2014 as sabiron
from landing_sim.papers.claims import evaluate, runs_of
from landing_sim.papers.sabiron_trials import OPEN_LOOP, run

SHIPPED = "LPV observer, shipped gains"


@pytest.fixture(scope="module")
def clean():
    return run(sabiron.SHIPPED_GAINS)[0]


def test_perfect_flows(clean) -> None:
    """Within 3 to 10 s |wx| <= 0.05, |wz| <= 0.12 deg/s, |theta| <= 1.5 deg, from 5 s 0.6 deg."""
    late = (clean.t >= 3.0) & (clean.t <= 10.0)
    wx, wz, theta = np.abs(clean.error[late, 2:]).max(axis=0)
    assert wx <= 0.05 and wz <= 0.12 and theta <= 1.5
    assert np.abs(clean.error[late & (clean.t >= 5.0), 4]).max() <= 0.6
    rms = clean.rms(5.0, 20.0)
    assert rms[3] <= 0.15 and rms[4] <= 1.0


def test_information_stays_definite_and_well_conditioned(clean) -> None:
    assert clean.least > 0.0 and clean.condition < 1e7


def test_five_times_better_than_without_looking(clean) -> None:
    """The flows, which the paper says diverge; in pitch the linear model is 3 deg off at 25 s, whoever looks."""
    open_loop = run(replace(sabiron.CLEAN[OPEN_LOOP], duration=25.0))[0].at(25.0)
    assert (np.abs(open_loop[2:4]) > 5.0 * np.abs(clean.at(25.0)[2:4])).all()


def test_halving_the_step(clean) -> None:
    half = run(replace(sabiron.HALF_STEP, duration=10.0))[0]
    change = np.abs(half.X_hat[::2] - clean.X_hat[:1001])[:, 2:]
    assert (change.max(axis=0) < 0.02 * np.abs(clean.X_hat - clean.X)[0, 2:]).all()


def test_noisy_flows() -> None:
    courses = run(replace(sabiron.NOISY[SHIPPED], repeats=3, duration=20.0))
    h, q, wx, wz, theta = np.median([course.rms(5.0, 20.0) for course in courses], axis=0)
    assert q <= 0.03 and wx <= 0.08 and wz <= 0.18 and theta <= 1.5 and h <= 40.0
    assert not np.array_equal(courses[0].X_hat, courses[1].X_hat)


@pytest.mark.parametrize("name", ["EKF", "UKF"])
def test_filters_that_relinearise_do_not_drift(name: str) -> None:
    course = run(replace(sabiron.CLEAN[name], duration=20.0))[0]
    assert (np.abs(course.at(20.0)[2:]) < [0.01, 0.01, 0.05]).all()


@pytest.mark.slow
def test_report(tmp_path) -> None:
    found = papers.reproduce("sabiron-2014", tmp_path)
    verdicts = {claim["id"]: claim["verdict"] for claim in found.result["claims"]}
    missed = {
        "fusion-printed-7",
        "fusion-printed-8",
        "state-equation",
        "riccati-printed",
        "q-unknown",
        "height-published",
    }
    not_met = {name for name, verdict in verdicts.items() if verdict == "not_met"}
    assert not_met - {"closed-lpv"} == missed  # five of six there: as good as nine of ten, as far as six can tell
    assert (tmp_path / "report.html").read_text().count("<figure") == 8


def test_claims_that_need_no_simulation() -> None:
    rows = evaluate([claim for claim in sabiron.CLAIMS if not claim.runs and claim.id != "state-equation"], {})
    assert len(rows) >= 9 and all(row.verdict in ("met", "not_met") for row in rows)
    assert len(runs_of(sabiron.CLAIMS)) >= 10
