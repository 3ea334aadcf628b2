"""What a window is made of: its columns, the rules for placing it, and how it lies on its line.

A window is a row of two arrays: floats F (n, 12) and integers I (n, 11). Its search path goes by whole pixels of the axis
nearer to its normal, its mask by whole pixels of the other.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array
from landing_sim.vision.prediction import NEAR, View, point

# columns of F; the first five take two
CENTRE, DIRECTION, STEP, ALONG, ORIGIN, NORMAL_STEP, OFFSET = 0, 2, 4, 6, 8, 10, 11
# columns of I; CORNER takes two, LOOKED four: of the window's pixels, columns and rows lo, and hi, that are looked at
FEATURE, STATUS, HALF, SEARCH, CORNER, ARM, LOOKED = 0, 1, 2, 3, 4, 6, 7
# fields of the rule
MASK, SIGMAS, SEARCH_MIN, SEARCH_MAX, EXTRA_SIGMA, SEPARATION, BLUR, CLEAR_OF_PAINT = 0, 1, 2, 3, 4, 5, 6, 7
# fields of the runway, [m] if UNIT is 0, in widths of it if 1 (unknown): length; |y| of the outermost and of the innermost
# side of the stripes; where they begin, how long they are, and their mean contrast over the surface's; how far behind the
# threshold no border is looked for; how far ahead of the aircraft one is, whatever the length
LENGTH, SLOPE, OUTER, INNER, START, STRIPES, BRIGHTER, CLEAR, AHEAD, UNIT = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9

OK, OUT, MAPPED, SHORT = 0, 1, 4, 5  # values of signals.Status
_SHEAR = 3.0  # a threshold window's path follows the runway's image up to this slant
_BEYOND = 60.0  # [m] how far past the runway's end its graded strip goes on: ICAO Annex 14, 3.4


@uncounted
def path(l: Array, du: float, dv: float) -> tuple[float, float, float, float, float]:
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


@uncounted
def search_range(rule: Array, sigma: float, advance: float) -> float:
    """Search half-width [steps]."""
    return min(rule[SEARCH_MAX], max(rule[SEARCH_MIN], math.ceil(rule[SIGMAS] * sigma / advance)))


@uncounted
def on_line(l: Array, u: float, v: float) -> tuple[float, float]:
    """The point of l near (u, v) that is whole along the edge, so that nothing is interpolated there."""
    if abs(l[1]) >= abs(l[0]):
        u = float(round(u))
        return u, -(l[0] * u + l[2]) / l[1]
    v = float(round(v))
    return -(l[1] * v + l[2]) / l[0], v


@uncounted
def put(
    F: Array, I: np.ndarray, at: int, u: float, v: float, su: float, sv: float, au: float, av: float, advance: float,
    half: int, search: float, arm: int,
) -> None:  # fmt: skip
    """Window `at`: centre (u, v), step (su, sv) across and (au, av) along the line, see the columns."""
    size = math.hypot(su, sv)
    F[at, CENTRE], F[at, CENTRE + 1] = u, v
    F[at, DIRECTION], F[at, DIRECTION + 1] = su / size, sv / size
    F[at, STEP], F[at, STEP + 1], F[at, ALONG], F[at, ALONG + 1] = su, sv, au, av
    F[at, NORMAL_STEP] = advance
    I[at, STATUS], I[at, HALF], I[at, SEARCH], I[at, ARM] = OK, half, int(search), arm


@kernel
def breadth(view: View) -> float:
    """[px] from corner to corner of the threshold, along the pixel axis nearer to it; 0 if one is behind the camera."""
    q_a = point(view.threshold, view.across, -0.5 * view.width)
    q_b = point(view.threshold, view.across, 0.5 * view.width)
    if q_a[2] < NEAR or q_b[2] < NEAR:
        return 0.0
    return max(abs(q_b[0] / q_b[2] - q_a[0] / q_a[2]), abs(q_b[1] / q_b[2] - q_a[1] / q_a[2]))


@uncounted
def horizon_hidden(view: View) -> bool:
    """Whether the horizon is: by a runway that rises, from who is lower than its far end."""
    return view.slope > 0.0 and -view.p_RC[2] < (view.length + _BEYOND) * math.tan(view.slope)
