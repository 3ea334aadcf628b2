"""A finished flight as tables for a terminal."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from landing_sim.record.judge import Criterion, Verdict, touchdown_json
from landing_sim.record.log import FlightLog

_PAPER_ERRORS = {  # Dickmanns & Schell 1992, section 7.1
    "range": "5 m",
    "height_approach": "1 m",
    "height_runway": "0.5 m",
    "lateral": "1 m, 3 m in the gust",
    "roll": "1 deg",
    "yaw": "1 deg",
}
_TITLES = {
    "range": "range, threshold in view, within 500 m",
    "range_far": "range, threshold in view, beyond 500 m",
    "height_approach": "height on approach",
    "height_runway": "height over the runway",
    "lateral": "lateral offset",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
    "airspeed": "airspeed",
    "speed_forward": "speed over ground, forward",
    "wind_along": "wind along the runway",
    "wind_across": "wind across",
    "wind_down": "wind down",
    "width": "runway width",
}
_TOUCHDOWN = (
    ("x_m", "behind the threshold", "m", "550"),
    ("y_m", "right of the centreline", "m", ""),
    ("sink_rate_mps", "sink rate", "m/s", ""),
    ("airspeed_mps", "airspeed", "m/s", "43"),
    ("groundspeed_mps", "ground speed", "m/s", ""),
    ("pitch_deg", "pitch", "deg", ""),
    ("bank_deg", "bank", "deg", ""),
    ("heading_error_deg", "heading off the runway's", "deg", ""),
    ("sideslip_deg", "sideslip", "deg", ""),
    ("time_s", "time", "s", ""),
)


def flight_tables(log: FlightLog, verdict: Verdict) -> RenderableType:
    """Touchdown and accuracy beside the paper's figures, then the criteria."""
    return Group(touchdown_table(log), error_table(verdict), criteria_table(verdict.criteria), outcome_line(verdict))


def touchdown_table(log: FlightLog) -> RenderableType:
    touchdown = touchdown_json(log)
    if touchdown is None:
        return Text("no touchdown", style="yellow")
    table = Table(title="Touchdown (first main wheel)", title_justify="left")
    for heading in ("", "ours", "paper", ""):
        table.add_column(heading, justify="right" if heading else "left")
    for key, title, unit, paper in _TOUCHDOWN:
        table.add_row(title, number(touchdown[key]), paper, unit)
    return table


def error_table(verdict: Verdict) -> Table:
    table = Table(title="Estimate against truth, from 1.5 s after acquisition", title_justify="left")
    table.add_column("")
    for heading in ("largest", "rms", "", "paper"):
        table.add_column(heading, justify="left" if heading in ("", "paper") else "right")
    for name, error in verdict.errors.items():
        row = (_TITLES[name], number(error["max"]), number(error["rms"]), error["unit"], _PAPER_ERRORS.get(name, ""))
        table.add_row(*row)
    return table


def criteria_table(criteria: tuple[Criterion, ...]) -> Table:
    table = Table(title="Criteria", title_justify="left")
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column("limit", justify="right")
    table.add_column("")
    table.add_column("source")
    for c in criteria:
        mark = Text("passed", style="green") if c.passed else Text("missed", style="bold red")
        limit = f"{c.limit[0]:g} … {c.limit[1]:g}" if isinstance(c.limit, tuple) else f"{c.limit:g}"
        table.add_row(c.name, number(c.value), limit, mark, c.source)
    return table


def outcome_line(verdict: Verdict) -> Text:
    missed = [c.name for c in verdict.criteria if not c.passed]
    if verdict.passed:
        return Text(f"{verdict.outcome}: every criterion met", style="bold green")
    return Text(f"{verdict.outcome}; missed: {', '.join(missed) or 'nothing but the landing'}", style="bold red")


def number(value: float | None) -> str:
    """Three figures that matter, no exponent; a dash for what does not exist."""
    if value is None or not math.isfinite(value):
        return "–"
    digits = 0 if abs(value) >= 100.0 else 1 if abs(value) >= 10.0 else 2
    return f"{value:.{digits}f}" if abs(value) >= 0.005 or value == 0.0 else f"{value:.4f}"
