"""Monocular keyframe SLAM: images and a rough attitude in, poses of the camera in R out.

Source     Klein & Murray 2007 (the method), Brockers et al. 2012, sections 3.2 and 4.3 (looking down, scale from a sonar,
           sliding window).
           Departs: tracking and mapping take turns in one thread; the modules tell of other departures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from landing_sim.geometry.so3 import from_euler
from landing_sim.types import Array
from landing_sim.vision.slam import growth, scale, start
from landing_sim.vision.slam.corners import Pyramid, pyramid
from landing_sim.vision.slam.map import Map
from landing_sim.vision.slam.pose import Pose, turned
from landing_sim.vision.slam.relocation import relocate
from landing_sim.vision.slam.settings import Rig, SlamSettings
from landing_sim.vision.slam.tracking import Tracked, track

Mode = Literal["map", "localise", "both"]
GAP = 0.3  # [s] without a pose, after which its rate of change is worth nothing
UNSCALED = 0.02  # standard deviation of the scale, as a share of the height, until it is frozen


@dataclass(frozen=True, slots=True)
class Located:
    """One frame and where it was taken. A landing-place detector works on pairs of these.

    t [s]; pose : R_CR, p_RC; p_RB (3,) [m] the cg; cov (3, 3) [m^2] of p_RB, without floor
    ids (n,) : of the features, the same in every frame; uv (n, 2) [px]; rays (n, 3) unit, frame C; X (n, 3) [m] in R, as
    mapped; sigma [px] spread of uv; metric : False until scale and level are frozen
    """

    t: float
    pose: Pose
    p_RB: Array
    cov: Array
    ids: np.ndarray
    uv: Array
    rays: Array
    X: Array
    sigma: float
    metric: bool


class Slam:
    """Holds the map and where the camera was last.

    mode : "map" builds a map from nothing, "localise" never changes the one given, "both" goes on building it.
    status : "starting" (no map yet), "tracking", "lost"; reason : what is wrong, "" if nothing is
    Same images, same bits: cv2 works in one thread.
    """

    def __init__(
        self, rig: Rig, settings: SlamSettings | None = None, mode: Mode = "map", chart: Map | None = None
    ) -> None:
        """Raises ValueError for a mode without the map that it needs, or a map of another lens."""
        if mode not in ("map", "localise", "both"):
            raise ValueError(f"slam mode must be 'map', 'localise' or 'both', not {mode!r}")
        if (mode == "map") != (chart is None):
            raise ValueError(f"slam mode {mode!r} " + ("starts without a map" if chart is not None else "needs a map"))
        if chart is not None and chart.lens != rig.lens:
            raise ValueError(f"the map was made with {chart.lens}, the camera is {rig.lens}")
        cv2.setNumThreads(1)
        self.rig, self.settings, self.mode = rig, settings or SlamSettings(), mode
        self.chart = chart if chart is not None else Map(rig.lens)
        self.status = "starting" if chart is None else "lost"
        self.reason = "no image yet"
        self.located: Located | None = None  # of the latest image, None if it could not be placed
        self._first: start.Beginning | None = None
        self._failures = 0
        self._anchor = np.zeros(3)  # place of the first keyframe, which a window forgets
        self._grown = 2  # keyframes made, those that a window has forgotten too
        self._heading: float | None = None  # [rad] to be added to the inertial unit's
        self._last: Pose | None = None
        self._last_t, self._velocity = -math.inf, np.zeros(3)
        self._R_last = np.eye(3)  # R_CR that the inertial unit told with _last
        self._heard = -math.inf, math.nan  # the latest reading
        self._sonar: list[tuple[float, float]] = []
        self._sonar_path: list[tuple[float, Array]] = []  # of the sonar in the map, until the scale is frozen

    def sonar(self, t: float, height: float) -> None:
        """A reading [m] of the height above the ground at t [s]: needed until the scale is frozen, useful when lost."""
        if math.isfinite(height):
            self._heard = t, height
            if not self.chart.metric:
                self._sonar.append((t, height))

    def image(self, t: float, image: np.ndarray, euler: Array, p_said: Array | None = None) -> Located | None:
        """Where the image (h, w) uint8, exposed at t [s], was taken; None if that is not known: `reason` says why.

        euler (3,) [rad] : attitude of the body then, as the inertial unit tells it
        p_said (3,) [m] : the cg's place, if it is believed to be known: where a new map begins, where to look when lost
        Raises ValueError for an image that is not of the lens's size, or an attitude that is not finite.
        """
        if image.shape != (self.rig.lens.height, self.rig.lens.width) or image.dtype != np.uint8:
            expected = f"{self.rig.lens.height} x {self.rig.lens.width} uint8"
            raise ValueError(f"slam: an image of {image.shape} {image.dtype} came, {expected} was expected")
        if not np.isfinite(euler).all():
            raise ValueError(f"slam: the attitude at t = {t} s is not finite: {np.asarray(euler).tolist()}")
        levels = pyramid(image)
        if self._heading is None:
            asked = self.settings.start_heading if self.mode == "map" else None
            self._heading = 0.0 if asked is None else asked - float(euler[2])
        euler = np.array([euler[0], euler[1], euler[2] + self._heading])
        R_said = self.rig.R_CB @ from_euler(*map(float, euler)).T
        self.located = None
        if self.status == "starting":
            seen = self._start(t, euler, R_said, levels, p_said)
        else:
            seen = self._track(t, R_said, levels, p_said)
        if seen is None:
            return None
        if self.mode != "localise" and self._last is not None:  # a place just found again is not built on yet
            seen = self._map(t, euler, levels, seen)
        self._remember(t, R_said, seen.pose)
        self.located = self._locate(t, seen)
        return self.located

    def save_all(self) -> Map:
        """The map after bundle adjustment of all of it, ready for `map_file.save`."""
        if self.chart.frames > 2:
            growth.adjust_all(self.chart)
        return self.chart

    # --- start

    def _start(self, t: float, euler: Array, R_said: Array, levels: Pyramid, p_said: Array | None) -> Tracked | None:
        if self._first is not None:
            self._first = start.go_on(self._first, levels)
        if self._first is None:
            height = self._sonar_at(t)
            if height is None:
                self.reason = "no sonar reading yet"
                return None
            there = np.zeros(2) if p_said is None or not np.isfinite(p_said).all() else p_said[:2]
            R_RB = R_said.T @ self.rig.R_CB
            p_RB = np.array([*there, -height]) - np.array([0.0, 0.0, (R_RB @ self.rig.p_BS)[2]])
            began = start.begin(t, euler, Pose(R_said, p_RB + R_RB @ self.rig.p_BC), levels, self.chart, self.settings)
            if isinstance(began, str):
                self.reason = began
            else:
                self._first, self.reason = began, "waiting for parallax"
            return None
        turn = R_said @ (self.rig.R_CB @ from_euler(*map(float, self._first.euler)).T).T
        if start.parallax(self._first, turn, self.chart) < self.settings.start_parallax:
            self.reason = "waiting for parallax"
            return None
        self.reason = start.second(self._first, t, euler, turn, levels, self.chart, self.settings)
        if self.reason:
            self._first = None
            return None
        self._first, self._anchor = None, self.chart.p[0].copy()
        self.status = "tracking"
        return track(self.chart, levels, self.chart.pose(1), self.settings, self.settings.fine_points)

    # --- tracking

    def _track(self, t: float, R_said: Array, levels: Pyramid, p_said: Array | None) -> Tracked | None:
        s = self.settings
        seen = None
        if self.status == "tracking" and self._last is not None:
            dt = t - self._last_t
            p = self._last.p_RC + self._velocity * (dt if dt < GAP else 0.0)
            guess = Pose(R_said @ self._R_last.T @ self._last.R_CR, p)
            most = s.fine_points if self.mode == "localise" or not self._far(p) else s.keyframe_points
            for coarser in (0, 1):
                seen = track(self.chart, levels, guess, s, most, coarser)
                if seen is not None and turned(seen.pose.R_CR, guess.R_CR) < s.most_turn:
                    break
                seen = None
        if seen is None:
            self._failures += 1
            self.reason = f"{self._failures} frames in a row did not match the map"
            if self._failures >= s.loss_frames or self._last is None:
                self.status = "lost"
        if self.status == "lost":
            there = None
            if p_said is not None and np.isfinite(p_said).all():
                there = p_said + R_said.T @ self.rig.R_CB @ self.rig.p_BC
            R = R_said if self._last is None else R_said @ self._R_last.T @ self._last.R_CR
            heard = self._heard[1] if abs(t - self._heard[0]) < GAP else None
            seen = relocate(self.chart, levels, R, s, there, heard)
        if seen is not None:
            if self.status == "lost":
                self._last = None  # no rate of change across the gap
            self.status, self.reason, self._failures = "tracking", "", 0
        return seen

    def _remember(self, t: float, R_said: Array, pose: Pose) -> None:
        if self._last is not None and 0.0 < t - self._last_t < GAP:
            self._velocity = (pose.p_RC - self._last.p_RC) / (t - self._last_t)
        else:
            self._velocity = np.zeros(3)
        self._last, self._last_t, self._R_last = pose, t, R_said

    def _locate(self, t: float, seen: Tracked) -> Located:
        R_RB = seen.pose.R_CR.T @ self.rig.R_CB
        arm = R_RB @ self.rig.p_BC
        # p_RB = p_RC - R_RC c, c = R_CB p_BC; C turned by w: R_RC becomes R_RC exp(-w)
        c = self.rig.R_CB @ self.rig.p_BC
        cross = np.array([[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]])
        J = np.hstack([-seen.pose.R_CR.T @ cross, np.eye(3)])
        uv, lens = seen.uv, self.rig.lens
        return Located(
            t, seen.pose, seen.pose.p_RC - arm, J @ seen.cov @ J.T, self.chart.ids[seen.point], uv, lens.rays(uv),
            self.chart.X[seen.point], seen.sigma, self.chart.metric,
        )  # fmt: skip

    # --- mapping

    def _height(self, seen: Tracked) -> float:
        """[m] of the camera above what it sees."""
        return float(np.median(self.chart.X[seen.point, 2])) - float(seen.pose.p_RC[2])

    def _far(self, p: Array) -> bool:
        """Whether the place p is about to be a keyframe."""
        nearest = float(np.linalg.norm(self.chart.p - p, axis=1).min())
        return nearest > 0.8 * self.settings.keyframe_distance * max(0.1, -float(p[2]))

    def _map(self, t: float, euler: Array, levels: Pyramid, seen: Tracked) -> Tracked:
        """A keyframe, if this is a new place; until the scale is frozen, what the sonar says about it."""
        s = self.settings
        if not self.chart.metric:
            R_RB = seen.pose.R_CR.T @ self.rig.R_CB
            self._sonar_path.append((t, seen.pose.p_RC + R_RB @ (self.rig.p_BS - self.rig.p_BC)))
        nearest = float(np.linalg.norm(self.chart.p - seen.pose.p_RC, axis=1).min())
        if nearest < s.keyframe_distance * self._height(seen) or len(seen.point) < 0.5 * seen.asked:
            return seen
        k = growth.add_keyframe(self.chart, t, euler, levels, seen, s)
        self._grown += 1
        if not self.chart.metric and self._grown >= s.scale_frames:
            self._freeze()
        at = np.flatnonzero(self.chart.frame == k)
        point = self.chart.point[at]
        return Tracked(
            self.chart.pose(k), seen.sigma, seen.cov, point, self.chart.seen[at], self.chart.size[at], seen.asked
        )

    def _sonar_at(self, t: float) -> float | None:
        """[m] mean of the readings of the second around t."""
        near = [height for at, height in self._sonar if abs(at - t) < 0.5]
        return float(np.mean(near)) if near else None

    def _freeze(self) -> None:
        """Metric scale, level and heading, once and for all, as soon as enough is known."""
        s, chart = self.settings, self.chart
        growth.adjust_all(chart)
        t = np.array([at for at, _ in self._sonar_path])
        path = np.array([p for _, p in self._sonar_path])
        said = np.array([(at, height) for at, height in self._sonar if t[0] <= at < t[-1]]).reshape(-1, 2)
        k = np.searchsorted(t, said[:, 0], side="right")
        said = said[t[k] - t[k - 1] < GAP]  # else the camera was lost between
        below = np.column_stack([np.interp(said[:, 0], t, path[:, axis]) for axis in range(3)])
        found = scale.similarity(chart.X, self._anchor, below, said[:, 1], s, self._grown < 2 * s.scale_frames)
        if isinstance(found, str):
            self.reason = found
            return
        chart.move(*found)
        if s.start_heading is None:  # else the first keyframe's is right as it is
            R_RB = np.einsum("kji,jl->kil", chart.R, self.rig.R_CB)
            off = chart.euler[:, 2] - np.arctan2(R_RB[:, 1, 0], R_RB[:, 0, 0])
            turn = from_euler(0.0, 0.0, math.atan2(float(np.sin(off).mean()), float(np.cos(off).mean())))
            chart.move(1.0, turn, self._anchor - turn @ self._anchor)
        chart.metric, self.reason = True, ""
        self._sonar, self._sonar_path = [], []
        self._last = None  # poses before this are in other units
