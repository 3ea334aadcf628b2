"""Image dynamics of a point, and the change of coordinates that the observer of Gibert et al. is built on.

With y3 = 1/x3 and the rows of A and B of x' = A x + B,

    y1' = p1 + d1 y3,   d1 = b1 - b3 y1
    y2' = p2 + d2 y3,   d2 = b2 - b3 y2
    y3' = -r3 y3 - b3 y3^2

d is the speed with which nearness drives the point through the image: v3 times the angle from the focus of expansion. On a
glide path to the point itself d1 = d2 = 0, and no observer can tell its range from this.

Source     Gibert et al. 2015, section 3. Departs: (3) is printed with x1'/x3 for y1'; the derivative of y1 is
           (x1' - y1 x3')/x3, and only with it does |dPsi/dx| vanish with (5), as the text says: printed, it is b1/x3^4.
           (5) is printed "> 0"; what is needed is that d does not vanish or change its sign while the observer runs.
"""

from __future__ import annotations

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array


@kernel
def drift(y1: float, y2: float, A: Array, B: Array) -> tuple[float, float, float, float, float]:
    """p1, p2, r3 [1/s] and d1, d2 [m/s] at the image point y."""
    r3 = A[2, 0] * y1 + A[2, 1] * y2 + A[2, 2]
    p1 = A[0, 0] * y1 + A[0, 1] * y2 + A[0, 2] - y1 * r3
    p2 = A[1, 0] * y1 + A[1, 1] * y2 + A[1, 2] - y2 * r3
    return p1, p2, r3, B[0] - B[2] * y1, B[1] - B[2] * y2


def psi(x: Array, A: Array, B: Array, output: int = 1) -> Array:
    """Psi(x) (3,): y1, y1', y2 (output 1), or y1, y2, y2' (output 2, remark 1)."""
    y1, y2 = x[0] / x[2], x[1] / x[2]
    p1, p2, _, d1, d2 = drift(y1, y2, A, B)
    return np.array([y1, p1 + d1 / x[2], y2] if output == 1 else [y1, y2, p2 + d2 / x[2]])


@kernel
def rate_row(x: Array, A: Array, B: Array, output: int) -> tuple[float, float, float]:
    """How y_output' changes with y1, y2 and 1/x3, at x."""
    y1, y2, y3 = x[0] / x[2], x[1] / x[2], 1.0 / x[2]
    _, _, r3, d1, d2 = drift(y1, y2, A, B)
    if output == 1:
        return A[0, 0] - r3 - y1 * A[2, 0] - B[2] * y3, A[0, 1] - y1 * A[2, 1], d1
    return A[1, 0] - y2 * A[2, 0], A[1, 1] - r3 - y2 * A[2, 1] - B[2] * y3, d2


def jacobian(x: Array, A: Array, B: Array, output: int = 1) -> Array:
    """dPsi/dx (3, 3) of `psi`: the rows' derivatives by (y1, y2, 1/x3), times those by x."""
    r = 1.0 / x[2]
    chart = np.array([[r, 0.0, -x[0] * r * r], [0.0, r, -x[1] * r * r], [0.0, 0.0, -r * r]])
    rate = np.array(rate_row(x, A, B, output))
    rows = [[1.0, 0.0, 0.0], rate, [0.0, 1.0, 0.0]] if output == 1 else [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], rate]
    return np.array(rows) @ chart


def determinant(x: Array, B: Array, output: int = 1) -> float:
    """|dPsi/dx| = d1/x3^4 with output 1, -d2/x3^4 with output 2: A does not matter."""
    i = output - 1
    d = float(B[i] - B[2] * x[i] / x[2])
    return (d if output == 1 else -d) / float(x[2]) ** 4


@kernel
def pulled_back(
    x: Array, A: Array, B: Array, output: int, own: float, rate: float, other: float, floor: float
) -> Array:
    """[dPsi/dx]^-1 kappa (3,), for kappa's entries of y_output, y_output' and the other output.

    The inverse is exact as long as |d| >= floor [m/s]; below, 1/d is continued by d/floor^2: to zero, not to infinity.
    """
    n1, n2, d = rate_row(x, A, B, output)
    dy1, dy2 = (own, other) if output == 1 else (other, own)
    nearness = (rate - n1 * dy1 - n2 * dy2) * d / max(d * d, floor * floor)
    out = np.empty(3)
    out[0] = x[2] * (dy1 - x[0] * nearness)
    out[1] = x[2] * (dy2 - x[1] * nearness)
    out[2] = -x[2] * x[2] * nearness
    return out
