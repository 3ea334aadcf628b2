"""Giving up an approach that the estimate itself is not sure enough of: guidance that listens to its covariance.

The landing guidance gives up what it sees go wrong. When sensors die nothing need look wrong: the estimate drifts,
smoothly. What it then says of itself is its covariance, and that no edge was found for a while. The limits are what a safe
touchdown can bear: 5 m off the centreline at 3 sigma with 2 m left for flying, and 2 m of height at 3 sigma.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from landing_sim.control.believed import believed, motion
from landing_sim.control.guidance import AIRBORNE, GuidanceMemory, LandingGuidance
from landing_sim.signals import Estimate, Reference


@dataclass(frozen=True, slots=True)
class Limits:
    """1 sigma of the estimate that an approach is flown on with; m, rad, s."""

    lateral: float = 1.0  # at the threshold
    lateral_per_range: float = 0.01
    height: float = 0.7  # at the threshold
    height_per_height: float = 0.02
    angle: float = math.radians(1.0)  # of roll and of pitch
    blind: float = 2.0  # [s] without any edge
    patience: float = 0.5  # [s] doubt for no longer is waited out


@dataclass(frozen=True, slots=True)
class DoubtMemory:
    """The landing guidance's memory; since when [s] an edge is missed, and since when there is doubt; inf = is not."""

    inner: GuidanceMemory
    blind_since: float = math.inf
    doubt_since: float = math.inf


class DoubtfulGuidance:
    """interfaces.Guidance: `landing`, or a go-around where the estimate's own doubt exceeds the limits for too long.

    At and below the decision height [m] of the landing guidance's settings the approach is continued: what is left of it is
    shorter than what a go-around would sink through.
    """

    def __init__(self, landing: LandingGuidance, limits: Limits) -> None:
        self.landing, self.limits = landing, limits

    def init(self) -> DoubtMemory:
        return DoubtMemory(self.landing.init())

    def step(self, memory: DoubtMemory, estimate: Estimate) -> tuple[DoubtMemory, Reference]:
        inner, t = memory.inner, estimate.t
        if estimate.valid and estimate.cov is not None and inner.mode in AIRBORNE:
            unseen = estimate.flags.get("unseen", estimate.flags.get("lost", False))
            blind = _since(memory.blind_since, t, unseen)
            doubt = _since(memory.doubt_since, t, self._doubted(estimate))
            memory = replace(memory, blind_since=blind, doubt_since=doubt)
            if t - doubt > self.limits.patience or t - blind > self.limits.blind:
                inner = self._given_up(inner, estimate)
        inner, reference = self.landing.step(inner, estimate)
        return replace(memory, inner=inner), reference

    def _doubted(self, estimate: Estimate) -> bool:
        assert estimate.cov is not None
        rows, c = _rows(estimate.names), self.limits
        x, _, height, _, _ = estimate.mean[rows].tolist()
        _, y, H, phi, theta = np.sqrt(np.maximum(np.diagonal(estimate.cov)[rows], 0.0)).tolist()
        return bool(
            y - c.lateral_per_range * max(-x, 0.0) > c.lateral
            or H - c.height_per_height * max(height, 0.0) > c.height
            or max(phi, theta) > c.angle
        )

    def _given_up(self, inner: GuidanceMemory, estimate: Estimate) -> GuidanceMemory:
        b = believed(estimate)
        s = self.landing.settings
        if b.H - s.gear.down_m <= s.go_around.decision_height_m or estimate.flags.get("on_ground"):
            return inner
        return replace(inner, mode="go_around", start=(estimate.t, b.H, motion(b).H_dot))


def _since(before: float, t: float, now: bool) -> float:
    return math.inf if not now else min(before, t)


@lru_cache(maxsize=16)
def _rows(names: tuple[str, ...]) -> np.ndarray:
    return np.array([names.index(name) for name in ("x", "y", "H", "phi", "theta")])
