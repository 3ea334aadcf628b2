"""Brockers et al. 2012 again: measures by hand, the equations, short flights, the report, and what must not leak."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from landing_sim import loop, papers
from landing_sim.estimators.readings import Fresh
from landing_sim.missions import quadrotor_eyes, quadrotor_landing
from landing_sim.papers import brockers_2012 as paper
from landing_sim.papers import brockers_checks as check
from landing_sim.papers import brockers_figures as figures
from landing_sim.papers import brockers_trials as trials
from landing_sim.papers import claims, report
from landing_sim.papers.brockers_trials import Beside, Brief, Detection, Flights, Heights, Watched
from landing_sim.papers.claims import Measured
from landing_sim.papers.flights import Run
from landing_sim.plants.quadrotor import QuadrotorPlant
from landing_sim.signals import Command, Truth
from landing_sim.vision.slam.front_end import SlamFrontEnd
from landing_sim.vision.slam.slam import Slam

CLAIMS = {claim.id: claim for claim in paper.CLAIMS}


def hovered(rms: float, x: float = 0.0, y: float = 0.0) -> Brief:
    return Brief("hovered", {"hover_rms_m": rms, "hover_x_rms_m": x, "hover_y_rms_m": y})


def landed(miss: float = 0.02, seconds: float = 47.0, across: float = 0.02, outcome: str = "landed") -> Brief:
    return Brief(outcome, {"miss_m": miss, "flight_s": seconds, "cross_track_rms_m": across})


def measured(name: str, *results: Sequence[Brief]) -> Measured:
    return CLAIMS[name].measure([list(r) for r in results])


# ------------------------------------------------------------------------------------------------------------- claims


def test_every_number_of_the_paper_is_claimed_once() -> None:
    assert len(CLAIMS) == len(paper.CLAIMS)
    assert {c.paper_value for c in paper.CLAIMS} >= {9.91, 3.44, 15.0, 7.5, 3.0, 2.0, 57.0, 47.0, 18.0}


def test_reported_seeds_are_not_those_of_tuning() -> None:
    """1 to 4 were tuned on."""
    for job in claims.runs_of(paper.CLAIMS):
        assert min(job.seeds()) > 100
    assert len(trials.HOVER_SEEDS) >= 8
    assert len(trials.PLACES) >= 3 and len(trials.LANDING_SEEDS) * len(trials.PLACES) >= 50


def test_hover_is_the_mean_over_seeds_and_one_lost_flight_meets_nothing() -> None:
    assert measured("hover", [hovered(0.09), hovered(0.11)]).value == pytest.approx(10.0)
    assert math.isnan(measured("hover-fused", [hovered(0.03), hovered(math.nan)]).value)


def test_ratios_are_paired() -> None:
    """0.10 over 0.05 and 0.12 over 0.02: 2 and 6, not the ratio of means."""
    found = measured("hover-factor", [hovered(0.10), hovered(0.12)], [hovered(0.05), hovered(0.02)])
    assert found.value == pytest.approx(4.0)
    assert measured("ellipse", [hovered(0.1, 0.06, 0.08)]).value == pytest.approx(16.0)
    assert measured("ellipse-factor", [hovered(0.1, 0.06, 0.08)], [hovered(0.1, 0.02, 0.01)]).value == pytest.approx(
        4.0
    )


def test_success_counts_what_landed_near_the_middle_and_says_how_sure_that_is() -> None:
    """49 of 50: Clopper-Pearson's lower end is 89.4 %."""
    good = [landed() for _ in range(49)]
    for bad in (landed(0.09), landed(outcome="crash"), landed(math.nan, outcome="refused")):
        found = measured("lands", [*good, bad])
        assert found.value == pytest.approx(98.0) and "89.4 %" in found.note
    assert measured("lands", good[:20], good[20:]).value == 100.0


def test_times_misses_and_ways() -> None:
    assert measured("miss", [landed(0.02), landed(0.07)], [landed(0.05)]).value == pytest.approx(7.0)
    assert measured("time", [landed(seconds=46.0), landed(seconds=48.0)]).value == pytest.approx(47.0)
    assert measured("faster", [landed(seconds=18.0)], [landed(seconds=45.0)]).value == pytest.approx(0.4)
    assert measured("fluctuations", [landed(across=0.06)], [landed(across=0.02)]).value == pytest.approx(3.0)


def test_equations_as_printed_and_as_used() -> None:
    assert check.at_rest(1.0) == 0.0 and check.at_rest(-1.0) == pytest.approx(2.0 * check.G)
    assert check.error_model_error(-1.0) < 1e-6
    assert check.error_model_error(1.0) == pytest.approx(2.0, rel=0.01)


def test_lag_of_a_delayed_course() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    p = np.column_stack([np.sin(1.7 * t), np.cos(1.1 * t), 0.0 * t])
    for delay in (0.0, 0.08, 0.15):
        seen = np.column_stack([np.sin(1.7 * (t - delay)), np.cos(1.1 * (t - delay)), 0.0 * t])
        assert paper.lag(t, seen, t, p) == pytest.approx(delay, abs=0.002)
    came = Watched(t, p, p, seen, t - 0.15, t)
    found = CLAIMS["latency"].measure([came])
    assert found.value == pytest.approx(0.0, abs=2.0) and "150 ms" in found.note


# ------------------------------------------------------------------------------------------------------------ flights


def test_flights_from_several_seeds_give_a_brief_each() -> None:
    found = trials.perform(Flights("quadrotor/hover", (*trials.EMULATED, "time.limit_s=24.0"), (11, 12)))
    assert isinstance(found, list) and [brief.outcome for brief in found] == ["hovered", "hovered"]
    first, second = (brief.metrics["hover_rms_m"] for brief in found)
    assert first != second and 0.01 < first < 0.05 and 0.01 < second < 0.05


def test_the_detector_is_found_inside_what_is_wrapped_round_it() -> None:
    wanted = trials.load("quadrotor/land", trials.EMULATED, 1)
    slam = SlamFrontEnd(Slam(quadrotor_eyes.rig(wanted), quadrotor_eyes.settings(wanted)))
    looking = quadrotor_eyes.Looking(slam, None)
    assert trials._looking(Fresh(quadrotor_eyes.While(looking, lambda: True), 0.8)) is looking


@pytest.fixture(scope="module")
def watched() -> Watched:
    found = trials.perform(
        Beside("quadrotor/hover_unfused", "quadrotor/hover", (*trials.EMULATED, "time.limit_s=31.0"), 13)
    )
    assert isinstance(found, Watched)
    return found


def test_the_filter_beside_a_flight_makes_up_for_the_latency(watched: Watched) -> None:
    fix, fused = paper.lags(watched)
    assert fix == pytest.approx(0.16, abs=0.03) and abs(fused) < 0.02
    late = watched.t > 12.0
    error = np.linalg.norm((watched.p_hat - watched.p)[late], axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.015


@pytest.fixture(scope="module")
def results(watched: Watched) -> dict[claims.Job, object]:
    """One short flight of each kind and figures made on paper stand for all."""
    hover = trials.perform(Run("quadrotor/hover", (*trials.EMULATED, "time.limit_s=14.0"), 14))
    land = trials.perform(Run("quadrotor/land_fast", (*trials.EMULATED, *trials.PATH, *trials.PLACES[0]), 14))
    more = {**landed().metrics, "way_point_error_m": 0.01, "fix_error_rms_m": 0.008}
    made = [{**hovered(0.03, 0.02, 0.01).metrics, **more}, {**hovered(0.04, 0.01, 0.02).metrics, **more}]
    briefs = [Brief("landed", metrics) for metrics in made]
    found: dict[claims.Job, object] = {}
    for job in claims.runs_of(paper.CLAIMS):
        if isinstance(job, Run):
            found[job] = land if "land" in job.scenario else hover
        else:
            heights = Heights(np.array([1.0, 1.1]), np.array([0.14, 0.142]), 1.1, 0.141, 0.14)
            found[job] = watched if isinstance(job, Beside) else heights if isinstance(job, Detection) else briefs
    return found


def test_figures_and_report(results: dict[claims.Job, object]) -> None:
    drawn = figures.figures(results)
    assert [f.place for f in drawn][:3] == ["figure 3", "figure 6", "figure 7"] and "figure 10" in [
        f.place for f in drawn
    ]
    rows = claims.evaluate(paper.CLAIMS, results)
    text = report.html(papers.load("brockers-2012"), rows, drawn, {"numpy": "0.0"})
    assert text.count("<figure") == len(drawn) and "9.91" in text
    assert not re.search(r'(src|href)="(?!#)', text)  # needs nothing but itself
    verdicts = {row.claim.id: row.verdict for row in rows}
    assert verdicts["hover-fused"] == "met" and verdicts["hover"] == "not_met"  # 3.5 cm are no 9.91
    assert verdicts["eq5"] == "not_met" and verdicts["eq5-used"] == "met"


# ------------------------------------------------------------------------------------------------------------- no leak


class Lying:
    """A plant whose truth is wrong wherever no sensor of this flight looks: only p_RB and t are true."""

    def __init__(self, plant: QuadrotorPlant) -> None:
        self._plant = plant

    def __getattr__(self, name: str) -> object:
        return getattr(self._plant, name)

    def reset(self) -> Truth:
        return self._wrong(self._plant.reset())

    def truth(self) -> Truth:
        return self._wrong(self._plant.truth())

    def _wrong(self, truth: Truth) -> Truth:
        return replace(
            truth,
            R_RB=np.eye(3)[[1, 0, 2]],
            v_RB_R=truth.v_RB_R + 5.0,
            w_RB_B=truth.w_RB_B - 3.0,
            euler=truth.euler + 1.0,
            wind_R=truth.wind_R + 7.0,
            airspeed=99.0,
            surfaces=truth.surfaces + 1.0,
            thrust=0.0,
            wheels_height=truth.wheels_height - 2.0,
            on_ground=~truth.on_ground,
        )


@pytest.mark.parametrize("name", ["quadrotor/land_fast", "quadrotor/land_unfused"])
def test_no_truth_reaches_estimator_or_autonomy(name: str) -> None:
    """What only the log sees may be anything: commands keep their bits. The sonar looks at attitudes: left out."""
    wanted = trials.load(name, (*trials.EMULATED, *trials.PATH, *trials.PLACES[0]), 5)
    commands: list[list[Command]] = []
    for lying in (False, True):
        p = quadrotor_landing.build(wanted, wanted.seed).parts
        sensors = [sensor for sensor in p.sensors if sensor.name != "sonar"]
        plant = Lying(p.plant) if lying else p.plant
        steps = loop.simulate(
            p.clock, plant, p.world, sensors, p.front_ends, p.estimator, p.guidance, p.controller, Command()
        )  # fmt: skip
        commands.append([step.command for step, _ in zip(steps, range(1500))])
    assert commands[0] == commands[1]
    assert len({command.elevator for command in commands[0]}) > 100
