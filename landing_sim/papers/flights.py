"""A paper's flights: what is flown, and what came of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from landing_sim.record.log import FlightLog


@dataclass(frozen=True, slots=True)
class Run:
    """One flight (claims.Job): a shipped scenario, changes to it as with ``--set``, a seed, and who flies."""

    scenario: str
    changes: tuple[str, ...] = ()
    seed: int = 1
    pilot: bool = False  # flown by the scripted pilot, the filter only watching

    def told(self) -> str:
        who = "scripted pilot" if self.pilot else "autopilot"
        return f"{self.scenario} seed {self.seed} ({who}) {' '.join(self.changes)}".rstrip()

    def setting(self) -> tuple[str, str]:
        return self.scenario + (", flown by the scripted pilot" if self.pilot else ""), "  ".join(self.changes)

    def seeds(self) -> tuple[int, ...]:
        return (self.seed,)


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight's log, with the time that its onboard work took."""

    log: FlightLog
    cycle_ms: float = math.nan  # median onboard work of a cycle: vision, estimation, guidance, control
    estimator_ms: float = math.nan  # of it the filter's
