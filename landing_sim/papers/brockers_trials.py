"""What Brockers et al. 2012 flew, flown again: hovers, landings, and the filter beside a flight that it does not steer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from landing_sim import loop, scenario
from landing_sim.estimators.readings import Fresh
from landing_sim.missions import quadrotor_flight, quadrotor_landing
from landing_sim.missions.quadrotor_eyes import Looking
from landing_sim.papers.claims import Job
from landing_sim.papers.flights import Flown, Run
from landing_sim.sections.quadrotor import QuadrotorScenario
from landing_sim.signals import Command, Step
from landing_sim.types import Array

STEP = "time.step_s=0.002"
EMULATED = (STEP, "localisation.kind=emulated")
RENDERED = (STEP, "camera.width_px=320")
LONG = "time.limit_s=66.0"
UNFUSED_GAINS = ("bandwidth_radps=1.8", "damping=0.85", "vertical_radps=1.9", "vertical_damping=0.9", "integral=0.2")
HOVER_SEEDS = tuple(range(201, 209))
LANDING_SEEDS = tuple(range(301, 318))
RENDERED_SEEDS = (401, 402, 403)
PATH = ("path.goal_x_m=2.6", "path.climb_mps=0.2")
PLACES = (
    ("scene.seed=1", "scene.boxes=[{x_m: 2.1, y_m: 0.2, yaw_deg: 20}]"),
    ("scene.seed=2", "scene.boxes=[{x_m: 1.9, y_m: -0.3, yaw_deg: -35}]"),
    ("scene.seed=3", "scene.boxes=[{x_m: 2.3, height_m: 0.2}]"),
)
"""Three places; the first is the paper's as far as it says: 57 x 57 x 14 cm, how far off is ours."""


@dataclass(frozen=True, slots=True)
class Flights:
    """The same flight from several seeds (claims.Job); of each its outcome and figures are kept, not its log."""

    scenario: str
    changes: tuple[str, ...]
    of: tuple[int, ...]

    def told(self) -> str:
        return f"{self.scenario}, {len(self.of)} seeds {' '.join(self.changes)}".rstrip()

    def setting(self) -> tuple[str, str]:
        return self.scenario, "  ".join(self.changes)

    def seeds(self) -> tuple[int, ...]:
        return self.of


@dataclass(frozen=True, slots=True)
class Beside:
    """A flight, and what the fused filter makes of the same readings while another estimate flies it (claims.Job)."""

    scenario: str
    watching: str  # the scenario whose estimator watches
    changes: tuple[str, ...]
    seed: int

    def told(self) -> str:
        return f"{self.scenario} seed {self.seed}, the filter of {self.watching} watching"

    def setting(self) -> tuple[str, str]:
        return f"{self.scenario}, watched by {self.watching}", "  ".join(self.changes)

    def seeds(self) -> tuple[int, ...]:
        return (self.seed,)


@dataclass(frozen=True, slots=True)
class Detection:
    """What the detector makes of the images of one flight until it hovers above the place (claims.Job)."""

    scenario: str
    changes: tuple[str, ...]
    seed: int

    def told(self) -> str:
        return f"{self.scenario} seed {self.seed}, its detector"

    def setting(self) -> tuple[str, str]:
        return f"{self.scenario}, its detector", "  ".join(self.changes)

    def seeds(self) -> tuple[int, ...]:
        return (self.seed,)


@dataclass(frozen=True, slots=True)
class Brief:
    """One flight of many: how it ended, and missions.quadrotor_flight.METRICS."""

    outcome: str
    metrics: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Watched:
    """t (n,); true and estimated p (n, 3) in R; fixes (m, 3), when their images were taken and when they came (m,)."""

    t: Array
    p: Array
    p_hat: Array
    fixes: Array
    taken: Array
    came: Array


@dataclass(frozen=True, slots=True)
class Heights:
    """Platform height in each image that gave a way point (n,) [s], [m], the pool's mean once it agreed, the true one."""

    t: Array
    height: Array
    agreed_at: float  # [s]; NaN if it never did
    agreed: float  # [m]
    true: float


Results = Sequence[list[Brief]]

UNFUSED = Flights("quadrotor/hover_unfused", (*RENDERED, LONG), HOVER_SEEDS)
FUSED = Flights("quadrotor/hover", (*RENDERED, LONG), HOVER_SEEDS)
"""On rendered images; what follows, to find the reasons, on emulated ones."""
WITHOUT = Flights("quadrotor/hover_unfused", (*EMULATED, LONG), HOVER_SEEDS)


def _fused(*changes: str) -> Flights:
    return Flights("quadrotor/hover", (*EMULATED, LONG, *changes), HOVER_SEEDS)


WITH = _fused()
EQUAL = _fused(*(f"control.{gain}" for gain in UNFUSED_GAINS))
UNCOMPENSATED = _fused("filter.compensated=false")
SELDOM = _fused("control.period_s=0.05")
LATE = _fused(
    *(f"camera.latency.{c}" for c in ("mean_s=0.2", "spike_share=0.05", "spike_low_s=0.3", "spike_high_s=0.3"))
)


def _landings(name: str, how: tuple[str, ...], seeds: tuple[int, ...]) -> tuple[Flights, ...]:
    """One job a place."""
    return tuple(Flights(name, (*how, *PATH, *place), seeds) for place in PLACES)


SLOW, FAST, SLOW_UNFUSED = (
    _landings(name, EMULATED, LANDING_SEEDS)
    for name in ("quadrotor/land", "quadrotor/land_fast", "quadrotor/land_unfused")
)
SEEN_SLOW, SEEN_FAST = (_landings(name, RENDERED, RENDERED_SEEDS) for name in ("quadrotor/land", "quadrotor/land_fast"))
HOVERED = {
    name: Run(job.scenario, job.changes, HOVER_SEEDS[0]) for name, job in (("PTAM-only", UNFUSED), ("fused", FUSED))
}
FLOWN = {
    name: Run(jobs[0].scenario, jobs[0].changes, LANDING_SEEDS[0])
    for name, jobs in (("PTAM-only", SLOW_UNFUSED), ("fused", SLOW), ("fused, fast", FAST))
}
WATCHED = Beside("quadrotor/hover_unfused", "quadrotor/hover", (*EMULATED, LONG), HOVER_SEEDS[0])
DETECTED = tuple(Detection("quadrotor/land_fast", (*RENDERED, *PATH, *PLACES[0]), seed) for seed in RENDERED_SEEDS)


def perform(job: Job) -> list[Brief] | Flown | Watched | Heights:
    """Figures of many flights, one flight's log, a filter's course or a detector's. Raises ScenarioError."""
    if isinstance(job, Run):
        return Flown(quadrotor_flight.fly(load(job.scenario, job.changes, job.seed)).log)
    if isinstance(job, Beside):
        return _watch(job)
    if isinstance(job, Detection):
        return _detect(job)
    assert isinstance(job, Flights)
    return [_brief(load(job.scenario, job.changes, seed)) for seed in job.of]


def load(name: str, changes: Sequence[str], seed: int) -> QuadrotorScenario:
    """Raises ScenarioError."""
    wanted: object = scenario.load(name, [*changes, f"seed={seed}"])
    assert isinstance(wanted, QuadrotorScenario)
    return wanted


def _brief(wanted: QuadrotorScenario) -> Brief:
    verdict = quadrotor_flight.fly(wanted).verdict
    return Brief(verdict.outcome, verdict.metrics)


def _watch(job: Beside) -> Watched:
    steps: list[Step] = []
    quadrotor_flight.fly(load(job.scenario, job.changes, job.seed), steps.append)
    parts = quadrotor_landing.build(load(job.watching, job.changes, job.seed), job.seed).parts
    estimates = loop.estimate_offline(parts.clock, steps, parts.front_ends, parts.estimator, Command())
    p_hat = [(e["x"], e["y"], -e["H"]) if e.valid else (np.nan,) * 3 for e in estimates]
    fixes = [(s.truth.t, m.t_valid, *m.z.tolist()) for s in steps for m in s.measurements if m.kind == "position"]
    table = np.array(fixes)
    t, p = np.array([s.truth.t for s in steps]), np.array([s.truth.p_RB for s in steps])
    return Watched(t, p, np.array(p_hat), table[:, 2:], table[:, 1], table[:, 0])


def _looking(front_end: Any) -> Looking:
    """What looks at the images, inside what is wrapped round it."""
    while not isinstance(front_end, Looking):
        front_end = front_end.front_end if isinstance(front_end, Fresh) else front_end.inner
    return front_end


def _detect(job: Detection) -> Heights:
    wanted = load(job.scenario, job.changes, job.seed)
    mission = quadrotor_landing.build(wanted, wanted.seed)
    eye = _looking(mission.parts.front_ends["camera"])
    found: list[tuple[float, float]] = []
    at, agreed, last = math.nan, math.nan, None
    for step in mission.steps():
        if eye.look is not None and eye.look is not last:
            last = eye.look
            found += [(last.t, c.point.height) for c in last.candidates if c.refusal is None]
            if last.place is not None and math.isnan(at):
                at, agreed = last.t, last.place.height
        if step.reference.mode == "descend":
            break
    table = np.array(found).reshape(-1, 2)
    return Heights(table[:, 0], table[:, 1], at, agreed, wanted.scene.boxes[0].height_m)
