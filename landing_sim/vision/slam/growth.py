"""How the map grows: a keyframe, its new points, and bundle adjustment of what is near.

Source     Klein & Murray 2007, section 6.
           Departs: a new point's depth comes from trying horizontal planes through it against two other keyframes.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.slam.bundle import adjust
from landing_sim.vision.slam.corners import Pyramid, corners
from landing_sim.vision.slam.map import Map
from landing_sim.vision.slam.patches import shift_of, template, through_plane, warped_offsets
from landing_sim.vision.slam.settings import SlamSettings
from landing_sim.vision.slam.tracking import Tracked, look
from landing_sim.vision.slam.two_view import meet

CELLS = 12  # across the image, each with
PER_CELL = 4  # points
SPACING = 3.0  # [px] between the places in the other keyframe that a new point is tried at
NEAR, FAR = 0.3, 1.4  # [height above the ground] depths tried
WORST = 3.0  # [px of the level] an observation further off after bundle adjustment is a mistake
PATCH = 5  # half width of the patches of new points


def height_over_ground(chart: Map, k: int) -> float:
    """[m] of keyframe k above the plane z = 0."""
    return max(0.1, -float(chart.p[k, 2]))


def add_keyframe(chart: Map, t: float, euler: Array, levels: Pyramid, seen: Tracked, settings: SlamSettings) -> int:
    """A keyframe with what was tracked in it, new points in it, and the neighbourhood adjusted. Its index."""
    k = chart.add_frame(t, seen.pose, euler, levels)
    chart.add_seen(k, seen.point, seen.uv, seen.size)
    new_points(chart, k, settings)
    adjust_near(chart, k, settings)
    if settings.window and chart.frames > settings.window:
        frames = np.arange(chart.frames) >= chart.frames - settings.window
        chart.keep(frames, np.ones(len(chart.X), bool), np.ones(len(chart.point), bool))
    return chart.frames - 1


def new_points(chart: Map, k: int, settings: SlamSettings) -> int:
    """Adds points at corners of keyframe k that two other keyframes agree on; how many."""
    lens = chart.lens
    height = height_over_ground(chart, k)
    away = np.linalg.norm(chart.p - chart.p[k], axis=1)
    away[k] = np.inf
    useful = np.flatnonzero((away > 0.6 * settings.keyframe_distance * height) & (away < 0.7 * height))
    others = useful[np.argsort(away[useful], kind="stable")][:3]
    if len(others) < 2:
        return 0
    uv_k = corners(
        chart.views[0][k], settings.fast_threshold, chart.seen[chart.frame == k], lens.width / CELLS, PER_CELL
    )
    rays_k = lens.rays(uv_k)
    # the first of the others finds the depth, a second confirms
    best = np.full(len(uv_k), np.nan)
    first, second = int(others[0]), int(others[1])
    uv_1, score = np.empty((len(uv_k), 2)), np.empty(len(uv_k))
    _search(
        uv_k, rays_k, chart.views, k, first, chart.R, chart.p, NEAR * height, FAR * height, SPACING * lens.width / 640.0,
        lens.focal, lens.cx, lens.cy, uv_1, score, best,
    )  # fmt: skip
    X, angle = meet(chart.R[k], chart.p[k], rays_k, chart.R[first], chart.p[first], lens.rays(uv_1))
    good = (score > 0.8) & (angle > settings.parallax) & np.isfinite(X).all(axis=1)
    uv_k, X, uv_1 = uv_k[good], X[good], uv_1[good]
    new = chart.add_points(X, k, uv_k)
    confirmed, size, score = look(chart, new, _levels(chart, second), 0, chart.pose(second), PATCH, 3.0)
    again, size_1, score_1 = look(chart, new, _levels(chart, first), 0, chart.pose(first), PATCH, 2.0)
    off = np.linalg.norm(confirmed - _project(chart, second, X), axis=1)
    kept = (score > 0.8) & (off < 1.5 * size) & (score_1 > 0.8)
    chart.add_seen(k, new, uv_k, np.ones(len(new)))
    chart.add_seen(first, new, again, size_1)
    chart.add_seen(second, new, confirmed, size)
    alive = np.ones(len(chart.X), bool)
    alive[new[~kept]] = False
    chart.keep(np.ones(chart.frames, bool), alive, np.ones(len(chart.point), bool))
    return int(kept.sum())


def _levels(chart: Map, k: int) -> Pyramid:
    return tuple(view[k] for view in chart.views)


def _project(chart: Map, k: int, X: Array) -> Array:
    return chart.lens.project((X - chart.p[k]) @ chart.R[k].T)


def adjust_near(chart: Map, k: int, settings: SlamSettings) -> None:
    """Bundle adjustment of keyframe k and its nearest; all others that see the same points are held."""
    away = np.linalg.norm(chart.p - chart.p[k], axis=1)
    free = np.zeros(chart.frames, bool)
    free[np.argsort(away, kind="stable")[: settings.local_frames]] = True
    free[0] = False  # R hangs on the first
    if chart.frames == 2:
        free[1] = True
    adjust_map(chart, free)


def adjust_all(chart: Map) -> None:
    """Bundle adjustment of the whole map, its first keyframe and its scale held."""
    free = np.ones(chart.frames, bool)
    free[0] = False
    spread = np.linalg.norm(chart.p - chart.p[0], axis=1).sum()
    adjust_map(chart, free, steps=20)
    # the images do not tell the scale: give back what rounding and damping let drift
    scale = spread / np.linalg.norm(chart.p - chart.p[0], axis=1).sum()
    chart.move(scale, np.eye(3), (1.0 - scale) * chart.p[0])


def adjust_map(chart: Map, free: np.ndarray, steps: int = 8) -> None:
    """Adjusts the keyframes `free` (m,) and all that they see; observations that fit badly afterwards are dropped."""
    lens = chart.lens
    looked = np.zeros(len(chart.X), bool)
    looked[chart.point[free[chart.frame]]] = True
    k = np.flatnonzero(looked[chart.point])
    k = k[np.argsort(chart.point[k], kind="stable")]
    number = np.cumsum(looked) - 1
    frames, frame = np.unique(chart.frame[k], return_inverse=True)
    R, p, X, e = adjust(
        chart.R[frames], chart.p[frames], chart.X[looked], free[frames], frame, number[chart.point[k]], chart.seen[k],
        chart.size[k], lens.focal, lens.cx, lens.cy, steps,
    )  # fmt: skip
    chart.R[frames], chart.p[frames], chart.X[looked] = R, p, X
    fine = np.ones(len(chart.point), bool)
    fine[k[e > WORST]] = False
    lost = (chart.tried >= 10) & (chart.found < 0.2 * chart.tried)
    chart.keep(np.ones(chart.frames, bool), ~lost, fine)


@kernel
def _search(
    uv: Array, rays: Array, views: tuple[np.ndarray, ...], k: int, other: int, R: Array, p: Array, near: float, far: float,
    spacing: float, f: float, cx: float, cy: float, uv_o: Array, score: Array, depth: Array,
) -> None:  # fmt: skip
    """The depth of each corner uv (n, 2) of keyframe k at which another keyframe shows the same patch.

    Depths [m] between near and far are tried, `spacing` px apart in the other image, at level 1; the best is aligned at
    level 0. Fills uv_o (n, 2) [px], score (n,) (-1: none) and depth (n,): along z of R, from keyframe k.
    """
    half = 4
    n = 2 * half + 1
    T, gu, gv, ou, ov = np.empty(n * n), np.empty(n * n), np.empty(n * n), np.empty(n * n), np.empty(n * n)
    image = views[1][other]
    h, w = image.shape
    base = math.sqrt((p[other, 0] - p[k, 0]) ** 2 + (p[other, 1] - p[k, 1]) ** 2 + (p[other, 2] - p[k, 2]) ** 2)
    tries = max(8, int(f * base * (1.0 / near - 1.0 / far) / spacing))
    for i in range(uv.shape[0]):
        score[i], depth[i] = -1.0, 0.0
        uv_o[i, 0], uv_o[i, 1] = uv[i, 0], uv[i, 1]
        if not template(views[1][k], 0.5 * uv[i, 0], 0.5 * uv[i, 1], half, T, gu, gv):
            continue
        mT, tt = T.mean(), 0.0
        for a in range(n * n):
            T[a] -= mT
            tt += T[a] * T[a]
        best = 0.6
        for j in range(tries):
            d = 1.0 / (1.0 / far + (1.0 / near - 1.0 / far) * j / (tries - 1.0))
            z = p[k, 2] + d
            u, v, ok = through_plane(uv[i, 0], uv[i, 1], R[k], p[k], R[other], p[other], z, f, cx, cy)
            if not ok or u < 24.0 or v < 24.0 or u > 2.0 * w - 24.0 or v > 2.0 * h - 24.0:
                continue
            if not warped_offsets(uv[i, 0], uv[i, 1], 2.0, half, R[k], p[k], R[other], p[other], z, f, cx, cy, ou, ov):
                continue
            s, ss, st, inside = 0.0, 0.0, 0.0, True
            for a in range(n * n):
                x, y = 0.5 * (u + ou[a]), 0.5 * (v + ov[a])
                if not (x >= 0.0 and y >= 0.0 and x <= w - 1.001 and y <= h - 1.001):
                    inside = False
                    break
                ix, iy = int(x), int(y)
                b, c = x - ix, y - iy
                g = (image[iy, ix] * (1.0 - b) + image[iy, ix + 1] * b) * (1.0 - c) + (
                    image[iy + 1, ix] * (1.0 - b) + image[iy + 1, ix + 1] * b
                ) * c
                s += g
                ss += g * g
                st += g * T[a]
            if not inside:
                continue
            var = ss - s * s / (n * n)
            if var * tt > 0.0:
                like = st / math.sqrt(var * tt)
                if like > best:
                    best, depth[i] = like, d
        if depth[i] == 0.0:
            continue
        z = p[k, 2] + depth[i]
        u, v, ok = through_plane(uv[i, 0], uv[i, 1], R[k], p[k], R[other], p[other], z, f, cx, cy)
        if not template(views[0][k], uv[i, 0], uv[i, 1], half, T, gu, gv):
            continue
        if warped_offsets(uv[i, 0], uv[i, 1], 1.0, half, R[k], p[k], R[other], p[other], z, f, cx, cy, ou, ov):
            du, dv, score[i] = shift_of(views[0][other], u, v, 1.0, half, T, gu, gv, ou, ov, spacing + 2.0)
            uv_o[i, 0], uv_o[i, 1] = u + du, v + dv
