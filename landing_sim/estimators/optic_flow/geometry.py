"""What a strapped-down motion sensor sees over flat ground, and what several of them say together.

    omega(alpha) = 1/2 (1 - cos 2a) omega_x + 1/2 sin 2a omega_z - q,   a = alpha + theta                     (5)

alpha is the sensor's direction below the body's horizontal, forward; theta > 0 tilts the thrust forward (nose down), q is
its rate; omega_x = V_x/h and omega_z = V_z/h [rad/s] with V_z > 0 upwards. omega is the rate at which a point of the ground
turns in body axes, > 0 towards larger angles.

Source     Sabiron et al. 2014, eqs. (3)-(9). Departs: (6)-(8) are printed with factors 1/2 missing. H must be
           1/2 [1, cos 2 alpha, sin 2 alpha]; (7) prints no 1/2 at all, (8) only the first.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array

H, Q, WX, WZ, THETA = range(5)
"""Order of the state X = [h, q, omega_x, omega_z, theta]."""


@kernel
def flow(X: Array, alpha: float) -> float:
    """omega [rad/s] of the sensor at alpha [rad] (5)."""
    a = alpha + X[4]
    s, c = math.sin(a), math.cos(a)
    return s * s * X[2] + s * c * X[3] - X[1]


@kernel
def flow_row(X: Array, alpha: float, out: Array) -> None:
    """out (5,) = d omega / dX."""
    a = alpha + X[4]
    s2, c2 = math.sin(2.0 * a), math.cos(2.0 * a)
    out[0] = 0.0
    out[1] = -1.0
    out[2] = 0.5 * (1.0 - c2)
    out[3] = 0.5 * s2
    out[4] = s2 * X[2] + c2 * X[3]


def fusion(alpha: Array) -> Array:
    """H (n, 3) with omega = H Y: eqs. (6)-(8) corrected. alpha (n,) [rad]."""
    return 0.5 * np.column_stack([np.ones_like(alpha), np.cos(2.0 * alpha), np.sin(2.0 * alpha)])


def left_inverse(alpha: Array) -> Array:
    """(H'H)^-1 H' (3, n). Raises ValueError where the directions do not determine Y: condition (9)."""
    if len(alpha) < 3 or (len(alpha) == 3 and abs(spread(alpha)) < 1e-6):
        raise ValueError(f"motion sensors at {np.degrees(alpha).round(3)} deg do not tell rotation from translation")
    return np.asarray(np.linalg.pinv(fusion(np.asarray(alpha, dtype=float))))


def spread(alpha: Array) -> float:
    """The left side of (9) for three sensors: zero where H cannot be inverted."""
    a, b, c = alpha
    return math.sin(2 * (c - b)) + math.sin(2 * (a - c)) + math.sin(2 * (b - a))


def outputs(X: Array) -> Array:
    """Y (3,) [rad/s], what n >= 3 flows are equivalent to (6)."""
    s2, c2 = math.sin(2.0 * X[THETA]), math.cos(2.0 * X[THETA])
    return np.array([X[WX] - 2.0 * X[Q], -c2 * X[WX] + s2 * X[WZ], s2 * X[WX] + c2 * X[WZ]])
