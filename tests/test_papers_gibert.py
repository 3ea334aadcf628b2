"""Gibert et al. 2015: its claims, its checks against figures known by hand, and the report."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

from landing_sim import papers
from landing_sim.papers import claims, gibert_figures, point_approach, report
from landing_sim.papers import gibert_2015 as paper
from landing_sim.papers import gibert_checks as check
from landing_sim.papers import gibert_trials as g
from landing_sim.papers.academic_example import Trial, settings
from landing_sim.papers.courses import Course, largest_step, rms_between, settling

JOBS = claims.runs_of(paper.CLAIMS)


@pytest.fixture(scope="module")
def results() -> dict[claims.Job, list[Course]]:
    """One short trial and one watch stand for all."""
    example = paper.perform(Trial("", g.SAMPLED.observer, 0.01))
    watched = paper.perform(point_approach.Watch("", g.SAFE, 1.5))
    return {job: example if isinstance(job, Trial) else watched for job in JOBS}


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


# ------------------------------------------------------------------------------------------------------------ report


def test_report_holds_every_claim_and_figure(text):
    for row in paper.CLAIMS:
        assert f'<tr id="{row.id}">' in text
    for number in (2, 3, 5, 6):
        assert re.search(rf'id="figure-{number}">.*?<svg', text, re.DOTALL), number
    assert "Simulations" in text and "1–20" in text


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
    unmet = {"speed", "approach-noise", "zero-noise", "eq3", "eq5-print", "eq17"}
    assert {id for id, verdict in verdicts.items() if verdict == "not_met"} == unmet
