"""The command line. Heavy packages load only in the commands that need them."""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import traceback
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from landing_sim.campaign import commands
from landing_sim.errors import ConfigError, Mark, Problem, did_you_mean

if TYPE_CHECKING:
    from landing_sim.scenario import Scenario

# Before numpy loads: small matrices gain nothing from BLAS threads, and sums must not depend on how many there are.
for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

# What packages are made of stays: looking through it for garbage over and over took a sixteenth of a first landing.
gc.set_threshold(50_000, 20, 50)

PASSED, FAILED, USAGE, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 130

app = typer.Typer(
    name="landing-sim",
    help="Vision-based landing, pixels in the loop: JSBSim flies, a camera is rendered, the 4D-approach filter estimates.",
    epilog="Exit codes: 0 passed, 1 flown but criteria not met, 2 usage or bad file, 3 internal error, "
    "4 partial campaign, 130 interrupted.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

ScenarioArg = Annotated[str, typer.Argument(metavar="SCENARIO", help="A YAML file, or a shipped one: do128/gust.")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Change a value, e.g. wind.gust.lateral_mps=-3.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]


@app.command()
def run(
    scenario: ScenarioArg,
    set_: SetOption = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Root of all random numbers, instead of the file's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; out/NAME-SEED if left out.")] = None,
    json_: JsonOption = False,
    live: Annotated[bool, typer.Option("--live", help="Watch it in the viewer while it flies.")] = False,
    no_record: Annotated[bool, typer.Option("--no-record", help="Leave out the recording for the viewer.")] = False,
) -> None:
    """Fly a scenario: touchdown and accuracy table, columnar log, recording."""
    if live and no_record:
        raise typer.BadParameter("--live shows what is recorded: leave out --no-record")
    changes = [*(set_ or []), *([] if seed is None else [f"seed={seed}"])]
    _fly(_load(scenario, changes), scenario, out, as_json=json_, live=live, record=not no_record)


@app.command()
def replay(
    path: Annotated[Path, typer.Argument(help="A folder that `run` or `campaign` wrote, or a recording (.rrd).")],
    run: Annotated[int | None, typer.Option(min=0, help="Which landing of a campaign.")] = None,
    set_: SetOption = None,
    web: Annotated[bool, typer.Option("--web", help="Show it in a browser instead of a window.")] = False,
) -> None:
    """Open a flight in the viewer; with --set, fly it again with these changes first.

    Landing --run of a campaign is flown again, bit for bit; with --set, the changed one is seen beside it.
    """
    if run is not None:
        commands.replay(path, run, set_ or [], web)
        return
    from landing_sim.runner import RECORDING, SCENARIO

    if set_:
        if not (path / SCENARIO).is_file():
            raise ConfigError([Problem(Mark(str(path)), (), f"holds no {SCENARIO} to fly again")])
        again = _load(str(path / SCENARIO), set_)
        path = path.resolve().with_name(path.resolve().name + "-again")
        _fly(again, again.name, path, as_json=False, live=False, record=True, leave=False)
    recording = path / RECORDING if path.is_dir() else path
    if not recording.is_file():
        raise ConfigError([Problem(Mark(str(path)), (), f"no recording there: `landing-sim run` writes {RECORDING}")])
    from landing_sim.record.replay import ReplayError, open_viewer

    try:
        open_viewer(recording, web=web)
    except ReplayError as error:
        raise ConfigError([Problem(Mark(str(recording)), (), str(error))]) from None


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="e.g. dickmanns-1992; `list` shows all.")],
    out: Annotated[Path | None, typer.Option(help="Folder for the report; out/PAPER if left out.")] = None,
    json_: JsonOption = False,
) -> None:
    """Measure every claim of a paper: one row each, and the figures redrawn, in one HTML report."""
    from landing_sim.papers import PAPERS

    if paper not in PAPERS:
        near = did_you_mean(paper, PAPERS) or f"; there are: {', '.join(PAPERS)}"
        raise ConfigError([Problem(Mark(paper), (), f"no such paper{near}")])
    from landing_sim import papers, progress, runner

    folder = out or Path("out") / paper
    runner.check_out(folder, ("report.html", "claims.json"))
    found = papers.reproduce(paper, folder, lambda line: typer.echo(line, err=True))
    if json_:
        typer.echo(json.dumps(found.result, allow_nan=False))
    else:
        progress.claims(found.result, found.report)


@app.command()
def design(
    aircraft: Annotated[str, typer.Argument(metavar="AIRCRAFT", help="A vehicle under aircraft/, e.g. do128.")],
    json_: JsonOption = False,
) -> None:
    """Trim, modes wanted and achieved, gains, stability margins."""
    from landing_sim import paths, vehicle
    from landing_sim.control import design as control
    from landing_sim.missions.onboard import linear_models
    from landing_sim.plants.jsbsim import PlantError

    craft = vehicle.load(aircraft)
    try:
        result = control.design(
            craft.control, linear_models(paths.aircraft_folder(aircraft), craft.control, craft.mass_kg)
        )
    except (PlantError, ValueError) as error:
        raise ConfigError([Problem(Mark(aircraft), (), f"cannot be designed for: {error}")]) from error
    if json_:
        typer.echo(json.dumps({"aircraft": aircraft, **control.design_dict(result)}, allow_nan=False))
    else:
        typer.echo(control.design_report(result, craft.name))


@app.command()
def check(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Scenarios, campaigns (files or names) or vehicle.yaml.")
    ],
) -> None:
    """Check files without flying: every problem as file:line:column."""
    from landing_sim import paths, scenario, vehicle
    from landing_sim.campaign import file as campaign_file

    problems: list[Problem] = []
    for name in files:
        try:
            if Path(name).name == "vehicle.yaml":
                vehicle.load_file(Path(name))
            elif _is_campaign(name):
                campaign_file.load(name)
            else:
                found = scenario.load(name)
                if found.mission == "runway_landing":
                    vehicle.load_file(paths.aircraft_folder(found.aircraft.model) / "vehicle.yaml")
        except ConfigError as error:
            problems += error.problems
        else:
            typer.echo(f"{name}: good")
    if problems:
        raise ConfigError(problems)


@app.command()
def schema(
    campaign: Annotated[bool, typer.Option("--campaign", help="Of campaign files.")] = False,
    lunar: Annotated[bool, typer.Option("--lunar", help="Of lunar landings.")] = False,
    quadrotor: Annotated[bool, typer.Option("--quadrotor", help="Of quadrotor landings.")] = False,
) -> None:
    """Print the JSON Schema of scenario files, or of campaigns, for editors."""
    from landing_sim import scenario

    if campaign:
        from landing_sim.campaign.file import schema_text
    else:
        mission = "lunar_landing" if lunar else "quadrotor_landing" if quadrotor else "runway_landing"
        schema_text = partial(scenario.schema_text, mission)

    typer.echo(schema_text(), nl=False)


@app.command()
def doctor() -> None:
    """Look for what could keep landing-sim from working here."""
    from landing_sim import doctor as examination

    raise typer.Exit(PASSED if examination.report(typer.echo) else FAILED)


@app.command(name="list")
def list_() -> None:
    """Shipped scenarios, campaigns, aircraft and papers."""
    from landing_sim import paths, scenario, yamlfile
    from landing_sim.papers import PAPERS

    typer.echo("scenarios")
    for name in paths.scenario_names():
        typer.echo(f"  {name:22}{scenario.load(name).description}")
    typer.echo("campaigns")
    for name in paths.campaign_names():
        typer.echo(f"  {name:30}{yamlfile.load(paths.campaign_file(name)).data.get('description', '')}")
    typer.echo("aircraft")
    for name in paths.aircraft_names():
        typer.echo(f"  {name}")
    typer.echo("papers")
    for name in PAPERS:
        typer.echo(f"  {name}")


app.command()(commands.campaign)
app.command()(commands.report)
app.command()(commands.export)


def _load(name: str, changes: list[str]) -> Scenario:
    from landing_sim.scenario import load

    return load(name, changes)


def _is_campaign(name: str) -> bool:
    """By its name if it is shipped, else by what its file holds: a campaign names a scenario, a scenario a mission."""
    from landing_sim import paths, yamlfile

    if name in paths.campaign_names():
        return True
    return name not in paths.scenario_names() and "scenario" in yamlfile.load(paths.scenario_file(name)).data


def _fly(
    scenario: Scenario, label: str, out: Path | None, *, as_json: bool, live: bool, record: bool, leave: bool = True
) -> None:
    """Fly, write, show. Ends the command with the exit code that the result deserves, unless told not to `leave`."""
    from landing_sim import ahead, progress, runner, vehicle
    from landing_sim.record.viewer import ReplayError

    folder = out or Path("out") / f"{scenario.name}-{scenario.seed}"
    runner.check_out(folder)
    craft = vehicle.load(scenario.aircraft.model) if scenario.mission == "runway_landing" else None
    with runner.out_folder(folder) as work:
        recording = work / runner.RECORDING if record else None
        try:
            with progress.shown(scenario) as watch, nullcontext() if craft is None else ahead.helped():
                flight = runner.fly(scenario, craft, watch=watch, recording=recording, live=live)
        except ReplayError as error:
            raise ConfigError([Problem(Mark("--live" if live else f"--out {folder}"), (), str(error))]) from None
        result = runner.write(flight, scenario, label, work, folder)
    if flight.log.meta.get("reason"):
        typer.echo(f"the flight model gave up: {flight.log.meta['reason']}", err=True)
    if as_json:
        typer.echo(json.dumps(result, allow_nan=False))
    else:
        progress.table(result)
    if leave:
        raise typer.Exit(PASSED if result["passed"] else FAILED)


def main() -> None:
    """Entry point: every way to end has its exit code and a message that helps."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that half a run is cleared away
    try:
        app(prog_name="landing-sim")
    except ConfigError as error:
        print(error, file=sys.stderr)
        sys.exit(USAGE)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except SystemExit as end:  # what typer makes of Ctrl-C
        if end.code == INTERRUPTED:
            print("interrupted", file=sys.stderr)
        raise
    except Exception as error:
        traceback.print_exc()
        print(f"\nlanding-sim: internal error: {error}\n`landing-sim doctor` may tell why.", file=sys.stderr)
        sys.exit(INTERNAL)


if __name__ == "__main__":
    main()
