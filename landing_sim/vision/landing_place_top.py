"""What lies on a plane: a patch of its features, the smallest rectangle round it, and whether all of it has been seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.types import Array
from landing_sim.vision.landing_place_views import Pair, View

BESIDE = 0.8  # of a side's length counts as beside it: a rectangle is a little askew


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Level, at height z: centre (2,), half (2,) [m] lengths along its own axes u, (2, 2) with the axes as rows."""

    centre: Array
    half: Array
    u: Array
    z: float

    def corners(self, out: float = 0.0) -> Array:
        """(4, 3) [m] in R of the rectangle with `out` [m] added on each side."""
        sides = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * (self.half + out)
        return np.column_stack([self.centre + sides @ self.u, np.full(4, self.z)])

    def own(self, xy: Array) -> Array:
        """(n, 2) [m] of points (n, 2) along its axes, from its centre."""
        return np.asarray((xy - self.centre) @ self.u.T)


def patches(xy: Array, link: float) -> list[np.ndarray]:
    """The points xy (n, 2) [m] in groups that no gap wider than `link` [m] splits, the largest first: index arrays."""
    from scipy.sparse.csgraph import connected_components

    apart = np.linalg.norm(xy[:, None] - xy[None], axis=2)
    count, label = connected_components(apart <= link, directed=False)
    groups = [np.flatnonzero(label == k) for k in range(count)]
    return sorted(groups, key=len, reverse=True)


def rectangle(X: Array) -> Rectangle:
    """The smallest round the points X (n, 3) [m] of a plane, R, as seen from above; at the plane's height in its middle."""
    import cv2

    middle = X.mean(axis=0)
    off = X - middle
    centre, size, turn = cv2.minAreaRect(off[:, :2].astype(np.float32))
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    slope = np.linalg.lstsq(off[:, :2], off[:, 2], rcond=None)[0]
    z = float(middle[2] + slope @ centre)
    return Rectangle(middle[:2] + centre, 0.5 * np.array(size, dtype=float), np.array([[c, s], [-s, c]]), z)


def on_level(rays: Array, p: Array, z: float) -> Array:
    """(n, 2) [m] where the directions (n, 3) from p (3,) meet the level z, all in R; far away if they do not."""
    down = np.maximum(rays[:, 2], 1e-3)
    return np.asarray(p[:2] + rays[:, :2] * ((z - p[2]) / down)[:, None])


def in_view(top: Rectangle, view: View, lens: Fisheye, margin: float) -> bool:
    """Whether the rectangle's corners are seen `margin` [px] or more from the image's edge."""
    return bool(lens.inside(lens.project((top.corners() - view.p) @ view.R_CR.T), margin).all())


def foreign(top: Rectangle, pair: Pair, members: np.ndarray, shrink: float) -> np.ndarray:
    """Indices of the features seen inside the rectangle, less `shrink` [m] on each side, that are not on its plane."""
    own = top.own(on_level(pair.b, pair.second.p, top.z))
    return np.flatnonzero((abs(own) < top.half - shrink).all(axis=1) & ~members)


def gaps(top: Rectangle, ground: Array, nth: int) -> Array:
    """(2, 2) [m] from the rectangle's sides, - and + along each of its axes, to the nth nearest of `ground` beside it.

    ground (n, 2) [m] : where ground was seen, on the rectangle's level; inf where fewer than nth are beside a side
    """
    own = top.own(ground)
    out = np.full((2, 2), np.inf)
    for axis in (0, 1):
        beside = own[abs(own[:, 1 - axis]) < BESIDE * top.half[1 - axis], axis]
        for k, sign in enumerate((-1.0, 1.0)):
            gap = sign * beside - top.half[axis]
            gap = gap[gap > 0.0]
            if len(gap) >= nth:
                out[axis, k] = np.partition(gap, nth - 1)[nth - 1]
    return out


def halfway(top: Rectangle, gap: Array) -> Rectangle:
    """The rectangle with each side moved outwards by half its gap (2, 2) [m]."""
    shift = 0.25 * (gap[:, 1] - gap[:, 0])
    return Rectangle(top.centre + shift @ top.u, top.half + 0.25 * gap.sum(axis=1), top.u, top.z)


def uncertainty(gap: Array) -> float:
    """[m] standard deviation of the middle along the worse axis if each side may be anywhere in its gap (2, 2) [m]."""
    return float(np.hypot(gap[:, 0], gap[:, 1]).max()) / math.sqrt(48.0)
