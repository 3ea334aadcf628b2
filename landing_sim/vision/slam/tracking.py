"""One frame against the map: where is the camera?

Coarse points first, far apart and at a coarse level, then many at full resolution; a pose is fitted to each lot.

Source     Klein & Murray 2007, section 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.slam.corners import LEVELS, Pyramid, coarse_level
from landing_sim.vision.slam.lens import seen
from landing_sim.vision.slam.map import Map
from landing_sim.vision.slam.patches import align
from landing_sim.vision.slam.pose import Fit, Pose, fit_pose
from landing_sim.vision.slam.settings import SlamSettings

CELLS = 12  # across the image; points are looked for in all of them alike
NEAREST = 0.05  # [m] points closer to the camera are not looked for


@dataclass(frozen=True, slots=True)
class Tracked:
    """What a frame showed.

    pose, sigma [px], cov (6, 6) of small turns of C and of p_RC : see `pose.Fit`
    point (n,) : indices of the map's points that were found and fit the pose; uv (n, 2) [px]; size (n,) [px] see `Map`
    asked : how many were looked for
    """

    pose: Pose
    sigma: float
    cov: Array
    point: np.ndarray
    uv: Array
    size: Array
    asked: int


def track(
    chart: Map, levels: Pyramid, start: Pose, settings: SlamSettings, most: int, coarser: int = 0
) -> Tracked | None:
    """The frame's pose from a first guess, by at most `most` points; None if too few are found.

    coarser : so many levels above the usual coarse one are gone through first, for a guess that is far off
    """
    level = coarse_level(chart.lens.width)
    for k in range(min(level + coarser, LEVELS - 1), level - 1, -1):
        guess = _rough(chart, levels, k, start, settings)
        if guess is None:
            return None
        start = guess
    return refine(chart, levels, start, settings, most)


def _rough(chart: Map, levels: Pyramid, level: int, start: Pose, settings: SlamSettings) -> Pose | None:
    """Better pose from a few points at a coarse level, or None."""
    lens = chart.lens
    few = in_view(chart, start, settings.coarse_points, margin=(settings.coarse_half + 2) * 2**level)
    uv, size, score = look(chart, few, levels, level, start, settings.coarse_half, settings.coarse_reach)
    good = score > settings.correlation
    fit = fit_pose(start, chart.X[few[good]], uv[good], size[good], lens.focal, lens.cx, lens.cy)
    return fit.pose if fit is not None and fit.used.sum() >= max(8, 0.25 * len(few)) else None


def refine(chart: Map, levels: Pyramid, start: Pose, settings: SlamSettings, most: int) -> Tracked | None:
    """As `track`, from a guess that is good to a pixel or two."""
    lens = chart.lens
    many = in_view(chart, start, most, margin=settings.fine_half + 3)
    uv, size, score = look(chart, many, levels, 0, start, settings.fine_half, settings.fine_reach)
    good = score > settings.correlation
    point = many[good]
    fit: Fit | None = fit_pose(start, chart.X[point], uv[good], size[good], lens.focal, lens.cx, lens.cy)
    if fit is None:
        return None
    used = fit.used
    if used.sum() < max(settings.least_points, settings.least_share * len(many)):
        return None
    chart.tried[many] += 1
    chart.found[point[used]] += 1
    return Tracked(fit.pose, fit.sigma, fit.cov, point[used], uv[good][used], size[good][used], len(many))


def look(
    chart: Map, point: np.ndarray, levels: Pyramid, level: int, pose: Pose, half: int, reach: float
) -> tuple[Array, Array, Array]:
    """uv (n, 2) [px], size (n,) [px] and score (n,) of the map's points (n,) in an image: see `patches.align`."""
    lens = chart.lens
    uv, size, score = np.empty((len(point), 2)), np.ones(len(point)), np.empty(len(point))
    align(
        chart.X[point], chart.source[point], chart.uv[point], chart.R, chart.p, chart.views, levels, level, pose.R_CR,
        pose.p_RC, half, reach, uv, size, score, lens.focal, lens.cx, lens.cy,
    )  # fmt: skip
    return uv, size, score


def in_view(chart: Map, pose: Pose, most: int, margin: float) -> np.ndarray:
    """Indices of at most `most` points that the pose sees, `margin` [px] inside the image, spread over it.

    Which ones is a matter of their ids alone, so that a camera at rest sees the same ones in every frame.
    """
    lens = chart.lens
    cell = np.empty(len(chart.X), np.int64)
    _cells(chart.X, pose.R_CR, pose.p_RC, lens.focal, lens.cx, lens.cy, lens.width, lens.height, margin, cell)
    reliable = (chart.tried < 10) | (chart.found > 0.3 * chart.tried)
    seen_now = np.flatnonzero((cell >= 0) & reliable)
    if len(seen_now) <= most:
        return seen_now
    hashed = (chart.ids[seen_now] * 2654435761) % 4294967296
    order = np.lexsort((hashed, cell[seen_now]))
    ordered = cell[seen_now][order]
    first = np.searchsorted(ordered, ordered)
    rank = np.empty(len(seen_now), np.int64)
    rank[order] = np.arange(len(seen_now)) - first  # 0 for the first of each cell, ...
    chosen = np.lexsort((hashed, rank))[:most]
    return np.sort(seen_now[chosen])


@kernel
def _cells(
    X: Array,
    R: Array,
    p: Array,
    f: float,
    cx: float,
    cy: float,
    width: int,
    height: int,
    margin: float,
    cell: np.ndarray,
) -> None:
    """Which cell of the image each point falls into, -1 for none."""
    side = width / CELLS
    for i in range(X.shape[0]):
        cell[i] = -1
        dx, dy, dz = X[i, 0] - p[0], X[i, 1] - p[1], X[i, 2] - p[2]
        x = R[0, 0] * dx + R[0, 1] * dy + R[0, 2] * dz
        y = R[1, 0] * dx + R[1, 1] * dy + R[1, 2] * dz
        z = R[2, 0] * dx + R[2, 1] * dy + R[2, 2] * dz
        if z < NEAREST or z < 0.2 * math.hypot(x, y):  # further than 79 deg off the axis
            continue
        u, v = seen(x, y, z, f, cx, cy)
        if u >= margin and v >= margin and u <= width - 1 - margin and v <= height - 1 - margin:
            cell[i] = int(v / side) * CELLS + int(u / side)
