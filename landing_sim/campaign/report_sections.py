"""The sections of a campaign's report below its verdict table: words, figures and tables, from results alone."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.campaign import report_figures, verdict
from landing_sim.campaign.figures import NEES_BANDS, SCATTER
from landing_sim.campaign.plan import Campaign, Plan
from landing_sim.campaign.report_figures import label
from landing_sim.campaign.sensitivity import strongest
from landing_sim.campaign.store import Results
from landing_sim.campaign.units import factor
from landing_sim.campaign.verdict import Judged, Risk
from landing_sim.papers.report import number
from landing_sim.types import Array

WORST = 10
SHORT = {verdict.PASS: "PASS", verdict.FAIL: "FAIL", verdict.OPEN: "not enough"}


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure and its words."""

    svg: str
    title: str = ""
    aside: str = ""
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Lines under headings; columns of numbers stand right, of code in a fixed width."""

    headings: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    numbers: tuple[str, ...] = ()
    code: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """A heading of the page and what stands under it."""

    title: str
    lead: str = ""
    figures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()


def event(row: Judged) -> str:
    """The event in words, with its unit."""
    parts = [f"< {row.below:g}"] if row.below is not None else []
    parts += [f"> {row.above:g}"] if row.above is not None else []
    return f"{label(row.metric)} {' or '.join(parts)}"


def held(value: float | None, campaign: Campaign) -> str:
    """A swept value in the file's own unit."""
    if value is None or campaign.sweep is None:
        return "none"
    unit = campaign.sweep.unit
    return f"{value / factor(campaign.sweep.path, unit):.4g}" + (f" {unit}" if unit else "")


def bounds(rows: Sequence[Judged]) -> list[Section]:
    """Every risk's intervals in one figure."""
    if not rows:
        return []
    caption = (
        "Points: estimates. An interval that ends left of the dark mark is PASS, one that begins right of it FAIL."
    )
    return [Section("What is known of each risk", figures=(Picture(report_figures.bounds(rows), caption=caption),))]


def over_sweep(swept: Sequence[verdict.Swept], campaign: Campaign) -> list[Section]:
    """Verdicts and bounds at every value of a sweep."""
    sweep = campaign.sweep
    if sweep is None or not swept:
        return []
    scale = factor(sweep.path, sweep.unit)
    values = [value / scale for value in swept[0].values]
    path = f"{sweep.path.rsplit('_', 1)[0]}_{sweep.unit}" if sweep.unit else sweep.path
    named = [(one.name, one.judged) for one in swept]
    figures = tuple(
        Picture(report_figures.swept(values, dict(named[k : k + 3]), path)) for k in range(0, len(named), 3)
    )
    headings = (label(path), *(one.name for one in swept))
    lines = tuple((f"{value:g}", *(SHORT[one.judged[k].verdict] for one in swept)) for k, value in enumerate(values))
    last = ("PASS up to", *(held(one.largest_passing, campaign) for one in swept))
    lead = f"Every landing holds {sweep.path} at one of {len(values)} values. Bars: 95 % intervals, dashed: the risk."
    return [Section("Over the sweep", lead, figures, (Table(headings, (*lines, last)),))]


def rare_events(details: Mapping[str, Mapping[str, Any]]) -> list[Section]:
    """What rare-event runs found, and by how many landings."""
    if not details:
        return []
    lines = []
    for name, found in details.items():
        levels, reached = found["levels"], found["reached"]
        shares = " · ".join(number(level["share"]) for level in levels)
        held = "" if found.get("held") is None else f" at {found['held']:g}"
        lines.append(
            (
                name + held,
                f"{found['probability']:.2g}" if reached else "not reached",
                f"{found['lower']:.1g} … {found['upper']:.1g}",
                shares,
                f"{found['evaluations']:,}",
                _duration(float(found.get("seconds") or 0.0)),
            )
        )
    headings = ("risk", "probability", "95 %", "shares of the levels", "landings", "took")
    lead = (
        "Subset simulation: each level's landings start from the worst of the last one's and move every random number "
        "behind them a little. The probability is the product of the shares."
    )
    table = Table(headings, tuple(lines), ("probability", "95 %", "landings", "took"))
    return [Section("Rare-event runs", lead, tables=(table,))]


def footprint(results: Results, plan: Plan, rows: Sequence[Judged]) -> list[Section]:
    """Touchdowns on the drawn runway, with the legal box; nothing where there is no runway."""
    if plan.mission != "runway_landing":
        return []
    columns, outcome = results.columns, results.outcome
    runway = plan.scenario["runway"]
    x, y = columns["touchdown_x_m"], columns["touchdown_y_m"]
    event = np.zeros(len(results), bool)
    for row in rows:
        event |= verdict.events(row, columns[row.metric], outcome)[1]
    svg = report_figures.footprint(
        x, y, event, outcome != "landed", float(runway["width_m"]), float(runway["length_m"]), _box(rows)
    )
    known = np.isfinite(x) & np.isfinite(y)
    caption = "Along the runway to scale, across it stretched. "
    if known.any():
        along, across = np.percentile(x[known], [5, 50, 95]), np.percentile(y[known], [5, 50, 95])
        caption += (
            f"x: median {along[1]:.0f} m, 5 to 95 % {along[0]:.0f} … {along[2]:.0f} m, sd {np.std(x[known]):.0f} m; "
            f"y: median {across[1]:.2f} m, 5 to 95 % {across[0]:.2f} … {across[2]:.2f} m, sd {np.std(y[known]):.2f} m."
        )
    if (~known).any():
        caption += f" {int((~known).sum())} flights never touched the ground on their wheels."
    return [Section("Where they touched down", figures=(Picture(svg, caption=caption),))]


def _box(rows: Sequence[Judged]) -> tuple[float | None, float | None, float | None]:
    """Nearest x, farthest x, largest |y| that no risk forbids; the wheels' height at 60 m is a nearest x of 60 m."""
    near = [row.below for row in rows if row.metric == "touchdown_x_m" and row.below is not None]
    near += [60.0 for row in rows if row.metric == "gear_height_60m_m" and row.below is not None]
    far = [row.above for row in rows if row.metric == "touchdown_x_m" and row.above is not None]
    side = [abs(v) for row in rows if row.metric == "touchdown_y_m" for v in (row.above, row.below) if v is not None]
    return max(near, default=None), min(far, default=None), min(side, default=None)


def distributions(rows: Sequence[Judged], columns: Mapping[str, Array], use: np.ndarray) -> list[Section]:
    """Each risk's figure: histogram, limits, fitted tails."""
    figures = []
    for row in rows:
        values = columns[row.metric][use]
        if not np.isfinite(values).any():
            continue
        known = values[np.isfinite(values)]
        caption = f"mean {number(float(known.mean()))}, sd {number(float(known.std()))}, "
        caption += f"{number(float(known.min()))} … {number(float(known.max()))} in {len(known):,} landings. "
        if row.tail is None:
            caption += f"No tail is fitted: {row.no_tail}."
        for tail in () if row.tail is None else row.tail.tails:
            caption += (
                f"{'Upper' if tail.side > 0 else 'Lower'} tail: {tail.excesses} values beyond {number(tail.threshold)}, "
                f"shape {tail.shape:.2f}, Anderson–Darling p = {tail.p_value:.2g}. "
            )
        figures.append(Picture(report_figures.distribution(row, values), row.name, event(row), caption))
    return [Section("Figures and their tails", figures=tuple(figures))] if figures else []


def severity(risk: Risk, values: Array, outcome: np.ndarray) -> Array:
    """(n,) how near each landing came to the event: 0 the median landing, 1 the limit; infinite without the figure."""
    counted, happened = verdict.events(risk, values, outcome)
    known = np.isfinite(values)
    middle = float(np.median(values[known])) if known.any() else math.nan
    found = np.full(len(values), -math.inf)
    for limit in (risk.above, risk.below):
        if limit is not None and limit != middle:
            found[known] = np.maximum(found[known], (values[known] - middle) / (limit - middle))
    found[happened & ~known] = math.inf
    found[happened & np.isin(outcome, verdict.ALWAYS_EVENTS)] = math.inf
    return np.where(counted, found, -math.inf)


def worst(results: Results, rows: Sequence[Judged], use: np.ndarray, folder: Path) -> Section:
    """The landings that came nearest to any risk's event, and how to watch them."""
    columns, outcome = results.columns, results.outcome
    title = f"The worst {WORST} landings"
    if not rows or not len(results):
        return Section(title, "Nothing to rank: the campaign names no risk.")
    table = np.array([severity(row, columns[row.metric], outcome) for row in rows])
    worst = np.where(use, table.max(axis=0), -math.inf)
    order = [int(k) for k in np.argsort(-worst, kind="stable")[:WORST] if worst[k] > -math.inf]
    drawn = [name for name in results.dispersed if name.startswith("wind.")] or list(results.dispersed)
    drawn = drawn[:3]
    lines = []
    for k in order:
        row = rows[int(np.argmax(table[:, k]))]
        value = columns[row.metric][k]
        lines.append(
            (
                f"{int(columns['run'][k])}",
                str(outcome[k]).replace("_", " "),
                row.name if math.isfinite(value) else "no figure",
                f"{number(float(value))}" + (f" ({100 * worst[k]:.0f} %)" if math.isfinite(worst[k]) else ""),
                *(number(float(columns[name][k])) for name in drawn),
                f"landing-sim replay {shlex.quote(str(folder))} --run {int(columns['run'][k])}",
            )
        )
    headings = ("run", "outcome", "nearest to", "its figure", *map(label, drawn), "watch it")
    lead = "How near a landing came: 0 % is the median landing, 100 % the limit. Replay flies it again, bit for bit."
    right = ("run", "its figure", *map(label, drawn))
    return Section(title, lead, tables=(Table(headings, tuple(lines), right, ("watch it",)),))


def sensitivity(results: Results, use: np.ndarray, mission: str) -> list[Section]:
    """Which draws explain the scatter at touchdown."""
    columns = {name: column[use] for name, column in results.columns.items()}
    found = strongest(SCATTER[mission], columns, results.dispersed, results.campaign.seed)
    if not found:
        return []
    figures = tuple(Picture(report_figures.effects(found[k : k + 2])) for k in range(0, len(found), 2))
    lead = (
        "First-order Sobol indices of what was drawn, from these landings, with 95 % intervals. Orange: the figure rises "
        "with it, blue: it falls (rank regression), grey: neither for sure. What is missing to 100 % is turbulence, sensor "
        "noise and effects of several together."
    )
    return [Section("What explains the scatter", lead, figures)]


def consistency(columns: Mapping[str, Array]) -> list[Section]:
    """NEES over the stretches of the approach."""

    def words(band: tuple[float, float]) -> str:
        low, high = band
        if math.isinf(low):
            return f"beyond {-high:g} m"
        return "over the runway" if math.isinf(high) else f"{-low:g} … {abs(high):g} m"

    bands = {words(NEES_BANDS[name]): columns[name] for name in NEES_BANDS if name in columns}
    bands = {name: values for name, values in bands.items() if np.isfinite(values).any()}
    if not bands:
        return []
    caption = (
        "Squared error of the estimate over the variance it claims, per state; each landing's mean over a stretch of the "
        "way to the threshold. 1: the filter knows what it does not know; above: it is surer than it should be. Thick: "
        "middle half of the landings, thin: 5 to 95 %."
    )
    picture = Picture(report_figures.consistency(bands), caption=caption)
    return [Section("Does the estimator know its errors?", figures=(picture,))]


def drawn(results: Results) -> Section:
    """Mean and spread of everything that was drawn."""
    headings = ("value", "mean", "sd", "least", "most")
    lines = []
    for name in results.dispersed:
        values = results.columns[name]
        values = values[np.isfinite(values)]
        if len(values):
            figures = (values.mean(), values.std(), values.min(), values.max())
            lines.append((label(name), *(number(float(v)) for v in figures)))
    return Section("What was drawn", tables=(Table(headings, tuple(lines), headings[1:]),))


def effort(results: Results) -> Section:
    """Sessions, machine, software, processor time."""
    columns, sessions = results.columns, results.meta["sessions"]
    lines = []
    for s in sessions:
        began = datetime.fromtimestamp(s["started"], UTC).strftime("%Y-%m-%d %H:%M UTC")
        landings, seconds = s.get("landings"), s.get("seconds")
        rate = f"{landings / seconds:.2f}" if landings and seconds else "–"
        machine = s.get("machine", {})
        count = s.get("workers")
        workers = "dask" if count is None else "1 process" if count == 1 else f"{count} processes"
        lines.append(
            (
                began,
                "interrupted" if seconds is None else _duration(seconds),
                "–" if landings is None else f"{landings:,}",
                rate,
                workers,
                f"{machine.get('processor', '')}, {machine.get('cores', '?')} cores, {machine.get('system', '')}",
            )
        )
    headings = ("began", "took", "landings", "landings/s", "workers", "on")
    cpu = columns["cpu_s"][np.isfinite(columns["cpu_s"])]
    lead = ""
    if len(cpu):
        lead = f"{_duration(float(cpu.sum()))} of processor time in all, {np.median(cpu):.2f} s a landing (median). "
    if "peak_mb" in columns and np.isfinite(columns["peak_mb"]).any():
        lead += f"Largest worker: {np.nanmax(columns['peak_mb']):.0f} MB. "
    software = sessions[-1].get("software", {}) if sessions else {}
    lead += ", ".join(f"{name} {version}" for name, version in software.items())
    table = Table(headings, tuple(lines), ("took", "landings", "landings/s"))
    return Section("How long it took, and on what", lead, tables=(table,))


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
