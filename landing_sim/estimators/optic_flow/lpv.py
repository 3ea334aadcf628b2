"""Sabiron et al. 2014's linear parameter-varying model and observer, for deviations dX from the reference.

    dX' = A dX + B du,   Y = Y* + C dX,   C = (C1, C2)                                                    (10)-(14)
    Xbar = M X,  M = diag(I2, C2):   Xbar' = Abar Xbar + Bbar du - S^-1 Cbar' (Yhat - Y)                      (18)
    S' = -1/2 (Theta S + S Theta) - Abar' S - S Abar + Cbar' W Cbar                                           (19)

Departs    (19) prints Theta S, which is not symmetric unless Theta is a multiple of I: S loses definiteness at once. Its
           symmetric part is meant (the same for scalar Theta). Abar is (M' + M A) M^-1 whole, not the block diagonal of the
           text, which would let h and q grow as e^t. W is I as published, or the flows' information.
           Det C2 = -2 omega_z: in hover, and only there, M cannot be inverted.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.estimators.optic_flow.geometry import THETA, WX, WZ, Q
from landing_sim.jit import kernel
from landing_sim.types import Array

SCALE = np.array([1e-3, 1.0, 1.0, 1.0, 1.0])
"""h in km: all states are then of the order of one, and matrices of them well conditioned."""


@kernel
def output_matrix(X: Array, C: Array) -> None:
    """C (3, 5) = (C1, C2) at X: eqs. (10), (11), (14)."""
    s2, c2 = math.sin(2.0 * X[4]), math.cos(2.0 * X[4])
    C[:, :] = 0.0
    C[0, 1] = -2.0
    C[0, 2] = 1.0
    C[1, 2] = -c2
    C[1, 3] = s2
    C[1, 4] = 2.0 * (X[2] * s2 + X[3] * c2)
    C[2, 2] = s2
    C[2, 3] = c2
    C[2, 4] = 2.0 * (X[2] * c2 - X[3] * s2)


def c2(X: Array) -> Array:
    """C2 (3, 3) of eq. (10); its determinant is -2 omega_z."""
    C = np.empty((3, 5))
    output_matrix(X, C)
    return C[:, 2:].copy()


def c2_rate(X: Array, X_dot: Array) -> Array:
    """d/dt C2 (3, 3) along a motion with X' = X_dot: section IV.B."""
    s, c = math.sin(2.0 * X[THETA]), math.cos(2.0 * X[THETA])
    q, wx, wz, wx_dot, wz_dot = X[Q], X[WX], X[WZ], X_dot[WX], X_dot[WZ]
    c23 = 2.0 * (2.0 * q * c * wx + s * wx_dot - 2.0 * q * s * wz + c * wz_dot)
    c33 = 2.0 * (-2.0 * q * s * wx + c * wx_dot - 2.0 * q * c * wz - s * wz_dot)
    return np.array([[0.0, 0.0, 0.0], [2.0 * q * s, 2.0 * q * c, c23], [2.0 * q * c, -2.0 * q * s, c33]])


def input_matrix(X: Array, mass: float, agility: float) -> Array:
    """B (5, 2) for du = (du_th, du_theta) [N]: eq. (14)."""
    B = np.zeros((5, 2))
    B[WX, 0] = math.sin(X[THETA]) / (mass * X[0])
    B[WZ, 0] = math.cos(X[THETA]) / (mass * X[0])
    B[Q, 1] = agility
    return B


def barred(X: Array, X_dot: Array, A: Array) -> tuple[Array, Array]:
    """M and Abar = (M' + M A) M^-1, both (5, 5). Raises LinAlgError in hover."""
    M, M_dot = np.eye(5), np.zeros((5, 5))
    M[2:, 2:], M_dot[2:, 2:] = c2(X), c2_rate(X, X_dot)
    return M, (M_dot + M @ A) @ np.linalg.inv(M)


C_BAR = np.array([[0.0, -2.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]])
"""(C1, I3): what Y is of Xbar, at all times."""
