"""Way points wait here until enough of them agree."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from landing_sim.types import Array

LOOKS = 60  # whose ground is remembered


class Refusal(StrEnum):
    """Why there is no landing place, or not here."""

    NO_PAIR = "no earlier view far enough off that shares enough features"
    NO_GROUND = "no plane below"
    GROUND_TILTED = "the ground is not level"
    NOTHING_ELSE = "nothing but ground"
    TOO_FEW = "too few features on it"
    TOO_LOW = "too low"
    TOO_HIGH = "too high"
    TOO_SMALL = "too small"
    TOO_LARGE = "too large"
    TILTED = "tilted"
    CLUTTER = "something on it, or the ground seen through it"
    NOT_IN_VIEW = "never yet wholly in view"
    NOT_SURROUNDED = "no ground seen next to one of its sides: it may go on there"
    TOO_NEW = "not seen often enough"
    UNSTEADY = "its place varies too much"


@dataclass(frozen=True, slots=True)
class WayPoint:
    """One pair of views' idea of a landing place.

    t [s]; p_R (3,) [m] centre of its rectangle; height [m] above the ground; size (2,) [m] longer, shorter side
    normal (3,) unit, downwards, of the plane without regard to the ground; features on it
    """

    t: float
    p_R: Array
    height: float
    size: tuple[float, float]
    normal: Array
    features: int


@dataclass(frozen=True, slots=True)
class Limits:
    """Of the mean way point of a pool, [m] and [rad]; `samples` and `spread` [m] of the pool itself, each axis."""

    lowest: float = 0.07
    highest: float = 0.6
    smallest: float = 0.25
    largest: float = 0.9
    tilt: float = math.radians(6.0)
    samples: int = 8
    spread: float = 0.03

    def widened(self, share: float) -> Limits:
        """The same with every limit of height, size and tilt moved outwards by a share of itself."""
        less, more = 1.0 - share, 1.0 + share
        return replace(
            self, lowest=less * self.lowest, highest=more * self.highest, smallest=less * self.smallest,
            largest=more * self.largest, tilt=more * self.tilt,
        )  # fmt: skip


@dataclass(eq=False)
class Pool:
    """The way points of one place, the latest `keep`; the features that were found to lie on it; where it is not.

    level [m] : height above the ground at which it was first seen
    """

    level: float
    keep: int = 16
    points: deque[WayPoint] = field(default_factory=deque)
    seen: dict[int, tuple[int, Array]] = field(default_factory=dict)  # id: how often, sum of places (3,) [m]
    strange: dict[int, int] = field(default_factory=dict)  # id of what is seen on it but is not of its plane: how often
    whole: bool = False  # all of it has been in view at once
    around: deque[Array] = field(
        default_factory=lambda: deque(maxlen=LOOKS)
    )  # (n, 2) [m] where ground was seen past it

    def collect(self, ids: np.ndarray, X: Array) -> None:
        """Features ids (n,) lie on it, at X (n, 3) [m]."""
        for name, place in zip(ids.tolist(), X):
            count, total = self.seen.get(name, (0, 0.0))
            self.seen[name] = count + 1, total + place

    def notice(self, ids: np.ndarray) -> None:
        """Features ids (n,) are seen on it, but lie elsewhere."""
        for name in ids.tolist():
            self.strange[name] = self.strange.get(name, 0) + 1

    @property
    def strangers(self) -> int:
        """How many features are more often found off it than on it, twice at least."""
        return sum(count > max(1, self.seen.get(name, (0, None))[0]) for name, count in self.strange.items())

    def known(self, times: int) -> Array:
        """(n, 3) [m] mean places of the features found on it so many times or more."""
        return np.array([total / count for count, total in self.seen.values() if count >= times]).reshape(-1, 3)

    def add(self, point: WayPoint) -> None:
        """A way point; the oldest goes when there are too many."""
        self.points.append(point)
        if len(self.points) > self.keep:
            self.points.popleft()

    @property
    def middle(self) -> Array:
        """(3,) [m] mean of all its features."""
        return np.asarray(np.mean([total / count for count, total in self.seen.values()], axis=0))

    @property
    def mean(self) -> Array:
        """(3,) [m] of the way points."""
        return np.asarray(np.mean([q.p_R for q in self.points], axis=0))

    @property
    def spread(self) -> float:
        """[m] the largest standard deviation of an axis."""
        return float(np.std([q.p_R for q in self.points], axis=0).max())

    @property
    def height(self) -> float:
        """[m] mean over the ground."""
        return float(np.mean([q.height for q in self.points]))

    def summary(self) -> WayPoint:
        """The mean way point, at the time of the latest."""
        return replace(self.points[-1], p_R=self.mean, height=self.height)

    def refusal(self, limits: Limits) -> Refusal | None:
        """Why the place is not fit to land on, or not yet; None if it is."""
        if not self.points:
            return Refusal.TOO_FEW
        longer, shorter = np.mean([q.size for q in self.points], axis=0)
        normal = np.sum([q.normal for q in self.points], axis=0)
        tilt = math.acos(min(1.0, float(normal[2] / np.linalg.norm(normal))))
        unfit = outside(self.height, float(longer), float(shorter), tilt, limits)
        if unfit is not None:
            return unfit
        if len(self.points) < limits.samples:
            return Refusal.TOO_NEW
        return Refusal.UNSTEADY if self.spread >= limits.spread else None


def outside(height: float, longer: float, shorter: float, tilt: float, limits: Limits) -> Refusal | None:
    """Which limit is broken, if one is; lengths in m, tilt in rad."""
    if tilt > limits.tilt:
        return Refusal.TILTED
    if height < limits.lowest:
        return Refusal.TOO_LOW
    if height > limits.highest:
        return Refusal.TOO_HIGH
    if shorter < limits.smallest:
        return Refusal.TOO_SMALL
    return Refusal.TOO_LARGE if longer > limits.largest else None
