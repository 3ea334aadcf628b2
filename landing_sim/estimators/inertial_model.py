"""Measurement equations of the gyros and the airspeed sensor, with Jacobians over all states."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.estimators.states import BP, PHI, WX, N, P, U
from landing_sim.geometry.so3 import from_euler, turned
from landing_sim.jit import kernel
from landing_sim.types import Array


@kernel
def gyro_model(x: Array, z: Array) -> tuple[Array, Array]:
    """Innovation (3,) and H (3, 26) of z = (p, q, r) + bias."""
    nu = np.empty(3)
    Hx = np.zeros((3, N))
    for i in range(3):
        nu[i] = z[i] - x[P + i] - x[BP + i]
        Hx[i, P + i] = 1.0
        Hx[i, BP + i] = 1.0
    return nu, Hx


@kernel
def airspeed_model(x: Array, z: float) -> tuple[Array, Array]:
    """Innovation (1,) and H (1, 26) of z = |u - R_BR w|."""
    Hx = np.zeros((1, N))
    R = from_euler(x[PHI], x[PHI + 1], x[PHI + 2])
    wB = turned(R.T.copy(), x[WX], x[WX + 1], x[WX + 2])
    a = np.empty(3)
    V2 = 0.0
    for i in range(3):
        a[i] = x[U + i] - wB[i]
        V2 += a[i] * a[i]
    V = math.sqrt(V2)
    for i in range(3):
        a[i] /= V
        Hx[0, U + i] = a[i]
    for j in range(3):
        Hx[0, WX + j] = -(R[j, 0] * a[0] + R[j, 1] * a[1] + R[j, 2] * a[2])
    cph, sph = math.cos(x[PHI]), math.sin(x[PHI])
    cth, sth = math.cos(x[PHI + 1]), math.sin(x[PHI + 1])
    # du_a/dangle = omega x w_B, omega the axis about which the angle turns the body
    cx, cy, cz = wB[1] * a[2] - wB[2] * a[1], wB[2] * a[0] - wB[0] * a[2], wB[0] * a[1] - wB[1] * a[0]
    Hx[0, PHI] = cx
    Hx[0, PHI + 1] = cph * cy - sph * cz
    Hx[0, PHI + 2] = -sth * cx + cth * sph * cy + cth * cph * cz
    nu = np.empty(1)
    nu[0] = z - V
    return nu, Hx
