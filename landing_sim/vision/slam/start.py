"""The start of a map: a first keyframe, corners followed from it, and a second one as soon as they show parallax."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_sim.types import Array
from landing_sim.vision.slam.corners import Pyramid, corners
from landing_sim.vision.slam.growth import CELLS, adjust_map
from landing_sim.vision.slam.map import Map
from landing_sim.vision.slam.patches import align
from landing_sim.vision.slam.pose import Pose
from landing_sim.vision.slam.settings import SlamSettings
from landing_sim.vision.slam.two_view import follow, meet, plane_motion

LEAST = 60  # corners that must still be followed
PER_CELL = 4


@dataclass(frozen=True, slots=True)
class Beginning:
    """The first keyframe while the second is waited for.

    t [s], euler (3,) [rad], pose with the height that the sonar says, levels; uv (n, 2) [px] corners, at (n, 2) [px] where
    they are in the latest image, which is `latest`
    """

    t: float
    euler: Array
    pose: Pose
    levels: Pyramid
    uv: Array
    at: Array
    latest: np.ndarray


def begin(t: float, euler: Array, pose: Pose, levels: Pyramid, chart: Map, settings: SlamSettings) -> Beginning | str:
    """A first keyframe; a string says why this frame will not do."""
    uv = corners(levels[0], settings.fast_threshold, np.empty((0, 2)), chart.lens.width / CELLS, PER_CELL)
    if len(uv) < 2 * LEAST:
        return f"{len(uv)} corners, {2 * LEAST} needed"
    return Beginning(t, euler, pose, levels, uv, uv, levels[0])


def go_on(first: Beginning, levels: Pyramid) -> Beginning | None:
    """The same corners in the next image; None if too few were followed."""
    at, good = follow(first.latest, levels[0], first.at)
    if good.sum() < LEAST:
        return None
    return Beginning(first.t, first.euler, first.pose, first.levels, first.uv[good], at[good], levels[0])


def parallax(first: Beginning, R_said: Array, chart: Map) -> float:
    """[rad] median angle that the corners have moved by, other than by the rotation that the inertial unit tells."""
    a, b = chart.lens.rays(first.uv) @ R_said.T, chart.lens.rays(first.at)
    return float(np.median(np.arccos(np.clip((a * b).sum(1), -1.0, 1.0))))


def second(
    first: Beginning, t: float, euler: Array, R_said: Array, levels: Pyramid, chart: Map, settings: SlamSettings
) -> str:
    """Fill the empty map from two views; "" or why it could not be done.

    R_said (3, 3) : rotation from the first camera to this one, as the inertial unit tells
    """
    lens = chart.lens
    rays_1, rays_2 = lens.rays(first.uv), lens.rays(first.at)
    R_1, p_1 = first.pose.R_CR, first.pose.p_RC
    down = R_1 @ np.array([0.0, 0.0, 1.0])
    motion = plane_motion(rays_1, rays_2, R_said, down)
    if isinstance(motion, str):
        return motion
    height = -float(p_1[2])
    R_2 = motion.R @ R_1
    p_2 = p_1 - R_2.T @ motion.t * height
    X, angle = meet(R_1, p_1, rays_1, R_2, p_2, rays_2)
    depth = X[:, 2] - p_1[2]
    good = np.isfinite(X).all(1) & (angle > settings.parallax) & (depth > 0.2 * height) & (depth < 2.0 * height)
    if good.sum() < LEAST:
        return f"{good.sum()} points with parallax, {LEAST} needed"
    X, uv_1 = X[good], first.uv[good]
    # what was followed through many images has crept: align with the pixels of the first
    uv_2, size, score = np.empty((len(X), 2)), np.ones(len(X)), np.empty(len(X))
    views = tuple(level[None] for level in first.levels)
    align(
        X, np.zeros(len(X), int), uv_1, R_1[None], p_1[None], views, levels, 0, R_2, p_2, settings.fine_half,
        settings.fine_reach, uv_2, size, score, lens.focal, lens.cx, lens.cy,
    )  # fmt: skip
    good = score > settings.correlation
    if good.sum() < LEAST:
        return f"{good.sum()} corners look alike in both views, {LEAST} needed"
    chart.add_frame(first.t, first.pose, first.euler, first.levels)
    chart.add_frame(t, Pose(R_2, p_2), euler, levels)
    new = chart.add_points(X[good], 0, uv_1[good])
    chart.add_seen(0, new, uv_1[good], np.ones(len(new)))
    chart.add_seen(1, new, uv_2[good], size[good])
    base = np.linalg.norm(p_2 - p_1)
    for _ in range(2):
        adjust_map(chart, np.array([False, True]), steps=15)
    scale = float(base / np.linalg.norm(chart.p[1] - chart.p[0]))
    chart.move(scale, np.eye(3), (1.0 - scale) * p_1)
    if len(chart.X) < LEAST:
        left = len(chart.X)
        chart.clear()
        return f"{left} points agree with both views, {LEAST} needed"
    return ""
