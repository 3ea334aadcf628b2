"""Putting windows on the predicted lines: the compiled part of `windows`.

A window is a row of two arrays: floats F (n, 12) and integers I (n, 7), in the columns named below. Along its predicted
line each gets an exact centre, a search path, a mask length and a search range; what cannot be looked at keeps its row and
gets a status.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import HORIZON, LEFT, RIGHT, THRESHOLD
from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.masks import REACH, pulled
from landing_sim.vision.prediction import NEAR, WIDTH, View, cut, dot, feature_line, in_image, look, oriented, spread

# columns of F; the first five take two
CENTRE, DIRECTION, STEP, ALONG, ORIGIN, NORMAL_STEP, OFFSET = 0, 2, 4, 6, 8, 10, 11
FEATURE, STATUS, HALF, SEARCH, CORNER, ARM = 0, 1, 2, 3, 4, 6  # columns of I; CORNER takes two
MASK, SIGMAS, SEARCH_MIN, SEARCH_MAX, EXTRA_SIGMA, SEPARATION, BLUR = 0, 1, 2, 3, 4, 5, 6  # fields of the rule
# fields of the runway, [m] if UNIT is 0, in widths of it if 1 (unknown): length; |y| of the outermost and of the innermost
# side of the stripes; where they begin, how long they are, and their mean contrast over the surface's; how far behind the
# threshold no border is looked for; how far ahead of the aircraft one is, whatever the length
LENGTH, SLOPE, OUTER, INNER, START, STRIPES, BRIGHTER, CLEAR, AHEAD, UNIT = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9

_OK, _OUT, _MAPPED, _SHORT = 0, 1, 4, 5  # values of signals.Status
_SHEAR = 3.0  # a threshold window's path follows the runway's image up to this slant
_CLEAR = 2.0  # [px] between a mask and another edge
_BESIDE = 1.5  # [px] between the end of a threshold mask and paint beside it: there, room is short
_PROFILE = 4.5  # steps from the edge that the mask's profile reaches; two less with an arm of 1
_BEYOND = 60.0  # [m] how far past the runway's end its graded strip goes on: ICAO Annex 14, 3.4
_PLACES = 17  # places tried around each regular one, 1/32 of the line apart
_FAR = 45.0  # [px] breadth of the threshold below which no mask fits between the marks along a border
_NARROW = 3.5  # [px] strips free of paint are no use below: what is beside them is blurred into all of their width
_OPPOSITE = 1.5  # [px] between what a border's mask looks at and the other border
_SHARE, _SHARE_NEAR = 0.4, 0.12  # of a mask's length on paint: within the search range, and within the mask's profile


@kernel
def _path(l: Array, du: float, dv: float) -> tuple[float, float, float, float, float]:
    """Step, along and normal advance of a window on the unit line l that searches along (du, dv), l . (du, dv) > 0.

    (0, 0) searches along the pixel axis nearer to the normal.
    """
    if abs(l[1]) >= abs(l[0]):
        su = min(_SHEAR, max(-_SHEAR, du / abs(dv))) if dv != 0.0 else 0.0
        sv, au, av = math.copysign(1.0, l[1]), 1.0, -l[0] / l[1]
    else:
        sv = min(_SHEAR, max(-_SHEAR, dv / abs(du))) if du != 0.0 else 0.0
        su, au, av = math.copysign(1.0, l[0]), -l[1] / l[0], 1.0
    return su, sv, au, av, l[0] * su + l[1] * sv


@kernel
def _range(rule: Array, sigma: float, advance: float) -> float:
    """Search half-width [steps]."""
    return min(rule[SEARCH_MAX], max(rule[SEARCH_MIN], math.ceil(rule[SIGMAS] * sigma / advance)))


@kernel
def _on_line(l: Array, u: float, v: float) -> tuple[float, float]:
    """The point of l near (u, v) that is whole along the edge, so that nothing is interpolated there."""
    if abs(l[1]) >= abs(l[0]):
        u = float(round(u))
        return u, -(l[0] * u + l[2]) / l[1]
    v = float(round(v))
    return -(l[1] * v + l[2]) / l[0], v


@kernel
def _put(
    F: Array, I: np.ndarray, at: int, u: float, v: float, su: float, sv: float, au: float, av: float, advance: float,
    half: int, search: float, arm: int,
) -> None:  # fmt: skip
    size = math.hypot(su, sv)
    F[at, CENTRE], F[at, CENTRE + 1] = u, v
    F[at, DIRECTION], F[at, DIRECTION + 1] = su / size, sv / size
    F[at, STEP], F[at, STEP + 1], F[at, ALONG], F[at, ALONG + 1] = su, sv, au, av
    F[at, NORMAL_STEP] = advance
    I[at, STATUS], I[at, HALF], I[at, SEARCH], I[at, ARM] = _OK, half, int(search), arm


@kernel
def _hidden(view: View) -> bool:
    """Whether the horizon is: by a runway that rises, from who is lower than its far end."""
    return view.slope > 0.0 and -view.p_RC[2] < (view.length + _BEYOND) * math.tan(view.slope)


@kernel
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


@kernel
def _blocked(rows: Array, side: int, s0: float, s1: float, y: float) -> bool:
    """Whether a footprint meets one of the rows x0, x1, Feature, |y|: it reaches inwards to |y| = `y`."""
    for k in range(len(rows)):  # noqa: SIM110 a generator cannot be compiled
        if rows[k, 2] == side and s1 > rows[k, 0] and s0 < rows[k, 1] and y < rows[k, 3]:
            return True
    return False


@kernel
def _covered(rows: Array, side: int, s0: float, s1: float, y: float) -> float:
    """Share of a footprint's length that meets such rows."""
    length = 0.0
    for k in range(len(rows)):
        if rows[k, 2] == side and y < rows[k, 3]:
            length += max(0.0, min(s1, rows[k, 1]) - max(s0, rows[k, 0]))
    return length / max(1e-9, s1 - s0)


@kernel
def _breadth(view: View) -> float:
    """[px] from corner to corner of the threshold, along the pixel axis nearer to it; 0 if one is behind the camera."""
    q_a = view.threshold - 0.5 * view.width * view.across
    q_b = view.threshold + 0.5 * view.width * view.across
    if q_a[2] < NEAR or q_b[2] < NEAR:
        return 0.0
    return max(abs(q_b[0] / q_b[2] - q_a[0] / q_a[2]), abs(q_b[1] / q_b[2] - q_a[1] / q_a[2]))


@kernel
def _place_border(
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
    within the smallest one; else within the mask itself, the test for ambiguity standing guard; else little of it, which
    is what a far runway shows; else with shorter masks.
    """
    for i in range(at, at + n):
        I[i, FEATURE], I[i, STATUS] = side, _OUT
    l, length, half = view.lines[side], view.length, int(rule[MASK]) // 2
    su, sv, au, av, advance = _path(l, 0.0, 0.0)
    wanted = _range(rule, sigma[side], advance)
    mu = (wanted + REACH) * abs(su) + half * abs(au) + 2.0
    mv = (wanted + REACH) * abs(sv) + half * abs(av) + 2.0
    q0, qd = view.threshold + (side - 0.5) * view.width * view.across, view.along
    lo, hi = in_image(q0, qd, 0.0, length, mu, mv, view.frame)
    if lo >= hi:
        return
    for i in range(at, at + n):
        I[i, STATUS] = _SHORT
    far = 0.0 < _breadth(view) < _FAR
    other, sky, row, apart = view.lines[1 - side], view.lines[HORIZON], view.lines[THRESHOLD], rule[SEPARATION]
    beside = min(apart, (REACH + _OPPOSITE) * advance)
    lo, hi = cut(dot(other, q0) - beside * q0[2], dot(other, qd) - beside * qd[2], lo, hi)
    if not _hidden(view):
        lo, hi = cut(-dot(sky, q0) - apart * q0[2], -dot(sky, qd) - apart * qd[2], lo, hi)
    if lo >= hi:
        return
    q_a, q_b = q0 + lo * qd, q0 + hi * qd
    a_u, a_v = q_a[0] / q_a[2], q_a[1] / q_a[2]
    d_u, d_v = q_b[0] / q_b[2] - a_u, q_b[1] / q_b[2] - a_v
    t0 = t1 = span = 0.0
    for h in range(half, 0, -1):
        # the mask, the runway's side of its profile included, stays clear of the threshold and of the far end
        depth = h * abs(row[0] * au + row[1] * av) + _CLEAR + 2.0 * sigma[THRESHOLD]
        depth += 3.5 * max(0.0, -(row[0] * su + row[1] * sv))
        inset = depth / max(1e-9, abs(row[0] * d_u + row[1] * d_v))
        t0, t1 = inset if lo <= 0.0 else 0.0, 1.0 - (inset if hi >= length and not unknown else 0.0)
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
        for k in range(6 * _PLACES):
            level, place = k // _PLACES, k % _PLACES
            if level == 3 and not far:
                continue
            t = wish + (place // 2 + place % 2) * (1.0 if place % 2 else -1.0) / 32.0
            if t < 0.0 or t > 1.0:
                continue
            t = t0 + t * (t1 - t0)
            u, v = _on_line(l, a_u + t * d_u, a_v + t * d_v)
            taken = False
            for j in range(at, at + i):
                if I[j, STATUS] == _OK:
                    taken |= max(abs(F[j, CENTRE] - u), abs(F[j, CENTRE + 1] - v)) < mask
            if taken:
                continue
            h = half if level < 4 else min(half, 6 - level)
            arm = 1 if level == 3 or unknown else 3
            search = wanted if level in (0, 3) else min(wanted, rule[SEARCH_MIN])
            near = _PROFILE - 3.0 + arm
            reach = near + (search + 1.0 if level in (0, 1, 3) else 0.0)
            s0, s1, deep = _footprint(view, side, u, v, su, sv, au, av, h, reach)
            if level == 3:
                if _covered(paint, side, s0, s1, deep) > _SHARE:
                    continue
                s0, s1, deep = _footprint(view, side, u, v, su, sv, au, av, h, near)
                if _covered(paint, side, s0, s1, deep) > _SHARE_NEAR:
                    continue
            elif _blocked(paint, side, s0, s1, deep):
                continue
            _put(F, I, at + i, u, v, su, sv, au, av, advance, h, search, arm)
            s0, s1, deep = _footprint(view, side, u, v, su, sv, au, av, h, 0.0)
            if _blocked(mouths, side, s0, s1, -math.inf):
                I[at + i, STATUS] = _MAPPED
            break


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
def _place_threshold(
    F: Array, I: np.ndarray, at: int, n: int, view: View, sigma: float, rule: Array, runway: Array
) -> int:
    """n windows in rows at.. on the strips of the threshold that no paint follows; returns how many are in view.

    They search along the runway's image, so that the profile stays in its strip, with masks as long as the strip allows.
    From so far away that no strip can be told apart they take all there is between the borders, and by how much the
    stripes then pull the edge outwards is taken off what they measure.
    """
    for i in range(at, at + n):
        I[i, FEATURE], I[i, STATUS] = THRESHOLD, _OUT
    q, qd, row = view.threshold, view.along, view.lines[THRESHOLD]
    if q[2] < NEAR:
        return 0
    t_u, t_v = qd[0] * q[2] - q[0] * qd[2], qd[1] * q[2] - q[1] * qd[2]
    norm = max(math.hypot(t_u, t_v), 1e-300)
    su, sv, au, av, advance = _path(row, t_u / norm, t_v / norm)
    if advance < 0.1:  # the runway's image runs along the threshold's: search normal to it instead
        su, sv, au, av, advance = _path(row, 0.0, 0.0)
    search = _range(rule, sigma, advance)
    blurred = 2.0 * _BESIDE * math.hypot(su, sv) / abs(su * av - sv * au)
    strips = clean_strips(view.width, runway[OUTER], runway[INNER])
    wide = _breadth(view)
    resolved = runway[OUTER] <= 0.0
    for k in range(len(strips)):
        resolved |= (strips[k, 1] - strips[k, 0]) * wide >= _NARROW * view.width
    pull = 0.0
    if not resolved:
        side = 0.5 * view.width * (1.0 - blurred / max(wide, blurred))
        strips, blurred = np.array([[-side, 0.0], [0.0, side]]), 0.0
        begin, end = q + runway[START] * qd, q + (runway[START] + runway[STRIPES]) * qd
        pull = pulled(
            dot(row, begin) / (begin[2] * advance), dot(row, end) / (end[2] * advance), runway[BRIGHTER],
            rule[BLUR] / advance,
        )  # fmt: skip
    n_strips, n_usable = len(strips), 0
    ends, room = np.empty((n_strips, 4)), np.empty(n_strips)
    for attempt in range(2):  # far off and from the side no strip has room for the full distance: then half of it
        n_usable = 0
        for k in range(n_strips):
            q_a, q_b = q + strips[k, 0] * view.across, q + strips[k, 1] * view.across
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
                _put(F, I, at + seen, u, v, su, sv, au, av, advance, half, search, 3 if resolved else 1)
                F[at + seen, OFFSET] = -pull * math.hypot(su, sv)
                seen += 1
    if n_usable == 0:
        reach = 0.5 * view.width
        lo, hi = in_image(q, view.across, -reach, reach, 0.0, 0.0, view.frame)
        if lo < hi:
            for i in range(at, at + n):
                I[i, STATUS] = _SHORT
    return seen


@kernel
def _place_horizon(F: Array, I: np.ndarray, at: int, n: int, view: View, sigma: float, rule: Array) -> None:
    """n windows in rows at.. spread over the horizon, where no runway lies right below it."""
    sky, half = view.lines[HORIZON], int(rule[MASK]) // 2
    su, sv, au, av, advance = _path(sky, 0.0, 0.0)
    search = _range(rule, sigma, advance)
    mu = (search + REACH) * abs(su) + half * abs(au) + 3.0
    mv = (search + REACH) * abs(sv) + half * abs(av) + 3.0
    upright = abs(sky[1]) >= abs(sky[0])
    h0 = np.array([0.0, -sky[2] / sky[1], 1.0]) if upright else np.array([-sky[2] / sky[0], 0.0, 1.0])
    hd = np.array([1.0, -sky[0] / sky[1], 0.0]) if upright else np.array([-sky[1] / sky[0], 1.0, 0.0])
    lo, hi = in_image(h0, hd, -1e9, 1e9, mu, mv, view.frame)
    if _hidden(view):
        hi = lo
    below = rule[SEPARATION] + (search + REACH) * advance
    for i in range(at, at + n):
        I[i, FEATURE], I[i, STATUS] = HORIZON, _OUT
        if lo >= hi:
            continue
        I[i, STATUS] = _SHORT
        wish = 0.5 if n == 1 else (i - at) / (n - 1.0)
        for k in range(65):
            t = wish + (k // 2 + k % 2) * (1.0 if k % 2 else -1.0) / 32.0
            if t < 0.0 or t > 1.0:
                continue
            q = h0 + (lo + t * (hi - lo)) * hd
            u, v = q[0], q[1]
            q[0] -= below * sky[0]
            q[1] -= below * sky[1]
            if min(dot(view.lines[LEFT], q), dot(view.lines[RIGHT], q)) > -(half + 1.0):
                continue
            l = sky
            for _ in range(4):  # the horizon's line turns with the azimuth it is looked at
                l = oriented(
                    feature_line(HORIZON, view.p_RC, view.R_CR, view.lens, view.width, view.slope, u, v), view.up
                )
                u, v = _on_line(l, u, v)
            su, sv, au, av, advance = _path(l, 0.0, 0.0)
            _put(F, I, i, u, v, su, sv, au, av, advance, half, search, 3)
            break


@kernel
def place(
    sight: Array,
    cov: Array,
    lever: Array,
    lens: Array,
    frame: Array,
    runway: Array,
    paint: Array,
    mouths: Array,
    counts: np.ndarray,
    rule: Array,
) -> tuple[Array, np.ndarray, int, int]:
    """F (n, 12), I (n, 7) and the width and height [px] of all windows.

    sight (9,), cov (9, 9): see `prediction`; lens: f, cx, cy; frame: width, height; runway, paint, mouths as RunwayMap
    gives them; counts (4,) windows by Feature; rule: see the columns.
    """
    unknown, width = runway[UNIT] > 0.0, sight[WIDTH]
    if unknown:
        runway = in_metres(runway, width)
        runway[LENGTH] = max(runway[LENGTH], sight[0] + runway[AHEAD])
        paint = np.array([[0.0, runway[CLEAR], LEFT, width], [0.0, runway[CLEAR], RIGHT, width]])
    view = look(sight, lever, lens, frame, runway[LENGTH], runway[SLOPE])
    sigma = spread(view, sight, cov, lever, rule[EXTRA_SIGMA])
    most = counts[0] + counts[1] + 2 * counts[2] + counts[3]
    F, I = np.zeros((most, 12)), np.zeros((most, 7), dtype=np.int64)
    F[:, :DIRECTION] = np.nan
    n_T = counts[THRESHOLD]
    seen = _place_threshold(F, I, 0, n_T, view, sigma[THRESHOLD], rule, runway)
    n_L, n_R = counts[LEFT] + (n_T - seen + 1) // 2, counts[RIGHT] + (n_T - seen) // 2
    _place_border(F, I, n_T, n_L, LEFT, view, sigma, rule, paint, mouths, unknown)
    _place_border(F, I, n_T + n_L, n_R, RIGHT, view, sigma, rule, paint, mouths, unknown)
    _place_horizon(F, I, n_T + n_L + n_R, counts[HORIZON], view, sigma[HORIZON], rule)
    n = n_T + n_L + n_R + counts[HORIZON]
    F, I = F[:n], I[:n]

    size = np.zeros(2, dtype=np.int64)
    for i in range(n):
        if I[i, STATUS] == _OK:
            for c in range(2):
                reach = (I[i, SEARCH] + REACH) * abs(F[i, STEP + c]) + I[i, HALF] * abs(F[i, ALONG + c])
                size[c] = max(size[c], 2 * math.ceil(reach) + 4)
    for c in range(2):
        size[c] = min(size[c], int(frame[c]))
    for i in range(n):
        if I[i, STATUS] == _OK:
            c = 1 if F[i, ALONG] == 1.0 and abs(F[i, STEP + 1]) == 1.0 else 0
            shift = (round(F[i, CENTRE + c]) - F[i, CENTRE + c]) * F[i, STEP + c]
            F[i, OFFSET] += shift * math.hypot(F[i, STEP], F[i, STEP + 1])
            for k in range(2):
                F[i, ORIGIN + k] = F[i, CENTRE + k] + shift * F[i, STEP + k]
                low = math.floor(F[i, ORIGIN + k]) - size[k] // 2 + 1
                I[i, CORNER + k] = min(int(frame[k]) - size[k], max(0, low))
    return F, I, size[0], size[1]
