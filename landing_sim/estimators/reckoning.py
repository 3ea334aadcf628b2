"""What gyros and airspeed tell of a flight that has not seen its runway: enough to keep the wings level and climb away."""

from __future__ import annotations

import math

from landing_sim.estimators.states import PHI, THETA, P, Q, R, U, W
from landing_sim.types import Array

GRAVITY = 9.80665
BANK_TIME = 15.0  # [s] after which the bank is what the turn says: of a gyro's bias of 0.1 deg/s it makes 1.5 deg
LOAD_PER_ALPHA = 5.0  # [g/rad] on an approach, where some 11 deg of angle of attack double the lift


def reckoned(x: Array, gyro: Array, airspeed: float, dt: float) -> Array:
    """The state x (26,) dt [s] later: p q r as read, phi and theta by them from wings level and the pitch it began with.

    u is the airspeed [m/s]; w that by which the path has not followed the pitch yet, from the trim it began in. In a turn
    without sideslip tan(phi) is V / g times its rate: that is what the bank drifts towards. Nothing tells the pitch but
    its rate: it drifts with the gyro's bias, and is of use for damping, not for a climb angle.
    """
    x = x.copy()
    p, q, r = gyro.tolist()
    phi, theta, V = float(x[PHI]), float(x[THETA]), max(airspeed, 1.0)
    turn = q * math.sin(phi) + r * math.cos(phi)
    x[PHI] += dt * (p + math.tan(theta) * turn - (phi - math.atan(V * turn / GRAVITY)) / BANK_TIME)
    x[THETA] += dt * (q * math.cos(phi) - r * math.sin(phi))
    x[W] = followed(float(x[W]), q, V, dt)
    x[P], x[Q], x[R], x[U] = p, q, r, airspeed
    return x


def followed(w: float, q: float, V: float, dt: float) -> float:
    """w [m/s] dt [s] later: by how much the path lags behind a pitch that changes at q [rad/s], at the airspeed V [m/s]."""
    return (w + dt * V * q) / (1.0 + dt * GRAVITY * LOAD_PER_ALPHA / V)
