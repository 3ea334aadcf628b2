"""What one image says of an unknown runway, free of its scale: bearings, angular width, borders.

In levelled axes along the runway, from the camera, with the threshold's middle at (X, Y, Z) ahead, right, down:

    y1 = Y / X,   y2 = Z / X,   s = W / X,      k = (Y -+ W/2) / Z     (lateral over height of the borders)

Source     Gibert et al. 2015, eq. (2) and the appendix (heading from the vanishing point). Departs: the corners' rays are
           turned into the runway's levelled axes before they are divided, so that rotation drops out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from landing_sim.estimators.line_fit import CENTRE, COV, USED, cross_rows, fit_rows
from landing_sim.estimators.lines import LineConfig
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import HORIZON, LEFT, RIGHT, THRESHOLD, horizon_dip
from landing_sim.geometry.so3 import camera_from_body, product, to_euler, turned
from landing_sim.geometry.vanishing import down_of
from landing_sim.jit import kernel
from landing_sim.signals import EdgeSet
from landing_sim.types import Array

_MIN_BASELINE, _LIMIT = LineConfig().min_baseline, LineConfig().limit
_FOUND = 0  # of signals.Status
LEVEL_SIGMA = 2e-3  # [rad] of the roll that is believed
SHORT = 20.0  # [px] between windows that then tell the threshold's direction worse than the roll does


@dataclass(frozen=True, slots=True)
class Bearings:
    """Of one image; None what it does not show."""

    turned: tuple[Array, Array] | None  # (2,) [rad] runway's heading less the believed, vanishing point's rise; (2, 2)
    level: tuple[float, float] | None  # [rad] roll, pitch believed less the horizon's, whose dip is that from `height`
    threshold: tuple[Array, Array] | None  # y1, y2, s and their variances (3,), (3,)
    borders: tuple[Array, Array] | None  # k of the left and right border and their variances (2,), (2,)


def bearings(
    z: Array,
    R: Array,
    edges: EdgeSet,
    lens: Intrinsics,
    R_RB: Array,
    camera_error: tuple[float, float],
    height: float,
) -> Bearings:
    """From the edges of an image (measurement "edges": z, R, geometry).

    R_RB (3, 3): attitude as believed; camera_error [rad]: of the pan and tilt read; height [m] of the camera, for the dip.
    """
    seen = see(
        z, R, edges.feature, edges.status, edges.centre, edges.direction, edges.pan - camera_error[0],
        edges.tilt - camera_error[1], np.array([lens.f, lens.cx, lens.cy]), R_RB, height,
    )  # fmt: skip
    return Bearings(
        None if math.isnan(seen.turned[0]) else (seen.turned, seen.turned_cov),
        None if math.isnan(seen.level[0]) else seen.level,
        None if math.isnan(seen.y[0]) else (seen.y, seen.y_var),
        None if math.isnan(seen.k[0]) else (seen.k, seen.k_var),
    )


class Seen(NamedTuple):
    """`Bearings` with NaN for what the image does not show."""

    turned: Array
    turned_cov: Array
    level: tuple[float, float]
    y: Array
    y_var: Array
    k: Array
    k_var: Array


@kernel
def see(
    z: Array, R: Array, feature: np.ndarray, status: np.ndarray, centre: Array, direction: Array, pan: float, tilt: float,
    lens: Array, R_RB: Array, height: float,
) -> Seen:  # fmt: skip
    """`bearings` of edges seen by a camera at pan and tilt [rad] as they are believed to be; lens (3,) f, cx, cy."""
    directions, directions_cov = np.full(2, np.nan), np.full((2, 2), np.nan)
    y, y_var, k, k_var = np.full(3, np.nan), np.full(3, np.nan), np.full(2, np.nan), np.full(2, np.nan)
    R_BC = camera_from_body(pan, tilt).T.copy()
    level = _level_threshold(feature, status, centre, product(R_RB, R_BC), lens)
    rows = fit_rows(z, R, feature, status, centre, direction, lens, horizon_dip(height), level, _MIN_BASELINE, _LIMIT)
    off = (math.nan, math.nan)
    horizon = rows[HORIZON]
    if horizon[USED] > 0.0:
        c = -(horizon[0] * horizon[CENTRE] + horizon[1] * horizon[CENTRE + 1])
        down = down_of(horizon[0], horizon[1], c, lens[0], lens[1], lens[2])
        down = turned(R_BC, down[0], down[1], down[2])
        phi, theta, _ = to_euler(R_RB)
        off = phi - math.atan2(down[1], down[2]), theta - math.asin(min(1.0, max(-1.0, -down[0])))
    R_RC = product(R_RB, R_BC)
    _see_vanishing(rows, R_RC, lens, directions, directions_cov)
    _see_threshold(rows, R_RC, lens, y, y_var)
    _see_borders(rows, R_RC, lens, k, k_var)
    return Seen(directions, directions_cov, off, y, y_var, k, k_var)


@kernel
def _level_threshold(feature: np.ndarray, status: np.ndarray, centre: Array, R_RC: Array, lens: Array) -> Array:
    """Prior (4,) of `fit_row`: the direction that a level threshold across the runway must have, where its windows are too
    close to tell."""
    prior, lo, hi, mean = np.zeros(4), np.full(2, np.inf), np.full(2, -np.inf), np.zeros(2)
    m = 0
    for i in range(len(feature)):
        if feature[i] == THRESHOLD and status[i] == _FOUND:
            m += 1
            for k in range(2):
                mean[k] += centre[i, k]
                lo[k], hi[k] = min(lo[k], centre[i, k]), max(hi[k], centre[i, k])
    if m == 0 or max(hi[0] - lo[0], hi[1] - lo[1]) > SHORT:
        return prior
    u, v = mean[0] / m - lens[1], mean[1] / m - lens[2]
    across_u, across_v = lens[0] * R_RC[1, 0] - u * R_RC[1, 2], lens[0] * R_RC[1, 1] - v * R_RC[1, 2]
    along_u, along_v = lens[0] * R_RC[0, 0] - u * R_RC[0, 2], lens[0] * R_RC[0, 1] - v * R_RC[0, 2]
    size = math.hypot(across_u, across_v)
    if across_u * along_v - across_v * along_u < 0.0:
        size = -size
    prior[0], prior[1], prior[2], prior[3] = -across_v / size, across_u / size, LEVEL_SIGMA, 1.0
    return prior


@kernel
def _ray(R_RC: Array, u: float, v: float, lens: Array) -> tuple[float, float, float]:
    return turned(R_RC, (u - lens[1]) / lens[0], (v - lens[2]) / lens[0], 1.0)


@kernel
def _see_vanishing(rows: Array, R_RC: Array, lens: Array, out: Array, cov: Array) -> None:
    """Heading and rise of the borders' vanishing point and their covariance."""
    if rows[LEFT, USED] == 0.0 or rows[RIGHT, USED] == 0.0:
        return
    ok, uv, cov_uv = cross_rows(rows, np.array([[LEFT, RIGHT]]))
    w = _ray(R_RC, uv[0, 0], uv[0, 1], lens)
    if not ok or w[0] <= 0.05:
        return
    level = math.hypot(w[0], w[1])
    out[0], out[1] = math.atan2(w[1], w[0]), math.atan2(-w[2], level)
    J = np.empty((2, 2))
    for k in range(2):
        along = (w[0] * R_RC[0, k] + w[1] * R_RC[1, k]) / level
        J[0, k] = (w[0] * R_RC[1, k] - w[1] * R_RC[0, k]) / (level * level * lens[0])
        J[1, k] = -(level * R_RC[2, k] - w[2] * along) / ((level * level + w[2] * w[2]) * lens[0])
    _carried(J, cov_uv, cov)


@kernel
def _see_threshold(rows: Array, R_RC: Array, lens: Array, y: Array, var: Array) -> None:
    """y1, y2, s of the threshold's corners and their variances."""
    if rows[LEFT, USED] == 0.0 or rows[RIGHT, USED] == 0.0 or rows[THRESHOLD, USED] == 0.0:
        return
    ok, uv, cov_uv = cross_rows(rows, np.array([[THRESHOLD, LEFT], [THRESHOLD, RIGHT]]))
    left, right = _ray(R_RC, uv[0, 0], uv[0, 1], lens), _ray(R_RC, uv[1, 0], uv[1, 1], lens)
    if not ok or left[0] <= 0.05 or right[0] <= 0.05:
        return
    s = right[1] / right[0] - left[1] / left[0]
    if not s > 0.0:
        return
    y[0], y[1] = 0.5 * (left[1] / left[0] + right[1] / right[0]), 0.5 * (left[2] / left[0] + right[2] / right[0])
    y[2] = s
    J = np.zeros((3, 4))  # d(r_i / r_1) by the pixel
    for corner in range(2):
        ray, sign = (left, -1.0) if corner == 0 else (right, 1.0)
        for k in range(2):
            for i in range(2):
                g = (R_RC[1 + i, k] - ray[1 + i] / ray[0] * R_RC[0, k]) / (lens[0] * ray[0])
                J[i, 2 * corner + k] = 0.5 * g
                if i == 0:
                    J[2, 2 * corner + k] = sign * g
    full = np.empty((3, 3))
    _carried(J, cov_uv, full)
    for i in range(3):
        var[i] = full[i, i]


@kernel
def _see_borders(rows: Array, R_RC: Array, lens: Array, k: Array, var: Array) -> None:
    """k of the borders, at the middle of what is seen of each, where a wrong heading matters least for the least noise."""
    at, spread = np.empty(2), np.empty(2)
    for i in range(2):
        line = rows[i]
        ray = _ray(R_RC, line[CENTRE], line[CENTRE + 1], lens)
        if line[USED] == 0.0 or ray[2] <= 1e-3 * math.hypot(ray[0], ray[1]):
            return
        at[i] = ray[1] / ray[2]
        across = 0.0
        for j in range(2):
            across += (R_RC[1, j] - at[i] * R_RC[2, j]) * line[j] / (lens[0] * ray[2])
        spread[i] = across * across * line[COV]
    if at[1] > at[0]:
        for i in range(2):
            k[i], var[i] = at[i], spread[i]


@kernel
def _carried(J: Array, cov: Array, out: Array) -> None:
    """out = J cov J'."""
    m, n = J.shape
    for i in range(m):
        for j in range(m):
            acc = 0.0
            for a in range(n):
                for b in range(n):
                    acc += J[i, a] * cov[a, b] * J[j, b]
            out[i, j] = acc
