"""The verdict sheet of a campaign's results: what `campaign` prints, and `campaign --json`."""

from __future__ import annotations

import shlex
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.campaign import verdict
from landing_sim.campaign.figures import GOOD
from landing_sim.campaign.store import FILE, HISTORIES, Results
from landing_sim.campaign.units import factor

STYLES = {verdict.PASS: "[bold green]PASS[/]", verdict.FAIL: "[bold red]FAIL[/]"}


def sheet(results: Results, folder: Path, rare: Mapping[str, verdict.Bounds] | None = None) -> dict[str, Any]:
    """The object that `campaign --json` prints.

    Of a campaign with a sweep each risk's row is that of the value aimed at, and says for which values it is PASS.

    rare : by the risks' names, what rare-event runs found
    """
    campaign, columns, outcome = results.campaign, results.columns, results.outcome
    sweep = campaign.sweep
    found: dict[str, Any] = {
        "campaign": campaign.name,
        "runs": len(results),
        "outcomes": dict(sorted(Counter(outcome.tolist()).items())),
    }
    if sweep is None:
        rows = [verdict.to_json(row) for row in verdict.sheet(campaign.risks, columns, outcome, rare, campaign.seed)]
    else:
        scale = factor(sweep.path, sweep.unit)
        aim = sweep.values[-1] if sweep.aim is None else sweep.aim
        rows = []
        swept = verdict.sweep(campaign.risks, columns[sweep.path], columns, outcome, campaign.seed, rare, aim * scale)
        nothing = np.empty(0), np.empty(0, dtype=str)
        for risk, asked in zip(swept, campaign.risks):
            by_value = {
                _given(held, sweep.values, scale): verdict.to_json(row) for held, row in zip(risk.values, risk.judged)
            }
            largest = None if risk.largest_passing is None else _given(risk.largest_passing, sweep.values, scale)
            at_aim = by_value.get(aim) or verdict.to_json(verdict.judge(asked, *nothing))
            table = [{"value": value} | row for value, row in by_value.items()]
            rows.append(at_aim | {"largest_pass": largest, "by_value": table})
        found["sweep"] = {"path": sweep.path, "unit": sweep.unit, "aim": aim, "values": sorted(sweep.values)}
    found["risks"] = rows
    found["passed"] = bool(rows) and all(row["verdict"] == verdict.PASS for row in rows)
    found["files"] = {"results": str(folder / FILE)}
    if (folder / HISTORIES).is_dir():
        found["files"]["histories"] = str(folder / HISTORIES)
    return found


def _given(held: float, values: tuple[float, ...], scale: float) -> float:
    """The value as the file gives it: `held` is in the scenario's unit."""
    return min(values, key=lambda value: abs(value * scale - held))


def table(found: Mapping[str, Any], results: Results, folder: Path) -> None:
    """The same for people."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120)
    sweep = found.get("sweep")
    at = f", {sweep['path']} = {sweep['aim']:g} {sweep['unit'] or ''}" if sweep else ""
    title = escape(f"{found['campaign']}, {found['runs']} landings{at}")
    rows = Table(title=title, title_justify="left", box=SIMPLE_HEAD)
    headings = [
        ("risk", "left"),
        ("event", "left"),
        ("seen", "right"),
        ("95 % bounds", "right"),
        ("must be below", "right"),
    ]
    for heading, justify in [*headings, ("by", "left"), ("verdict", "left")] + [("PASS up to", "right")] * bool(sweep):
        rows.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for row in found["risks"]:
        largest = [] if sweep is None else [f"{row['largest_pass']:g}" if row["largest_pass"] is not None else "none"]
        rows.add_row(
            escape(row["name"]),
            _event(row),
            f"{row['count']} of {row['n']}",
            f"{row['lower95']:.2g} ... {row['upper95']:.2g}",
            f"{row['limit']:.0e}",
            row["method"],
            STYLES.get(row["verdict"], f"[bold yellow]{row['verdict']}[/]"),
            *largest,
        )
    if found["risks"]:
        console.print(rows)
        for row in found["risks"]:
            for note in row["notes"]:
                console.print(f"  {escape(row['name'])}: {escape(note)}", highlight=False)
    else:
        console.print(f"{title}: the file names no risk", highlight=False)
    outcomes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in found["outcomes"].items())
    console.print(f"Outcomes: {outcomes or 'none'}", highlight=False)
    odd = [int(run) for run, end in zip(results.columns["run"], results.outcome) if end not in GOOD]
    if odd:
        shown = ", ".join(map(str, odd[:10])) + (f" and {len(odd) - 10} more" if len(odd) > 10 else "")
        console.print(f"Not landed: {shown}", highlight=False)
    for kind, file in found["files"].items():
        console.print(f"  {kind:10} {file}", highlight=False, markup=False, soft_wrap=True)
    if odd:
        command = f"landing-sim replay {shlex.quote(str(folder))} --run {odd[0]}"
        console.print(f"  watch one: {command}", markup=False, highlight=False, soft_wrap=True)


def _event(row: Mapping[str, Any]) -> str:
    parts = [f"< {row['below']:g}"] if row["below"] is not None else []
    parts += [f"> {row['above']:g}"] if row["above"] is not None else []
    return f"{row['metric']} {' or '.join(parts)}"
