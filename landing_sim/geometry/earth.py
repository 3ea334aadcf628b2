"""The WGS84 Earth, and the runway's tangent frame on it.

E is Earth-centred, Earth-fixed (x through 0° N 0° E, z through the pole); N is local north-east-down along the ellipsoid's
normal; R touches the ellipsoid at the threshold. Latitudes are geodetic; heights are above the ellipsoid, and "elevation
above sea level" is taken as such (no geoid).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.geometry.so3 import from_euler
from landing_sim.jit import kernel
from landing_sim.types import Array

A = 6378137.0  # [m] semi-major axis, WGS84
F = 1.0 / 298.257223563  # flattening, WGS84
E2 = F * (2.0 - F)  # first eccentricity squared


def geodetic_to_ecef(latitude: float, longitude: float, height: float) -> Array:
    """p_E (3,) [m] of a point given in [rad, rad, m]."""
    s, c = math.sin(latitude), math.cos(latitude)
    n = A / math.sqrt(1.0 - E2 * s * s)
    r = (n + height) * c
    return np.array([r * math.cos(longitude), r * math.sin(longitude), (n * (1.0 - E2) + height) * s])


def ecef_to_geodetic(p_E: Array) -> tuple[float, float, float]:
    """Latitude, longitude [rad], height [m] of p_E (3,) [m]. Closed form; not for points within 43 km of the centre.

    Source     Vermeille, "Direct transformation from geocentric coordinates to geodetic coordinates", J. Geodesy 76
               (2002) 451-454.
    """
    x, y, z = float(p_E[0]), float(p_E[1]), float(p_E[2])
    e4 = E2 * E2
    rho2 = x * x + y * y
    p = rho2 / (A * A)
    q = (1.0 - E2) / (A * A) * z * z
    r = (p + q - e4) / 6.0
    s = e4 * p * q / (4.0 * r**3)
    t = (1.0 + s + math.sqrt(s * (2.0 + s))) ** (1.0 / 3.0)
    u = r * (1.0 + t + 1.0 / t)
    v = math.sqrt(u * u + e4 * q)
    w = E2 * (u + v - q) / (2.0 * v)
    k = math.sqrt(u + v + w * w) - w
    d = k * math.sqrt(rho2) / (k + E2)
    radius = math.hypot(d, z)
    return 2.0 * math.atan2(z, d + radius), math.atan2(y, x), (k + E2 - 1.0) / k * radius


def ned_from_ecef(latitude: float, longitude: float) -> Array:
    """R_NE (3, 3) at a geodetic position [rad]."""
    sp, cp = math.sin(latitude), math.cos(latitude)
    sl, cl = math.sin(longitude), math.cos(longitude)
    return np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0.0], [-cp * cl, -cp * sl, -sp]])


@dataclass(frozen=True, slots=True)
class RunwayFrame:
    """Frame R on the Earth: origin at the threshold's centre, x along the landing direction, z along the normal, down.

    Raises ValueError for a position or heading that is not finite, or a latitude beyond the poles.
    """

    latitude: float  # [rad] geodetic
    longitude: float  # [rad]
    elevation: float  # [m] of the threshold
    heading: float  # [rad] true, of the landing direction
    origin_E: Array = field(init=False, repr=False, compare=False)  # (3,) [m]
    R_RE: Array = field(init=False, repr=False, compare=False)  # (3, 3)

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (self.latitude, self.longitude, self.elevation, self.heading)):
            raise ValueError("runway position and heading must be finite numbers")
        if abs(self.latitude) > math.pi / 2:
            raise ValueError(f"runway latitude {math.degrees(self.latitude):g} deg lies beyond the poles: use -90..90")
        c, s = math.cos(self.heading), math.sin(self.heading)
        R_RN = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        object.__setattr__(self, "origin_E", geodetic_to_ecef(self.latitude, self.longitude, self.elevation))
        object.__setattr__(self, "R_RE", R_RN @ ned_from_ecef(self.latitude, self.longitude))

    def ecef_to_R(self, p_E: Array) -> Array:
        """p_R (3,) [m]."""
        return self.R_RE @ (p_E - self.origin_E)

    def R_to_ecef(self, p_R: Array) -> Array:
        """p_E (3,) [m]."""
        return self.origin_E + self.R_RE.T @ p_R

    def geodetic_to_R(self, latitude: float, longitude: float, height: float) -> Array:
        """p_R (3,) [m] of a point given in [rad, rad, m]."""
        return self.ecef_to_R(geodetic_to_ecef(latitude, longitude, height))

    def R_to_geodetic(self, p_R: Array) -> tuple[float, float, float]:
        """Latitude, longitude [rad], height [m]."""
        return ecef_to_geodetic(self.R_to_ecef(p_R))

    def R_RN(self, latitude: float, longitude: float) -> Array:
        """(3, 3) from the local north-east-down frame at that position into R."""
        return self.R_RE @ ned_from_ecef(latitude, longitude).T


@kernel
def level_at(p_R: Array) -> Array:
    """R_LR (3, 3): the runway's axes, levelled where p_R (3,) [m] is, on a sphere: 0.045 degrees at 5 km."""
    return from_euler(-p_R[1] / A, p_R[0] / A, 0.0)
