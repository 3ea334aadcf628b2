"""A campaign's results as one HTML file that needs nothing else: the verdict first, then what it rests on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.campaign import rare_landings, report_figures, store, verdict
from landing_sim.campaign import report_sections as part
from landing_sim.campaign.plan import Campaign, Plan
from landing_sim.campaign.report_template import TEMPLATE
from landing_sim.campaign.store import Results
from landing_sim.campaign.units import factor
from landing_sim.campaign.verdict import FAIL, OPEN, PASS, Bounds, Judged
from landing_sim.papers.report import write

FILE = "report.html"
WORDS = {"PASS": PASS, "FAIL": FAIL, "OPEN": OPEN}
MARKS = {word: mark for mark, word in WORDS.items()} | {part.SHORT[OPEN]: "OPEN"}


def report(folder: Path) -> Path:
    """Write `folder`/report.html from what has been flown there. Raises CampaignError where there is no campaign."""
    results, plan = store.read(folder), store.plan(folder)
    rare, details = rare_landings.saved(folder, plan), rare_landings.details(folder, plan)
    write(html(results, plan, folder, rare, details), folder / FILE)
    return folder / FILE


def html(
    results: Results,
    plan: Plan,
    folder: Path,
    rare: Mapping[str, Bounds] | None = None,
    details: Mapping[str, Mapping[str, Any]] | None = None,
) -> str:
    """The page. Same results, same bytes.

    folder : as replay commands name it; rare, details : of rare-event runs, by the risks' names
    """
    import jinja2

    campaign, columns, outcome = results.campaign, results.columns, results.outcome
    aim, swept = _sweep(results, campaign, rare)
    use = np.ones(len(results), bool) if aim is None else columns[campaign.sweep.path] == aim[0]  # type: ignore[union-attr]
    rows = verdict.sheet(
        campaign.risks, {name: column[use] for name, column in columns.items()}, outcome[use], rare, campaign.seed
    )
    verdicts = [row.verdict for row in rows]
    overall = "FAIL" if FAIL in verdicts else "PASS" if verdicts and set(verdicts) == {PASS} else "OPEN"
    sections = [
        *part.bounds(rows),
        *part.over_sweep(swept, campaign),
        *part.rare_events(details or {}),
        *part.footprint(results, plan, rows),
        *part.distributions(rows, columns, use),
        part.worst(results, rows, use, folder),
        *part.sensitivity(results, use, plan.mission),
        *part.consistency(columns),
        part.drawn(results),
        part.effort(results),
    ]
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(TEMPLATE).render(
        title=f"Campaign {campaign.name}",
        description=campaign.description,
        landings=f"{len(results):,} landings" + ("" if len(results) == campaign.runs else f" (of {campaign.runs:,})"),
        scenario=campaign.scenario,
        seed=campaign.seed,
        overall=overall,
        words=WORDS,
        marks=MARKS,
        summary=_summary(rows, aim, campaign),
        outcomes=[(name.replace("_", " "), f"{count:,}") for name, count in Counter(outcome.tolist()).most_common()],
        rows=[_row(row, campaign, swept) for row in rows],
        any_rare=any(row.rare is not None for row in rows),
        sweep=campaign.sweep,
        sobol=campaign.sampling == "sobol",
        sections=sections,
    )


# ------------------------------------------------------------------------------------------------------- verdict


def _sweep(
    results: Results, campaign: Campaign, rare: Mapping[str, Bounds] | None
) -> tuple[tuple[float, str] | None, tuple[verdict.Swept, ...]]:
    """The value that the verdict is about, as the column has it and in words, and the verdicts at every value."""
    sweep = campaign.sweep
    if sweep is None:
        return None, ()
    held = results.columns[sweep.path]
    aim = (sweep.values[-1] if sweep.aim is None else sweep.aim) * factor(sweep.path, sweep.unit)
    swept = verdict.sweep(campaign.risks, held, results.columns, results.outcome, campaign.seed, rare, aim)
    return (aim, f"{sweep.path} = {part.held(aim, campaign)}"), swept


def _summary(rows: Sequence[Judged], aim: tuple[float, str] | None, campaign: Campaign) -> str:
    if not rows:
        return "The campaign names no risk."
    counts = Counter(row.verdict for row in rows)
    parts = [f"{counts[v]} {v}" for v in (PASS, FAIL, OPEN) if counts[v]]
    at = "" if aim is None else f" at {aim[1]}"
    return f"{len(rows)} risks{at}: {', '.join(parts)}."


def _row(row: Judged, campaign: Campaign, swept: Sequence[verdict.Swept]) -> dict[str, Any]:
    source = next((risk.source for risk in campaign.risks if risk.name == row.name), "")
    largest = next((part.held(one.largest_passing, campaign) for one in swept if one.name == row.name), "")
    tail = row.tail
    fit = row.no_tail if tail is None else f"goodness of fit p = {min(t.p_value for t in tail.tails):.2g}"
    return {
        "name": row.name,
        "source": source,
        "event": part.event(row),
        "notes": row.notes,
        "limit": _power(row.probability),
        "count": f"{row.count:,}",
        "n": f"{row.n:,}",
        "go_arounds": row.go_arounds,
        "unmeasured": row.unmeasured,
        "by_count": _interval(row.by_count.lower, row.by_count.upper),
        "by_tail": "–" if tail is None else _interval(tail.lower, tail.upper),
        "fit": fit,
        "by_rare": "–" if row.rare is None else _interval(row.rare.lower, row.rare.upper),
        "method": row.method,
        "mark": MARKS[row.verdict],
        "verdict": row.verdict,
        "largest": largest,
    }


def _power(p: float) -> str:
    """1e-06 as people write it."""
    if p <= 0.0:
        return "0"
    exponent = math.floor(math.log10(p) + 1e-9)
    if exponent >= -3:
        return f"{p:.2g}"
    factor_ = p / 10.0**exponent
    raised = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if abs(factor_ - 1.0) < 0.05 else f"{factor_:.1f}·10{raised}"


def _interval(low: float, high: float) -> str:
    return f"{_power(low)} … {_power(high)}" if low > report_figures.SMALLEST else f"< {_power(high)}"
