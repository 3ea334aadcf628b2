"""Windows on the threshold: in the strips that no stripe follows, or, from far off, over all of it."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import THRESHOLD
from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.layout import (
    BLUR,
    BRIGHTER,
    FEATURE,
    INNER,
    MASK,
    OFFSET,
    OUT,
    OUTER,
    SHORT,
    SLOPE,
    START,
    STATUS,
    STRIPES,
    UNIT,
    breadth,
    path,
    put,
    search_range,
)
from landing_sim.vision.masks import REACH, pulled
from landing_sim.vision.prediction import NEAR, View, dot, in_image, point

_BESIDE = 1.5  # [px] between the end of a mask and paint beside it: there, room is short
_NARROW = 3.5  # [px] strips free of paint are no use below: what is beside them is blurred into all of their width


@kernel
def in_metres(runway: Array, width: float) -> Array:
    """The runway's fields, those of an unknown one by its believed width [m]."""
    out = runway.copy()
    if out[UNIT] > 0.0:
        for k in range(len(out)):
            if k not in (SLOPE, BRIGHTER, UNIT):
                out[k] *= width
    return out


@kernel
def clean_strips(width: float, outer: float, inner: float) -> Array:
    """(k, 2) [m] y0, y1: where no paint follows the threshold, the outer ones first.

    outer, inner [m]: |y| of the outermost and innermost side of the stripes, 0 without any. With 6 stripes on 29 m: 3.7 m
    at each side, 3.6 m at the centre. Elsewhere the stripe's own edge, 6 m in, is only 0.7 px behind the threshold's at
    950 m and would pull a measurement inwards. Strips narrower than 1.5 m at the sides are left out: the borderline is in
    the windows there, and with 16 stripes on 60 m it pulls the range by 7 m.
    """
    half = 0.5 * width
    if outer <= 0.0:
        return np.array([[-half, 0.0], [0.0, half]])
    if outer >= half - 1.5:
        return np.array([[-inner, inner]])
    return np.array([[-half, -outer], [outer, half], [-inner, inner]])


@kernel
def place_threshold(
    F: Array, I: np.ndarray, at: int, n: int, view: View, sigma: float, rule: Array, runway: Array
) -> int:
    """n windows in rows at.. on the strips of the threshold that no paint follows; returns how many are in view.

    They search along the runway's image, so that the profile stays in its strip, with masks as long as the strip allows.
    From so far away that no strip can be told apart they take all there is between the borders, and by how much the
    stripes then pull the edge outwards is taken off what they measure.
    """
    for i in range(at, at + n):
        I[i, FEATURE], I[i, STATUS] = THRESHOLD, OUT
    q, qd, row = view.threshold, view.along, view.lines[THRESHOLD]
    if q[2] < NEAR:
        return 0
    t_u, t_v = qd[0] * q[2] - q[0] * qd[2], qd[1] * q[2] - q[1] * qd[2]
    norm = max(math.hypot(t_u, t_v), 1e-300)
    su, sv, au, av, advance = path(row, t_u / norm, t_v / norm)
    if advance < 0.1:  # the runway's image runs along the threshold's: search normal to it instead
        su, sv, au, av, advance = path(row, 0.0, 0.0)
    search = search_range(rule, sigma, advance)
    blurred = 2.0 * _BESIDE * math.hypot(su, sv) / abs(su * av - sv * au)
    strips = clean_strips(view.width, runway[OUTER], runway[INNER])
    wide = breadth(view)
    resolved = runway[OUTER] <= 0.0
    for k in range(len(strips)):
        resolved |= (strips[k, 1] - strips[k, 0]) * wide >= _NARROW * view.width
    pull = 0.0
    if not resolved:
        side = 0.5 * view.width * (1.0 - blurred / max(wide, blurred))
        strips, blurred = np.array([[-side, 0.0], [0.0, side]]), 0.0
        begin, end = point(q, qd, runway[START]), point(q, qd, runway[START] + runway[STRIPES])
        pull = pulled(
            dot(row, begin) / (begin[2] * advance), dot(row, end) / (end[2] * advance), runway[BRIGHTER],
            rule[BLUR] / advance,
        )  # fmt: skip
    n_strips, n_usable = len(strips), 0
    ends, room = np.empty((n_strips, 4)), np.empty(n_strips)
    for attempt in range(2):  # far off and from the side no strip has room for the full distance: then half of it
        n_usable = 0
        for k in range(n_strips):
            q_a, q_b = point(q, view.across, strips[k, 0]), point(q, view.across, strips[k, 1])
            if q_a[2] < NEAR or q_b[2] < NEAR:
                continue
            e = ends[n_usable]
            e[0], e[1] = q_a[0] / q_a[2], q_a[1] / q_a[2]
            e[2], e[3] = q_b[0] / q_b[2] - e[0], q_b[1] / q_b[2] - e[1]
            room[n_usable] = max(abs(e[2]), abs(e[3])) - blurred / (1.0 + attempt)
            if room[n_usable] >= 1.0:
                n_usable += 1
        if n_usable > 0:
            break
    seen, per_strip = 0, (n + n_usable - 1) // max(1, n_usable)
    for turn in range(per_strip):
        for k in range(n_usable):
            half = int((min(rule[MASK], room[k]) - 1.0) / 2.0)
            fit = min(per_strip, int(room[k] / (2 * half + 1))) if attempt == 0 or not resolved else 1
            if seen == n or turn >= fit:
                continue
            t = (turn + 0.5) / fit
            u, v = ends[k, 0] + t * ends[k, 2], ends[k, 1] + t * ends[k, 3]
            mu = (search + REACH + 0.5) * abs(su) + half * abs(au) + 1.5
            mv = (search + REACH + 0.5) * abs(sv) + half * abs(av) + 1.5
            if mu <= u <= view.frame[0] - 1.0 - mu and mv <= v <= view.frame[1] - 1.0 - mv:
                put(F, I, at + seen, u, v, su, sv, au, av, advance, half, search, 3 if resolved else 1)
                F[at + seen, OFFSET] = -pull * math.hypot(su, sv)
                seen += 1
    if n_usable == 0:
        reach = 0.5 * view.width
        lo, hi = in_image(q, view.across, -reach, reach, 0.0, 0.0, view.frame)
        if lo < hi:
            for i in range(at, at + n):
                I[i, STATUS] = SHORT
    return seen
