"""Metres and level: what a single camera cannot know.

The sonar gives the scale (least squares over all readings until the tenth keyframe), the ground gives the level, the
inertial unit the heading.

Source     Brockers et al. 2012, section 4.3.
           Departs: every reading counts, not one a keyframe, since readings come in steps of 2.5 cm that only motion evens
           out; readings far off the fit (over a box) are left out; the ground's plane in the map is levelled, because an
           attitude that is 0.6 deg off tilts the map by 1 cm a metre. `level_ground` False keeps the inertial unit's level.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from landing_sim.noise import Noise
from landing_sim.types import Array

MOST_TILT = 0.03  # [rad] a plane steeper than this against the inertial unit's level is not the ground
TRIES = 200


class Ground(NamedTuple):
    """A plane: n (3,) its normal, pointing down; on (n,) bool, the points on it."""

    n: Array
    on: np.ndarray


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
