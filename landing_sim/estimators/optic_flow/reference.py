"""The reference descent: what the lander was meant to do, computed before the flight and known on board.

Pitch and thrust are splines through knots; eq. (2) makes the rest. The knots are a solution of the boundary values that the
paper gives for the start (1,496 m, 56.9 m/s along, 44.9 m/s down, pitch -53.4 deg) and of ours for the end: 10 m above the
ground, 1 m/s down, upright, at rest along it.

Source     Sabiron et al. 2014, section V, for the start. The trajectory itself is not published: ours.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.optic_flow.dynamics import Lander
from landing_sim.jit import kernel
from landing_sim.types import Array

DURATION = 46.528354931  # [s]
HEIGHT = 1496.0  # [m]
OMEGA_X, OMEGA_Z = math.radians(2.18), math.radians(-1.72)  # [rad/s]
RATE, MASS = math.radians(-0.92), 758.0  # [rad/s], [kg]
PITCH_KNOTS = np.radians(
    [-53.43, -53.862688, -46.860007, -36.587131, -25.919959, -16.30753, -8.343995, -2.452399, 0.0]
)  # equispaced, slopes RATE and 0 at the ends
THRUST_KNOTS = np.array(
    [1998.483014, 2034.999833, 2121.002798, 2236.214881, 2353.051311, 2443.462856, 2483.463804]
)  # [N] equispaced, natural ends
PAPERS = Lander()


@dataclass(frozen=True, slots=True)
class Reference:
    """table (n, 9): X* (5,), a* = u_th*/m* [m/s^2], spin* = (R/I) u_theta* [rad/s^2], m* [kg], x* [m]; every `step` [s].

    After its end the reference stays as it was there.
    """

    lander: Lander
    step: float
    table: Array

    @property
    def duration(self) -> float:
        return self.step * (len(self.table) - 1)

    def at(self, t: float) -> Array:
        """(9,) at time t [s]."""
        return _at(self.table, self.step, t)

    def state(self, t: float) -> Array:
        """X* (5,)"""
        return _at(self.table, self.step, t)[:5]

    def inputs(self, t: float) -> tuple[float, float]:
        """u_th*, u_theta* [N]."""
        row = _at(self.table, self.step, t)
        return float(row[5] * row[7]), float(row[6] / self.lander.agility)


@kernel
def _at(table: Array, step: float, t: float) -> Array:
    last = table.shape[0] - 1
    place = min(max(t / step, 0.0), last - 1e-9)
    k = int(place)
    share = place - k
    return (1.0 - share) * table[k] + share * table[k + 1]


@functools.cache
def reference(lander: Lander = PAPERS, step: float = 0.005) -> Reference:
    """Integrated once; the last row is at the last whole step before DURATION."""
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    pitch = CubicSpline(np.linspace(0.0, DURATION, 9), PITCH_KNOTS, bc_type=((1, RATE), (1, 0.0)))
    thrust = CubicSpline(np.linspace(0.0, DURATION, 7), THRUST_KNOTS, bc_type="natural")
    bend = pitch.derivative(2)

    def rates(t: float, state: Array) -> Array:
        return lander.rates(state, float(thrust(t)), float(bend(t)) / lander.agility)

    start = [0.0, HEIGHT, OMEGA_X * HEIGHT, OMEGA_Z * HEIGHT, float(pitch(0.0)), RATE, MASS]
    t = step * np.arange(int(DURATION / step) + 1)
    x, h, vx, vz, theta, q, m = solve_ivp(
        rates, (0.0, t[-1]), start, "DOP853", t_eval=t, rtol=1e-11, atol=1e-10, max_step=0.5
    ).y
    columns = (h, q, vx / h, vz / h, theta, thrust(t) / m, bend(t), m, x)
    return Reference(lander, step, np.ascontiguousarray(np.column_stack(columns)))
