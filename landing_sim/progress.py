"""What a person sees of a flight: progress while it lasts (on stderr), a table when it is over (on stdout)."""

from __future__ import annotations

import json
import math
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from landing_sim.scenario import Scenario
from landing_sim.signals import Step

if TYPE_CHECKING:
    from landing_sim.campaign import run as campaign_run

EVERY = 5.0  # [s] between lines of a campaign's progress

LABELS = {
    "range_m": "range error, within 500 m",
    "range_far_percent": "range error, beyond 500 m",
    "height_approach_m": "height error, approach",
    "height_runway_m": "height error, over the runway",
    "lateral_m": "lateral error",
    "roll_deg": "roll error",
    "pitch_deg": "pitch error",
    "yaw_deg": "yaw error",
    "airspeed_mps": "airspeed error",
    "captured_after_m": "within 5 m of the centreline after",
    "peak_roll_deg": "peak bank",
    "range_1km_percent": "range error, 1 km before the threshold",
    "threshold_lateral_error_m": "lateral error over the threshold",
    "threshold_height_error_m": "height error over the threshold",
    "threshold_y_m": "off the centreline over the threshold",
    "threshold_above_m": "above the path over the threshold",
    "touchdown_x_m": "touchdown x",
    "touchdown_y_m": "touchdown y",
    "sink_rate_mps": "sink rate at touchdown",
    "touchdown_airspeed_mps": "airspeed at touchdown",
    "final_groundspeed_mps": "ground speed at the end",
    "rollout_y_m": "off the centreline on the ground",
    "hover_rms_m": "rms distance from the hover point",
    "miss_m": "touchdown from the platform's middle",
    "touchdown_tilt_deg": "tilt at touchdown",
}
UNITS = {"m": "m", "deg": "deg", "mps": "m/s", "percent": "%"}


@contextmanager
def shown(scenario: Scenario) -> Iterator[Callable[[Step], None]]:
    """A watcher of steps: a bar on a terminal, else one JSON line a flight phase."""
    if not sys.stderr.isatty():
        yield _lines()
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        total, gone = _way(scenario)
        task = bar.add_task(escape(scenario.name), total=total, state="compiling, loading")

        def watch(step: Step) -> None:
            x, height, airspeed = step.truth.p_RB[0], -step.truth.p_RB[2], step.truth.airspeed
            state = f"{step.reference.mode:9} x {x:6.0f} m  H {height:5.1f} m  {airspeed:4.1f} m/s"
            bar.update(task, completed=gone(step), state=state)

        yield watch


def _way(scenario: Scenario) -> tuple[float, Callable[[Step], float]]:
    """What is to be done, and how much of it is: the way along the ground, or the time that a quadrotor has."""
    mission = str(scenario.mission)
    if mission == "quadrotor_landing":
        return scenario.time.limit_s, lambda step: step.truth.t
    start = scenario.initial.x_m if mission == "runway_landing" else -850.0
    total = scenario.runway.length_m - start if mission == "runway_landing" else -start
    return total, lambda step: float(step.truth.p_RB[0]) - start


def _lines() -> Callable[[Step], None]:
    mode = ""

    def watch(step: Step) -> None:
        nonlocal mode
        if step.reference.mode != mode:
            mode = step.reference.mode
            p = step.truth.p_RB
            line = {"t_s": round(step.truth.t, 3), "phase": mode, "x_m": round(p[0], 1), "height_m": round(-p[2], 2)}
            print(json.dumps(line), file=sys.stderr, flush=True)

    return watch


@contextmanager
def campaign_shown(name: str, runs: int) -> Iterator[Callable[[campaign_run.Progress], None]]:
    """A watcher of a campaign: a bar on a terminal, else a JSON line every few seconds: rate and time that remains."""
    started = time.monotonic()

    def figures(now: campaign_run.Progress) -> tuple[float, float]:
        """[1/s] landings, [s] remaining"""
        rate = now.here / max(time.monotonic() - started, 1e-3)
        return rate, (now.runs - now.done) / rate

    if not sys.stderr.isatty():
        last = -math.inf

        def say(now: campaign_run.Progress) -> None:
            nonlocal last
            if now.done < now.runs and time.monotonic() - last < EVERY:
                return
            last = time.monotonic()
            rate, left = figures(now)
            line = {"landings": now.done, "of": now.runs, "per_s": round(rate, 3), "remaining_s": round(left)}
            print(json.dumps(line), file=sys.stderr, flush=True)

        yield say
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[state]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(escape(name), total=runs, state="starting workers")

        def watch(now: campaign_run.Progress) -> None:
            rate, left = figures(now)
            state = f"{rate:.2f}/s, {timedelta(seconds=round(left))} left; run {now.latest.run} {now.latest.outcome}"
            bar.update(task, completed=now.done, state=state)

        yield watch


def table(result: dict[str, Any]) -> None:
    """The result of a run: touchdown, every criterion beside its limit and source, files."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    console = _console()
    title = escape(f"{result['scenario']}, seed {result['seed']}")
    rows = Table(title=title, title_justify="left", box=SIMPLE_HEAD)
    for heading, justify in (("", "left"), ("ours", "right"), ("limit", "right"), ("", "left"), ("source", "left")):
        rows.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for criterion in result["criteria"]:
        value, limit = criterion["value"], criterion["limit"]
        unit = UNITS.get(criterion["name"].rsplit("_", 1)[-1], "")
        bounds = f"{limit[0]:g} ... {limit[1]:g}" if isinstance(limit, list) else f"{limit:g}"
        rows.add_row(
            LABELS.get(criterion["name"], criterion["name"]),
            "none" if value is None else f"{value:.{2 if abs(value) >= 0.2 else 3}f} {unit}",
            f"{bounds} {unit}",
            "[green]met[/]" if criterion["passed"] else "[bold red]not met[/]",
            escape(criterion["source"]),
        )
    console.print(rows)
    touchdown = result["touchdown"]
    if touchdown:
        x = touchdown["x_m"]
        at = f"x {x:.{0 if abs(x) >= 100 else 2}f} m, y {touchdown['y_m']:+.2f} m"
        console.print(
            f"Touchdown after {touchdown['time_s']:.1f} s at {at}: "
            f"sink {touchdown['sink_rate_mps']:.2f} m/s, {touchdown['airspeed_mps']:.1f} m/s, "
            f"pitch {touchdown['pitch_deg']:.1f} deg, bank {touchdown['bank_deg']:+.1f} deg, "
            f"heading {touchdown['heading_error_deg']:+.1f} deg",
            highlight=False,
        )
    verdict = "[bold green]passed[/]" if result["passed"] else "[bold red]criteria not met[/]"
    timing = result["timing"]
    console.print(
        f"{result['outcome'].replace('_', ' ').capitalize()}: {verdict}. "
        f"{timing['sim_s']:.1f} s flown in {timing['wall_s']:.1f} s",
        highlight=False,
    )
    for kind, file in result["files"].items():
        console.print(f"  {kind:10} {file}", highlight=False, markup=False, soft_wrap=True)
    if "recording" in result["files"]:
        console.print(
            f"  watch it:  landing-sim replay {shlex.quote(result['files']['recording'].rsplit('/', 1)[0])}",
            markup=False,
            soft_wrap=True,
        )


def claims(result: dict[str, Any], report: Path) -> None:
    """The result of `reproduce`: every claim, the paper's value beside ours."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    rows = Table(title=result["paper"], title_justify="left", box=SIMPLE_HEAD)
    for heading, justify in (("claim", "left"), ("where", "left"), ("paper", "right"), ("ours", "right"), ("", "left")):
        rows.add_column(heading, justify=justify)  # type: ignore[arg-type]
    styles = {"met": "[green]met[/]", "not_met": "[bold red]not met[/]", "not_comparable": "[dim]not comparable[/]"}
    for claim in result["claims"]:
        values = ["" if v is None else f"{v:.3g} {claim['unit']}" for v in (claim["paper_value"], claim["our_value"])]
        rows.add_row(claim["statement"], claim["where"], *values, styles[claim["verdict"]])
    console = _console()
    console.print(rows)
    counts = {verdict: sum(c["verdict"] == verdict for c in result["claims"]) for verdict in styles}
    console.print(", ".join(f"{n} {verdict.replace('_', ' ')}" for verdict, n in counts.items()), highlight=False)
    console.print(f"  report     {report}", highlight=False, markup=False, soft_wrap=True)


def _console() -> Any:
    """Tables keep their columns when they go to a file or a pipe."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 110)
