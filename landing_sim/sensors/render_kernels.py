"""Compiled pixels: every ground quadrilateral is four image lines, every pixel a sum of exact edge profiles.

A quadrilateral seen from C is the cone of rays inside four planes through C, so in the image it is the intersection of
four half-planes {l . (u, v, 1) > 0}, l = K^-T (P_i x P_i+1), wherever its corners lie: in view, far outside, or behind
the camera. Homogeneous clipping is thus exact without a near plane, and no coordinate is ever clamped.

Optics: the indicator of a half-plane blurred by a Gaussian is Phi(d / sigma) of the signed distance d. The two opposite
edges of a quadrilateral are a slab, Phi(d1) + Phi(d2) - 1, which keeps the contrast of stripes thinner than a pixel; its
two slabs are multiplied (exact where they are at right angles; elsewhere inexact only within ~2 sigma of a corner).
Layers are composed bottom up. Lines are stored in table units (TABLE_HALF at the edge, 0 and 2 TABLE_HALF at -+ CUT
sigma), beyond which the profile is exactly 0 or 1: so skipping what cannot matter changes no bit, and windows, tiles
and single pixels agree whatever is computed with them.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.jit import kernel
from landing_sim.types import Array

CUT = 4.0  # [sigma] half width of an edge's profile
TABLE_HALF = 512
TABLE_SIZE = 2 * TABLE_HALF
SLACK = 1e-6  # table units: covers rounding when a whole block is classified at once
TILE = 16  # [px] side of the blocks a full frame is made of
CULL_MARGIN = 64.0  # [px] around the image outside which a quadrilateral is dropped

SKY, GRASS = 0, 1  # as in world.runway


def edge_table() -> Array:
    """(TABLE_SIZE + 1,) fraction of a blurred half-plane that lies beyond its edge: 1 at -CUT sigma .. 0 at +CUT."""
    x = np.linspace(-CUT, CUT, TABLE_SIZE + 1)
    table = np.array([0.5 * math.erfc(v / math.sqrt(2.0)) for v in x])
    table[0], table[-1] = 1.0, 0.0
    return table


@kernel
def project(
    points: Array,
    material: np.ndarray,
    p_RC: Array,
    R_CR: Array,
    camera: Array,
    lines: Array,
    seen: np.ndarray,
    horizon: Array,
) -> int:
    """Project quadrilaterals `points` (m, 4, 3) [m], frame R, into image lines.

    camera (6,): f, cx, cy [px], width, height, blur sigma [px].
    Fills lines (m, 4, 3) in table units, seen (m,) the material of each, horizon (5,): gradient and offset of the
    z component (frame R) of the ray (x, y, 1) of pixel (u, v), sine of the dip, bound of the gradient.
    Returns the number of quadrilaterals kept: those in front of the camera, near the image and seen from above.
    """
    f, cx, cy = camera[0], camera[1], camera[2]
    units = TABLE_HALF / (CUT * camera[5])
    left, right = -(cx + CULL_MARGIN) / f, (camera[3] - cx + CULL_MARGIN) / f
    top, bottom = -(cy + CULL_MARGIN) / f, (camera[4] - cy + CULL_MARGIN) / f
    q = np.empty((4, 3))
    count = 0
    for m in range(points.shape[0]):
        out_left = out_right = out_top = out_bottom = True
        for i in range(4):
            x = points[m, i, 0] - p_RC[0]
            y = points[m, i, 1] - p_RC[1]
            z = points[m, i, 2] - p_RC[2]
            for j in range(3):
                q[i, j] = R_CR[j, 0] * x + R_CR[j, 1] * y + R_CR[j, 2] * z
            out_left &= q[i, 0] < left * q[i, 2]
            out_right &= q[i, 0] > right * q[i, 2]
            out_top &= q[i, 1] < top * q[i, 2]
            out_bottom &= q[i, 1] > bottom * q[i, 2]
        if out_left or out_right or out_top or out_bottom:
            continue
        above = True
        for i in range(4):
            k = (i + 1) & 3
            dx, dy, dz = q[k, 0] - q[i, 0], q[k, 1] - q[i, 1], q[k, 2] - q[i, 2]
            n0 = q[i, 1] * dz - q[i, 2] * dy
            n1 = q[i, 2] * dx - q[i, 0] * dz
            n2 = q[i, 0] * dy - q[i, 1] * dx
            if i == 0:
                above = n0 * q[2, 0] + n1 * q[2, 1] + n2 * q[2, 2] > 0.0
                if not above:
                    break
            a, b = n0 / f, n1 / f
            c = n2 - a * cx - b * cy
            scale = units / max(math.hypot(a, b), 1e-12 * abs(c) + 1e-300)
            lines[count, i, 0] = a * scale
            lines[count, i, 1] = b * scale
            lines[count, i, 2] = c * scale + TABLE_HALF
        if above:
            seen[count] = material[m]
            count += 1
    horizon[0] = R_CR[0, 2] / f
    horizon[1] = R_CR[1, 2] / f
    horizon[2] = R_CR[2, 2] - horizon[0] * cx - horizon[1] * cy
    horizon[3] = math.sin(horizon_dip(-p_RC[2]))
    horizon[4] = (math.hypot(R_CR[0, 2], R_CR[1, 2]) + horizon[3]) / f
    return count


@kernel
def _dip_function(u: float, v: float, horizon: Array, camera: Array) -> tuple[float, float]:
    """F = r_z - sin(dip) |r| of the ray through (u, v), > 0 below the horizon, and |grad F| per pixel.

    F is concave in the image (the ground is a convex region), which makes the bounds of `_classify` exact.
    """
    f, s = camera[0], horizon[3]
    x, y = (u - camera[1]) / f, (v - camera[2]) / f
    norm = math.sqrt(1.0 + x * x + y * y)
    value = horizon[0] * u + horizon[1] * v + horizon[2] - s * norm
    k = s / (f * norm)
    gu, gv = horizon[0] - k * x, horizon[1] - k * y
    return value, math.sqrt(gu * gu + gv * gv)


@kernel
def _classify(
    u0: int, v0: int, w: int, h: int, lines: Array, seen: np.ndarray, count: int, horizon: Array, camera: Array,
    active: np.ndarray, edges: np.ndarray,
) -> tuple[int, int, int]:  # fmt: skip
    """What a block of pixels shows: (material below all, or -1 for the horizon; first and end of `active`).

    active[first:end] are the quadrilaterals with an edge in the block, bottom first, drawn over that material; edges
    is the bit mask of those edges.
    """
    hu, hv = 0.5 * (w - 1), 0.5 * (h - 1)
    uc, vc = u0 + hu, v0 + hv
    full = TABLE_SIZE + SLACK
    first = count
    for m in range(count - 1, -1, -1):
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
            return seen[m], first, count
        first -= 1
        active[first] = m
        edges[first] = mask
    margin = (CUT * camera[5] + 1e-3) * horizon[4]
    value, slope = _dip_function(uc, vc, horizon, camera)
    if value + slope * math.hypot(hu, hv) < -margin:
        return SKY, first, count
    lowest = value
    for i in range(4):
        value, _ = _dip_function(uc + (hu if i & 1 else -hu), vc + (hv if i & 2 else -hv), horizon, camera)
        lowest = min(lowest, value)
    return (GRASS if lowest > margin else -1), first, count


@kernel
def _beyond(x: float, table: Array) -> float:
    """Fraction beyond the edge at x table units: piecewise linear, exactly 1 below 0 and 0 above TABLE_SIZE."""
    if x <= 0.0:
        return 1.0
    if x >= TABLE_SIZE:
        return 0.0
    i = int(x)
    return table[i] + (x - i) * (table[i + 1] - table[i])


@kernel
def _draw_horizon(row: Array, u0: int, v: int, horizon: Array, camera: Array, palette: Array, table: Array) -> None:
    units = TABLE_HALF / (CUT * camera[5])
    for c in range(row.shape[0]):
        value, slope = _dip_function(u0 + c, v, horizon, camera)
        sky = _beyond(units * (value / max(slope, 1e-30)) + TABLE_HALF, table)
        row[c] = (1.0 - sky) * palette[GRASS] + sky * palette[SKY]


@kernel
def _draw_quad(row: Array, u0: int, v: int, line: Array, mask: int, grey: float, table: Array) -> None:
    """Compose one quadrilateral over one row. Edges outside `mask` are known to be far inside."""
    lo, hi = 0, row.shape[0]
    for i in range(4):
        if mask >> i & 1:
            a = line[i, 0]
            offset = line[i, 1] * v + line[i, 2]
            # Narrow to the part of the row not beyond this edge, one pixel generous: there alpha is exactly zero.
            if abs(a) > 1e-9:
                zero = min(max(-offset / a - u0, -2.0), row.shape[0] + 2.0)
                if a > 0.0:
                    lo = max(lo, int(zero) - 1)
                else:
                    hi = min(hi, int(zero) + 2)
            elif offset < -1.0:
                return
    a0, e0 = line[0, 0], line[0, 1] * v + line[0, 2]
    a1, e1 = line[1, 0], line[1, 1] * v + line[1, 2]
    a2, e2 = line[2, 0], line[2, 1] * v + line[2, 2]
    a3, e3 = line[3, 0], line[3, 1] * v + line[3, 2]
    one_edge = mask & (mask - 1) == 0
    if one_edge:
        if mask == 2:
            a0, e0 = a1, e1
        elif mask == 4:
            a0, e0 = a2, e2
        elif mask == 8:
            a0, e0 = a3, e3
        for c in range(lo, hi):
            alpha = 1.0 - _beyond(a0 * (u0 + c) + e0, table)
            row[c] = alpha * grey + (1.0 - alpha) * row[c]
        return
    for c in range(lo, hi):
        u = u0 + c
        across = max(0.0, 1.0 - (_beyond(a0 * u + e0, table) + _beyond(a2 * u + e2, table)))
        along = max(0.0, 1.0 - (_beyond(a1 * u + e1, table) + _beyond(a3 * u + e3, table)))
        alpha = across * along
        row[c] = alpha * grey + (1.0 - alpha) * row[c]


@kernel
def mix(x: np.uint64) -> np.uint64:
    """Finaliser of splitmix64: 64 bits in, 64 well mixed bits out (Steele, Lea & Flood 2014, fig. 16)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel
def _develop(
    out: np.ndarray, r: int, c0: int, row: Array, u0: int, v: int, stream: np.uint64, lens: Array, quantiles: np.ndarray
) -> None:
    """Lens gain and offset, sensor noise and quantisation of one row; lens (3,): gain, offset, noise sigma.

    The noise of pixel (u, v) is 16 bits of the hash of its counter (four pixels share one hash), through a table of
    Gaussian quantiles.
    """
    gain, offset, sigma = lens[0], lens[1], lens[2]
    bits = np.uint64(0)
    for c in range(row.shape[0]):
        u = u0 + c
        if c == 0 or u & 3 == 0:
            counter = np.uint64((v << 20) | (u >> 2))
            bits = mix(stream + (counter + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15))
        draw = quantiles[(bits >> np.uint64((u & 3) << 4)) & np.uint64(0xFFFF)]
        value = row[c] * gain + offset + sigma * draw + 0.5
        out[r, c0 + c] = np.uint8(min(max(value, 0.0), 255.0))


@kernel
def stream_of(key: np.uint64, index: int) -> np.uint64:
    """Start of the noise sequence of frame `index`."""
    return mix(mix(key) + np.uint64(index) * np.uint64(0xD1B54A32D192ED03))


@kernel
def _block(
    out: np.ndarray, r0: int, c0: int, u0: int, v0: int, w: int, h: int,
    lines: Array, seen: np.ndarray, counts: np.ndarray, horizon: Array, camera: Array, palette: Array, lens: Array,
    table: Array, quantiles: np.ndarray, stream: np.uint64, filled: np.ndarray,
    active: np.ndarray, edges: np.ndarray, row: Array, total: Array,
) -> None:  # fmt: skip
    """Pixels u0.., v0.. of size w x h into out[r0.., c0..]: the mean over the sub-exposures, then lens and noise.

    filled: (height, width) uint8 materials painted beforehand, used where the block has no edge; or empty.
    """
    subs = lines.shape[0]
    base = np.empty(subs, np.int64)
    first = np.empty(subs, np.int64)
    flat = filled.size > 0
    for k in range(subs):
        base[k], first[k], _ = _classify(
            u0, v0, w, h, lines[k], seen[k], counts[k], horizon[k], camera, active[k], edges[k]
        )
        flat &= base[k] >= 0 and first[k] == counts[k]
    for r in range(h):
        v = v0 + r
        total[:w] = 0.0
        for k in range(subs):
            if flat:
                for c in range(w):
                    row[c] = palette[filled[v, u0 + c]]
            elif base[k] < 0:
                _draw_horizon(row[:w], u0, v, horizon[k], camera, palette, table)
            else:
                row[:w] = palette[base[k]]
            for j in range(first[k], counts[k]):
                m = active[k, j]
                _draw_quad(row[:w], u0, v, lines[k, m], edges[k, j], palette[seen[k, m]], table)
            total[:w] += row[:w]
        total[:w] /= subs
        _develop(out, r0 + r, c0, total[:w], u0, v, stream, lens, quantiles)


@kernel
def shade_windows(
    corners: np.ndarray, w: int, h: int,
    lines: Array, seen: np.ndarray, counts: np.ndarray, horizon: Array, camera: Array, palette: Array, lens: Array,
    table: Array, quantiles: np.ndarray, key: np.uint64, index: int,
) -> np.ndarray:  # fmt: skip
    """(n, h, w) uint8 for n corners (n, 2) [u0, v0]."""
    n = corners.shape[0]
    out = np.empty((n * h, w), np.uint8)
    active, edges = np.empty(seen.shape, np.int64), np.empty(seen.shape, np.int64)
    row, total = np.empty(w), np.empty(w)
    nothing = np.empty((0, 0), np.uint8)
    stream = stream_of(key, index)
    for i in range(n):
        _block(
            out, i * h, 0, corners[i, 0], corners[i, 1], w, h, lines, seen, counts, horizon, camera, palette, lens,
            table, quantiles, stream, nothing, active, edges, row, total,
        )  # fmt: skip
    return out.reshape((n, h, w))


@kernel
def shade_frame(
    filled: np.ndarray,
    lines: Array, seen: np.ndarray, counts: np.ndarray, horizon: Array, camera: Array, palette: Array, lens: Array,
    table: Array, quantiles: np.ndarray, key: np.uint64, index: int,
) -> np.ndarray:  # fmt: skip
    """(height, width) uint8: interiors from `filled`, every block with an edge in it from its exact profile."""
    height, width = filled.shape
    out = np.empty((height, width), np.uint8)
    active, edges = np.empty(seen.shape, np.int64), np.empty(seen.shape, np.int64)
    row, total = np.empty(TILE), np.empty(TILE)
    stream = stream_of(key, index)
    for v0 in range(0, height, TILE):
        for u0 in range(0, width, TILE):
            w, h = min(TILE, width - u0), min(TILE, height - v0)
            _block(
                out, v0, u0, u0, v0, w, h, lines, seen, counts, horizon, camera, palette, lens,
                table, quantiles, stream, filled, active, edges, row, total,
            )  # fmt: skip
    return out


@kernel
def develop_frame(image: Array, lens: Array, quantiles: np.ndarray, key: np.uint64, index: int) -> np.ndarray:
    """(height, width) uint8 of an image drawn elsewhere: lens, noise and quantisation as in all frames."""
    height, width = image.shape
    out = np.empty((height, width), np.uint8)
    stream = stream_of(key, index)
    for v in range(height):
        _develop(out, v, 0, image[v], 0, v, stream, lens, quantiles)
    return out
