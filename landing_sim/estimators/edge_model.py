"""Measurement equation of the edge windows and its Jacobian by the filter's states (eqs. 4 and 7), compiled."""

from __future__ import annotations

import numpy as np

from landing_sim.estimators.states import EPAN, ETILT, JPAN, JTILT, PHI, PSI, THETA, WIDTH, H, X, Y
from landing_sim.geometry.runway_edge import BY_PAN, BY_PHI, BY_TILT, BY_WIDTH, crossing, turning_axes
from landing_sim.geometry.so3 import camera_from_body, from_euler, product, turned
from landing_sim.jit import kernel
from landing_sim.types import Array


@kernel
def edge_model(
    x: Array,
    feature: Array,
    centre: Array,
    direction: Array,
    pan: float,
    tilt: float,
    lever: Array,
    focal: Array,
    slope: float,
    h: Array,
    Hx: Array,
) -> None:
    """Fill h (n,) [px] and Hx (n, 26) = dh/dx for n windows.

    x (26,) layout of `states`; feature (n,) Feature codes; centre, direction (n, 2) [px]; pan, tilt [rad] as the encoders
    say (their errors are part of x: reading = true + bias + noise); lever (3,) camera in body axes [m]; focal (3,) f, cx,
    cy [px].
    """
    R_RB = from_euler(x[PHI], x[THETA], x[PSI])
    true_pan = pan - x[EPAN] - x[JPAN]
    R_CR = product(camera_from_body(true_pan, tilt - x[ETILT] - x[JTILT]), R_RB.T.copy())
    p_RC, arm = np.empty(3), turned(R_RB, lever[0], lever[1], lever[2])
    p_RC[0], p_RC[1], p_RC[2] = arm[0] + x[X], arm[1] + x[Y], arm[2] - x[H]
    axes, J = turning_axes(x[PHI], x[THETA], true_pan), np.empty((1, 9))
    row: int = np.int64(0)  # type: ignore[assignment]  # numba compiles a constant for itself
    for i in range(Hx.shape[0]):
        for k in range(Hx.shape[1]):
            Hx[i, k] = 0.0
        h[i] = crossing(
            feature[i], centre[i, 0], centre[i, 1], direction[i, 0], direction[i, 1], p_RC, R_CR, R_RB, axes, lever, focal,
            x[WIDTH], slope, J, row,
        )  # fmt: skip
        for k in range(3):
            Hx[i, X + k], Hx[i, PHI + k] = J[0, k], J[0, BY_PHI + k]
        Hx[i, EPAN] = Hx[i, JPAN] = -J[0, BY_PAN]  # true = reading - errors
        Hx[i, ETILT] = Hx[i, JTILT] = -J[0, BY_TILT]
        Hx[i, WIDTH] = J[0, BY_WIDTH]
