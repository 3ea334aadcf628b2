"""How fast the wind may change where turbulence is reported: the filter's process noise of its wind states.

Source     MIL-F-8785C (1980), section 3.7.3.4: intensity and scale of turbulence near the ground, from the wind at 20 ft.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.types import Array

_FOOT = 0.3048  # [m]


def change(height: float, wind_20ft: float, airspeed: float, dt: float) -> Array:
    """Variance (3,) [m^2/s^2] of what wx, wy, wz change by within dt [s] of flight at `height` [m] and `airspeed` [m/s].

    2 sigma^2 (1 - exp(-V dt / L)): exact for the longitudinal component, near enough for the others.
    """
    h = min(max(height / _FOOT, 10.0), 1000.0)
    base = 0.177 + 0.000823 * h
    vertical = 0.1 * wind_20ft
    along, down = vertical / base**0.4, vertical
    far, near = _FOOT * h / base**1.2, _FOOT * h
    level = -2.0 * along**2 * math.expm1(-airspeed * dt / far)
    return np.array([level, level, -2.0 * down**2 * math.expm1(-airspeed * dt / near)])
