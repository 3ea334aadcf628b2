"""Gibert et al. 2015: its claims, its checks against figures known by hand, and the report."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
import synthetic_flight as synthetic

from landing_sim import papers
from landing_sim.papers import claims, flying, gibert_figures, gibert_flown_figures, point_approach, report
from landing_sim.papers import gibert_2015 as paper
from landing_sim.papers import gibert_checks as check
from landing_sim.papers import gibert_flown as fl
from landing_sim.papers import gibert_trials as g
from landing_sim.papers.academic_example import Trial, settings
from landing_sim.papers.courses import Course, largest_step, rms_between, settling
from landing_sim.papers.flights import Flown, Run
from landing_sim.record.builder import LogBuilder
from landing_sim.record.judge import outcome
from landing_sim.record.log import FlightLog

JOBS = claims.runs_of(paper.CLAIMS)


def flight(factor: float = 1.0, aside: float = 0.0, **kwargs: float) -> Flown:
    """A flight made on paper whose estimate has `factor` times the true position; `aside` [m] moves the track."""
    builder = LogBuilder()
    for step in synthetic.fly(**kwargs):
        builder.add(step)
    log = builder.finish(
        runway={"width_m": 29.0, "length_m": 1680.0}, touchdown=synthetic.touchdown(), seed=1, scenario={}
    )
    extra = {"true_y_m": log["true_y_m"] + aside}
    for name, column in (("x", "x_m"), ("y", "y_m"), ("H", "H_m")):
        true = extra.get("true_y_m", log["true_y_m"]) if name == "y" else log[f"true_{column}"]
        extra[f"est_{column}"] = np.where(log["valid"], factor * true, np.nan)
    for name in ("phi_rad", "theta_rad", "psi_rad"):
        extra[f"est_{name}"] = np.where(log["valid"], log[f"true_{name}"], np.nan)
    extra["flag_range_valid"] = log["valid"] & (log["t_s"] > 3.0)
    return Flown(FlightLog({**log.columns, **extra}, log.meta))


@pytest.fixture(scope="module")
def results() -> dict[claims.Job, list[Course] | Flown]:
    """One short trial, one watch and one flight made on paper stand for all."""
    example = paper.perform(Trial("", g.SAMPLED.observer, 0.01))
    watched = paper.perform(point_approach.Watch("", g.SAFE, 1.5))
    flown = flight(1.02)
    return {job: example if isinstance(job, Trial) else flown if isinstance(job, Run) else watched for job in JOBS}


@pytest.fixture(scope="module")
def text(results) -> str:
    rows = claims.evaluate(paper.CLAIMS, results)
    return report.html(papers.load("gibert-2015"), rows, gibert_figures.figures(results), {"numpy": "0.0"})


def test_every_part_of_the_paper_is_claimed():
    ids = [claim.id for claim in paper.CLAIMS]
    assert len(set(ids)) == len(ids)
    places = " ".join(claim.where for claim in paper.CLAIMS)
    for place in ("4.1", "4.2", "app.", "fig. 2", "fig. 3", "fig. 5", "fig. 6", "eq. 3", "eq. 5", "eqs. 6", "eq. 17"):
        assert place in places, place
    assert {claim.paper_value for claim in paper.CLAIMS} >= {1.0, 0.0}
    assert all(claim.met is not None or claim.reason for claim in paper.CLAIMS), "what is not compared says why"


def test_jobs_differ_in_what_is_listed():
    listed = [(job.setting(), job.seeds()) for job in JOBS]
    assert len(set(listed)) == len(JOBS)


def test_settings_are_told_as_they_would_be_written():
    from landing_sim.estimators.ranging.gains import HighGain
    from landing_sim.estimators.ranging.gibert import Gibert, GibertDiscrete

    for observer in (Gibert(), g.SLOW, g.ON_APPROACH, Gibert(HighGain(xi=0.7), output=2)):
        written = settings(observer)
        assert eval(written, {c.__name__: c for c in (Gibert, GibertDiscrete, HighGain)}) == observer
    assert settings(g.SLOW) == "Gibert(kappa=HighGain(lambda1=2.04))"


def test_misprints_are_reported(results):
    rows = {row.claim.id: row for row in claims.evaluate(paper.CLAIMS, results)}
    for id in ("eq3", "eq5-print", "eq17"):
        assert rows[id].verdict == "not_met", id
    for id in ("eq5", "eq13", "eq19", "remark2"):
        assert rows[id].verdict == "met", id
    assert "four columns" in rows["eq13"].note
    assert rows["eq5-print"].value == pytest.approx(0.5, abs=1e-6)  # b1, where the text needs 0.38


def test_one_second_does_not_come_out():
    rows = {claim.id: claim for claim in paper.CLAIMS}
    for id, value, met in (("speed", 0.561, False), ("speed-lambda", 0.992, True)):
        found = rows[id].measure([paper.perform(job) for job in rows[id].runs])
        assert found.value == pytest.approx(value, abs=0.005)
        assert rows[id].met(found.value) is met


# ------------------------------------------------------------------------------------------------ equations by hand


@pytest.mark.parametrize(("reading", "degrees"), [(0, 3.0), (1, 2.71), (2, 1.19)])
def test_readings_of_the_heading_feature(reading, degrees):
    """Roll 20, pitch 5, heading 3 deg: figures worked out apart from this code."""
    phi, theta = math.radians(20.0), math.radians(5.0)
    d_F = check.feature(reading, phi, theta, math.radians(-3.0))
    found = math.degrees(check.runway_heading(d_F, phi, theta))
    assert found == pytest.approx(degrees, abs=1e-9 if reading == 0 else 0.005)


def test_heading_is_exact():
    assert check.heading_error(0) < 1e-9 < 1e-2 < check.heading_error(1) < check.heading_error(2)


def test_eq_17_has_the_wrong_sign_for_a_camera_s_motion():
    assert check.motion_error(-1.0) < 1e-6
    # the truth is -(w x r + v): a plus is wrong by twice that
    r, v, w = np.array([-300.0, 250.0, 5000.0]), np.array([2.0, 1.0, 70.0]), np.array([0.02, 0.05, -0.03])
    assert check.motion_error(1.0) == pytest.approx(2.0 * np.abs(np.cross(w, r) + v).max(), rel=1e-6)


def test_the_example_leaves_its_domain():
    assert check.first_singularity() == pytest.approx(9.565, abs=0.002)


# ---------------------------------------------------------------------------------------------------------- measures


def made(error: np.ndarray, dt: float = 0.1) -> Course:
    n = len(error)
    x = np.tile([0.0, 0.0, 2.0], (n, 1))
    return Course(dt * np.arange(n), x, x + np.outer(error, [0, 0, 1]), np.zeros((n, 2)), np.zeros(n, int))


def test_settling_by_hand():
    error = np.array([1.0, 0.2, 0.05, 0.11, 0.09, -0.09, 0.0])
    assert settling(made(error)) == pytest.approx(0.4)  # 5 % of 2 m is 0.1 m; outside once more at 0.3 s
    assert math.isnan(settling(made(np.array([1.0, 0.0, 1.0]))))
    assert settling(made(np.array([1.0, 0.0, 1.0])), until=0.1) == pytest.approx(0.1)
    assert settling(made(np.zeros(3))) == 0.0
    assert rms_between(made(error), 0.1, 0.2) == pytest.approx(math.sqrt((0.04 + 0.0025) / 2))


def test_largest_step_is_beyond_the_motion():
    motions = point_approach.motions(point_approach.ON_GLIDE)[:2]
    x = point_approach.points(point_approach.ON_GLIDE)[:3]
    assert largest_step(Course(np.arange(3.0), x, x, np.zeros((3, 2)), np.zeros(3)), motions) < 1e-9
    jumped = x * np.array([[1.0], [1.1], [1.1]])
    assert largest_step(Course(np.arange(3.0), x, jumped, np.zeros((3, 2)), np.zeros(3)), motions) == pytest.approx(0.1)


def test_the_approach_is_one():
    poses = point_approach.fly(point_approach.Approach())
    assert poses.p[0] == pytest.approx([-5000.0, 300.0, -5000.0 * math.tan(math.radians(3.0)) - 50.0])
    off = poses.p[poses.t > 30.0]
    assert np.abs(off[:, 1]).max() < 0.5  # on the centreline
    height = -off[:, 2] + off[:, 0] * math.tan(math.radians(3.0))
    assert np.abs(height).max() < 2.0  # on the glide path


# ----------------------------------------------------------------------------------------------------------- flights


def test_the_threshold_in_the_aircraft_s_axes():
    """1000 m before it, 30 m right, 50 m high, level: 30 m to the left, 50 m down. Turned right by 90 deg: to the left."""
    x, y, H, zero = (np.array([v]) for v in (-1000.0, 30.0, 50.0, 0.0))
    assert fl._ahead(x, y, H, zero, zero, zero)[0] == pytest.approx([-30.0, 50.0, 1000.0])
    assert fl._ahead(x, y, H, zero, zero, zero + math.pi / 2)[0] == pytest.approx([-1000.0, 50.0, -30.0])
    assert fl._ahead(x, y, H, zero, zero + math.radians(5.0), zero)[0][1] > 50.0  # nose up: farther down


def test_a_flight_s_course():
    far = fl.course(flight(1.5).log)
    assert far.t[0] == 0.0 and far.x[0, 2] == pytest.approx(944.0, abs=5.0)  # acquired after 0.12 s at 50 m/s
    assert far.relative == pytest.approx(np.full(len(far.t), 0.5))
    assert far.x[-1, 2] > 50.0  # ends where the threshold is lost


def test_flights_by_hand(monkeypatch):
    monkeypatch.setattr(fl, "LATE", 5.0)  # these are shorter
    right, close, far = flight(), flight(1.04), flight(1.5)
    assert fl.converges([right, close]).value == 0.0
    assert "−50 %: 0.0 s, steered by from 2.9 s, touchdown 31 s" in fl.converges([right, close]).note
    assert math.isnan(fl.converges([right, far]).value)
    assert fl.late_error([close]).value == pytest.approx(4.0)
    assert fl.tracks_apart([right, flight(aside=-7.0)]).value == pytest.approx(7.0)
    assert fl.tracks_apart([right, right]).value == 0.0
    assert fl.lands([right, far]).value == 2.0
    assert fl.trusted(right.log) == pytest.approx(3.0 - fl.acquired(right.log), abs=0.07)


def test_flights_that_never_see_the_runway_meet_nothing(results):
    blind = flight(duration=3.0, acquired=99.0)
    blind = Flown(FlightLog(blind.log.columns, {**blind.log.meta, "touchdown": None, "end": "crash"}))
    failed = {job: blind if isinstance(job, Run) else result for job, result in results.items()}
    rows = {row.claim.id: row for row in claims.evaluate(paper.CLAIMS, failed)}
    for id in ("flown", "flown-zero", "flown-good", "flown-lands", "flown-point"):
        assert rows[id].verdict == "not_met", id
    assert math.isnan(rows["flown-track"].value) and "crash" in rows["flown-lands"].note
    json.dumps(claims.to_json(paper.NAME, rows.values()), allow_nan=False)
    assert all("<svg" in figure.svg for figure in gibert_flown_figures.flown(failed))


@pytest.mark.slow
@pytest.mark.parametrize(("run", "share"), tuple(zip(fl.BOTH, g.SHARES)))
def test_it_lands_from_rendered_pixels(run, share):
    log = flying.fly(run).log
    course = fl.course(log)
    assert course.x_hat[0, 2] == pytest.approx(share * course.x[0, 2], rel=0.02)
    assert abs(log["true_x_m"][0] + 5000.0) < 1.0
    assert outcome(log) == "landed"
    assert settling(course) <= 30.0
    assert np.abs(course.relative[course.t > 55.0]).max() < 0.01
    # until the range may be trusted nobody turns in
    waiting = (log["t_s"] > 1.0) & (log["t_s"] < fl.acquired(log) + fl.trusted(log))
    assert waiting.any() and np.degrees(np.abs(log["true_phi_rad"][waiting])).max() < 2.0


# ------------------------------------------------------------------------------------------------------------ report


def test_report_holds_every_claim_and_figure(text):
    for row in paper.CLAIMS:
        assert f'<tr id="{row.id}">' in text
    for place in ("2", "3", "5", "5-in-camera-axes", "5-as-errors", "5-without-pixels", "6"):
        assert re.search(rf'id="figure-{place}">.*?<svg', text, re.DOTALL), place
    assert "Simulations and flights" in text and "1–20" in text
    assert "transport/gibert_near" in text and "transport/gibert_far" in text


def test_report_needs_nothing_else(text):
    assert "<script" not in text
    outside = set(re.findall(r'(?:src|href)\s*=\s*"([^"#]+)"', text)) | set(re.findall(r"url\((?!#)([^)]*)\)", text))
    assert not outside


def test_same_results_same_report(results, text):
    rows = claims.evaluate(paper.CLAIMS, results)
    again = report.html(papers.load("gibert-2015"), rows, gibert_figures.figures(results), {"numpy": "0.0"})
    assert again == text


@pytest.mark.slow
def test_reproduce_writes_the_report(tmp_path):
    found = papers.reproduce("gibert-2015", tmp_path)
    assert json.loads((tmp_path / "claims.json").read_text()) == found.result
    verdicts = {row["id"]: row["verdict"] for row in found.result["claims"]}
    unmet = {"speed", "approach-noise", "zero-noise", "eq3", "eq5-print", "eq17", "flown-point"}
    assert {id for id, verdict in verdicts.items() if verdict == "not_met"} == unmet
