"""Rotations as 3x3 matrices; ``v_A = R_AB @ v_B``. Compiled, so that filter and renderer share them."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array


@kernel
def from_euler(phi: float, theta: float, psi: float) -> Array:
    """R_RB of 3-2-1 Euler angles [rad]: body to runway (or to local north-east-down).

    Source     any flight mechanics text, e.g. Etkin 1972, eq. (4.5,3) transposed.
    """
    R = np.empty((3, 3))
    fill_from_euler(phi, theta, psi, R)
    return R


@uncounted
def fill_from_euler(phi: float, theta: float, psi: float, R: Array) -> None:
    """`from_euler` into R (3, 3)."""
    cph, sph = math.cos(phi), math.sin(phi)
    cth, sth = math.cos(theta), math.sin(theta)
    cps, sps = math.cos(psi), math.sin(psi)
    R[0, 0] = cth * cps
    R[0, 1] = sph * sth * cps - cph * sps
    R[0, 2] = cph * sth * cps + sph * sps
    R[1, 0] = cth * sps
    R[1, 1] = sph * sth * sps + cph * cps
    R[1, 2] = cph * sth * sps - sph * cps
    R[2, 0] = -sth
    R[2, 1] = sph * cth
    R[2, 2] = cph * cth


@kernel
def to_euler(R_RB: Array) -> Array:
    """phi, theta, psi [rad] of R_RB, (3,); theta in [-pi/2, pi/2]."""
    out = np.empty(3)
    fill_to_euler(R_RB, out)
    return out


@uncounted
def fill_to_euler(R_RB: Array, out: Array) -> None:
    """`to_euler` into out (3,)."""
    out[0] = math.atan2(R_RB[2, 1], R_RB[2, 2])
    out[1] = math.asin(min(1.0, max(-1.0, -R_RB[2, 0])))
    out[2] = math.atan2(R_RB[1, 0], R_RB[0, 0])


@kernel
def camera_from_body(pan: float, tilt: float) -> Array:
    """R_CB of the two-axis platform: pan > 0 looks right, tilt > 0 looks up; zero looks along body x.

        R_KB = Ry(tilt) Rz(pan),  K: x optical axis, y right, z down;  C: x right, y down, z optical axis

    Source     Dickmanns & Schell 1992, section 3 and fig. 2. Departs: C has its optical axis along z.
    """
    ca, sa = math.cos(pan), math.sin(pan)
    ce, se = math.cos(tilt), math.sin(tilt)
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = -sa, ca, 0.0
    R[1, 0], R[1, 1], R[1, 2] = se * ca, se * sa, ce
    R[2, 0], R[2, 1], R[2, 2] = ce * ca, ce * sa, -se
    return R


@kernel
def product(A: Array, B: Array) -> Array:
    """A B of two 3x3 matrices."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
    return out


@uncounted
def turned(R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R v of the vector v = (x, y, z)."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@uncounted
def back(R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R^T v of the vector v = (x, y, z)."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@kernel
def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    return math.atan2(math.sin(angle), math.cos(angle))
