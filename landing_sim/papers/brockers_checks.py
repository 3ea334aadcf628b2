"""What Brockers et al. 2012 states as equations, as printed and as used here, against differences and a body at rest."""

from __future__ import annotations

import numpy as np

from landing_sim.estimators.strapdown_ekf import propagate
from landing_sim.geometry.so3 import from_euler
from landing_sim.types import Array

G = 9.797
ATTITUDES = np.array([[0.0, 0.0, 0.0], [0.2, -0.1, 1.0], [-0.3, 0.25, -2.5]])


def transition(euler: Array, dt: float = 1e-3) -> Array:
    """(9, 9) by central differences of (1) to (3): the state after dt over the state before."""
    a_B, columns = np.array([0.4, -0.7, -G]), []
    for j in range(9):
        e = np.zeros(9)
        e[j] = 1e-3
        up, down = (propagate(x, np.zeros((9, 9)), a_B, euler, euler, dt, np.zeros(3), G)[0] for x in (e, -e))
        columns.append((up - down) / 2e-3)
    return np.column_stack(columns)


def error_model_error(sign: float) -> float:
    """Largest difference of dv' over db [1] from `sign` C: +1 is (5) as printed, -1 what is used."""
    dt, worst = 1e-3, 0.0
    for euler in ATTITUDES:
        slope = transition(euler, dt)[3:6, 6:] / dt
        worst = max(worst, float(np.abs(slope - sign * from_euler(*euler)).max()))
    return worst


def at_rest(sign: float) -> float:
    """[m/s^2] that (2) makes of a body at rest, whose accelerometers feel the ground's push; `sign` of g: -1 as printed."""
    felt = np.array([0.0, 0.0, -G])
    return float(np.linalg.norm(felt + sign * np.array([0.0, 0.0, G])))
