"""What workers do in tests of campaigns: importable by them, unlike what a test module defines."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from landing_sim.campaign.dispersions import draw
from landing_sim.campaign.landing import Landing, land
from landing_sim.campaign.plan import Plan


def dies_once(plan: Plan, run: int) -> Landing:
    """Landing 2 takes its first worker with it; the file named in CAMPAIGN_TEST remembers."""
    mark = Path(os.environ["CAMPAIGN_TEST"])
    if run == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return land(plan, run)


def kills(plan: Plan, run: int) -> Landing:
    """Landing 1 takes every worker with it, landing 3 is beyond our code."""
    if run == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if run == 3:
        raise ZeroDivisionError("run 3 divides by zero")
    return Landing(run, "landed", values={"wind.crosswind_mps": float(run)})


def cheap(plan: Plan, run: int) -> Landing:
    """No flight."""
    return Landing(run, "landed", values={"wind.crosswind_mps": float(run)})


def held(plan: Plan, run: int) -> Landing:
    """No flight: banked beyond any limit where the sweep is at its third value."""
    figures = dict.fromkeys(plan.figures(), 1.0) | {"peak_roll_deg": 99.0 if run % 3 == 2 else 0.0}
    return Landing(run, "landed", "", figures, draw(plan.campaign, run))


def windy(plan: Plan, run: int) -> Landing:
    """No flight: crashes in more than 9.85 m/s of headwind, touches down harder in more than 4.9 m/s across."""
    values = draw(plan.campaign, run)
    if values["wind.headwind_mps"] > 9.85:
        return Landing(run, "crash", values=values)
    sink = (1.8 if values["wind.crosswind_mps"] > 4.9 else 0.8) + 0.1 * (run // 2)
    return Landing(run, "landed", "", dict.fromkeys(plan.figures(), 1.0) | {"sink_rate_mps": sink}, values)


def square(number: int) -> int:
    """Killed by 7."""
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def no_worker(number: int) -> int:
    """Never begun: its module cannot be loaded where CAMPAIGN_TEST says so."""
    return number


def signs(number: int) -> int:
    """Leaves its process in the file that CAMPAIGN_TEST names."""
    with Path(os.environ["CAMPAIGN_TEST"]).open("a") as stream:
        stream.write(f"{os.getpid()}\n")
    return number


def whoami(number: int) -> int:
    """The worker's process."""
    return os.getpid()


if os.environ.get("CAMPAIGN_TEST") == "broken":
    os._exit(7)
