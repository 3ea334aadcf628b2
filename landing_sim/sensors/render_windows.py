"""Windows shaded together: far off they overlap, and what they share, the whole runway, is drawn once.

Pixels are the same whatever block they are made in (`render_kernels`), so joining blocks changes none.
"""

from __future__ import annotations

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.sensors.render_kernels import shade
from landing_sim.sensors.render_noise import stream_of
from landing_sim.types import Array

GENEROUS = 2.0  # times as many pixels may be made where windows are joined


@uncounted
def merged(corners: np.ndarray, looked: np.ndarray, boxes: np.ndarray, member: np.ndarray) -> int:
    """Join what is looked at of windows that overlap, so that what they share is shaded once.

    corners (n, 2), looked (n, 4) as in `shade`. Fills boxes (n, 4), first and behind the last column and row in the frame,
    and member (n,), the box of each window; returns the number of boxes. Windows are joined where that makes no more than
    GENEROUS times the pixels: what is drawn there costs more than the pixels it is drawn on.
    """
    count = 0
    for i in range(len(corners)):
        k = count
        for c in range(2):
            boxes[k, 2 * c], boxes[k, 2 * c + 1] = corners[i, c] + looked[i, c], corners[i, c] + looked[i, 2 + c]
        member[i], count = k, count + 1
        j = 0
        while j < count:
            u0, u1 = max(boxes[j, 0], boxes[k, 0]), min(boxes[j, 1], boxes[k, 1])
            v0, v1 = max(boxes[j, 2], boxes[k, 2]), min(boxes[j, 3], boxes[k, 3])
            a0, a1 = min(boxes[j, 0], boxes[k, 0]), max(boxes[j, 1], boxes[k, 1])
            b0, b1 = min(boxes[j, 2], boxes[k, 2]), max(boxes[j, 3], boxes[k, 3])
            apart = (boxes[j, 1] - boxes[j, 0]) * (boxes[j, 3] - boxes[j, 2])
            apart += (boxes[k, 1] - boxes[k, 0]) * (boxes[k, 3] - boxes[k, 2])
            if j == k or u0 >= u1 or v0 >= v1 or (a1 - a0) * (b1 - b0) > GENEROUS * apart:
                j += 1
                continue
            low, high, last = min(j, k), max(j, k), count - 1
            boxes[low, 0], boxes[low, 1], boxes[low, 2], boxes[low, 3] = a0, a1, b0, b1
            for c in range(4):
                boxes[high, c] = boxes[last, c]
            for m in range(i + 1):
                member[m] = low if member[m] == high else high if member[m] == last else member[m]
            count, k, j = last, low, 0  # what has grown may reach others
    return count


@kernel
def shade_windows(
    out: np.ndarray, corners: np.ndarray, w: int, h: int, looked: np.ndarray, whole: bool,
    lines: Array, seen: np.ndarray, counts: np.ndarray, horizon: Array, camera: Array, palette: Array, lens: Array,
    table: Array, quantiles: np.ndarray, greys: np.ndarray, key: np.uint64, index: int,
) -> bool:  # fmt: skip
    """`shade`, what windows share of their `looked` shaded once: the same pixels.

    key: of the pixel noise, index: the frame's number. False, and nothing done, if a window leaves the frame.
    """
    n = m = len(corners)
    for i in range(0 if whole else n):
        if min(corners[i, 0], corners[i, 1]) < 0 or corners[i, 0] + w > camera[3] or corners[i, 1] + h > camera[4]:
            return False
    boxes, member = np.empty((n, 4), np.int64), np.empty(n, np.int64)
    if len(looked) > 0:
        m = merged(corners, looked, boxes, member)
    made, tops, parts, size = out, corners, looked, np.array([w, h])
    if m < n:
        tops, parts, size = np.empty((m, 2), np.int64), np.zeros((m, 4), np.int64), np.zeros(2, np.int64)
        for k in range(m):
            tops[k, 0], tops[k, 1] = boxes[k, 0], boxes[k, 2]
            parts[k, 2], parts[k, 3] = boxes[k, 1] - boxes[k, 0], boxes[k, 3] - boxes[k, 2]
            size[0], size[1] = max(size[0], parts[k, 2]), max(size[1], parts[k, 3])
        # blocks are all as large as the largest: near the frame's end a box lies further back in its own
        for k in range(m):
            for c in range(2):
                parts[k, c] = max(0, tops[k, c] + size[c] - int(camera[3 + c]))
                tops[k, c] -= parts[k, c]
                parts[k, 2 + c] += parts[k, c]
        made = np.empty((m * size[1], size[0]), np.uint8)
    room = size[1], size[0]
    lists, heads = np.empty((2, seen.shape[0], seen.shape[1]), np.int64), np.empty((2, len(counts)), np.int64)
    shade(  # called in one place: each would be a copy to compile
        made, tops, size[0], size[1], parts, whole, lines, seen, counts, horizon, camera, palette, lens, table, quantiles,
        greys, stream_of(key, index), np.empty(room), np.empty(room), np.empty(size[0] + 6),
        np.empty((size[0] + 6) >> 2, np.uint64), lists, heads,
    )  # fmt: skip
    if m == n:
        return True
    for i in range(n):
        k = member[i]
        left, top = corners[i, 0] - tops[k, 0], corners[i, 1] - tops[k, 1] + k * size[1]
        for r in range(looked[i, 1], looked[i, 3]):
            for c in range(looked[i, 0], looked[i, 2]):
                out[i * h + r, c] = made[top + r, left + c]
    return True
