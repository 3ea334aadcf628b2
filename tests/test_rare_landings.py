"""Subset simulation and falsifier on the real loop: what they fly are the campaign's landings."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from landing_sim.campaign import landing, rare_landings
from landing_sim.campaign.falsify import Gust
from landing_sim.campaign.file import load
from landing_sim.campaign.plan import Plan
from landing_sim.campaign.pool import Done
from landing_sim.campaign.rare import simulate
from landing_sim.campaign.rare_landings import FRESH, Job, Landings, badness, fly, gust_margin, save, saved
from landing_sim.campaign.verdict import Bounds

TEXT = """
schema_version: 1
scenario: do128/gust
runs: 4
seed: 3
set: {time.limit_s: 4.0, wind.crosswind_from_x_m: null}
dispersions:
  wind.crosswind_mps: {normal: {mean: 0, sd: 3}}
risks:
  - {name: roll, metric: peak_roll_deg, above: 12.0, probability: 1.0e-3}
  - {name: wing, metric: touchdown_bank_deg, above: 12.0, below: -12.0, probability: 1.0e-3}
"""


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    (tmp_path / "c.yaml").write_text(TEXT)
    return load(tmp_path / "c.yaml")


def test_the_first_level_is_the_campaign_itself(plan: Plan) -> None:
    row = landing.land(plan, 2)
    outcome, value = fly(plan, Job(0, ((2, 0.0),), 0, "peak_roll_deg"))
    assert (outcome, value) == (row.outcome, row.figures["peak_roll_deg"])


def test_the_updraught_that_the_falsifier_once_crashed_with_is_landed_in() -> None:
    """8.5 m/s over the threshold, and the filter lost the borderlines there, believed itself 35 m below the ground."""
    gust = "{at_x_m: -137.5, gradient_m: 195.0, shape: pulse, vertical_mps: 8.519301795959475}"
    _, flight = landing.fly(load("do128/campaign_wind"), 0, changes=[f"wind.discrete_gust={gust}"])
    log = flight.log
    airborne = ~log["flag_on_ground"].astype(bool) & (log["t_s"] > 2.0)
    assert flight.verdict.outcome == "landed"
    assert np.abs(log.error("H"))[airborne].max() < 0.5


def test_a_move_moves_everything_a_little(plan: Plan) -> None:
    """The crosswind drawn blends as told, and the flight is another one; small moves change it little."""
    values = [
        landing.draw(plan.campaign, 0, rare_landings.noise_of(3, links))["wind.crosswind_mps"]
        for links in (((2, 0.0),), ((FRESH, 0.0),), ((2, 0.0), (FRESH, 0.6)))
    ]
    assert values[2] == pytest.approx(0.6 * values[0] + 0.8 * values[1])
    still, near, far = (
        fly(plan, Job(0, links, 0, "peak_roll_deg"))[1]
        for links in (((2, 0.0),), ((2, 0.0), (FRESH, 0.9999)), ((2, 0.0), (FRESH, 0.0)))
    )
    assert 0 < abs(near - still) < abs(far - still)


def test_space_numbers_its_moves_and_keeps_order(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever order the workers answer in; a landing that kills its worker is as bad as can be."""

    def evaluate(plan: Plan, function, jobs, workers):
        for job in reversed(jobs):
            yield Done(job, None if job.links[0][0] == 1 else ("landed", float(job.links[-1][0])))

    monkeypatch.setattr(rare_landings, "evaluate", evaluate)
    space = Landings(plan, plan.campaign.risks[0])
    states = space.first(3)
    moved = space.moved(states, 0.5)
    assert moved[1] == ((1, 0.0), (FRESH + 1, 0.5))
    assert space.moved(states, 0.5)[0][-1] == (FRESH + 3, 0.5)
    np.testing.assert_array_equal(space.performance(states), [-12.0, math.inf, -10.0])
    assert space.flown == 3


def test_a_landing_that_fails_for_our_own_fault_is_an_error(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rare_landings, "evaluate", lambda *_: [Done(Job(0, (), 0, ""), None, "Traceback: a bug")])
    with pytest.raises(RuntimeError, match="a bug"):
        Landings(plan, plan.campaign.risks[0]).performance([()])


def test_badness() -> None:
    risk = SimpleNamespace(above=12.0, below=-12.0)
    cases = {("landed", 13.0): 1.0, ("landed", -12.5): 0.5, ("landed", 2.0): -10.0, ("off_runway", 0.0): -12.0}
    cases |= {("crash", math.nan): math.inf, ("go_around", math.nan): -math.inf, ("numeric_error", 0.0): math.inf}
    for (outcome, value), wanted in cases.items():
        assert badness(risk, outcome, value) == wanted
    assert badness(SimpleNamespace(above=None, below=0.0), "landed", 2.0) == -2.0


def test_found_results_are_kept_for_the_verdict(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only for the same campaign and the same limits; a crash's infinite badness survives."""

    def evaluate(plan: Plan, function, jobs, workers):
        for job in jobs:
            x = rare_landings.noise_of(3, job.links)("x").normal(1)[0]
            yield Done(job, ("landed", 12.0 + float(x) - 2.0) if x < 3.0 else ("crash", math.nan))

    monkeypatch.setattr(rare_landings, "evaluate", evaluate)
    risk = plan.campaign.risks[0]
    estimate = simulate(Landings(plan, risk), n=200)
    assert estimate.lower < 0.02275 < estimate.upper
    save(tmp_path / "out", plan, risk, estimate, seconds=3.0)
    assert saved(tmp_path / "out", plan) == {"roll": estimate.bounds}
    kept = rare_landings.details(tmp_path / "out", plan)["roll"]
    assert (kept["seconds"], kept["evaluations"]) == (3.0, estimate.evaluations)
    (tmp_path / "c.yaml").write_text(TEXT.replace("above: 12.0, probability", "above: 11.0, probability"))
    assert saved(tmp_path / "out", load(tmp_path / "c.yaml")) == {}
    (tmp_path / "c.yaml").write_text(TEXT.replace("sd: 3", "sd: 2"))
    assert saved(tmp_path / "out", load(tmp_path / "c.yaml")) == {}
    assert isinstance(estimate.bounds, Bounds)


def test_gusts_are_flown(plan: Plan) -> None:
    margin = gust_margin(plan, plan.campaign.risks[0], run=1)
    calm = landing.land(plan, 1).figures["peak_roll_deg"] - 12.0
    gust = Gust("right", "pulse", -900.0, 30.0, 10.0)
    assert margin(gust) == margin(gust) > calm + 0.5
