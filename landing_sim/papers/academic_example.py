"""The example of Gibert et al. 2015, eqs. (14)-(16), first used by Chen & Kano 2002: constant motion, a point at 2.5 m.

d1 = b1 - b3 y1 passes zero at 9.565 s and d2 at 2.718 s: comparisons end before 9 s, and Psi = (y1, y2, y2') is of no use
here. x3 never vanishes. The true course is exact, by the matrix exponential.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from landing_sim.estimators.ranging.contract import RangeObserver, steady_motion
from landing_sim.noise import Noise
from landing_sim.papers.courses import Course, observe
from landing_sim.types import Array

A = np.array([[-0.2, 0.4, -0.6], [0.1, -0.2, 0.3], [0.3, -0.4, 0.4]])  # [1/s]
B = np.array([0.5, 0.25, 0.3])  # [m/s]
START = np.array([1.0, 1.5, 2.5])  # [m]
GUESS = 1.0  # [m] depth of (0.4, 0.6, 1), which lies on the ray to START


@dataclass(frozen=True, slots=True)
class Trial:
    """One observer on the example (claims.Job), once for each seed.

    dt : [s] time between samples; the observer steps once a sample
    noise : sigma of the measured y, as a share of y, each sample and coordinate on its own
    """

    name: str
    observer: RangeObserver
    dt: float = 1e-3
    noise: float = 0.0
    repeats: int = 1
    duration: float = 8.0
    guess: float = GUESS
    mirrored: bool = False  # left for right: d1 < 0

    def told(self) -> str:
        return f"{self.name}: {self._conditions()}" + (f", {self.repeats} times" if self.repeats > 1 else "")

    def setting(self) -> tuple[str, str]:
        return f"eqs. (14)–(16), {self._conditions()}", f"{self.name}: {settings(self.observer)}"

    def seeds(self) -> tuple[int, ...]:
        return tuple(range(1, self.repeats + 1)) if self.noise else ()

    def _conditions(self) -> str:
        noise = f"{100.0 * self.noise:g} % noise" if self.noise else "no noise"
        return f"every {1e3 * self.dt:g} ms, {noise}{', left for right' if self.mirrored else ''}"


def settings(part: Any) -> str:
    """An observer, or a part of its settings, as it would be written: only what differs from the defaults."""
    if not is_dataclass(part):
        return repr(part)
    told = []
    for field in fields(part):
        default = field.default if field.default_factory is MISSING else field.default_factory()
        value = getattr(part, field.name)
        if value != default:
            told.append(f"{field.name}={settings(value)}")
    return f"{type(part).__name__}({', '.join(told)})"


def course(dt: float, duration: float) -> Array:
    """The true positions (n, 3) [m], every dt [s]."""
    motion = steady_motion(A, B, dt)
    x = np.empty((round(duration / dt) + 1, 3))
    x[0] = START
    for k in range(1, len(x)):
        x[k] = motion.R @ x[k - 1] + motion.t
    return x


def run(trial: Trial) -> list[Course]:
    """A course for each seed; one without noise."""
    x = course(trial.dt, trial.duration)
    motion = steady_motion(A, B, trial.dt)
    if trial.mirrored:
        left = np.diag([-1.0, 1.0, 1.0])
        x, motion = x @ left, steady_motion(left @ A @ left, left @ B, trial.dt)
    found = []
    for seed in trial.seeds() or (0,):
        y = x[:, :2] / x[:, 2:]
        if trial.noise:
            drawn = Noise(seed, "academic_example").normal(y.size).reshape(y.shape)
            y = y * (1.0 + trial.noise * drawn)
        found.append(observe(trial.observer, x, y, [motion] * (len(x) - 1), trial.dt, trial.guess))
    return found
