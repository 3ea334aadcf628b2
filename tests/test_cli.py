"""The command line as a user types it: exit codes, what is on stdout, what is left on disk."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from landing_sim import paths
from landing_sim.errors import ConfigError

PROGRAM = Path(sys.executable).with_name("landing-sim")
SHORT = ("--set", "time.limit_s=1.2")  # a flight that ends before anything has happened


def cli(*arguments: str, cwd: Path, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(PROGRAM), *arguments],
        cwd=cwd,
        env=os.environ | env,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_help_lists_the_commands_and_exit_codes(tmp_path: Path) -> None:
    result = cli("--help", cwd=tmp_path)
    assert result.returncode == 0
    commands = (
        "run",
        "campaign",
        "replay",
        "report",
        "export",
        "reproduce",
        "design",
        "check",
        "schema",
        "doctor",
        "list",
    )
    for word in (*commands, "4 partial campaign", "130 interrupted"):
        assert word in result.stdout
    assert cli(cwd=tmp_path).returncode == 2


@pytest.mark.parametrize(
    "arguments",
    [("fly",), ("run",), ("run", "do128/gust", "--bogus"), ("run", "do128/gust", "--seed", "-1"), ("design",)],
)
def test_usage_errors_exit_2(arguments: tuple[str, ...], tmp_path: Path) -> None:
    result = cli(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert result.stdout == ""
    assert "Traceback" not in result.stderr


def test_bad_scenarios_exit_2_and_write_nothing(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(
        "schema_version: 1\nmission: runway_landing\nrunway: {width_m: -1}\nwind: {turbulance: {}}\n"
    )
    for arguments in (("run", "bad.yaml", "--json"), ("run", "bad.yaml", "--out", "o"), ("check", "bad.yaml")):
        result = cli(*arguments, cwd=tmp_path)
        assert result.returncode == 2
        assert result.stdout == ""
        assert result.stderr.splitlines() == [
            "bad.yaml:3:19: runway.width_m: must be greater than 0, not -1",
            "bad.yaml:4:8: wind.turbulance: unknown key (did you mean 'turbulence'?)",
        ]
    assert [p.name for p in tmp_path.iterdir()] == ["bad.yaml"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("run", "do128/gusty"),
            "do128/gusty:1:1: (file): no such file or shipped scenario (did you mean 'do128/gust'?)",
        ),
        (("run", "do128/gust", "--set", "seed=x"), "--set seed: seed: must be a valid integer, not 'x'"),
        (("run", "do128/gust", "--seed", str(2**63)), "--set seed: seed: must be less than"),
        (("run", "do128/gust", "--out", "/proc/nope"), "--out /proc/nope: (file): cannot be made: "),
        (("run", "do128/gust", "--set", "initial.airspeed_mps=12"), "gust:1:1: (file): cannot be flown: "),
        (("design", "do127"), "do127:1:1: (file): no such aircraft (did you mean 'do128'?)"),
        (("replay", "nowhere"), "nowhere:1:1: (file): no recording there"),
        (("reproduce", "dickmann-1992"), "(did you mean 'dickmanns-1992'?)"),
        (("check", "vehicle.yaml"), "vehicle.yaml:1:1: (file): no such file"),
    ],
)
def test_wrong_names_are_explained(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    result = cli(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stdout == ""
    assert not list(tmp_path.iterdir())


def test_check_list_and_schema(tmp_path: Path) -> None:
    result = cli("check", "do128/gust", str(paths.aircraft_folder("do128") / "vehicle.yaml"), cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.count(": good\n") == 2
    listed = cli("list", cwd=tmp_path).stdout
    for name in (*paths.scenario_names(), "do128", "dickmanns-1992"):
        assert name in listed
    assert json.loads(cli("schema", cwd=tmp_path).stdout)["title"] == "landing-sim scenario"


def test_doctor_finds_nothing_broken(tmp_path: Path) -> None:
    result = cli("doctor", cwd=tmp_path)
    assert result.returncode == 0, result.stdout
    assert result.stdout.endswith("nothing is broken\n")
    assert "FAIL" not in result.stdout


def test_doctor_says_what_is_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    from landing_sim import doctor

    monkeypatch.setattr(doctor, "requirements", lambda: iter(["numpy", "no-such-package"]))
    lines: list[str] = []
    assert not doctor.report(lines.append)
    assert "FAIL  packages      RuntimeError: not installed: no-such-package" in lines


def test_design_prints_the_design(tmp_path: Path) -> None:
    result = cli("design", "do128", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    for word in ("trim", "short period", "dutch roll", "elevator", "margins"):
        assert word in result.stdout
    data = json.loads(cli("design", "do128", "--json", cwd=tmp_path).stdout)
    assert [round(p["airspeed_mps"]) for p in data["trim_points"]] == [50, 43]


def test_an_aircraft_that_nothing_can_be_designed_for_is_a_bad_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from landing_sim import cli

    shutil.copytree(paths.aircraft_folder("do128"), tmp_path / "odd")
    (tmp_path / "odd/do128.xml").rename(tmp_path / "odd/odd.xml")
    file = tmp_path / "odd/vehicle.yaml"
    file.write_text(file.read_text().replace("shape: {w: 1, u: 0}", "shape: {zz: 1}"))
    monkeypatch.setattr(paths, "data_folder", lambda name: tmp_path)
    with pytest.raises(ConfigError, match="odd:1:1: .*cannot be designed for: .*no state 'zz'"):
        cli.design("odd")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    folder = tmp_path_factory.mktemp("cli")
    return folder, cli("run", "do128/gust", *SHORT, "--seed", "3", "--json", cwd=folder)


def test_run_json_is_one_object_with_its_promised_keys(flown: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    folder, result = flown
    assert result.returncode == 1, result.stderr  # flown, but it did not land
    assert result.stdout.count("\n") == 1
    data: dict[str, Any] = json.loads(result.stdout)
    assert list(data) == ["scenario", "seed", "outcome", "touchdown", "errors", "criteria", "passed", "timing", "files"]
    assert (data["scenario"], data["seed"], data["outcome"], data["passed"]) == ("do128/gust", 3, "timeout", False)
    assert data["touchdown"] is None
    assert all(set(c) == {"name", "value", "limit", "passed", "source"} for c in data["criteria"])
    assert set(data["timing"]) == {"sim_s", "wall_s", "realtime_factor"}
    assert {"log", "recording", "result", "scenario"} == set(data["files"])
    for file in data["files"].values():
        assert (folder / file).stat().st_size > 0
    for line in result.stderr.splitlines():
        assert {"t_s", "phase", "x_m", "height_m"} == set(json.loads(line))
    assert sorted(p.name for p in (folder / "out").iterdir()) == ["gust-3"]


def test_the_scenario_written_flies_again_to_the_same_bits(
    flown: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, _ = flown
    again = cli("run", "out/gust-3/scenario.json", "--no-record", "--out", "again", cwd=folder)
    assert again.returncode == 1, again.stderr
    assert (folder / "again/log.parquet").read_bytes() == (folder / "out/gust-3/log.parquet").read_bytes()
    assert not (folder / "again/recording.rrd").exists()
    assert "not met" in again.stdout
    assert "Timeout" in again.stdout


def test_out_is_never_taken_from_others(flown: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    folder, _ = flown
    mine = folder / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("precious")
    refused = cli("run", "do128/gust", *SHORT, "--out", "mine", cwd=folder)
    assert refused.returncode == 2
    assert refused.stderr.startswith("--out mine: (file): is not empty and holds no earlier run")
    assert [p.name for p in mine.iterdir()] == ["thesis.tex"]
    file = cli("run", "do128/gust", *SHORT, "--out", "mine/thesis.tex", cwd=folder)
    assert file.returncode == 2
    assert (mine / "thesis.tex").read_text() == "precious"
    (folder / "out/gust-3/notes.txt").write_text("beside")
    rewritten = cli("run", "do128/gust", *SHORT, "--seed", "3", "--no-record", cwd=folder)
    assert rewritten.returncode == 1
    assert sorted(p.name for p in (folder / "out/gust-3").iterdir()) == [
        "log.parquet", "notes.txt", "result.json", "scenario.json",
    ]  # fmt: skip


def test_replay_shows_the_recording_or_flies_again_with_changes(
    flown: tuple[Path, subprocess.CompletedProcess[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from typer.testing import CliRunner

    from landing_sim.cli import app
    from landing_sim.record import replay

    shown: list[tuple[Path, bool]] = []
    monkeypatch.setattr(replay, "open_viewer", lambda path, web: shown.append((path, web)))
    recorded = tmp_path / "gust-3"
    shutil.copytree(flown[0] / "out/gust-3", recorded)
    (recorded / "recording.rrd").touch()
    runner = CliRunner()
    assert runner.invoke(app, ["replay", str(recorded), "--web"]).exit_code == 0
    assert runner.invoke(app, ["replay", str(recorded / "recording.rrd")]).exit_code == 0
    changed = runner.invoke(app, ["replay", str(recorded), "--set", "wind.headwind_mps=3"], catch_exceptions=False)
    assert changed.exit_code == 0
    assert shown == [
        (recorded / "recording.rrd", True),
        (recorded / "recording.rrd", False),
        (tmp_path / "gust-3-again/recording.rrd", False),
    ]
    again = json.loads((tmp_path / "gust-3-again/scenario.json").read_text())
    assert (again["wind"]["headwind_mps"], again["seed"]) == (3.0, 3)


def test_an_interrupted_run_exits_130_and_leaves_nothing(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [str(PROGRAM), "run", "do128/gust"], cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    process.stderr.readline()  # the first phase: it flies
    process.send_signal(2)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == ""
    assert "Traceback" not in err
    assert not [p for p in tmp_path.rglob("*") if p.name != "out"]


def test_an_internal_error_exits_3_and_says_so() -> None:
    code = """
import sys
from landing_sim import cli, paths
paths.scenario_names = lambda: 1 / 0
sys.argv = ["landing-sim", "list"]
cli.main()
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 3
    assert "landing-sim: internal error: division by zero" in result.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_ended_run_clears_up_after_itself_and_says_so(number: signal.Signals, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [str(PROGRAM), "run", "do128/gust", "--out", "a/b/c"],
        cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    process.stderr.readline()  # the first phase: it flies
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert ("interrupted" in err) == (number == signal.SIGINT)
    assert not list(tmp_path.iterdir())


def test_live_without_a_recording_is_refused(tmp_path: Path) -> None:
    result = cli("run", "do128/gust", "--live", "--no-record", cwd=tmp_path)
    assert result.returncode == 2
    assert "--no-record" in result.stderr


def test_live_where_no_viewer_comes_up_says_so_and_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from landing_sim import cli
    from landing_sim.record import replay

    def fail() -> str:
        raise replay.ReplayError("no live view")

    monkeypatch.setattr(replay, "start_live_viewer", fail)
    with pytest.raises(ConfigError, match=r"^--live: \(file\): no live view$"):
        cli.run("do128/gust", list(SHORT[1:]), out=tmp_path / "o", live=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "message"), [("gone", "is a link to nowhere"), ("x" * 300, "cannot be used: ")])
def test_an_out_that_can_never_be_is_refused_before_flying(name: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "gone").symlink_to("nowhere")
    result = cli("run", "do128/gust", "--out", name, cwd=tmp_path)
    assert result.returncode == 2
    assert message in result.stderr
    assert '"phase"' not in result.stderr


def test_words_in_brackets_are_shown_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "[b].yaml").write_text(
        "schema_version: 1\nmission: runway_landing\ncriteria: [{metric: lateral_m, high: 1, source: '[/x] FAA [1]'}]\n"
    )
    result = cli("run", "[b].yaml", *SHORT, "--no-record", cwd=tmp_path)
    assert result.returncode == 1, result.stderr
    for words in ("[b].yaml, seed 1", "[/x] FAA [1]", "out/[b]-1/log.parquet"):
        assert words in result.stdout
