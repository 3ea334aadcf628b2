"""The command line of campaigns: fly, export, replay one landing. Heavy packages load only where they are needed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from landing_sim.errors import ConfigError, Mark, Problem

if TYPE_CHECKING:
    from landing_sim.campaign.plan import Plan
    from landing_sim.campaign.store import Results
    from landing_sim.record.log import FlightLog

PASSED, FAILED, PARTIAL = 0, 1, 4


def campaign(
    file: Annotated[
        str, typer.Argument(metavar="CAMPAIGN", help="A YAML file, or a shipped one: do128/campaign_wind.")
    ],
    runs: Annotated[int | None, typer.Option(min=1, help="Landings, instead of the file's number.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one a core if left out.")] = None,
    cluster: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Of a dask scheduler.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; out/NAME if left out.")] = None,
    json_: Annotated[
        bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")
    ] = False,
) -> None:
    """Fly a scenario many times, dispersed: every risk's verdict with bounds. Run it again to go on."""
    if workers is not None and cluster is not None:
        raise typer.BadParameter("--workers are this machine's: the cluster has its own")
    from landing_sim.campaign.file import load

    plan = load(file, runs)
    folder = out or Path("out") / plan.campaign.name
    from landing_sim import progress
    from landing_sim.campaign import rare_landings, run, sheet, store

    with progress.campaign_shown(plan.campaign.name, plan.campaign.runs) as watch:
        aside = run.fly(plan, folder, workers, cluster, watch=watch)
    results = store.read(folder)
    found = sheet.sheet(results, folder, rare_landings.saved(folder, plan))
    if json_:
        typer.echo(json.dumps(found, allow_nan=False))
    else:
        sheet.table(found, results, folder)
    if aside:
        for number in aside[:5]:
            typer.echo(f"run {number} was set aside: {results.reasons[number].strip().splitlines()[-1]}", err=True)
        typer.echo(f"{len(aside)} landings are missing; the same command tries them again", err=True)
        raise typer.Exit(PARTIAL)
    raise typer.Exit(PASSED if found["passed"] else FAILED)


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `campaign` wrote.")],
) -> None:
    """Write DIR/report.html: verdict, footprint, tails, worst landings, sensitivity, on one page."""
    from landing_sim.campaign.report import report as write

    typer.echo(str(write(folder)))


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `campaign` wrote.")],
    csv: Annotated[Path | None, typer.Option(help="Write the rows there as CSV.")] = None,
    parquet: Annotated[Path | None, typer.Option(help="Write the rows there as Parquet.")] = None,
) -> None:
    """Write a campaign's rows as CSV or Parquet, one a landing."""
    if csv is None and parquet is None:
        raise typer.BadParameter("nothing to write: name --csv FILE, --parquet FILE or both")
    from landing_sim.campaign import export as exporting

    for file in exporting.export(folder, csv, parquet):
        typer.echo(str(file))


def replay(folder: Path, run: int, changes: list[str], web: bool) -> None:
    """Fly landing `run` of a campaign again, and with `changes` beside it, and show the recording."""
    from landing_sim import runner
    from landing_sim.campaign import landing, store
    from landing_sim.record import replay as recordings

    plan = store.plan(folder)
    if changes:
        landing.scenario_of(
            plan, run, landing.draw(plan.campaign, run), changes
        )  # wrong changes are told before a flight
    place = folder / "replays" / (f"run-{run:06d}" + "-changed" * bool(changes))
    other: FlightLog | None = None
    if changes:
        _, other = _fly(plan, run, place.with_name(f"{place.name}-other"), changes=changes)
    figures, _ = _fly(plan, run, place, other=other)
    _compare(store.read(folder), run, figures)
    try:
        recordings.open_viewer(place / runner.RECORDING, web=web)
    except recordings.ReplayError as error:
        raise ConfigError([Problem(Mark(str(place)), (), str(error))]) from None


def _fly(
    plan: Plan, run: int, place: Path, changes: Sequence[str] = (), other: FlightLog | None = None
) -> tuple[dict[str, Any], FlightLog]:
    """Fly it into a folder and show its table: with `changes` for comparison only, else recorded, beside `other`."""
    from landing_sim import progress, runner
    from landing_sim.campaign import landing
    from landing_sim.record.replay import ReplayError

    runner.check_out(place)
    with runner.out_folder(place) as work:
        recording = None if changes else work / runner.RECORDING
        try:
            wanted, flight = landing.fly(plan, run, changes=changes, recording=recording, other=other)
        except ReplayError as error:
            raise ConfigError([Problem(Mark(str(place)), (), str(error))]) from None
        label = f"{plan.label}, run {run}" + "".join(f", {change}" for change in changes)
        result = runner.write(flight, wanted, label, work, place)
    progress.table(result)
    return {"outcome": flight.verdict.outcome, **landing.measure(flight, wanted)}, flight.log


def _compare(results: Results, run: int, figures: dict[str, Any]) -> None:
    """Say whether this landing is the campaign's own, bit for bit."""
    at = [k for k, number in enumerate(results.columns["run"]) if number == run]
    if not at:
        typer.echo(f"run {run} has not been flown by the campaign yet", err=True)
        return
    stored = {name: float(results.columns[name][at[0]]) for name in figures if name != "outcome"}
    stored["outcome"] = results.outcome[at[0]]
    other = [
        name
        for name, value in figures.items()
        if value != stored[name] and (value == value or stored[name] == stored[name])
    ]
    if other:
        what = ", ".join(f"{name} {figures[name]} instead of {stored[name]}" for name in other[:3])
        typer.echo(f"NOT the campaign's landing ({what}): another processor, other software?", err=True)
    else:
        typer.echo(f"run {run}: the same bits as in the campaign", err=True)
