"""Putting windows on the predicted lines: the compiled part of `windows`.

Along its predicted line each window gets an exact centre, a search path, a mask length and a search range; what cannot be
looked at keeps its row and gets a status.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import HORIZON, LEFT, RIGHT, THRESHOLD
from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.border import place_border
from landing_sim.vision.layout import (
    AHEAD,
    ALONG,
    CENTRE,
    CLEAR,
    CORNER,
    DIRECTION,
    EXTRA_SIGMA,
    FEATURE,
    HALF,
    LENGTH,
    LOOKED,
    MASK,
    OFFSET,
    OK,
    ORIGIN,
    OUT,
    SEARCH,
    SEPARATION,
    SHORT,
    SLOPE,
    STATUS,
    STEP,
    UNIT,
    horizon_hidden,
    on_line,
    path,
    put,
    search_range,
)
from landing_sim.vision.masks import REACH
from landing_sim.vision.prediction import WIDTH, View, dot, feature_line, in_image, look, oriented, point, spread
from landing_sim.vision.threshold import in_metres, place_threshold


@kernel
def _place_horizon(F: Array, I: np.ndarray, at: int, n: int, view: View, sigma: float, rule: Array) -> None:
    """n windows in rows at.. spread over the horizon, where no runway lies right below it."""
    sky, half = view.lines[HORIZON], int(rule[MASK]) // 2
    feature: int = np.int64(HORIZON)  # type: ignore[assignment]  # numba compiles a constant for itself
    arm: int = np.int64(3)  # type: ignore[assignment]
    su, sv, au, av, advance = path(sky, 0.0, 0.0)
    search = search_range(rule, sigma, advance)
    mu = (search + REACH) * abs(su) + half * abs(au) + 3.0
    mv = (search + REACH) * abs(sv) + half * abs(av) + 3.0
    upright = abs(sky[1]) >= abs(sky[0])
    h0 = np.array([0.0, -sky[2] / sky[1], 1.0]) if upright else np.array([-sky[2] / sky[0], 0.0, 1.0])
    hd = np.array([1.0, -sky[0] / sky[1], 0.0]) if upright else np.array([-sky[1] / sky[0], 1.0, 0.0])
    lo, hi = in_image(h0, hd, -1e9, 1e9, mu, mv, view.frame)
    if horizon_hidden(view):
        hi = lo
    below = rule[SEPARATION] + (search + REACH) * advance
    for i in range(at, at + n):
        I[i, FEATURE], I[i, STATUS] = HORIZON, OUT
        if lo >= hi:
            continue
        I[i, STATUS] = SHORT
        wish = 0.5 if n == 1 else (i - at) / (n - 1.0)
        for k in range(65):
            t = wish + (k // 2 + k % 2) * (1.0 if k % 2 else -1.0) / 32.0
            if t < 0.0 or t > 1.0:
                continue
            q = point(h0, hd, lo + t * (hi - lo))
            u, v = q[0], q[1]
            q[0] -= below * sky[0]
            q[1] -= below * sky[1]
            if min(dot(view.lines[LEFT], q), dot(view.lines[RIGHT], q)) > -(half + 1.0):
                continue
            l = sky.copy()
            for _ in range(4):  # the horizon's line turns with the azimuth it is looked at
                line = feature_line(feature, view.p_RC, view.R_CR, view.lens, view.width, view.slope, u, v)
                oriented(line, view.up, l)
                u, v = on_line(l, u, v)
            su, sv, au, av, advance = path(l, 0.0, 0.0)
            put(F, I, i, u, v, su, sv, au, av, advance, half, search, arm)
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
    """F (n, 12), I (n, 11) and the width and height [px] of all windows.

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
    F, I = np.zeros((most, 12)), np.zeros((most, 11), dtype=np.int64)
    F[:, :DIRECTION] = np.nan
    n_T = counts[THRESHOLD]
    seen = place_threshold(F, I, 0, n_T, view, sigma[THRESHOLD], rule, runway)
    n_L, n_R = counts[LEFT] + (n_T - seen + 1) // 2, counts[RIGHT] + (n_T - seen) // 2
    for side in range(2):  # LEFT, RIGHT: a variable, since a constant would be compiled for itself
        at, count = (n_T, n_L) if side == LEFT else (n_T + n_L, n_R)
        place_border(F, I, at, count, side, view, sigma, rule, paint, mouths, unknown)
    _place_horizon(F, I, n_T + n_L + n_R, counts[HORIZON], view, sigma[HORIZON], rule)
    n = n_T + n_L + n_R + counts[HORIZON]
    F, I = F[:n], I[:n]

    size = np.zeros(2, dtype=np.int64)
    for i in range(n):
        if I[i, STATUS] == OK:
            for c in range(2):
                reach = (I[i, SEARCH] + REACH) * abs(F[i, STEP + c]) + I[i, HALF] * abs(F[i, ALONG + c])
                size[c] = max(size[c], min(2 * math.ceil(reach) + 4, int(frame[c])))
    for i in range(n):
        if I[i, STATUS] == OK:
            c = 1 if F[i, ALONG] == 1.0 and abs(F[i, STEP + 1]) == 1.0 else 0
            shift = (round(F[i, CENTRE + c]) - F[i, CENTRE + c]) * F[i, STEP + c]
            F[i, OFFSET] += shift * math.hypot(F[i, STEP], F[i, STEP + 1])
            for k in range(2):
                F[i, ORIGIN + k] = F[i, CENTRE + k] + shift * F[i, STEP + k]
                low = math.floor(F[i, ORIGIN + k]) - size[k] // 2 + 1
                corner = min(int(frame[k]) - size[k], max(0, low))
                I[i, CORNER + k] = corner
                reach = (I[i, SEARCH] + REACH) * abs(F[i, STEP + k]) + I[i, HALF] * abs(F[i, ALONG + k]) + 1e-6
                I[i, LOOKED + k] = max(0, math.floor(F[i, ORIGIN + k] - reach) - corner)
                I[i, LOOKED + 2 + k] = min(size[k], math.floor(F[i, ORIGIN + k] + reach) + 2 - corner)
    return F, I, size[0], size[1]


@kernel
def to_look_at(I: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (m,) of the windows to look at, the top-left pixels (m, 2) of their images, what is wanted of these (m, 4)."""
    rows, corners = np.empty(len(I), dtype=np.int64), np.empty((len(I), 2), dtype=np.int64)
    looked = np.empty((len(I), 4), dtype=np.int64)
    m = 0
    for i in range(len(I)):
        if I[i, STATUS] == OK:
            rows[m] = i
            for k in range(2):
                corners[m, k] = I[i, CORNER + k]
            for k in range(4):
                looked[m, k] = I[i, LOOKED + k]
            m += 1
    return rows[:m], corners[:m], looked[:m]
