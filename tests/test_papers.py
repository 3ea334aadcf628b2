"""Claims, how they are measured, and the report: on synthetic flights, and on short real ones."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import synthetic_flight as synthetic

from landing_sim import papers, scenario
from landing_sim.papers import claims, flying, report
from landing_sim.papers import dickmanns_1992 as paper
from landing_sim.papers import dickmanns_figures as figures
from landing_sim.papers import measures as m
from landing_sim.papers.claims import Claim, Measured
from landing_sim.papers.flights import Flown, Run
from landing_sim.record.builder import LogBuilder
from landing_sim.record.log import FlightLog

# ------------------------------------------------------------------------------------------ synthetic flights


def synthetic_log(seed: int = 1) -> FlightLog:
    """As a pilot's flight with a width filter, so that it serves every claim."""
    builder = LogBuilder()
    for step in synthetic.fly(seed):
        builder.add(step)
    told = {"filter": {"believed_width_m": 25.0}}
    log = builder.finish(
        runway={"width_m": 29.0, "length_m": 1680.0}, touchdown=synthetic.touchdown(), seed=seed, scenario=told
    )
    n = len(log)
    gps = np.where(np.arange(n) % 16 == 0, 1.0, np.nan)
    extra = {
        "dgps_x_m": (log["true_x_m"] + 1.5) * gps,
        "dgps_y_m": (log["true_y_m"] + 0.5) * gps,
        "dgps_H_m": (log["true_H_m"] - 2.0) * gps,
        "radar_H_m": log["true_H_m"] + 0.3,
        "est_W_m": np.where(log["valid"], 29.2, np.nan),
        "sd_W_m": np.full(n, 0.1),
    }
    decay = np.where(log["true_x_m"] > -650.0, np.exp(-(log["t_s"] - 6.0) / 6.0), 0.0)
    extra |= {"true_wy_mps": log["true_wy_mps"] - 2.0 * decay, "true_wz_mps": -decay}
    return FlightLog({**log.columns, **extra}, log.meta)


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return synthetic_log()


@pytest.fixture(scope="module")
def flown(log) -> dict[Run, Flown]:
    return dict.fromkeys(claims.runs_of(paper.CLAIMS), Flown(log, 0.5, 0.2))


def with_columns(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **columns}, log.meta)


# ----------------------------------------------------------------------------------------------------- claims


def test_every_number_of_the_paper_is_claimed_once():
    ids = [claim.id for claim in paper.CLAIMS]
    assert len(set(ids)) == len(ids)
    numbers = {claim.paper_value for claim in paper.CLAIMS} - {None}
    section_7 = {
        950.0,
        51.0,
        50.0,
        85.0,
        15.0,
        2.0,
        1.0,
        6.0,
        550.0,
        250.0,
        43.0,
        5.0,
        120.0,
        0.5,
        500.0,
        8.0,
        3.0,
        0.4,
    }
    assert section_7 | {29.1, 60.0, 12.5} <= numbers
    for figure in range(9, 16):
        if figure not in (8,):
            assert any(f"fig. {figure}" in claim.where for claim in paper.CLAIMS), figure
    assert all(claim.met is not None or claim.reason for claim in paper.CLAIMS), "what is not compared says why"


@pytest.mark.parametrize(
    "run", dict.fromkeys(Run(r.scenario, r.changes) for r in claims.runs_of(paper.CLAIMS)), ids=str
)
def test_every_flight_asked_for_is_a_valid_scenario(run):
    assert scenario.load(run.scenario, [*run.changes, "seed=3"]).seed == 3


def claim(value: float, met, reason: str = "") -> Claim:
    return Claim("a", "says", "7", 1.0, "m", "so", (Run("x"),), lambda flown: Measured(value, "note"), met, reason)


@pytest.mark.parametrize(
    ("value", "met", "verdict"),
    [
        (0.9, claims.at_most(1.0), "met"),
        (-1.1, claims.at_most(1.0), "not_met"),
        (1.25, claims.about(1.0, 0.3), "met"),
        (0.6, claims.about(1.0, 0.3), "not_met"),
        (2.0, claims.at_least(2.0), "met"),
        (math.nan, lambda value: True, "not_met"),
        (1.0, None, "not_comparable"),
    ],
)
def test_verdict(value, met, verdict):
    row = claims.evaluate([claim(value, met, "because")], {Run("x"): None})[0]
    assert row.verdict == verdict
    assert row.note == "note; because"


def test_a_flight_that_several_claims_need_is_flown_once():
    runs = claims.runs_of(paper.CLAIMS)
    assert len(runs) == len(set(runs))
    assert set(runs) == {run for claim in paper.CLAIMS for run in claim.runs}


def test_a_job_that_several_claims_need_is_done_once(tmp_path, monkeypatch):
    done = []
    rows = (claim(1.0, None, "a"), claim(2.0, None, "b"))
    few = replace(papers.load("dickmanns-1992"), claims=rows, perform=done.append, figures=lambda results: [])
    monkeypatch.setattr(papers, "load", lambda name: few)
    papers.reproduce("dickmanns-1992", tmp_path)
    assert done == [Run("x")]


def test_json_is_strict_and_complete(flown):
    rows = claims.evaluate(paper.CLAIMS, flown)
    found = json.loads(json.dumps(claims.to_json(paper.NAME, rows), allow_nan=False))
    assert found["paper"] == "dickmanns-1992"
    assert len(found["claims"]) == len(paper.CLAIMS)
    keys = {"id", "statement", "where", "paper_value", "our_value", "unit", "verdict", "note"}
    assert all(set(row) == keys for row in found["claims"])
    assert {row["verdict"] for row in found["claims"]} == {"met", "not_met", "not_comparable"}


# --------------------------------------------------------------------------------------------------- measures


def test_heading_at_750_m_by_hand(log):
    assert m.heading_settled(with_columns(log, true_psi_rad=np.full(len(log), math.radians(-2.0)))) == pytest.approx(
        2.0
    )
    x = log["true_x_m"]
    only_there = np.where(np.abs(x + 200.0) < 5.0, 1.0, 0.0)  # 10 of the 50 m that the second spans
    assert m.heading_settled(with_columns(log, true_psi_rad=only_there)) == pytest.approx(57.3 * 0.2, rel=0.25)


def test_lateral_error_in_and_outside_the_gust(log):
    x = log["true_x_m"]
    off = log["true_y_m"] + np.where((x > -600.0) & (x < -500.0), 2.5, 0.25)
    spoiled = with_columns(log, est_y_m=off)
    assert m.lateral_in_gust(spoiled) == pytest.approx(2.5)
    assert m.lateral_otherwise(spoiled) == pytest.approx(0.25)


def test_growth_of_the_height_error_at_flare_onset(log):
    start = m.flare_time(log)
    t = log["t_s"]
    error = np.where(t <= start, -0.1, np.where(t < start + 2.0, 0.7, 0.0))
    assert m.onset_growth(with_columns(log, est_H_m=log["true_H_m"] + error)) == pytest.approx(0.6)
    shrinking = np.where(t <= start, 0.7, 0.1)
    assert m.onset_growth(with_columns(log, est_H_m=log["true_H_m"] + shrinking)) == pytest.approx(-0.6)


def test_range_error_counts_while_the_threshold_is_seen(log):
    seen = np.flatnonzero(log["threshold_found"])[-1]
    error = np.zeros(len(log))
    error[seen], error[seen + 1] = 3.0, 9.0
    spoiled = with_columns(log, est_x_m=log["true_x_m"] + error)
    assert m.range_error(spoiled) == pytest.approx(3.0)
    assert m.range_error_after_loss(spoiled) == pytest.approx(9.0)


def test_width_by_hand(log):
    assert m.width_mean(log) == pytest.approx(29.2)
    assert m.width_mean_error(log) == pytest.approx(0.2)
    late = np.where(log["true_x_m"] > -600.0, 28.5, 25.0)  # the first belief is forgotten
    assert m.width_mean(with_columns(log, est_W_m=late)) == pytest.approx(28.5)
    assert m.width_error_at_loss(with_columns(log, est_W_m=late)) == pytest.approx(0.5)


def test_a_width_that_is_wrong_either_way_does_not_average_out(log):
    wide, narrow = (Flown(with_columns(log, est_W_m=np.full(len(log), w))) for w in (33.0, 25.2))
    found = m.over(m.width_mean, m.farthest_from(29.0))([wide, narrow])
    assert found.value == pytest.approx(33.0)


def test_difference_to_gps_by_hand(log):
    perfect = with_columns(log, est_x_m=np.where(log["valid"], log["true_x_m"], np.nan))
    assert m.rms_difference("x", "dgps_x_m")([Flown(perfect)]).value == pytest.approx(1.5)


def test_effect_of_the_vertical_gust_by_hand(log):
    higher = with_columns(log, true_H_m=log["true_H_m"] + np.where(log["true_x_m"] < -400.0, 0.6, 0.1))
    assert m.vertical_gust_effect([Flown(higher), Flown(log)]).value == pytest.approx(0.6)


def test_cost_of_half_a_filter_by_hand(log):
    found = m.split_cost([Flown(log, estimator_ms=0.25), Flown(log, estimator_ms=1.0)])
    assert found.value == pytest.approx(12.5)


def test_gust_of_the_scenario_is_read_from_the_true_wind(log):
    rows = {c.id: c for c in paper.CLAIMS}
    for id, value in (("gust-lateral", 2.0), ("gust-vertical", 1.0), ("gust-time", 6.0)):
        assert rows[id].measure([Flown(log)]).value == pytest.approx(value, rel=0.01)


# ----------------------------------------------------------------------------------------------------- report


@pytest.fixture(scope="module")
def text(flown) -> str:
    rows = claims.evaluate(paper.CLAIMS, flown)
    return report.html(papers.load("dickmanns-1992"), rows, figures.figures(flown), {"numpy": "0.0"})


def test_report_holds_every_claim_and_figure(text):
    for row in paper.CLAIMS:
        assert f'<tr id="{row.id}">' in text
    for number in ("8", "9", "10", "11", "12", "13", "14", "15"):
        assert re.search(rf'id="figure-{number}">.*?<svg', text, re.DOTALL), number
    assert text.index('<tr id="range">') < text.index('id="figure-8"') < text.index("<h2>Flights</h2>")
    for words in ("not met", "not comparable", "scripted pilot", "filter.kind=split"):
        assert words in text


def test_report_needs_nothing_else(text):
    assert "<script" not in text
    outside = set(re.findall(r'(?:src|href)\s*=\s*"([^"#]+)"', text)) | set(re.findall(r"url\((?!#)([^)]*)\)", text))
    assert not outside


def test_same_flights_same_report(text, log):
    assert figures._angle(log, "9", "Roll angle", "phi", 1.0, "deg", 1.0, 8.0) == figures._angle(
        log, "9", "Roll angle", "phi", 1.0, "deg", 1.0, 8.0
    )
    for changing in ("dc:date", "matplotlib.org/"):
        assert changing not in text


def test_flights_that_never_see_the_runway_are_reported_not_met(log):
    steps = synthetic.fly(duration=3.0, acquired=99.0)
    builder = LogBuilder()
    for step in steps:
        builder.add(step)
    short = builder.finish(
        runway={"width_m": 29.0, "length_m": 1680.0}, scenario=dict(log.meta["scenario"]), end="crash"
    )
    nothing = np.full(len(short), np.nan)
    missing = dict.fromkeys(("dgps_x_m", "dgps_y_m", "dgps_H_m", "radar_H_m"), nothing)
    failed = Flown(with_columns(short, **missing), 0.5, 0.2)
    flown = dict.fromkeys(claims.runs_of(paper.CLAIMS), failed)
    rows = claims.evaluate(paper.CLAIMS, flown)
    verdicts = {row.claim.id: row.verdict for row in rows}
    assert {verdicts[id] for id in ("range", "touchdown", "capture", "heading", "width", "flare-onset")} == {"not_met"}
    json.dumps(claims.to_json(paper.NAME, rows), allow_nan=False)
    assert "<svg" in report.html(papers.load("dickmanns-1992"), rows, figures.figures(flown), {})


def test_statements_cannot_smuggle_markup():
    row = claims.evaluate([claim(1.0, None, "<b>&")], {Run("x"): None})[0]
    assert "&lt;b&gt;&amp;" in report.html(papers.load("dickmanns-1992"), [row], [], {})


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "–"),
        (math.nan, "–"),
        (0.0, "0"),
        (950.0, "950"),
        (43.25, "43.2"),
        (0.0102, "0.0102"),
        (2.0, "2"),
        (100.0, "100"),
        (2.6e-9, "3e-09"),
    ],
)
def test_numbers(value, shown):
    assert report.number(value) == shown


def test_a_paper_that_is_not_there(tmp_path):
    with pytest.raises(KeyError, match="dickmanns-1992"):
        papers.reproduce("nobody-1900", tmp_path)


# ------------------------------------------------------------------------------------------------ real flights

SHORT = ("time.limit_s=4", "initial.y_m=-20", "initial.heading_deg=2")


@pytest.fixture(scope="module")
def by_hand() -> Flown:
    return flying.fly(Run("do128/calm", SHORT, pilot=True))


def test_the_filter_only_watches_a_pilot(by_hand):
    """Another filter, another estimate, the same flight bit by bit."""
    other = flying.fly(Run("do128/calm", (*SHORT, "filter.kind=plain"), pilot=True))
    for column in ("true_x_m", "true_y_m", "true_H_m", "true_phi_rad"):
        np.testing.assert_array_equal(other.log[column], by_hand.log[column])
    assert not np.array_equal(other.log["est_y_m"], by_hand.log["est_y_m"])


def test_pilots_misjudge_each_in_his_own_way(by_hand):
    """The air is still: but for his eyes, one pilot would fly like the other."""
    other = flying.fly(Run("do128/calm", SHORT, seed=2, pilot=True))
    apart = np.abs(other.log["true_y_m"] - by_hand.log["true_y_m"])
    assert 0.05 < apart.max() < 20.0


def test_reference_systems_watch_nobody_else():
    assert "dgps_x_m" not in flying.fly(Run("do128/calm", (*SHORT, "time.limit_s=0.3"))).log


def test_reference_systems_watch_a_pilot_s_flight(by_hand):
    log = by_hand.log
    read = np.isfinite(log["dgps_x_m"])
    assert 3 <= read.sum() <= 5  # 4 s at 1 Hz
    assert 0.0 < np.abs(log["dgps_x_m"] - log["true_x_m"])[read].max() < 10.0
    assert np.abs(log["radar_H_m"] - log["true_H_m"]).max() < 3.0


def test_onboard_work_is_timed_without_the_drawing(by_hand):
    assert 0.0 < by_hand.estimator_ms < by_hand.cycle_ms < 60.0


@pytest.mark.slow
def test_reproduce_writes_the_report(tmp_path):
    lines: list[str] = []
    found = papers.reproduce("dickmanns-1992", tmp_path / "out", lines.append)
    assert json.loads((tmp_path / "out" / "claims.json").read_text()) == found.result
    assert found.report.read_text().startswith("<!doctype html>")
    by_id = {row["id"]: row["verdict"] for row in found.result["claims"]}
    for id in (
        "range",
        "height-approach",
        "height-runway",
        "touchdown",
        "roll-error",
        "yaw-error",
        "cycle",
    ):
        assert by_id[id] == "met", id
    assert len(lines) == len(claims.runs_of(paper.CLAIMS)) + 1
