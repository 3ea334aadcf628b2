"""The map: keyframes with their pixels, points, and which keyframe saw which point where."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.types import Array
from landing_sim.vision.slam.corners import LEVELS, Pyramid
from landing_sim.vision.slam.pose import Pose

THUMB = (40, 30)  # [px] size of the blurred images that a lost camera is compared with


def _none(*shape: int) -> Array:
    return np.empty((0, *shape))


def _no_index() -> np.ndarray:
    return np.empty(0, np.int64)


@dataclass(slots=True)
class Map:
    """Arrays over keyframes (m), points (n) and observations (k); all are replaced, none is shared, when the map grows.

    metric : scale, level and heading are frozen, positions are in R.
    """

    lens: Fisheye
    metric: bool = False
    # keyframes
    R: Array = field(default_factory=lambda: _none(3, 3))  # R_CR
    p: Array = field(default_factory=lambda: _none(3))  # p_RC [m]
    t: Array = field(default_factory=_none)  # [s]
    euler: Array = field(default_factory=lambda: _none(3))  # [rad] what the inertial unit said then
    # points
    X: Array = field(default_factory=lambda: _none(3))  # [m]
    ids: np.ndarray = field(default_factory=_no_index)  # never given twice
    source: np.ndarray = field(default_factory=_no_index)  # the keyframe whose pixels stand for the point
    uv: Array = field(default_factory=lambda: _none(2))  # [px] where in it
    tried: np.ndarray = field(default_factory=_no_index)  # how often looked for, and found
    found: np.ndarray = field(default_factory=_no_index)
    # observations
    frame: np.ndarray = field(default_factory=_no_index)
    point: np.ndarray = field(default_factory=_no_index)
    seen: Array = field(default_factory=lambda: _none(2))  # [px]
    size: Array = field(default_factory=_none)  # [px] of a pixel of the level that it was found in
    next_id: int = 0
    _views: list[np.ndarray] = field(default_factory=list)  # per level (capacity, h, w)
    _thumbs: Array = field(default_factory=lambda: _none(THUMB[1], THUMB[0]))

    @property
    def frames(self) -> int:
        return len(self.t)

    @property
    def views(self) -> tuple[np.ndarray, ...]:
        """The keyframes' pyramids, (m or more, h, w) uint8 a level."""
        return tuple(self._views)

    @property
    def thumbs(self) -> Array:
        """(m, 30, 40) small blurred images of the keyframes."""
        return self._thumbs

    def pose(self, k: int) -> Pose:
        return Pose(self.R[k], self.p[k])

    def add_frame(self, t: float, pose: Pose, euler: Array, levels: Pyramid) -> int:
        """Index of the new keyframe."""
        k = self.frames
        self.R, self.p = np.append(self.R, pose.R_CR[None], 0), np.append(self.p, pose.p_RC[None], 0)
        self.t, self.euler = np.append(self.t, t), np.append(self.euler, euler[None], 0)
        self._thumbs = np.append(self._thumbs, thumb(levels)[None], 0)
        if not self._views:
            self._views = [np.empty((4, *level.shape), np.uint8) for level in levels]
        if k == len(self._views[0]):
            self._views = [np.concatenate([v, np.empty_like(v)]) for v in self._views]
        for view, level in zip(self._views, levels):
            view[k] = level
        return k

    def add_points(self, X: Array, source: int, uv: Array) -> np.ndarray:
        """Indices of the new points X (n, 3), seen at uv (n, 2) in the keyframe `source`."""
        n = len(X)
        new = np.arange(len(self.X), len(self.X) + n)
        self.X, self.uv = np.concatenate([self.X, X]), np.concatenate([self.uv, uv])
        self.ids = np.concatenate([self.ids, np.arange(self.next_id, self.next_id + n)])
        self.next_id += n
        self.source = np.concatenate([self.source, np.full(n, source)])
        self.tried, self.found = np.append(self.tried, np.zeros(n, int)), np.append(self.found, np.zeros(n, int))
        return new

    def add_seen(self, frame: int, point: np.ndarray, uv: Array, size: Array) -> None:
        """Keyframe `frame` saw the points (k,) at uv (k, 2)."""
        self.frame = np.concatenate([self.frame, np.full(len(point), frame)])
        self.point, self.seen = np.concatenate([self.point, point]), np.concatenate([self.seen, uv])
        self.size = np.concatenate([self.size, size])

    def keep(self, frames: np.ndarray, points: np.ndarray, observations: np.ndarray) -> None:
        """Forget what is False in the masks (m,), (n,), (k,), and points that fewer than two keyframes still see.

        A point whose source is forgotten is from then on looked for by its pixels in the latest keyframe that saw it.
        """
        observations = observations & frames[self.frame] & points[self.point]
        points = points & (np.bincount(self.point[observations], minlength=len(self.X)) >= 2)
        observations &= points[self.point]
        orphan = points & ~frames[self.source]
        if orphan.any():
            k = np.flatnonzero(observations & orphan[self.point])
            k = k[np.argsort(self.frame[k], kind="stable")]  # the last write wins: the latest keyframe
            self.source[self.point[k]], self.uv[self.point[k]] = self.frame[k], self.seen[k]
        new_frame, new_point = np.cumsum(frames) - 1, np.cumsum(points) - 1
        self.R, self.p, self.t, self.euler = self.R[frames], self.p[frames], self.t[frames], self.euler[frames]
        self._thumbs = self._thumbs[frames]
        if not frames.all():
            self._views = [view[: len(frames)][frames] for view in self._views] if frames.any() else []
        self.X, self.ids, self.uv = self.X[points], self.ids[points], self.uv[points]
        self.source = new_frame[self.source[points]]
        self.tried, self.found = self.tried[points], self.found[points]
        self.frame, self.point = new_frame[self.frame[observations]], new_point[self.point[observations]]
        self.seen, self.size = self.seen[observations], self.size[observations]

    def clear(self) -> None:
        """Forget everything; ids are not given again."""
        self.keep(np.zeros(self.frames, bool), np.zeros(len(self.X), bool), np.zeros(len(self.point), bool))

    def move(self, scale: float, R: Array, t: Array) -> None:
        """Every position X becomes scale R X + t."""
        self.X = scale * self.X @ R.T + t
        self.p = scale * self.p @ R.T + t
        self.R = self.R @ R.T


def thumb(levels: Pyramid) -> Array:
    """(30, 40) blurred image.

    Source     Klein & Murray 2008, section 4 (small blurry images for recovery).
    """
    small = cv2.resize(levels[LEVELS - 1], THUMB, interpolation=cv2.INTER_AREA).astype(float)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), 1.5))
