"""Image pyramids and corners spread over the image."""

from __future__ import annotations

import math

import cv2
import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array

LEVELS = 4
BORDER = 12  # [px] no corner nearer to the edge of the image
Pyramid = tuple[np.ndarray, ...]


def pyramid(image: np.ndarray) -> Pyramid:
    """The image and LEVELS - 1 halvings; pixel u of level k lies at u 2^k of level 0."""
    levels = [np.array(image)]  # a copy: kernels want all levels alike, writable
    for _ in range(LEVELS - 1):
        levels.append(cv2.pyrDown(levels[-1]))
    return tuple(levels)


def coarse_level(width: int) -> int:
    """The level about 160 px wide, where a frame is looked for first."""
    return min(LEVELS - 1, max(1, round(math.log2(width / 160.0))))


def corners(image: np.ndarray, threshold: int, taken: Array, cell: float, per_cell: int) -> Array:
    """(n, 2) [px] FAST corners where few points are known yet: the strongest of each cell.

    Parameters
    ----------
    taken (m, 2) [px] : points already there: they count towards per_cell and keep a third of a cell clear around them
    cell [px] : size of the squares that the image is split into; per_cell : points wanted in each

    Source     Rosten & Drummond 2006 (FAST); ranked by the smaller eigenvalue of the structure tensor, Shi & Tomasi 1994.
    """
    found = cv2.FastFeatureDetector.create(threshold).detect(image)
    uv = np.asarray(cv2.KeyPoint.convert(found), float).reshape(-1, 2)
    h, w = image.shape
    inner = (uv[:, 0] >= BORDER) & (uv[:, 1] >= BORDER) & (uv[:, 0] < w - BORDER) & (uv[:, 1] < h - BORDER)
    uv = uv[inner]
    strength = cv2.cornerMinEigenVal(image, 5, ksize=3)[uv[:, 1].astype(int), uv[:, 0].astype(int)]
    order = np.argsort(-strength, kind="stable")
    return _spread(uv[order], taken, w, h, cell, per_cell)


@kernel
def _spread(uv: Array, taken: Array, width: int, height: int, cell: float, per_cell: int) -> Array:
    """Of uv, in order, those whose cell is not full and whose neighbourhood is clear."""
    columns, rows = int(width / cell) + 1, int(height / cell) + 1
    count = np.zeros((rows, columns), np.int64)
    clear = max(4.0, cell / 6.0)
    fine_columns, fine_rows = int(width / clear) + 3, int(height / clear) + 3
    busy = np.zeros((fine_rows, fine_columns), np.bool_)
    for i in range(taken.shape[0]):
        u, v = taken[i, 0], taken[i, 1]
        if u >= 0.0 and v >= 0.0 and u < width and v < height:
            count[int(v / cell), int(u / cell)] += 1
            busy[int(v / clear) + 1, int(u / clear) + 1] = True
    kept = np.empty((uv.shape[0], 2))
    n = 0
    for i in range(uv.shape[0]):
        u, v = uv[i, 0], uv[i, 1]
        a, b = int(v / cell), int(u / cell)
        if count[a, b] >= per_cell:
            continue
        r, c = int(v / clear) + 1, int(u / clear) + 1
        near = False
        for y in range(r - 1, r + 2):
            for x in range(c - 1, c + 2):
                near = near or busy[y, x]
        if near:
            continue
        busy[r, c] = True
        count[a, b] += 1
        kept[n, 0], kept[n, 1] = u, v
        n += 1
    return kept[:n]
