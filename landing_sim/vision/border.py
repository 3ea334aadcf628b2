"""Windows on the borderlines: clear of corners, of each other, of paint as far as possible, dropped at taxiways."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import HORIZON, LEFT, THRESHOLD
from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array
from landing_sim.vision.layout import (
    BLUR,
    CENTRE,
    CLEAR_OF_PAINT,
    FEATURE,
    MAPPED,
    MASK,
    OK,
    OUT,
    SEARCH_MIN,
    SEPARATION,
    SHORT,
    STATUS,
    breadth,
    horizon_hidden,
    on_line,
    path,
    put,
    search_range,
)
from landing_sim.vision.masks import REACH
from landing_sim.vision.prediction import View, cut, dot, in_image, point

_CLEARANCE = 2.0  # [px] between a mask and another edge
_PLACES = 17  # places tried around each regular one, 1/32 of the line apart
_FAR = 45.0  # [px] breadth of the threshold below which no mask fits between the marks along a border
_OPPOSITE = 1.5  # [px] between what a border's mask looks at and the other border
_SHARE, _SHARE_NEAR = 0.4, 0.12  # of a mask's length on paint: within the search range, and within the mask's profile


@uncounted
def _footprint(
    view: View, side: int, u: float, v: float, su: float, sv: float, au: float, av: float, half: int, reach: float
) -> tuple[float, float, float]:
    """s0, s1, y [m]: the stretch of runway a mask at (u, v) sees, and the |y| to which it looks inwards."""
    s0, s1, depth = math.inf, -math.inf, 0.0
    border = (side - 0.5) * view.width
    for i in range(4):
        a, r = (half + 0.5) * (1 if i % 2 else -1), reach if i // 2 else 0.0
        x, y = u + a * au + r * su, v + a * av + r * sv
        g = view.ground
        w = g[2, 0] * x + g[2, 1] * y + g[2, 2]
        w = w if w != 0.0 else 1e-300
        s = (g[0, 0] * x + g[0, 1] * y + g[0, 2]) / w
        s0, s1 = min(s0, s), max(s1, s)
        depth = max(depth, ((g[1, 0] * x + g[1, 1] * y + g[1, 2]) / w - border) * (1.0 if side == LEFT else -1.0))
    return s0, s1, 0.5 * view.width - depth


@uncounted
def _blocked(rows: Array, side: int, s0: float, s1: float, y: float) -> bool:
    """Whether a footprint meets one of the rows x0, x1, Feature, |y|: it reaches inwards to |y| = `y`."""
    for k in range(len(rows)):  # noqa: SIM110 a generator cannot be compiled
        if rows[k, 2] == side and s1 > rows[k, 0] and s0 < rows[k, 1] and y < rows[k, 3]:
            return True
    return False


@uncounted
def _covered(rows: Array, side: int, s0: float, s1: float, y: float) -> float:
    """Share of a footprint's length that meets such rows."""
    length = 0.0
    for k in range(len(rows)):
        if rows[k, 2] == side and y < rows[k, 3]:
            length += max(0.0, min(s1, rows[k, 1]) - max(s0, rows[k, 0]))
    return length / max(1e-9, s1 - s0)


@uncounted
def _inset(
    line: Array, sigma: float, h: int, su: float, sv: float, au: float, av: float, d_u: float, d_v: float
) -> float:
    """Share of the way (d_u, d_v) along a border by which a mask of 2 h + 1 pixels, the runway's side of its profile
    included, stays off a `line` at its end, on whose positive side it lies.
    """
    depth = h * abs(line[0] * au + line[1] * av) + _CLEARANCE + 2.0 * sigma
    depth += 3.5 * max(0.0, -(line[0] * su + line[1] * sv))
    return depth / max(1e-9, abs(line[0] * d_u + line[1] * d_v))  # type: ignore[no-any-return]


@kernel
def place_border(
    F: Array,
    I: np.ndarray,
    at: int,
    n: int,
    side: int,
    view: View,
    sigma: Array,
    rule: Array,
    paint: Array,
    mouths: Array,
    unknown: bool,
) -> None:
    """n windows in rows at.. on the visible part of a borderline, spread from its near to its far end.

    Kept clear of the corners and of where the borderlines and the horizon converge; those at a mapped taxiway mouth are
    dropped. Of the places around each regular one the first is taken where no paint is within the search range; else
    within the smallest one; else within the mask itself, the test for ambiguity standing guard; else within a mask with
    an arm of 1, if paint is to be kept clear of; else little of it, which is what a far runway shows; else with shorter
    masks.
    """
    for i in range(at, at + n):
        I[i, FEATURE], I[i, STATUS] = side, OUT
    l, length, half = view.lines[side], view.length, int(rule[MASK]) // 2
    su, sv, au, av, advance = path(l, 0.0, 0.0)
    wanted = search_range(rule, sigma[side], advance)
    mu = (wanted + REACH) * abs(su) + half * abs(au) + 2.0
    mv = (wanted + REACH) * abs(sv) + half * abs(av) + 2.0
    q0, qd = point(view.threshold, view.across, (side - 0.5) * view.width), view.along
    lo, hi = in_image(q0, qd, 0.0, length, mu, mv, view.frame)
    if lo >= hi:
        return
    for i in range(at, at + n):
        I[i, STATUS] = SHORT
    far = 0.0 < breadth(view) < _FAR
    other, sky, row, apart = view.lines[1 - side], view.lines[HORIZON], view.lines[THRESHOLD], rule[SEPARATION]
    beside = min(apart, (REACH + _OPPOSITE) * advance)
    lo, hi = cut(dot(other, q0) - beside * q0[2], dot(other, qd) - beside * qd[2], lo, hi)
    if not horizon_hidden(view):
        lo, hi = cut(-dot(sky, q0) - apart * q0[2], -dot(sky, qd) - apart * qd[2], lo, hi)
    if lo >= hi:
        return
    q_a, q_b = point(q0, qd, lo), point(q0, qd, hi)
    a_u, a_v = q_a[0] / q_a[2], q_a[1] / q_a[2]
    d_u, d_v = q_b[0] / q_b[2] - a_u, q_b[1] / q_b[2] - a_v
    t0 = t1 = span = 0.0
    for h in range(half, 0, -1):
        # the far end runs as the horizon does; the threshold's line is none any more when the camera passes over it
        t0 = _inset(row, sigma[THRESHOLD], h, su, sv, au, av, d_u, d_v) if lo <= 0.0 else 0.0
        t1 = 1.0 - (_inset(-sky, sigma[HORIZON], h, su, sv, au, av, d_u, d_v) if hi >= length and not unknown else 0.0)
        span = (t1 - t0) * max(abs(d_u), abs(d_v))  # in pixels of the mask
        half = h
        if n < 2 or span >= 2 * h + 1:  # two short ones tell where the border runs, a long one does not
            break
    if t1 < t0:
        return
    mask = 2.0 * half + 1.0
    m = min(n, int(span / mask) + 1)
    for i in range(m):
        wish = 0.5 if m == 1 else i / (m - 1.0)
        for k in range(7 * _PLACES):
            level, place = k // _PLACES, k % _PLACES
            if (level == 3 and rule[CLEAR_OF_PAINT] == 0.0) or (level == 4 and not far):
                continue
            if level == 1 and wanted <= rule[SEARCH_MIN]:  # as level 0
                continue
            t = wish + (place // 2 + place % 2) * (1.0 if place % 2 else -1.0) / 32.0
            if t < 0.0 or t > 1.0:
                continue
            t = t0 + t * (t1 - t0)
            u, v = on_line(l, a_u + t * d_u, a_v + t * d_v)
            taken = False
            for j in range(at, at + i):
                if I[j, STATUS] == OK:
                    taken |= max(abs(F[j, CENTRE] - u), abs(F[j, CENTRE + 1] - v)) < mask
            if taken:
                continue
            h = half if level < 5 else min(half, 7 - level)
            arm = 1 if level in (3, 4) or unknown else 3
            search = wanted if level in (0, 4) else min(wanted, rule[SEARCH_MIN])
            # the parabola looks one step beyond the mask's arm, and there at what is blurred into that pixel
            near = arm + 1.5
            if not (level == 4 or unknown):
                near = max(near, arm + 1.0 + rule[CLEAR_OF_PAINT] * rule[BLUR] / advance)
            reach = near + (search + 1.0 if level in (0, 1, 4) else 0.0)
            s0, s1, deep = _footprint(view, side, u, v, su, sv, au, av, h, reach)
            if level == 4:
                if _covered(paint, side, s0, s1, deep) > _SHARE:
                    continue
                s0, s1, deep = _footprint(view, side, u, v, su, sv, au, av, h, near)
                if _covered(paint, side, s0, s1, deep) > _SHARE_NEAR:
                    continue
            elif _blocked(paint, side, s0, s1, deep):
                continue
            put(F, I, at + i, u, v, su, sv, au, av, advance, h, search, arm)
            s0, s1, deep = _footprint(view, side, u, v, su, sv, au, av, h, 0.0)
            if _blocked(mouths, side, s0, s1, -math.inf):
                I[at + i, STATUS] = MAPPED
            break
