"""The camera's pose from map points found in its image: robust Gauss-Newton on fisheye pixels.

Source     Klein & Murray 2007, section 5.4 (Tukey's biweight, scale from the median).
           Departs: pixels of an equidistant fisheye; the covariance is handed on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.slam.lens import seen, slopes, small_turn, solve_spd

TUKEY = 4.685  # [sigma] beyond which an observation has no weight
STEPS = 12
SMALLEST_SIGMA = 0.05  # [px] alignment is never believed to be better than this


class Pose(NamedTuple):
    """A camera's pose: q_C = R_CR (X_R - p_RC)."""

    R_CR: Array  # (3, 3)
    p_RC: Array  # (3,) [m]


class Fit(NamedTuple):
    """What came of a fit."""

    pose: Pose
    used: np.ndarray  # (n,) bool: observations with weight
    sigma: float  # [px] robust spread of the residuals, of a pixel of the level that each was found in
    cov: Array  # (6, 6) of small turns of C [rad] and of p_RC [m]


def turned(R_1: Array, R_2: Array) -> float:
    """[rad] the angle between two attitudes (3, 3)."""
    return math.acos(min(1.0, max(-1.0, 0.5 * (float(np.sum(R_1 * R_2)) - 1.0))))


def fit_pose(start: Pose, X: Array, uv: Array, size: Array, f: float, cx: float, cy: float) -> Fit | None:
    """Pose from points X (n, 3) found at uv (n, 2) [px], with standard deviations in the ratio of size (n,).

    None with fewer than 6 points, or if the fit does not hold together.
    """
    if len(X) < 6:
        return None
    R, p = start.R_CR.copy(), start.p_RC.copy()
    used, cov = np.zeros(len(X), np.bool_), np.empty((6, 6))
    sigma = _fit(R, p, X, uv, size, f, cx, cy, used, cov)
    return Fit(Pose(R, p), used, sigma, cov) if sigma > 0.0 else None


@kernel
def _fit(
    R: Array, p: Array, X: Array, uv: Array, size: Array, f: float, cx: float, cy: float, used: np.ndarray, cov: Array
) -> float:
    """Refines R, p in place; sigma, or -1."""
    n = X.shape[0]
    e, J = np.empty((n, 2)), np.empty((n, 2, 6))
    norm = np.empty(n)
    D = np.empty((2, 3))
    sigma = -1.0
    for step in range(STEPS + 1):
        for i in range(n):
            dx, dy, dz = X[i, 0] - p[0], X[i, 1] - p[1], X[i, 2] - p[2]
            x = R[0, 0] * dx + R[0, 1] * dy + R[0, 2] * dz
            y = R[1, 0] * dx + R[1, 1] * dy + R[1, 2] * dz
            z = R[2, 0] * dx + R[2, 1] * dy + R[2, 2] * dz
            if not x * x + y * y + z * z > 1e-6:
                return -1.0
            u, v = seen(x, y, z, f, cx, cy)
            slopes(x, y, z, f, D)
            e[i, 0], e[i, 1] = (uv[i, 0] - u) / size[i], (uv[i, 1] - v) / size[i]
            norm[i] = math.hypot(e[i, 0], e[i, 1])
            for r in range(2):
                a, b, c = D[r, 0] / size[i], D[r, 1] / size[i], D[r, 2] / size[i]
                J[i, r, 0] = c * y - b * z  # q + w x q
                J[i, r, 1] = a * z - c * x
                J[i, r, 2] = b * x - a * y
                for k in range(3):  # - R dp
                    J[i, r, 3 + k] = -(a * R[0, k] + b * R[1, k] + c * R[2, k])
        sigma = max(np.median(norm) / 1.1774, SMALLEST_SIGMA)  # median of a Rayleigh distribution
        H, g = np.zeros((6, 6)), np.zeros(6)
        count = 0
        for i in range(n):
            a = (norm[i] / (TUKEY * sigma)) ** 2
            used[i] = a < 1.0
            if a >= 1.0:
                continue
            w = (1.0 - a) ** 2
            count += 1
            for r in range(2):
                for j in range(6):
                    g[j] += w * J[i, r, j] * e[i, r]
                    for k in range(j + 1):
                        H[j, k] += w * J[i, r, j] * J[i, r, k]
        if count < 6:
            return -1.0
        for j in range(6):
            for k in range(j):
                H[k, j] = H[j, k]
        if step == STEPS:
            break
        if not solve_spd(H.copy(), g):
            return -1.0
        W = small_turn(g[0], g[1], g[2])
        R[:, :] = W @ R
        for k in range(3):
            p[k] += g[3 + k]
        if g[0] * g[0] + g[1] * g[1] + g[2] * g[2] < 1e-14 and g[3] * g[3] + g[4] * g[4] + g[5] * g[5] < 1e-14:
            break
    for j in range(6):
        b = np.zeros(6)
        b[j] = sigma * sigma
        if not solve_spd(H.copy(), b):
            return -1.0
        cov[:, j] = b
    return sigma
