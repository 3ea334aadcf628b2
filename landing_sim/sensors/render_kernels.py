"""Compiled pixels: every pixel is a sum of exact profiles of the lines of `render_lines`.

Optics: the indicator of a half-plane blurred by a Gaussian is Phi(d / sigma) of the signed distance d. The two opposite
edges of a quadrilateral are a slab, Phi(d1) + Phi(d2) - 1, which keeps the contrast of stripes thinner than a pixel. Two
slabs at right angles multiply; at other angles the truth is a bivariate normal of correlation n1 . n2, approached between
its bounds min(P1, P2) and P1 + P2 - 1 with weight 2 asin(n1 . n2) / pi, which is exact at the corner itself, at right
angles and where edges are parallel. Layers are composed bottom up as if their edges were independent: where edges of
two layers are less than a pixel apart (far end against horizon) single pixels are off by up to ~8 of 255 grey levels.
Beyond CUT sigma a profile is exactly 0 or 1: so skipping what cannot matter changes no bit, and windows, tiles and single
pixels agree whatever is computed with them. For the same reason nothing is drawn more than CUT sigma outside the box
around a quadrilateral's corners (which also removes the spikes that four profiles leave at sharp corners).
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import uncounted
from landing_sim.sensors.render_lines import CUT, TABLE_HALF, TABLE_SIZE, fill_corners
from landing_sim.sensors.render_noise import develop, develop_flat
from landing_sim.types import Array

SLACK = 1e-6  # table units: covers rounding when a whole block is classified at once
TILE = 128, 16  # [px] width and height of the blocks that a full frame is made of

SKY, GRASS, SURFACE, PAINT = 0, 1, 2, 3  # as in world.runway


@uncounted
def _dip_function(u: float, v: float, horizon: Array, camera: Array) -> tuple[float, float, float]:
    """F = r_z - sin(dip) |r| of the ray through (u, v), > 0 below the horizon, and its gradient per pixel.

    F is concave in the image (the ground is a convex region), which makes the bounds of `_side` exact.
    """
    inv, s = 1.0 / camera[0], horizon[3]
    x, y = (u - camera[1]) * inv, (v - camera[2]) * inv
    norm = math.sqrt(1.0 + x * x + y * y)
    value = horizon[0] * u + horizon[1] * v + horizon[2] - s * norm
    k = s * inv / norm
    return value, horizon[0] - k * x, horizon[1] - k * y


@uncounted
def _side(uc: float, vc: float, hu: float, hv: float, horizon: Array, camera: Array) -> int:
    """SKY or GRASS if a block of half sizes hu, hv around (uc, vc) shows only that, -1 if it may show the horizon."""
    margin = (CUT * camera[5] + 1e-3) * horizon[4]
    value, gu, gv = _dip_function(uc, vc, horizon, camera)
    if value + abs(gu) * hu + abs(gv) * hv < -margin:
        return SKY
    if value > margin:
        for i in range(4):
            value, gu, gv = _dip_function(uc + (hu if i & 1 else -hu), vc + (hv if i & 2 else -hv), horizon, camera)
            if value <= margin:
                return -1
        return GRASS
    return -1


@uncounted
def _classify(
    u0: int, v0: int, w: int, h: int, lines: Array, seen: np.ndarray, count: int, horizon: Array, camera: Array,
    active: np.ndarray, edges: np.ndarray,
) -> tuple[int, int]:  # fmt: skip
    """What a block of pixels shows: (material below all, or -1 for the horizon; first of `active`).

    active[first:count] are the quadrilaterals with an edge in the block, bottom first, drawn over that material; edges
    is the bit mask of those edges.
    """
    hu, hv = 0.5 * (w - 1), 0.5 * (h - 1)
    uc, vc = u0 + hu, v0 + hv
    full = TABLE_SIZE + SLACK
    first = count
    for m in range(count - 1, -1, -1):
        if u0 > seen[m, 2] or u0 + w <= seen[m, 1] or v0 > seen[m, 4] or v0 + h <= seen[m, 3]:
            continue
        mask = 0
        visible = True
        for i in range(4):
            a, b = lines[m, i, 0], lines[m, i, 1]
            centre = a * uc + b * vc + lines[m, i, 2]
            reach = abs(a) * hu + abs(b) * hv
            if centre + reach < -SLACK:
                visible = False
                break
            if centre - reach < full:
                mask |= 1 << i
        if not visible:
            continue
        if mask == 0:
            return seen[m, 0], first
        first -= 1
        active[first] = m
        edges[first] = mask
    return _side(uc, vc, hu, hv, horizon, camera), first


@uncounted
def _beyond(x: float, table: Array) -> float:
    """Fraction beyond the edge at x table units: piecewise linear, exactly 1 below 0 and 0 above TABLE_SIZE."""
    if x <= 0.0:
        return 1.0
    if x >= TABLE_SIZE:
        return 0.0
    i = np.uint32(x)  # unsigned: see `jit` on indices
    return table[i, 0] + (x - i) * table[i, 1]  # type: ignore[no-any-return]


@uncounted
def _draw_horizon(
    block: Array, w: int, h: int, u0: int, v0: int, horizon: Array, camera: Array, palette: Array, table: Array
) -> None:
    units = TABLE_HALF / (CUT * camera[5])
    ground, sky = palette[GRASS], palette[SKY]
    half = 0.5 * (w - 1)
    for r in range(h):
        v = v0 + r
        side = _side(u0 + half, float(v), half, 0.0, horizon, camera)
        if side >= 0:
            for c in range(w):
                block[r, c] = palette[side]
            continue
        for c in range(w):  # two loops: the roots and quotients of this one are taken several at a time
            value, gu, gv = _dip_function(float(u0 + c), float(v), horizon, camera)
            block[r, c] = value * (units / max(math.sqrt(gu * gu + gv * gv), 1e-30)) + TABLE_HALF
        for c in range(w):
            beyond = _beyond(block[r, c], table)
            block[r, c] = (1.0 - beyond) * ground + beyond * sky


@uncounted
def _draw_quad(
    block: Array, w: int, h: int, u0: int, v0: int, line: Array, box: np.ndarray, mask: int, grey: float, below: float,
    table: Array,
) -> None:  # fmt: skip
    """Compose one quadrilateral over a block; edges outside `mask` are known to be far inside.

    below >= 0 is the grey of what it is painted on: it replaces that, alpha (grey - below) is added. A lens blurs light,
    which adds up, so an edge of what is below shows through paint that is blurred over it. below < 0: it covers all.

    In each row, columns lo..hi are not wholly beyond an edge (one pixel generous), columns inside_lo..inside_hi wholly
    inside all (one pixel stingy): elsewhere alpha is exactly 0 or 1.
    """
    a0, b0, c0 = line[0, 0], line[0, 1], line[0, 2]
    a1, b1, c1 = line[1, 0], line[1, 1], line[1, 2]
    a2, b2, c2 = line[2, 0], line[2, 1], line[2, 2]
    a3, b3, c3 = line[3, 0], line[3, 1], line[3, 2]
    box_lo, box_hi = max(0, box[1] - u0), min(w, box[2] + 1 - u0)
    for r in range(max(0, box[3] - v0), min(h, box[4] + 1 - v0)):
        v = v0 + r
        e0, e1, e2, e3 = b0 * v + c0, b1 * v + c1, b2 * v + c2, b3 * v + c3
        lo, hi, inside_lo, inside_hi = box_lo, box_hi, 0, w
        for i in range(4):
            if mask >> i & 1 == 0:
                continue
            a = a0 if i == 0 else (a1 if i == 1 else (a2 if i == 2 else a3))
            e = e0 if i == 0 else (e1 if i == 1 else (e2 if i == 2 else e3))
            # Values at the row's ends settle most rows without a division.
            at_lo, at_hi = a * u0 + e, a * (u0 + w - 1) + e
            least, most = min(at_lo, at_hi), max(at_lo, at_hi)
            if least >= TABLE_SIZE + SLACK:
                continue
            if most <= -SLACK:
                hi, inside_hi = lo, 0
            elif least < -SLACK or most > TABLE_SIZE + SLACK:
                zero = min(max(-at_lo / a, -2.0), w + 2.0)
                full = min(max((TABLE_SIZE - at_lo) / a, -3.0), w + 3.0)
                if a > 0.0:
                    lo = max(lo, int(zero) - 1)
                    inside_lo = max(inside_lo, int(full) + 2)
                else:
                    hi = min(hi, int(zero) + 2)
                    inside_hi = min(inside_hi, int(full) - 1)
            else:
                inside_hi = 0
        if inside_lo >= inside_hi:
            inside_lo = inside_hi = hi
        covered = block[r, inside_lo:inside_hi]
        for c in range(len(covered)):
            covered[c] = grey if below < 0.0 else covered[c] + (grey - below)
        start, stop = lo, inside_lo
        for _ in range(2):
            edge = block[r, start:stop]
            for c in range(len(edge)):
                u = u0 + start + c
                q0, q1 = _beyond(a0 * u + e0, table), _beyond(a1 * u + e1, table)
                q2, q3 = _beyond(a2 * u + e2, table), _beyond(a3 * u + e3, table)
                across, along = max(0.0, 1.0 - (q0 + q2)), max(0.0, 1.0 - (q1 + q3))
                alpha = across * along
                both = (q0 + q2) * (q1 + q3)
                if both > 0.0 and alpha > 0.0:
                    w01, w12, w23, w30 = line[0, 3], line[1, 3], line[2, 3], line[3, 3]
                    weight = (q0 * (q1 * w01 + q3 * w30) + q2 * (q1 * w12 + q3 * w23)) / both
                    bound = min(across, along) if weight > 0.0 else max(0.0, across + along - 1.0)
                    alpha += abs(weight) * (bound - alpha)
                edge[c] += alpha * (grey - (edge[c] if below < 0.0 else below))
            start, stop = inside_hi, hi


@uncounted
def shade(
    out: np.ndarray, corners: np.ndarray, w: int, h: int, looked: np.ndarray, whole: bool,
    lines: Array, seen: np.ndarray, counts: np.ndarray, horizon: Array, camera: Array, palette: Array, lens: Array,
    table: Array, quantiles: np.ndarray, greys: np.ndarray, stream: np.uint64,
    block: Array, total: Array, noise: Array, hashes: np.ndarray, lists: np.ndarray, heads: np.ndarray,
) -> None:  # fmt: skip
    """Blocks of w x h pixels with their top-left pixels at corners (n, 2) [u0, v0], as uint8.

    whole: `out` is the frame (height, width), and each block goes to its place, less what sticks out of the frame.
    Otherwise `out` (n h, w) takes the blocks one below the other; none leaves the frame.
    looked (n, 4), if not empty: first and behind the last column and row of each block that are made, and no others.
    greys: the palette as `developed`, for blocks without an edge; stream: see `stream_of`.
    Working space: block and total (h, w), noise (w + 6,), hashes ((w + 6) // 4,), and for the k sub-exposures with up to
    m quadrilaterals lists (2, k, m) and heads (2, k).

    A frame is the mean over its sub-exposures (first axis of lines, seen, counts, horizon), then lens and noise.
    """
    width, height, subs = int(camera[3]), int(camera[4]), len(counts)
    active, edges, base, first = lists[0], lists[1], heads[0], heads[1]
    for i in range(corners.shape[0]):
        u0, v0 = corners[i, 0], corners[i, 1]
        r0, c0 = (v0, u0) if whole else (i * h, 0)
        bw, bh = min(w, width - u0), min(h, height - v0)
        if len(looked) > 0:
            bw, bh = looked[i, 2] - looked[i, 0], looked[i, 3] - looked[i, 1]
            u0, c0, v0, r0 = u0 + looked[i, 0], c0 + looked[i, 0], v0 + looked[i, 1], r0 + looked[i, 1]
        flat = True
        for k in range(subs):
            base[k], first[k] = _classify(
                u0, v0, bw, bh, lines[k], seen[k], counts[k], horizon[k], camera, active[k], edges[k]
            )
            flat = flat and base[k] >= 0 and base[k] == base[0] and first[k] == counts[k]
        if flat:
            develop_flat(out, r0, c0, greys[base[0]], bw, bh, u0, v0, stream, hashes)
            continue
        for k in range(subs):
            if base[k] < 0:
                _draw_horizon(block, bw, bh, u0, v0, horizon[k], camera, palette, table)
            else:
                for r in range(bh):
                    for c in range(bw):
                        block[r, c] = palette[base[k]]
            for j in range(first[k], counts[k]):
                m = active[k, j]
                if math.isnan(lines[k, m, 0, 3]):
                    fill_corners(lines[k, m], TABLE_HALF / (CUT * camera[5]))
                grey = palette[seen[k, m, 0]]
                below = palette[SURFACE] if seen[k, m, 0] == PAINT else -1.0
                _draw_quad(block, bw, bh, u0, v0, lines[k, m], seen[k, m], edges[k, j], grey, below, table)
            if subs > 1:
                for r in range(bh):
                    for c in range(bw):
                        total[r, c] = block[r, c] / subs + (total[r, c] if k else 0.0)
        drawn = total if subs > 1 else block
        develop(out, r0, c0, drawn, bw, bh, u0, v0, stream, lens, quantiles, noise)
