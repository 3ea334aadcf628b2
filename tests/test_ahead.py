"""A first flight is compiled by two processes: the second one compiles what is flown with, and goes when it is done."""

from __future__ import annotations

import sys
from importlib import import_module

import pytest
from numba.core import event, sigutils

from landing_sim import ahead, scenario, vehicle
from landing_sim.missions import runway_landing


@pytest.mark.parametrize("name", ["do128/gust", "transport/calm"])
def test_what_is_compiled_ahead_is_what_is_flown_with(name):
    wanted = scenario.load(name, ["time.limit_s=3"])
    for _ in runway_landing.build(wanted, vehicle.load(wanted.aircraft.model), 1).steps():
        pass
    for module, kernel, arguments in ahead.LAST:
        compiled = getattr(import_module(f"landing_sim.{module}"), kernel).signatures
        assert sigutils.normalize_signature(f"({arguments})")[0] in compiled, kernel


def test_a_process_helps_from_the_first_compilation_on_and_ends_with_the_flight(monkeypatch):
    started = []

    class Waiting(ahead.subprocess.Popen):
        def __init__(self, arguments, **where):
            assert arguments == [sys.executable, "-m", "landing_sim.ahead"]
            super().__init__([sys.executable, "-c", "import time; time.sleep(60)"], **where)
            started.append(self)

    monkeypatch.setattr(ahead.subprocess, "Popen", Waiting)
    monkeypatch.setattr(ahead.os, "cpu_count", lambda: 2)
    with ahead.helped():
        assert not started
        for _ in range(2):
            with event.trigger_event("numba:compile"):
                assert len(started) == 1
        assert started[0].poll() is None
    assert started[0].poll() is not None


def test_a_single_core_is_left_alone(monkeypatch):
    monkeypatch.setattr(ahead.os, "cpu_count", lambda: 1)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda *_, **__: pytest.fail("started"))
    with ahead.helped(), event.trigger_event("numba:compile"):
        pass
