"""Closed-loop flights for tests: each wanted flight is flown once a session."""

from __future__ import annotations

from functools import cache

import numpy as np

from landing_sim import runner, scenario, vehicle
from landing_sim.missions.flight import Flight
from landing_sim.record.judge import counted
from landing_sim.record.log import FlightLog


@cache
def fly(name: str, *changes: str, seed: int = 1) -> Flight:
    """A shipped scenario with changes, as given to --set."""
    wanted = scenario.load(name, [*changes, f"seed={seed}"])
    return runner.fly(wanted, vehicle.load(wanted.aircraft.model))


def approach(log: FlightLog, until: float = -130.0) -> np.ndarray:
    """(n,) bool: from 1.5 s after acquisition until x [m]: the threshold is in view for any front end."""
    return counted(log) & (log["true_x_m"] < until)


def worst(log: FlightLog, name: str, where: np.ndarray) -> float:
    return float(np.abs(log.error(name)[where]).max())
