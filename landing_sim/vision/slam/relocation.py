"""Where a lost camera is: the keyframes whose small blurred images look most like what it sees are tried one by one.

Source     Klein & Murray 2008, section 4.
           Departs: the attitude comes from the inertial unit; small images are turned by its heading, not aligned; nine
           places are tried around each keyframe, half a keyframe's distance apart.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from landing_sim.types import Array
from landing_sim.vision.slam.corners import Pyramid
from landing_sim.vision.slam.map import THUMB, Map, thumb
from landing_sim.vision.slam.pose import Pose, turned
from landing_sim.vision.slam.settings import SlamSettings
from landing_sim.vision.slam.tracking import Tracked, track

CANDIDATES = 5
ASKED = 0.5  # of the points looked for must be found: a wrong place finds few
LEAST = 40  # points


def relocate(
    chart: Map, levels: Pyramid, R_CR: Array, settings: SlamSettings, p_said: Array | None, height: float | None = None
) -> Tracked | None:
    """The pose of a frame that could be anywhere on the map, or None.

    R_CR (3, 3) : attitude from the inertial unit; p_said (3,) [m] : where else the camera may be, tried first;
    height [m] : of the camera, where the sonar tells it
    """
    places = [] if p_said is None else [p_said]
    places += [chart.p[k] for k in alike(chart, levels, R_CR)]
    for place in places:
        if height is not None and place is not p_said:
            place = np.array([place[0], place[1], -height])
        step = 0.5 * settings.keyframe_distance * max(0.1, -place[2])
        for dx, dy in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            start = Pose(R_CR, place + step * np.array([dx, dy, 0.0]))
            found = track(chart, levels, start, settings, settings.fine_points, coarser=1)
            if found is None or turned(found.pose.R_CR, R_CR) > settings.most_turn:
                continue
            if len(found.point) >= max(LEAST, ASKED * found.asked):
                return found
    return None


def alike(chart: Map, levels: Pyramid, R_CR: Array) -> np.ndarray:
    """Indices of the keyframes that look most like the frame, best first."""
    now = thumb(levels)
    w, h = THUMB
    u, v = np.meshgrid(np.arange(w) - 0.5 * (w - 1), np.arange(h) - 0.5 * (h - 1))
    middle = np.hypot(u, v) < 0.5 * h  # what a turned image still shows
    score = np.empty(chart.frames)
    for k in range(chart.frames):
        turn = R_CR @ chart.R[k].T  # C of the keyframe to C now
        angle = math.degrees(math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))
        M = cv2.getRotationMatrix2D((0.5 * (w - 1), 0.5 * (h - 1)), angle, 1.0)
        a, b = cv2.warpAffine(now, M, THUMB)[middle], chart.thumbs[k][middle]
        a, b = a - a.mean(), b - b.mean()
        score[k] = (a @ b) / max(1e-9, float(np.linalg.norm(a) * np.linalg.norm(b)))
    return np.argsort(-score, kind="stable")[:CANDIDATES]
