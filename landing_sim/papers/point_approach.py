"""An airliner's approach as a point mass: 5 km out, 300 m beside the centreline and 50 m above the glide path.

The paper's own trajectory (section 4.2) is not published. This one turns in at up to 25 degrees of bank, is on the glide
path after some 25 s and stays there. The camera looks along the aircraft's x axis, axes (right, down, forward); what it
sees is the aim point. Guided by truth: nothing depends on the estimate (remark 2 of the paper).

Frame      aim point at the origin, x along the runway, y right, z down.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.ranging.contract import Motion, RangeObserver, motion_between
from landing_sim.geometry.so3 import from_euler
from landing_sim.noise import Noise
from landing_sim.papers.academic_example import settings
from landing_sim.papers.courses import Course, observe
from landing_sim.types import Array

PERIOD = 0.04  # [s] 25 images a second
PIXEL = 0.33e-3  # [rad] half a pixel at f = 1500 px
G = 9.81
CAMERA_FROM_BODY = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Approach:
    """Where it begins and how it is flown."""

    distance: float = 5000.0  # [m]
    right: float = 300.0  # [m] of the centreline
    high: float = 50.0  # [m] above the glide path
    track: float = 0.0  # [rad] at the start, 0 along the runway
    speed: float = 70.0  # [m/s]
    glide: float = math.radians(-3.0)
    steepest_intercept: float = math.radians(20.0)
    end: float = 300.0  # [m] of distance left


@dataclass(frozen=True, slots=True)
class Poses:
    """The camera every PERIOD."""

    t: Array  # (n,) [s]
    p: Array  # (n, 3) [m]
    R_CW: tuple[Array, ...]  # n times (3, 3), frame above to camera axes


@dataclass(frozen=True, slots=True)
class Watch:
    """One observer on one approach (claims.Job), once for each seed.

    share : first range over the true one, 0.5 or 1.5 in the paper
    width : [m] of the object that a third output, its angular width, is of; 0 without. It is never told to the observer
    """

    name: str
    observer: RangeObserver
    share: float
    approach: Approach = Approach()
    noise: float = PIXEL  # [rad]
    width: float = 0.0
    repeats: int = 1

    def told(self) -> str:
        return f"{self.name}: {self.setting()[0]}" + (f", {self.repeats} times" if self.repeats > 1 else "")

    def setting(self) -> tuple[str, str]:
        where = "on the glide path" if self.approach == ON_GLIDE else "beside and above the glide path"
        if self.approach.track:
            where += f", track {math.degrees(self.approach.track):.0f}°"
        noise = f"{1e3 * self.noise:g} mrad" if self.noise else "no noise"
        return f"approach {where}, {noise}, first range × {self.share:g}", f"{self.name}: {settings(self.observer)}"

    def seeds(self) -> tuple[int, ...]:
        return tuple(range(1, self.repeats + 1)) if self.noise else ()


ON_GLIDE = Approach(right=0.0, high=0.0)


@functools.cache
def fly(approach: Approach) -> Poses:
    """The approach, from its start to `end` before the aim point. The autopilot is a point-mass law of this module's."""
    s, V = 5e-3, approach.speed
    x, y, z = -approach.distance, approach.right, approach.distance * math.tan(approach.glide) - approach.high
    track, path, bank = approach.track, approach.glide, 0.0
    every = round(PERIOD / s)
    times, positions, attitudes = [], [], []
    k = 0
    while x < -approach.end:
        if k % every == 0:
            R_BW = from_euler(bank, path + math.radians(5.0), track).T
            times.append(k * s)
            positions.append([x, y, z])
            attitudes.append(CAMERA_FROM_BODY @ R_BW)
        most = approach.steepest_intercept
        wanted_track = -math.asin(min(max(y / (6.0 * V), -math.sin(most)), math.sin(most)))
        wanted_bank = math.atan(V / G * 0.5 * (wanted_track - track))
        wanted_bank = min(max(wanted_bank, -math.radians(25.0)), math.radians(25.0))
        bank += min(max((wanted_bank - bank) / 0.6, -0.2), 0.2) * s
        high = -z - x * math.tan(approach.glide)
        wanted_path = approach.glide - min(max(high / (6.0 * V), -0.035), 0.035)
        path += (wanted_path - path) / 1.5 * s
        track += G / V * math.tan(bank) * s
        x += V * math.cos(path) * math.cos(track) * s
        y += V * math.cos(path) * math.sin(track) * s
        z -= V * math.sin(path) * s
        k += 1
    return Poses(np.array(times), np.array(positions), tuple(attitudes))


@functools.cache
def motions(approach: Approach) -> tuple[Motion, ...]:
    """Between its images: exact increments, as an inertial system would give them."""
    poses = fly(approach)
    return tuple(
        motion_between(poses.R_CW[k], poses.p[k], poses.R_CW[k + 1], poses.p[k + 1], PERIOD)
        for k in range(len(poses.t) - 1)
    )


def points(approach: Approach) -> Array:
    """The aim point in camera axes (n, 3) [m]."""
    poses = fly(approach)
    return np.array([R @ -p for R, p in zip(poses.R_CW, poses.p)])


def run(watch: Watch) -> list[Course]:
    """A course for each seed; ends where the first sample behind the camera would come."""
    x = points(watch.approach)
    y = x[:, :2] / x[:, 2:]
    noise = np.array([watch.noise, watch.noise])
    if watch.width:
        y, noise = np.column_stack([y, watch.width / x[:, 2]]), np.append(noise, math.sqrt(2.0) * watch.noise)
    found = []
    for seed in watch.seeds() or (0,):
        measured = y + noise * Noise(seed, "point_approach").normal(y.size).reshape(y.shape)
        first = watch.share * x[0, 2]
        found.append(observe(watch.observer, x, measured, motions(watch.approach), PERIOD, first))
    return found
