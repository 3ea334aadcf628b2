"""kill -9 at 50 random moments of a campaign of 200 landings: its parent, its workers, whatever else it has started."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from landing_sim.campaign import store

PROGRAM = Path(sys.executable).with_name("landing-sim")
KILLS, LANDINGS = 50, 200
TEXT = f"""schema_version: 1
scenario: do128/gust
runs: {LANDINGS}
seed: 11
keep: none
set: {{time.limit_s: 1.2, initial.x_m: -300, initial.y_m: 0, initial.height_m: 20, initial.heading_deg: 0}}
dispersions:
  wind.crosswind_mps: {{normal: {{mean: 0, sd: 1}}}}
  wind.turbulence.wind_at_20ft_mps: {{uniform: {{low: 0, high: 10}}}}
"""


def start(cwd: Path, folder: str) -> subprocess.Popen[bytes]:
    command = [str(PROGRAM), "campaign", "c.yaml", "--workers", "2", "--out", folder, "--json"]
    with (cwd / "log.txt").open("ab") as log:
        return subprocess.Popen(command, cwd=cwd, stdout=log, stderr=log)


def rows(folder: Path) -> list[tuple[Any, ...]]:
    try:
        with sqlite3.connect(folder / store.FILE) as db:
            return db.execute("SELECT * FROM landings ORDER BY run").fetchall()
    except sqlite3.OperationalError:  # not yet begun
        return []


def family(cwd: Path, parent: int) -> list[int]:
    """Everything that works in that folder but the parent."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != parent:
            try:
                if Path(os.readlink(entry / "cwd")) == cwd:
                    found.append(int(entry.name))
            except OSError:
                pass
    return sorted(found)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="finds workers in /proc")
def test_fifty_kills_change_no_row(tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text(TEXT)
    # without risks nothing is shown to be safe: exit code 1
    assert start(tmp_path, "whole").wait(600) == 1, (tmp_path / "log.txt").read_text()
    whole = rows(tmp_path / "whole")
    assert len(whole) == LANDINGS
    dice = random.Random(1)
    killed = {"parent": 0, "other": 0}
    process = start(tmp_path, "o")
    while sum(killed.values()) < KILLS:
        # a landing or three later, and somewhere in the next one
        target, end = min(len(rows(tmp_path / "o")) + dice.randint(1, 3), LANDINGS), time.monotonic() + 60.0
        while len(rows(tmp_path / "o")) < target and process.poll() is None and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(0.1 * dice.random())
        others = family(tmp_path, process.pid)
        if dice.random() < 0.3 or not others:
            process.kill()
            killed["parent"] += 1
        else:
            try:
                os.kill(dice.choice(others), signal.SIGKILL)
            except ProcessLookupError:
                continue
            killed["other"] += 1
        time.sleep(0.05)
        if process.poll() is not None:
            process = start(tmp_path, "o")
    assert min(killed.values()) >= 10, killed
    process.wait(600)
    for _ in range(3):  # what lost its worker twice in one go is tried again by the same command
        if start(tmp_path, "o").wait(600) == 1:
            break
    assert rows(tmp_path / "o") == whole
