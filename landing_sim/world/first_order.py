"""First-order turbulence: three gust components, each a random walk pulled back to zero within a time constant.

Spectra    one-sided in omega [rad/s], each integrating to sigma^2 over 0..inf: Phi = sigma^2 (2 T / pi) / (1 + (T omega)^2)
Source     the landing challenge of Biannic & Boada-Bauxell (2016): filters 10 / (2.5 s + 1) along and across and
           2.25 / (0.125 s + 1) vertically on white noise held for 0.05 s, whose gains make unit variance of it
           (100 x 0.05 / (2 x 2.5) = 1.00; 2.25^2 x 0.05 / (2 x 0.125) = 1.01), times sigma_u = sigma_v = 0.15 W33 and
           sigma_w = 0.77 m/s (1.5 kt). At 73 m/s these are CS-AWO's lengths: 183 m (600 ft) and 9 m (30 ft).
Departs    the continuous process, discretised exactly for whatever time has passed; the challenge's Euler steps of 0.05 s
           add 0.5 % to sigma_u and 12 % to sigma_w.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

from landing_sim.noise import NoiseStream

_DRAWS = 3  # standard normals a step takes
_BLOCK = 1024  # steps drawn at once


@dataclass(frozen=True, slots=True)
class FirstOrder:
    """1 sigma [m/s] and time constant [s] of the level components (each) and of the vertical one."""

    sigma_level: float
    sigma_vertical: float = 0.77
    time_level: float = 2.5
    time_vertical: float = 0.125

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in astuple(self)):
            raise ValueError(f"turbulence: every value must be a finite number, got {astuple(self)}")
        if min(self.sigma_level, self.sigma_vertical) < 0.0 or min(self.time_level, self.time_vertical) <= 0.0:
            raise ValueError("turbulence: sigma must be >= 0 m/s and time constants > 0 s")


class FirstOrderTurbulence:
    """The three processes along R's x, y, z, stationary from the start."""

    __slots__ = ("_at", "_config", "_gust", "_noise", "_normals", "_t")

    def __init__(self, config: FirstOrder, noise: NoiseStream) -> None:
        n = noise.normal(_DRAWS).tolist()
        self._config = config
        self._gust = (config.sigma_level * n[0], config.sigma_level * n[1], config.sigma_vertical * n[2])
        self._noise = noise
        self._normals: list[float] = []
        self._at = 0
        self._t = math.nan

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        """u, v, w [m/s] at time t; the same time again gives the same gust. Raises ValueError when time runs backwards."""
        if t == self._t:
            return self._gust
        if math.isnan(self._t):
            self._t = t
            return self._gust
        dt = t - self._t
        if dt < 0.0:
            raise ValueError(f"turbulence: time went back from {self._t} s to {t} s; make a new one for a new run")
        if self._at == len(self._normals):
            self._normals = self._noise.normal(_DRAWS * _BLOCK).tolist()
            self._at = 0
        c, n, at, (u, v, w) = self._config, self._normals, self._at, self._gust
        level, vertical = dt / c.time_level, dt / c.time_vertical
        keep, keep_w = math.exp(-level), math.exp(-vertical)
        new = c.sigma_level * math.sqrt(-math.expm1(-2.0 * level))
        new_w = c.sigma_vertical * math.sqrt(-math.expm1(-2.0 * vertical))
        self._gust = (keep * u + new * n[at], keep * v + new * n[at + 1], keep_w * w + new_w * n[at + 2])
        self._at = at + _DRAWS
        self._t = t
        return self._gust
