"""Whole frames drawn by OpenCV, as a control.

cv2.fillConvexPoly also draws the outline of what it fills, so edges move outwards by about 0.5 px (LINE_8) or 0.7 px
(LINE_AA): tens of metres of range for a camera on the glide path. These frames exist to show what the bias does.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.so3 import turned
from landing_sim.jit import kernel
from landing_sim.sensors.render_lines import TABLE_HALF
from landing_sim.types import Array

SHIFT = 8  # fractional bits of OpenCV's fixed-point coordinates
GUARD = 16.0  # [px] polygons are clipped this far outside the image
HORIZON_TANGENTS = 64  # around the compass; the polygon they bound leaves the dip cone by < 0.01 px at 51 m


@kernel
def _halve(corners: Array, n: int, a: float, b: float, c: float, out: Array) -> int:
    """Sutherland-Hodgman: keep the part of a convex polygon where a u + b v + c >= 0; number of its corners."""
    count = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        di = a * corners[i, 0] + b * corners[i, 1] + c
        dj = a * corners[j, 0] + b * corners[j, 1] + c
        if di >= 0.0:
            out[count, 0], out[count, 1] = corners[i, 0], corners[i, 1]
            count += 1
        if (di >= 0.0) != (dj >= 0.0):
            t = di / (di - dj)
            out[count, 0] = corners[i, 0] + t * (corners[j, 0] - corners[i, 0])
            out[count, 1] = corners[i, 1] + t * (corners[j, 1] - corners[i, 1])
            count += 1
    return count


@kernel
def _polygon(lines: Array, width: float, height: float, out: np.ndarray) -> int:
    """Corners, in OpenCV's fixed point, of the part of the image inside all lines (n, 3); 0 if there is none."""
    now, then = np.empty((lines.shape[0] + 8, 2)), np.empty((lines.shape[0] + 8, 2))
    now[0, 0] = now[3, 0] = now[0, 1] = now[1, 1] = -GUARD
    now[1, 0] = now[2, 0] = width - 1.0 + GUARD
    now[2, 1] = now[3, 1] = height - 1.0 + GUARD
    count: int = np.int64(4)  # type: ignore[assignment]  # numba compiles a constant for itself
    for i in range(lines.shape[0]):
        count = _halve(now, count, lines[i, 0], lines[i, 1], lines[i, 2], then)
        now, then = then, now
    for i in range(count):
        out[i, 0] = round(now[i, 0] * (1 << SHIFT))
        out[i, 1] = round(now[i, 1] * (1 << SHIFT))
    return count if count >= 3 else 0


@kernel
def _polygons(lines: Array, count: int, horizon: Array, R_CR: Array, camera: Array, out: np.ndarray) -> np.ndarray:
    """(count + 1,) corners of each polygon written to `out`: the ground first, then the quadrilaterals."""
    f, cx, cy, width, height = camera[0], camera[1], camera[2], camera[3], camera[4]
    corners = np.empty(count + 1, np.int64)
    tangents = np.empty((HORIZON_TANGENTS, 3))
    s = horizon[3]
    c = math.sqrt(1.0 - s * s)
    for i in range(HORIZON_TANGENTS):
        azimuth = 2.0 * math.pi * i / HORIZON_TANGENTS
        # Plane touching the dip cone at this azimuth: the ground is what lies inside all of them.
        n = turned(R_CR, -s * math.cos(azimuth), -s * math.sin(azimuth), c)
        tangents[i, 0], tangents[i, 1] = n[0] / f, n[1] / f
        tangents[i, 2] = n[2] - (n[0] * cx + n[1] * cy) / f
    corners[0] = _polygon(tangents, width, height, out[0])
    quad = np.empty((4, 3))
    for m in range(count):
        for i in range(4):
            quad[i, 0], quad[i, 1], quad[i, 2] = lines[m, i, 0], lines[m, i, 1], lines[m, i, 2] - TABLE_HALF
        corners[m + 1] = _polygon(quad, width, height, out[m + 1])
    return corners


def paint(
    image: np.ndarray,
    lines: Array,
    count: int,
    colours: np.ndarray,
    ground: int,
    horizon: Array,
    R_CR: Array,
    camera: Array,
    antialias: bool,
) -> None:
    """Draw the scene over `image` (height, width) uint8, which holds the sky, bottom layer first.

    lines, horizon, camera as in `render_lines.project`; colours (count,) of the quadrilaterals and `ground` are
    values 0..255.
    """
    import cv2

    points = np.empty((count + 1, HORIZON_TANGENTS + 8, 2), np.int32)
    corners = _polygons(lines, count, horizon, R_CR, camera, points)
    line_type = cv2.LINE_AA if antialias else cv2.LINE_8
    for polygon, n, colour in zip(points, corners.tolist(), [ground, *colours.tolist()], strict=True):
        if n:
            cv2.fillConvexPoly(image, polygon[:n], colour, line_type, SHIFT)


def blur(image: np.ndarray, sigma: float) -> Array:
    """(height, width) float64: a drawn image behind the lens."""
    import cv2

    return cv2.GaussianBlur(image.astype(np.float64), (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)  # type: ignore[no-any-return]
