"""Campaigns flown: the same rows for any number of workers, whatever is interrupted or killed; the command line."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import campaign_jobs
import pytest

from landing_sim.campaign import file, pool, run, store
from landing_sim.campaign.landing import Landing, land
from landing_sim.campaign.plan import Campaign, Risk

PROGRAM = Path(sys.executable).with_name("landing-sim")
SHORT = """schema_version: 1
scenario: do128/gust
runs: 6
seed: 5
set: {time.limit_s: 1.2, initial.x_m: -300, initial.y_m: 0, initial.height_m: 20, initial.heading_deg: 0}
dispersions:
  wind.crosswind_mps: {normal: {mean: 0, sd: 1}}
  wind.turbulence.wind_at_20ft_mps: {uniform: {low: 0, high: 10}}
  filter.kind: {choice: {values: [augmented, plain]}}
risks: [{name: bank, metric: peak_roll_deg, above: 90, probability: 0.6}]
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("campaign") / "short.yaml"
    path.write_text(SHORT)
    return path


@pytest.fixture(scope="module")
def flown(campaign: Path) -> Path:
    """The folder of the campaign flown by two workers without a break."""
    folder = campaign.parent / "flown"
    assert run.fly(file.load(campaign), folder, 2) == []
    return folder


def rows(folder: Path) -> list[tuple[Any, ...]]:
    with sqlite3.connect(folder / store.FILE) as db:
        return db.execute("SELECT * FROM landings ORDER BY run").fetchall()


def cli(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(PROGRAM), *arguments], cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.parametrize(("workers", "method"), [(1, "fork"), pytest.param(3, "spawn", marks=pytest.mark.slow)])
def test_workers_and_start_methods_change_no_bit(
    workers: int, method: pool.Method, campaign: Path, flown: Path, tmp_path: Path
) -> None:
    run.fly(file.load(campaign), tmp_path / "o", workers, method=method)
    assert rows(tmp_path / "o") == rows(flown)
    assert len({row[4:] for row in rows(flown)}) == 6


def test_run_k_alone_is_run_k_of_the_campaign(campaign: Path, flown: Path) -> None:
    alone = land(file.load(campaign), 4)
    stored = store.read(flown)
    assert alone.figures is not None
    for name, value in alone.figures.items():
        assert value == stored.columns[name][4] or (
            value != value and stored.columns[name][4] != stored.columns[name][4]
        )


def test_what_a_results_object_holds(campaign: Path, flown: Path) -> None:
    results = store.read(flown)
    assert len(results) == 6
    assert results.outcome.tolist() == ["timeout"] * 6
    assert results.dispersed == ("wind.crosswind_mps", "wind.turbulence.wind_at_20ft_mps", "filter.kind")
    assert all(column.shape == (6,) and column.dtype == float for column in results.columns.values())
    assert set(results.columns["filter.kind"]) <= {0.0, 1.0}
    assert (results.columns["cpu_s"] > 0).all()
    assert (results.columns["peak_mb"] < 400).all()
    session = results.meta["sessions"][0]
    assert (session["workers"], session["landings"], session["engine"]) == (2, 6, "forkserver")
    assert session["software"]["numba"]
    assert sorted(p.name for p in (flown / "histories").iterdir()) == [f"run-00000{k}.parquet" for k in range(6)]


def test_running_again_flies_only_what_is_missing(campaign: Path, flown: Path) -> None:
    assert run.fly(file.load(campaign), flown, 1, job=campaign_jobs.kills) == []  # there is nothing to fly
    with sqlite3.connect(flown / store.FILE) as db:
        whole = rows(flown)
        db.execute("DELETE FROM landings WHERE run IN (1, 4)")
    seen: list[int] = []
    run.fly(file.load(campaign), flown, 1, watch=lambda p: seen.append(p.latest.run))
    assert seen == [1, 4]
    assert rows(flown) == whole


def test_more_landings_go_on_fewer_look_at_fewer(campaign: Path, tmp_path: Path) -> None:
    for runs in (2, 4):
        run.fly(file.load(campaign, runs), tmp_path / "o", 1, method="fork", job=campaign_jobs.cheap)
    assert len(store.read(tmp_path / "o")) == 4
    run.fly(file.load(campaign, 3), tmp_path / "o", 1)
    assert len(store.read(tmp_path / "o")) == 3


def test_a_changed_campaign_is_refused_in_the_same_folder(campaign: Path, tmp_path: Path) -> None:
    run.fly(file.load(campaign), tmp_path / "o", 1, method="fork", job=campaign_jobs.cheap)
    changed = tmp_path / "short.yaml"
    changed.write_text(SHORT.replace("sd: 1", "sd: 1.5"))
    with pytest.raises(file.CampaignError, match=r"--out .*/o: \(file\): holds another campaign"):
        run.fly(file.load(changed), tmp_path / "o", 1)
    changed.write_text(SHORT.replace("probability: 0.6", "probability: 0.7"))
    assert run.fly(file.load(changed), tmp_path / "o", 1) == []  # what is asked of the landings may change


def test_a_folder_of_others_is_left_alone(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(file.CampaignError, match="is not empty and holds no campaign"):
        run.fly(file.load(campaign), tmp_path, 1)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_two_at_once_in_one_folder_are_refused(campaign: Path, tmp_path: Path) -> None:
    code = f"""
from pathlib import Path
from landing_sim.campaign import file, store, landing
plan = file.load({str(campaign)!r})
with store.Store(Path({str(tmp_path / "o")!r}), plan, plan.figures()):
    print("in", flush=True)
    input()
"""
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "in\n"
        with pytest.raises(file.CampaignError, match="another campaign is being flown there right now"):
            run.fly(file.load(campaign), tmp_path / "o", 1)
        other.communicate("\n")


def test_a_killed_worker_loses_nothing(
    campaign: Path, flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAMPAIGN_TEST", str(tmp_path / "mark"))
    assert run.fly(file.load(campaign), tmp_path / "o", 2, method="fork", job=campaign_jobs.dies_once) == []
    assert (tmp_path / "mark").exists()
    assert rows(tmp_path / "o") == rows(flown)


def test_what_kills_twice_is_set_aside_and_tried_again_later(campaign: Path, tmp_path: Path) -> None:
    plan = file.load(campaign)
    assert run.fly(plan, tmp_path / "o", 2, method="fork", job=campaign_jobs.kills) == [1, 3]
    results = store.read(tmp_path / "o")
    assert results.outcome.tolist() == ["landed", "worker_killed", "landed", "error", "landed", "landed"]
    assert results.reasons[1] == "its worker died 2 times"
    assert "ZeroDivisionError: run 3 divides by zero" in results.reasons[3]
    assert run.fly(plan, tmp_path / "o", 2, method="fork", job=campaign_jobs.cheap) == []
    assert store.read(tmp_path / "o").outcome.tolist() == ["landed"] * 6


def test_the_pool_knows_whose_fault_it_was() -> None:
    done = {d.job: d for d in pool.run(campaign_jobs.square, range(12), 3, "fork")}
    assert done.pop(7) == pool.Done(7)
    assert {job: d.value for job, d in done.items()} == {n: n * n for n in range(12) if n != 7}


def test_the_first_job_alone_in_a_worker_of_its_own() -> None:
    done = {d.job: d.value for d in pool.run(campaign_jobs.whoami, range(20), 2, "fork", first_alone=True)}
    assert done[0] not in [done[k] for k in range(1, 20)]


@pytest.mark.slow
def test_workers_that_never_begin_are_no_endless_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAMPAIGN_TEST", "broken")
    with pytest.raises(pool.PoolError, match=r"end before they can work \(exit code 7\)"):
        list(pool.run(campaign_jobs.no_worker, range(3), 1, "spawn"))


def test_workers_end_with_whoever_stops_listening() -> None:
    flying = pool.run(campaign_jobs.square, range(100), 2, "fork")
    next(flying)
    flying.close()
    import multiprocessing

    assert not multiprocessing.active_children()


# ------------------------------------------------------------------------------------------------ command line


def test_the_command_line(campaign: Path, flown: Path, tmp_path: Path) -> None:
    first = cli("campaign", str(campaign), "--workers", "2", "--out", "o", "--json", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    assert rows(tmp_path / "o") == rows(flown)
    data = json.loads(first.stdout)
    assert first.stdout.count("\n") == 1
    assert list(data) == ["campaign", "runs", "outcomes", "risks", "passed", "files"]
    assert (data["campaign"], data["runs"], data["outcomes"], data["passed"]) == ("short", 6, {"timeout": 6}, True)
    assert list(data["risks"][0])[:8] == ["name", "limit", "count", "n", "upper95", "lower95", "method", "verdict"]
    assert data["files"]["results"] == "o/campaign.sqlite"
    assert json.loads(first.stderr.splitlines()[-1]) == {"landings": 6, "of": 6} | {
        key: value
        for key, value in json.loads(first.stderr.splitlines()[-1]).items()
        if key in ("per_s", "remaining_s")
    }
    again = cli("campaign", str(campaign), "--out", "o", "--runs", "3", cwd=tmp_path)
    assert again.returncode == 1, again.stderr  # three are too few to show it
    assert "NOT ENOUGH EVIDENCE" in again.stdout
    written = cli("export", "o", "--csv", "rows.csv", "--parquet", "rows.parquet", cwd=tmp_path)
    assert written.stdout.split() == ["rows.csv", "rows.parquet"]
    lines = (tmp_path / "rows.csv").read_text().splitlines()
    assert len(lines) == 4
    assert lines[1].startswith('0,"timeout",')
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(tmp_path / "rows.parquet")
    results = store.read(tmp_path / "o")
    assert table.column("peak_roll_deg").to_pylist() == results.columns["peak_roll_deg"].tolist()
    assert set(table.column("filter.kind").to_pylist()) <= {"augmented", "plain"}


def test_the_sheet_of_a_sweep_is_that_of_its_aim(campaign: Path, tmp_path: Path) -> None:
    from landing_sim.campaign.sheet import sheet

    path = tmp_path / "c.yaml"
    path.write_text(SHORT + "sweep: {path: camera.noise_dn, values: [0, 10, 20], aim: 10}\n")
    for runs in (1, 30):
        run.fly(file.load(path, runs), tmp_path / "o", 1, method="fork", job=campaign_jobs.held)
        found = sheet(store.read(tmp_path / "o"), tmp_path / "o")
        assert found["sweep"] == {"path": "camera.noise_dn", "unit": None, "aim": 10, "values": [0, 10, 20]}
        (row,) = found["risks"]
        if runs == 1:  # the aim has not been flown yet
            assert (row["n"], row["verdict"], found["passed"]) == (0, "NOT ENOUGH EVIDENCE", False)
    assert (row["count"], row["n"], row["verdict"], row["largest_pass"]) == (0, 10, "PASS", 10)
    by_value = [(r["value"], r["count"], r["verdict"]) for r in row["by_value"]]
    assert by_value == [(0, 0, "PASS"), (10, 0, "PASS"), (20, 10, "FAIL")]
    assert found["passed"]


def test_bad_campaigns_exit_2_and_write_nothing(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(SHORT.replace("crosswind", "croswind"))
    for arguments in (("campaign", "bad.yaml", "--json"), ("check", "bad.yaml")):
        result = cli(*arguments, cwd=tmp_path)
        assert result.returncode == 2
        assert result.stdout == ""
        assert result.stderr.startswith("bad.yaml:7:3: wind.croswind_mps: unknown key (did you mean 'crosswind_mps'?)")
    assert [p.name for p in tmp_path.iterdir()] == ["bad.yaml"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("campaign", "do128/campaign_win"), "no such file or shipped campaign (did you mean 'do128/campaign_wind'?)"),
        (("campaign", "do128/campaign_wind", "--workers", "2", "--cluster", "x"), "the cluster has its own"),
        (("campaign", "do128/campaign_wind", "--runs", "0"), "--runs"),
        (("export", "nowhere", "--csv", "x"), "nowhere:1:1: (file): holds no campaign.sqlite"),
        (("export", "nowhere"), "nothing to write"),
        (("replay", "nowhere", "--run", "3"), "nowhere:1:1: (file): holds no campaign.sqlite"),
    ],
)
def test_wrong_words_are_explained(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    result = cli(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert message in result.stderr.replace("\n", " ").replace("│", "").replace("  ", " ")
    assert not list(tmp_path.iterdir())


def start(campaign: Path, cwd: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [str(PROGRAM), "campaign", str(campaign), "--out", "o", "--json", *arguments],
        cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def wait_for(what: Callable[[], Any], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def count(folder: Path) -> int:
    try:
        return len(rows(folder))
    except sqlite3.OperationalError:
        return 0


def test_ctrl_c_exits_130_and_the_same_command_goes_on(campaign: Path, flown: Path, tmp_path: Path) -> None:
    process = start(campaign, tmp_path, "--workers", "1", "--runs", "40")
    wait_for(lambda: count(tmp_path / "o") >= 2)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert out == ""
    assert "Traceback" not in err
    assert 2 <= count(tmp_path / "o") < 40
    run.fly(file.load(campaign), tmp_path / "o", 1, method="fork")
    assert rows(tmp_path / "o")[:6] == rows(flown)


def test_a_killed_parent_leaves_rows_that_another_goes_on_from(campaign: Path, flown: Path, tmp_path: Path) -> None:
    process = start(campaign, tmp_path, "--workers", "2", "--runs", "40")
    wait_for(lambda: count(tmp_path / "o") >= 1)
    process.kill()
    process.communicate()
    assert 1 <= count(tmp_path / "o") < 40
    wait_for(lambda: not _orphans(tmp_path))
    run.fly(file.load(campaign), tmp_path / "o", 2)
    assert rows(tmp_path / "o")[:6] == rows(flown)


def _orphans(cwd: Path) -> list[int]:
    """Processes that still live in that folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if (
                    Path(os.readlink(entry / "cwd")) == cwd
                    and "Z" not in (entry / "stat").read_text().split(")")[1].split()[0]
                ):
                    found.append(int(entry.name))
            except OSError:
                pass
    return found


def test_replay_flies_the_landing_again(campaign: Path, flown: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from typer.testing import CliRunner

    from landing_sim.cli import app
    from landing_sim.record import parquet, replay

    shown: list[Path] = []
    monkeypatch.setattr(replay, "open_viewer", lambda path, web: shown.append(path))
    result = CliRunner().invoke(app, ["replay", str(flown), "--run", "3"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert "run 3: the same bits as in the campaign" in result.output
    again = parquet.read(flown / "replays/run-000003/log.parquet")
    kept = parquet.read(flown / "histories/run-000003.parquet")
    assert all((again[name] == kept[name]).all() or (again[name] != again[name]).any() for name in kept.columns)
    assert again["true_x_m"].tobytes() == kept["true_x_m"].tobytes()
    changed = ["replay", str(flown), "--run", "3", "--set", "wind.turbulence=null"]
    assert CliRunner().invoke(app, changed, catch_exceptions=False).exit_code == 0
    assert shown == [flown / f"replays/run-000003{name}/recording.rrd" for name in ("", "-changed")]
    assert all(path.stat().st_size > 10_000 for path in shown)
    other = parquet.read(flown / "replays/run-000003-changed-other/log.parquet")
    assert other["true_wz_mps"].tobytes() != again["true_wz_mps"].tobytes()
    wrong = CliRunner().invoke(app, ["replay", str(flown), "--run", "3", "--set", "wind.x=null"])
    assert "wind.x: unknown key" in str(wrong.exception)


def test_replay_says_when_the_landing_is_another_one(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from landing_sim.campaign.commands import _compare

    results = store.read(flown)
    figures = {name: float(results.columns[name][2]) for name in ("nees", "peak_roll_deg", "touchdown_x_m")}
    _compare(results, 2, {**figures, "outcome": "timeout"})
    _compare(results, 2, {**figures, "peak_roll_deg": figures["peak_roll_deg"] * (1 + 1e-15), "outcome": "timeout"})
    _compare(results, 99, {})
    same, other, none = capsys.readouterr().err.splitlines()
    assert same == "run 2: the same bits as in the campaign"
    assert other.startswith("NOT the campaign's landing (peak_roll_deg ")
    assert none == "run 99 has not been flown by the campaign yet"


def test_time_histories_as_asked() -> None:
    from landing_sim.campaign.landing import kept

    figures = {"sink_rate_mps": 2.0}
    plan = Campaign(
        schema_version=1, scenario="x", risks=(Risk(name="a", metric="sink_rate_mps", above=1.5, probability=0.1),)
    )
    assert kept(plan, "landed", figures)
    assert not kept(plan, "landed", {"sink_rate_mps": 1.4})
    assert kept(plan, "go_around", {"sink_rate_mps": 1.4})
    assert not kept(plan.model_copy(update={"keep": "none"}), "crash", figures)
    assert kept(plan.model_copy(update={"keep": "all"}), "landed", {"sink_rate_mps": 1.4})


def test_a_draw_that_cannot_be_flown_is_a_row_and_not_the_end(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(SHORT + "sweep: {path: initial.airspeed_mps, values: [12]}\n")
    landing = land(file.load(path), 0)
    assert (landing.outcome, landing.figures) == ("cannot_fly", None)
    assert "no trim at 12 m/s" in landing.reason
    assert isinstance(landing, Landing)


# ------------------------------------------------------------------------------------------------ cluster

needs_dask = pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="extra `cluster` not installed")


def test_without_dask_it_says_what_to_install(campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(file.CampaignError, match=r"--cluster tcp://x: .*pip install 'landing-sim\[cluster\]'"):
        run.fly(file.load(campaign), tmp_path / "o", cluster="tcp://x")


def test_a_dask_worker_never_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without kernels on disk another process flies its first landing before it does; from then on nobody else."""
    from landing_sim.campaign import cluster

    marks: list[bool] = []

    def warm(mark: bool = False) -> bool:
        marks.append(mark)
        return False

    monkeypatch.setattr(cluster, "caches_warm", warm)
    monkeypatch.setattr(cluster, "_looked", False)
    monkeypatch.setenv("CAMPAIGN_TEST", str(tmp_path / "signed"))
    assert [cluster._call(campaign_jobs.signs, k) for k in (4, 5)] == [(4, ""), (5, "")]
    other, *ours = map(int, (tmp_path / "signed").read_text().split())
    assert other != os.getpid()
    assert ours == [os.getpid()] * 2
    assert marks == [False, True]


@pytest.mark.slow
@needs_dask
@pytest.mark.parametrize("workers", [1, 2])
def test_dask_workers_fly_the_same_bits_and_one_killed_loses_nothing(
    workers: int, campaign: Path, flown: Path, tmp_path: Path
) -> None:
    """With a single one, nobody else holds what it was told."""
    from distributed import LocalCluster

    killed = []

    def kill_one(progress: run.Progress) -> None:
        if not killed:
            killed.append(int(progress.latest.worker.rpartition(":")[2]))
            os.kill(killed[0], signal.SIGKILL)

    with LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        plan = file.load(campaign)
        assert run.fly(plan, tmp_path / "o", cluster=cluster.scheduler_address, watch=kill_one) == []
    assert killed
    assert rows(tmp_path / "o") == rows(flown)


@pytest.mark.slow
@needs_dask
def test_dask_workers_with_threads_are_refused(campaign: Path, tmp_path: Path) -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        pytest.raises(file.CampaignError, match="has 2 threads: start it with --nthreads 1"),
    ):
        run.fly(file.load(campaign), tmp_path / "o", cluster=cluster.scheduler_address)
