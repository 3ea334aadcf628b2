"""The equidistant fisheye as scalar kernels (geometry.fisheye has the same model for arrays), and small rotations.

A lens is passed as (f, cx, cy) [px], a pose as R_CR (3, 3) and p_RC (3,): q_C = R_CR (X_R - p_RC).
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array


@kernel
def seen(x: float, y: float, z: float, f: float, cx: float, cy: float) -> tuple[float, float]:
    """u, v [px] of the direction (x, y, z) in C."""
    rho = math.hypot(x, y)
    s = f * math.atan2(rho, z) / rho if rho > 1e-9 else f / z
    return cx + s * x, cy + s * y


@kernel
def ray(u: float, v: float, f: float, cx: float, cy: float) -> tuple[float, float, float]:
    """Unit direction in C of the pixel u, v."""
    x, y = (u - cx) / f, (v - cy) / f
    theta = math.hypot(x, y)
    s = math.sin(theta) / theta if theta > 1e-9 else 1.0
    return s * x, s * y, math.cos(theta)


@kernel
def slopes(x: float, y: float, z: float, f: float, J: Array) -> None:
    """J (2, 3) [px per unit] becomes the derivative of `seen` at (x, y, z)."""
    rho2 = x * x + y * y
    whole = rho2 + z * z
    if rho2 < 1e-10 * z * z:
        ratio, bend = 1.0 / z, -2.0 / (3.0 * z * z * z)
    else:
        rho = math.sqrt(rho2)
        ratio = math.atan2(rho, z) / rho
        bend = (z / whole - ratio) / rho2
    J[0, 0] = f * (ratio + x * x * bend)
    J[0, 1] = f * x * y * bend
    J[0, 2] = -f * x / whole
    J[1, 0] = J[0, 1]
    J[1, 1] = f * (ratio + y * y * bend)
    J[1, 2] = -f * y / whole


@kernel
def small_turn(wx: float, wy: float, wz: float) -> Array:
    """exp([w]x), (3, 3), of a rotation vector [rad] of any length (Rodrigues)."""
    a2 = wx * wx + wy * wy + wz * wz
    a = math.sqrt(a2)
    s = math.sin(a) / a if a > 1e-6 else 1.0 - a2 / 6.0
    c = (1.0 - math.cos(a)) / a2 if a > 1e-6 else 0.5 - a2 / 24.0
    W = np.empty((3, 3))
    W[0, 0] = 1.0 - c * (wy * wy + wz * wz)
    W[0, 1] = c * wx * wy - s * wz
    W[0, 2] = c * wx * wz + s * wy
    W[1, 0] = c * wx * wy + s * wz
    W[1, 1] = 1.0 - c * (wx * wx + wz * wz)
    W[1, 2] = c * wy * wz - s * wx
    W[2, 0] = c * wx * wz - s * wy
    W[2, 1] = c * wy * wz + s * wx
    W[2, 2] = 1.0 - c * (wx * wx + wy * wy)
    return W


@kernel
def solve_spd(A: Array, b: Array) -> bool:
    """x of A x = b into b, A (n, n) symmetric; False if it is not positive definite. A is overwritten."""
    n = b.shape[0]
    for j in range(n):
        d = A[j, j]
        for k in range(j):
            d -= A[j, k] * A[j, k]
        if not d > 1e-300:
            return False
        d = math.sqrt(d)
        A[j, j] = d
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            A[i, j] = s / d
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= A[i, k] * b[k]
        b[i] = s / A[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= A[k, i] * b[k]
        b[i] = s / A[i, i]
    return True
