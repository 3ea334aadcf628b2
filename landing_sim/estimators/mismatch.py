"""How far off a believed aircraft may be: relative errors of its parameters as errors of force and moment coefficients.

The parameters themselves are not told apart in one approach. What they do together is, near the trim, an offset of three
coefficients that stays through the flight, and that a filter can estimate.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from landing_sim.estimators import states
from landing_sim.estimators.aircraft_model import downwash, dynamics, parameters
from landing_sim.estimators.belief import AircraftBelief
from landing_sim.types import Array

_HIGH = 100.0  # [m] free of the ground's effect


def offset_sigma(
    belief: AircraftBelief, airspeed: float, flap: float, aero_sigma: float, mass_sigma: float
) -> tuple[float, float, float]:
    """1 sigma of what coefficients X, Z and m lack at `airspeed` [m/s] and `flap`, where the parameters are off as
    `AircraftBelief.perturbed` draws them: each by itself, to first order, root of the sum of squares."""
    x, shadow = _level(belief, airspeed, flap)
    acceleration = _accelerations(belief, x, shadow)
    total = np.zeros(3)
    for names, sigma in ((belief.aerodynamic(), aero_sigma), (("mass", "CL_flap"), mass_sigma)):
        for name in names:
            off = replace(belief, **{name: getattr(belief, name) * (1.0 + sigma)})
            total += (_accelerations(off, x, shadow) - acceleration) ** 2
    force = 0.5 * belief.rho * airspeed**2 * belief.S
    X, Z, m = np.sqrt(total) * [belief.mass / force, belief.mass / force, belief.Iyy / (force * belief.c)]
    return float(X), float(Z), float(m)


def _accelerations(belief: AircraftBelief, x: Array, shadow: Array) -> Array:
    """u', w' [m/s^2] and q' [rad/s^2]."""
    f = np.empty(12)
    par = parameters(belief, 0.0)
    settled = shadow.copy()
    settled[5] = downwash(x, math.atan2(x[states.W], x[states.U]), shadow[3], par)
    dynamics(x, settled, par, f, np.empty((12, states.DRIVING)), False)
    return f[[0, 2, 4]]


def _level(belief: AircraftBelief, airspeed: float, flap: float) -> tuple[Array, Array]:
    """State and shadow of steady level flight, by Newton's method on angle of attack, elevator and thrust."""

    def at(v: Array) -> tuple[Array, Array]:
        x = np.zeros(states.N)
        x[[states.U, states.W]] = airspeed * math.cos(v[0]), airspeed * math.sin(v[0])
        x[states.THETA], x[states.H] = v[0], _HIGH
        return x, np.array([v[1], 0.0, 0.0, flap, v[2] * belief.mass, 0.0])

    v = np.array([0.0, 0.0, 1.0])  # rad, rad, m/s^2
    for _ in range(8):
        f = _accelerations(belief, *at(v))
        J = np.column_stack([(_accelerations(belief, *at(v + d)) - f) / 1e-5 for d in 1e-5 * np.eye(3)])
        v = v - np.linalg.solve(J, f)
    return at(v)
