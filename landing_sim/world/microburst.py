"""A microburst: air that falls in a round shaft, stagnates on the ground and flows out on all sides.

In cylinder coordinates about its axis, r outward and z up, with the shaft's radius R and f(z) = e^(-z/z*) - e^(-z/e):
    u_r =  lambda R^2 / (2 r) (1 - e^(-(r/R)^2)) f(z)
    u_z = -lambda e^(-(r/R)^2) (e (e^(-z/e) - 1) - z* (e^(-z/z*) - 1))
which conserves mass exactly: (1/r) d(r u_r)/dr + d u_z/dz = 0. It is steady, still air far from the axis.

Source     Oseguera & Bowles, "A simple, analytic 3-dimensional downburst model based on boundary layer stagnation flow",
           NASA TM-100632 (1988), from memory: the divergence above and the maximum's place check it (tests). With
           z* = 4.545 z_m and e = z_m / 2.75 the outflow is strongest at r = 1.1209 R and, nearly, at the height z_m.
Departs    lambda follows from the strongest outflow wanted, computed, not from the paper's rounded 0.2357 lambda R.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

RADIUS_OF_MAXIMUM = 1.1209064227785  # r/R where (1 - e^(-(r/R)^2)) / (r/R) is largest: 1 + 2 q = e^q, q = (r/R)^2
_ABOVE, _BELOW = 1.0 / 0.22, 1.0 / 2.75  # z*, e over z_m


@dataclass(frozen=True, slots=True)
class Microburst:
    """Oseguera-Bowles downburst.

    x, y : [m] its axis in R
    radius : [m] R, of the falling shaft
    outflow : [m/s] the strongest horizontal wind
    outflow_height : [m] z_m, where the outflow is strongest
    """

    x: float
    y: float = 0.0
    radius: float = 1000.0
    outflow: float = 15.0
    outflow_height: float = 40.0
    _rate: float = field(init=False, repr=False)  # [1/s] lambda

    def __post_init__(self) -> None:
        values = (self.x, self.y, self.radius, self.outflow, self.outflow_height)
        if not all(math.isfinite(value) for value in values):
            raise ValueError(f"microburst: every value must be a finite number, got {values}")
        if not (self.radius > 0.0 and self.outflow_height > 0.0 and self.outflow >= 0.0):
            raise ValueError("microburst: radius and outflow_height must be > 0 m, outflow >= 0 m/s")
        q = RADIUS_OF_MAXIMUM**2
        # f is largest where e^(z (1/e - 1/z*)) = z*/e
        z = math.log(_ABOVE / _BELOW) / (1.0 / _BELOW - 1.0 / _ABOVE)
        strongest = 0.5 * (1.0 - math.exp(-q)) / RADIUS_OF_MAXIMUM * (math.exp(-z / _ABOVE) - math.exp(-z / _BELOW))
        object.__setattr__(self, "_rate", self.outflow / (self.radius * strongest))

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        above, below = _ABOVE * self.outflow_height, _BELOW * self.outflow_height
        z = height if height > 0.0 else 0.0
        dx, dy = x - self.x, y - self.y
        q = (dx * dx + dy * dy) / (self.radius * self.radius)
        fall_above, fall_below = math.expm1(-z / above), math.expm1(-z / below)
        # u_r / r; (1 - e^-q) / q is 1 on the axis
        spread = 0.5 * self._rate * (-math.expm1(-q) / q if q > 0.0 else 1.0) * (fall_above - fall_below)
        sink = self._rate * math.exp(-q) * (below * fall_below - above * fall_above)
        return spread * dx, spread * dy, sink
