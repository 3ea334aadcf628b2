"""A range observer run along a known course, and the figures of what it did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.ranging.contract import Motion, RangeObserver
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class Course:
    """Truth and estimate at every sample."""

    t: Array  # (n,) [s]
    x: Array  # (n, 3) [m] true, camera axes
    x_hat: Array  # (n, 3) estimated
    d: Array  # (n, 2) [m/s] d1, d2; NaN at the first sample
    flag: np.ndarray  # (n,) contract.Flag

    @property
    def error(self) -> Array:
        """(n,) [m] of the range x3."""
        return self.x_hat[:, 2] - self.x[:, 2]

    @property
    def relative(self) -> Array:
        """(n,) error of the range over the true range."""
        return self.error / self.x[:, 2]


def observe(observer: RangeObserver, x: Array, y: Array, motions: Sequence[Motion], dt: float, guess: float) -> Course:
    """x (n, 3) true, y (n, m) measured, n - 1 motions between the samples; `guess` [m] is the first range."""
    state = observer.start(y[0], guess)
    states = [state]
    for measured, motion in zip(y[1:], motions):
        state = observer.step(state, measured, motion, dt)
        states.append(state)
    return Course(
        dt * np.arange(len(x), dtype=float),
        x,
        np.array([observer.estimate(s) for s in states]),
        np.array([[s.d1, s.d2] for s in states]),
        np.array([int(s.flag) for s in states]),
    )


def settling(course: Course, share: float = 0.05, until: float = math.inf) -> float:
    """[s] after which the range stays within this share of its true value; NaN if it does not. `until` ends the watch."""
    outside = np.flatnonzero((np.abs(course.relative) > share) & (course.t <= until))
    last = int(np.searchsorted(course.t, until, side="right")) - 1
    if not len(outside):
        return 0.0
    return float(course.t[outside[-1] + 1]) if outside[-1] < last else math.nan


def rms_between(course: Course, start: float, end: float) -> float:
    """[m] of the range error over start <= t <= end [s]."""
    use = (course.t >= start - 1e-9) & (course.t <= end + 1e-9)
    return float(np.sqrt(np.mean(course.error[use] ** 2)))


def largest_step(course: Course, motions: Sequence[Motion]) -> float:
    """Largest share of the range that one sample changed it by, beyond what the motion did."""
    carried = np.array([(m.R @ x + m.t)[2] for m, x in zip(motions, course.x_hat)])
    return float(np.max(np.abs(course.x_hat[1:, 2] / carried - 1.0)))
