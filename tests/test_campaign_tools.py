"""tools/rare and tools/worst: what they refuse, and which variable is said to be the worst."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import campaign_jobs
import pytest

from landing_sim.campaign import file, run, worst

ROOT = Path(__file__).resolve().parent.parent
TEXT = """schema_version: 1
scenario: do128/gust
runs: 2
set: {wind.crosswind_from_x_m: null}
dispersions:
  wind.headwind_mps: {uniform: {low: 0, high: 10}}
  wind.crosswind_mps: {uniform: {low: 0, high: 5}}
  filter.kind: {choice: {values: [augmented, plain]}}
risks: [{name: hard, metric: sink_rate_mps, above: 3.0, probability: 1.0e-3}]
"""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rare.py", "bad.yaml"), "bad.yaml:6:3: wind.headwnd_mps: unknown key"),
        (("worst.py", "bad.yaml"), "bad.yaml:6:3: wind.headwnd_mps: unknown key"),
        (("rare.py", "good.yaml", "--risk", "soft"), "error: its risks are: hard"),
        (("rare.py", "good.yaml", "--landings", "55"), "error: share 0.1 of 55 states must be 10 or more"),
        (("rare.py", "good.yaml", "--held", "3"), "error: --held 3 is none of the sweep's values"),
        (("worst.py", "good.yaml", "--variable", "wind.x"), "error: not drawn: wind.x; there are: wind.headwind_mps"),
        (("worst.py", "good.yaml", "--variable", "filter.kind"), "filter.kind is chosen from words"),
    ],
)
def test_what_cannot_be_asked_is_said_and_nothing_written(
    arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    (tmp_path / "good.yaml").write_text(TEXT)
    (tmp_path / "bad.yaml").write_text(TEXT.replace("headwind", "headwnd"))
    tool, *others = arguments
    command = [sys.executable, str(ROOT / "tools" / tool), *others]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.yaml", "good.yaml"]


def test_the_worst_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In much headwind all crash and have no figure: worse than much crosswind, which is 1 m/s from the limit."""
    (tmp_path / "c.yaml").write_text(TEXT)
    fly = run.fly
    monkeypatch.setattr(worst.run, "fly", lambda *given: fly(*given, method="fork", job=campaign_jobs.windy))
    told: list[str] = []
    found = worst.worst(
        file.load(tmp_path / "c.yaml"), tmp_path / "o", 5, workers=1, told=lambda name, values: told.append(name)
    )
    assert told == ["wind.headwind_mps", "wind.crosswind_mps"]  # words have no ends
    names = [(held.name, round(held.value, 2), held.count, held.n) for held in found]
    assert names[:2] == [("wind.headwind_mps", 9.9, 5, 5), ("wind.crosswind_mps", 4.95, 0, 5)]
    assert math.isnan(found[0].sigmas)
    assert found[1].sigmas == pytest.approx((3.0 - 2.0) / (0.1 * math.sqrt(2.5)))  # 1.8 ... 2.2 m/s
    assert found[-1].sigmas > found[1].sigmas
