"""The report page: what it says of results that are known, that it needs nothing else, that it survives odd campaigns."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from synthetic_campaign import fill

from landing_sim.campaign import rare_landings, store, verdict
from landing_sim.campaign.file import load
from landing_sim.campaign.plan import CampaignError, Plan
from landing_sim.campaign.report import _interval, _power, html, report
from landing_sim.campaign.report_figures import label
from landing_sim.campaign.report_sections import severity
from landing_sim.campaign.verdict import Bounds

RISKS = """
risks:
  - {name: long <far>, metric: touchdown_x_m, above: 915.0, probability: 1.0e-6}
  - {name: hard, metric: sink_rate_mps, above: 3.048, probability: 1.0e-2, source: 10 ft/s}
  - {name: lateral, metric: touchdown_y_m, above: 2.0, below: -2.0, probability: 1.0e-6}
  - {name: short, metric: gear_height_60m_m, below: 0.0, probability: 1.0e-6}
"""
TEXT = """
schema_version: 1
scenario: do128/gust
description: nobody flew this
runs: 400
set: {wind.crosswind_from_x_m: null}
dispersions:
  wind.headwind_mps: {truncated_normal: {mean: 4, sd: 3, low: -5, high: 15}}
"""
CROSS = "  wind.crosswind_mps: {truncated_normal: {mean: 0, sd: 3.5, low: -10, high: 10}}\n"
SWEEP = "sweep: {path: wind.crosswind_mps, values: [5, 10, 20], unit: kt, aim: 10}\n"


def campaign(tmp_path: Path, text: str) -> Plan:
    (tmp_path / "made_up.yaml").write_text(text)
    return load(tmp_path / "made_up.yaml")


class Page(HTMLParser):
    """Text and tags, and whatever would be fetched."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.words, self.fetched, self.open = "", list[str](), list[str]()
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "br", "link", "image", "use", "path", "rect"):
            self.open.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "xlink:href") and not (value or "").startswith(("#", "data:")):
                self.fetched.append(f"{tag} {value}")
        if tag in ("script", "link", "iframe"):
            self.fetched.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in self.open:
            while self.open.pop() != tag:
                pass

    def handle_data(self, data: str) -> None:
        self.words += " " + data


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Page]:
    folder = tmp_path_factory.mktemp("report")
    plan = campaign(folder, TEXT + CROSS + RISKS)
    fill(folder / "out dir", plan, 400, crashes=1)
    return folder / "out dir", Page(report(folder / "out dir").read_text())


def test_needs_nothing_else(page: tuple[Path, Page]) -> None:
    assert page[1].fetched == []
    assert page[1].open == []


def test_says_the_verdicts_of_the_sheet(page: tuple[Path, Page]) -> None:
    """One crash of 400 is an event of every risk: 2.5e-3, above 1e-6 for sure; sink within 1e-2 is open."""
    folder, found = page
    results = store.read(folder)
    rows = verdict.sheet(results.campaign.risks, results.columns, results.outcome, seed=results.campaign.seed)
    assert [row.verdict for row in rows] == ["FAIL", "NOT ENOUGH EVIDENCE", "FAIL", "FAIL"]
    table = found.words[: found.words.index("What is known")]
    assert table.count("FAIL") >= 3 and "1 NOT ENOUGH EVIDENCE" in table
    assert "1 without the figure" in table
    assert "long <far>" in found.words  # escaped in the file, as written on the page


def test_has_every_part(page: tuple[Path, Page]) -> None:
    folder, found = page
    order = ["What is known", "Where they touched down", "Figures and their tails", "The worst 10 landings"]
    order += ["What explains the scatter", "Does the estimator know", "What was drawn", "How long it took"]
    places = [found.words.index(title) for title in order]
    assert places == sorted(places)
    assert "399 landed" in re.sub(r"\s+", " ", found.words) and "1 crash" in re.sub(r"\s+", " ", found.words)
    assert f"landing-sim replay '{folder}' --run 399" in found.words  # the crash is the worst
    assert "2 processes" in found.words and "2.0" in found.words


def test_same_results_same_bytes(page: tuple[Path, Page]) -> None:
    folder, _ = page
    results, plan = store.read(folder), store.plan(folder)
    assert html(results, plan, folder) == (folder / "report.html").read_text()


def test_sweep(tmp_path: Path) -> None:
    """The table is that of the value aimed at; every value has its line, and the largest one shown is named."""
    plan = campaign(tmp_path, TEXT + SWEEP + RISKS.replace("1.0e-6", "1.0e-1"))
    fill(tmp_path / "out", plan, 390)
    found = Page(report(tmp_path / "out").read_text()).words
    assert "at wind.crosswind_mps = 10 kt" in found
    assert "0 of 130" in found
    assert "Over the sweep" in found and re.search(r"PASS up to\s+20 kt", found)


def test_rare_event_runs_are_shown(tmp_path: Path) -> None:
    plan = campaign(tmp_path, TEXT + CROSS + RISKS)
    fill(tmp_path / "out", plan, 60)
    results = store.read(tmp_path / "out")
    level = {"share": 0.1, "threshold": 1.0}
    details = {"hard": {"probability": 1e-9, "lower": 3e-10, "upper": 4e-9, "reached": True, "levels": [level] * 9}}
    details["hard"] |= {"evaluations": 8200, "seconds": 7000.0, "held": None}
    found = Page(html(results, plan, tmp_path, {"hard": Bounds(1e-9, 3e-10, 4e-9)}, details)).words
    assert "8,200" in found and "117 min" in found
    assert "by rare-event run" in found and "3.0·10⁻¹⁰ … 4.0·10⁻⁹" in found
    assert rare_landings.saved(tmp_path / "out", plan) == {}


@pytest.mark.parametrize("runs", [0, 12])
def test_few_landings(tmp_path: Path, runs: int) -> None:
    plan = campaign(tmp_path, TEXT + CROSS + RISKS)
    fill(tmp_path / "out", plan, runs)
    found = Page(report(tmp_path / "out").read_text()).words
    assert f"{runs} landings (of 400)" in found
    assert "NOT ENOUGH EVIDENCE" in found


def test_all_crashed_and_no_risks(tmp_path: Path) -> None:
    plan = campaign(tmp_path, TEXT + CROSS)
    fill(tmp_path / "out", plan, 20, crashes=20)
    found = Page(report(tmp_path / "out").read_text()).words
    assert "names no risk" in found and "20 flights never touched" in found


def test_a_folder_without_a_campaign(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="holds no"):
        report(tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_severity_ranks() -> None:
    """0 the median, 1 the limit on either side, beyond it more; a crash first, a go-around never."""
    risk = verdict.judge(_Risk(), np.zeros(3), np.array(["landed"] * 3))
    values = np.array([0.0, 15.0, -7.5, 30.0, np.nan, np.nan, 0.0])
    outcome = np.array(["landed", "landed", "landed", "off_runway", "crash", "go_around", "landed"])
    np.testing.assert_allclose(severity(risk, values, outcome), [0.0, 1.0, 0.5, 2.0, np.inf, -np.inf, 0.0])


class _Risk:
    name, metric, above, below, probability = "lateral", "y", 15.0, -15.0, 1e-6


def test_numbers_as_people_write_them() -> None:
    assert [_power(p) for p in (1e-6, 3.2e-8, 0.0018, 1.0, 0.0, 1e-5)] == [
        "10⁻⁶",
        "3.2·10⁻⁸",
        "0.0018",
        "1",
        "0",
        "10⁻⁵",
    ]
    assert _interval(0.0, 1e-4) == "< 10⁻⁴"
    assert _interval(2e-5, 1e-4) == "2.0·10⁻⁵ … 10⁻⁴"
    assert [label(m) for m in ("touchdown_x_m", "wind.headwind_mps", "nees", "cg_percent", "aircraft.mass_kg")] == [
        "touchdown x [m]", "wind headwind [m/s]", "nees", "cg [%]", "aircraft mass [kg]"]  # fmt: skip
