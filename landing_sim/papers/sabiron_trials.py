"""Sabiron et al. 2014's simulation: eq. (2) flown open loop beside the reference, and the observers watching."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.optic_flow.contract import FlowObserver, Push
from landing_sim.estimators.optic_flow.geometry import flow
from landing_sim.estimators.optic_flow.kalman import FlowEkf, FlowUkf
from landing_sim.estimators.optic_flow.lpv_observer import PUBLISHED, SHIPPED, LpvObserver
from landing_sim.estimators.optic_flow.reference import reference
from landing_sim.noise import Noise
from landing_sim.types import Array

ANGLES = np.radians([90.0, 120.0, 160.0])
UNITS = np.array([1.0, *[math.degrees(1.0)] * 4])
"""[m, deg/s, deg/s, deg/s, deg] of [h, q, omega_x, omega_z, theta]."""
DEVIATION = np.array([100.0, *np.radians([-0.2, -0.115, -0.08, -2.0])])  # of the lander from the reference
BELIEVED = np.array([60.0, *np.radians([-0.2, -0.126, 0.23, 3.23])])  # what is believed of it


@dataclass(frozen=True, slots=True)
class Trial:
    """One simulation: claims.Job.

    observer : a key of OBSERVERS
    share : of the paper's deviation and of what is believed of it
    q_known : False: the first belief of q is the reference's
    noise_dps : [deg/s] white, of each flow, every step
    """

    observer: str
    share: float = 1.0
    q_known: bool = True
    noise_dps: float = 0.0
    dt: float = 0.01
    duration: float = 30.0
    repeats: int = 1

    def told(self) -> str:
        return f"descent of the published start, {self.observer}, {self.repeats} of them"

    def setting(self) -> tuple[str, str]:
        changes = {
            f"deviation x {self.share:g}": self.share != 1.0,
            "q unknown": not self.q_known,
            f"noise {self.noise_dps:g} deg/s": self.noise_dps != 0.0,
            f"step {1e3 * self.dt:g} ms": self.dt != 0.01,
        }
        return self.observer, ", ".join(text for text, changed in changes.items() if changed)

    def seeds(self) -> tuple[int, ...]:
        return tuple(range(1, self.repeats + 1)) if self.noise_dps else ()


@dataclass(frozen=True, slots=True)
class Course:
    """(n,) and (n, 5): the truth, what was believed, and the reference; S's smallest eigenvalue and condition."""

    t: Array
    X: Array
    X_hat: Array
    X_ref: Array
    least: float
    condition: float

    @property
    def error(self) -> Array:
        """(n, 5) in UNITS."""
        return (self.X_hat - self.X) * UNITS

    def rms(self, start: float, end: float) -> Array:
        """(5,) in UNITS"""
        inside = (self.t >= start - 1e-9) & (self.t <= end + 1e-9)
        return np.sqrt(np.mean(self.error[inside] ** 2, axis=0))

    def at(self, t: float) -> Array:
        """(5,) error in UNITS."""
        return self.error[round(t / (self.t[1] - self.t[0]))]


OPEN_LOOP = "open-loop linear model"
OBSERVERS: dict[str, FlowObserver] = {
    OPEN_LOOP: LpvObserver(reference()),
    "LPV observer, published gains": LpvObserver(reference(), PUBLISHED),
    "LPV observer, shipped gains": LpvObserver(reference(), SHIPPED),
    "EKF": FlowEkf(),
    "UKF": FlowUkf(),
}


@functools.cache
def descent(share: float, dt: float, duration: float) -> tuple[Array, Array]:
    """t (n,) and X (n, 5) of eq. (2) under the reference's inputs, from share x DEVIATION beside it."""
    from scipy.integrate import solve_ivp

    ref = reference()
    h, q, wx, wz, theta = ref.state(0.0) + share * DEVIATION
    t: Array = dt * np.arange(round(duration / dt) + 1, dtype=float)
    start = [0.0, h, wx * h, wz * h, theta, q, float(ref.at(0.0)[7])]
    _, h, vx, vz, theta, q, _ = solve_ivp(
        lambda t, state: ref.lander.rates(state, *ref.inputs(t)),
        (0.0, t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-9, max_step=0.05,
    ).y  # fmt: skip
    return t, np.column_stack([h, q, vx / h, vz / h, theta])


def run(trial: Trial) -> list[Course]:
    """A course for each of the trial's seeds."""
    t, X = descent(trial.share, trial.dt, trial.duration)
    return [_watch(trial, t, X, seed) for seed in range(1, trial.repeats + 1)]


def _watch(trial: Trial, t: Array, X: Array, seed: int) -> Course:
    observer, ref = OBSERVERS[trial.observer], reference()
    believed = trial.share * BELIEVED
    believed[1] *= trial.q_known
    state = observer.start(0.0, ref.state(0.0) + believed)
    sigma = math.radians(trial.noise_dps)
    noise = sigma * Noise(seed, "flows").normal(3 * len(t)).reshape(-1, 3)
    out, least, condition = [state.X], math.inf, 1.0
    flows = np.array([flow(X[0], alpha) for alpha in ANGLES]) + noise[0]
    for k in range(1, len(t)):
        row = ref.at(0.5 * (t[k - 1] + t[k]))
        if isinstance(observer, LpvObserver) and trial.observer != OPEN_LOOP:
            state = observer.fuse(state, ANGLES, flows, 0.5 * trial.dt)
        state = observer.predict(state, Push(row[5], row[6]), trial.dt)
        if trial.observer != OPEN_LOOP:
            flows = np.array([flow(X[k], alpha) for alpha in ANGLES]) + noise[k]
            if isinstance(observer, LpvObserver):
                state = observer.fuse(state, ANGLES, flows, 0.5 * trial.dt)
                if k % 10 == 1:
                    low, high = np.linalg.eigvalsh(observer.barred_information(state))[[0, -1]]
                    least, condition = min(least, low), max(condition, high / low if low > 0.0 else math.inf)
            else:
                for alpha, seen in zip(ANGLES, flows):
                    state = observer.look(state, alpha, seen, max(sigma, math.radians(0.02)))
        out.append(state.X)
    return Course(t, X, np.array(out), np.array([ref.state(s) for s in t]), float(least), float(condition))
