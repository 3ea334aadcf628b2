"""Metres and level: what a single camera cannot know.

The sonar gives the scale (least squares over all readings until the tenth keyframe), the ground gives the level, the
inertial unit the heading.

Source     Brockers et al. 2012, section 4.3.
           Departs: every reading counts, not one a keyframe, since readings come in steps of 2.5 cm that only motion evens
           out; but only where the map shows nothing but ground below, and none that is far off the fit. The ground's plane
           in the map is levelled, because an attitude that is 0.6 deg off tilts the map by 1 cm a metre; `level_ground`
           False keeps the inertial unit's level.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from landing_sim.noise import Noise
from landing_sim.types import Array
from landing_sim.vision.slam.settings import SlamSettings

MOST_TILT = 0.06  # [rad] a plane steeper than this against the inertial unit's level is not the ground
TRIES = 200
BEAM = 0.27  # tangent of 15 deg: what the sonar may hear
FLAT = 0.012  # [height] a point further off the ground is not of it


class Similarity(NamedTuple):
    """X becomes scale R X + t."""

    scale: float
    R: Array
    t: Array


class Ground(NamedTuple):
    """A plane: n (3,) its normal, pointing down; on (n,) bool, the points on it."""

    n: Array
    on: np.ndarray


def similarity(
    X: Array, anchor: Array, path: Array, readings: Array, settings: SlamSettings, wait: bool
) -> Similarity | str:
    """What makes a map level and metric, its ground z = 0; a string says what is still missing.

    Parameters
    ----------
    X (m, 3) : points of the map; anchor (3,) : the first camera, whose x and y stay
    path (n, 3), readings (n,) [m] : where the sonar was in the map, and what it said there
    wait : for bare ground, if it has not been heard often enough yet
    """
    found = ground(X, 0.02 * -float(anchor[2]), settings.seed)
    turn, down = np.eye(3), 0.0
    if found is not None:
        turn = level(found.n) if settings.level_ground else turn
        X = (X - anchor) @ turn.T + anchor
        down = float(np.median(X[found.on, 2]))
        X = X - [0.0, 0.0, down]
        path = (path - anchor) @ turn.T + anchor - [0.0, 0.0, down]
    clear = over_ground(path, X)
    if clear.sum() < settings.scale_readings:
        if wait:
            return f"{clear.sum()} sonar readings over bare ground, {settings.scale_readings} needed for the scale"
        clear[:] = True
    fitted = sonar_scale(-path[clear, 2], readings[clear], settings.sonar_outlier)
    if fitted is None:
        return "too few sonar readings for a scale"
    k = fitted[0]
    origin = np.array([anchor[0], anchor[1], 0.0])
    # first turn @ (X - anchor) + anchor - down, then k (X - origin) + origin
    return Similarity(k, turn, k * (anchor - turn @ anchor - [0.0, 0.0, down]) + (1.0 - k) * origin)


def ground(X: Array, band: float, seed: int) -> Ground | None:
    """The plane, level to MOST_TILT, that holds most of the points X (n, 3) within `band` [m]; None below a third of them.

    RANSAC on three points each, then least squares over the inliers.
    """
    if len(X) < 30:
        return None
    u = Noise(seed, "slam ground").normal(3 * TRIES)
    uniform = np.array([0.5 * math.erfc(-value / math.sqrt(2.0)) for value in u])
    picks = np.minimum((uniform * len(X)).astype(int), len(X) - 1).reshape(TRIES, 3)
    best: np.ndarray | None = None
    for i, j, k in picks:
        n = np.cross(X[j] - X[i], X[k] - X[i])
        size = np.linalg.norm(n)
        if size < 1e-6:
            continue
        n = n / size * (1.0 if n[2] > 0.0 else -1.0)
        if n[2] < math.cos(MOST_TILT):
            continue
        near = np.abs((X - X[i]) @ n) < band
        if best is None or near.sum() > best.sum():
            best = near
    if best is None or best.sum() < len(X) / 3:
        return None
    for _ in range(3):
        middle = X[best].mean(axis=0)
        n = np.linalg.svd(X[best] - middle, full_matrices=False)[2][2]
        n = n * (1.0 if n[2] > 0.0 else -1.0)
        best = np.abs((X - middle) @ n) < band
    return Ground(n, best) if n[2] > math.cos(MOST_TILT) else None


def level(n: Array) -> Array:
    """(3, 3) the smallest rotation that takes the unit vector n to z."""
    axis = np.array([n[1], -n[0], 0.0])
    s, c = float(np.linalg.norm(axis)), float(n[2])
    if s < 1e-12:
        return np.eye(3)
    a = axis / s
    K = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    return np.asarray(np.eye(3) + s * K + (1.0 - c) * K @ K)


def over_ground(path: Array, X: Array) -> np.ndarray:
    """(n,) bool: below the places path (n, 3) of the sonar there are points of X (m, 3), and all of them on z = 0."""
    out = np.zeros(len(path), bool)
    for i, p in enumerate(path):
        below = np.hypot(X[:, 0] - p[0], X[:, 1] - p[1]) < BEAM * -p[2]
        out[i] = below.sum() >= 3 and bool((np.abs(X[below, 2]) < FLAT * -p[2]).all())
    return out


def sonar_scale(heights: Array, readings: Array, outlier: float) -> tuple[float, float] | None:
    """Factor that turns the map's heights (n,) into metres, and its standard deviation; None with fewer than 5 readings.

    readings (n,) [m]. Least squares, weights 0 for readings further off than `outlier` [m].
    """
    fine = (heights > 0.05) & np.isfinite(readings)
    if fine.sum() < 5:
        return None
    scale = float(np.median(readings[fine] / heights[fine]))
    for _ in range(5):
        used = fine & (np.abs(readings - scale * heights) < outlier)
        if used.sum() < 5:
            return None
        h, s = heights[used], readings[used]
        scale = float(h @ s / (h @ h))
    spread = float(np.sqrt(np.mean((s - scale * h) ** 2) / (h @ h)))
    return scale, spread
