"""Dryden turbulence near the ground: three gust components that an aircraft flying through frozen air meets.

Spectra    one-sided in spatial frequency Omega [rad/m], each integrating to sigma^2 over 0..inf:
               Phi_u  = sigma_u^2 (2 L_u / pi) / (1 + (L_u Omega)^2)
               Phi_vw = sigma^2 (L / pi) (1 + 3 (L Omega)^2) / (1 + (L Omega)^2)^2
Axes       u, v, w along R's x, y, z. The standard's axes follow the mean wind; on an approach R's x, the flight
           direction and a headwind agree within the crab angle, and sigma_u = sigma_v, L_u = L_v.
Omitted    the rotary components p, q, r (gradients over span and tail): the plant takes one wind at the cg.
Source     MIL-F-8785C (1980), section 3.7.2 (Dryden form) and 3.7.3.4 (low-altitude model, below 1,000 ft).
           MIL-HDBK-1797 (1997) halves the lengths L_v, L_w and writes twice the length into the transverse spectra: for
           the three components here, below 1,000 ft, that is the same air (`spectrum_1797`; checked in the tests).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.noise import NoiseStream
from landing_sim.types import Array

FOOT = 0.3048  # [m]
KNOT = 1852.0 / 3600.0  # [m/s]
W20 = {"light": 15.0 * KNOT, "moderate": 30.0 * KNOT, "severe": 45.0 * KNOT}  # [m/s] MIL-F-8785C

_DRAWS = 5  # standard normals a step takes: one for u, two each for v and w
_BLOCK = 1024  # steps drawn at once: a call to the generator costs as much as the step itself
_SQRT3 = math.sqrt(3.0)


@dataclass(frozen=True, slots=True)
class Turbulence:
    """How strong: the mean wind at 20 ft that goes with it [m/s]; see `W20` for the named intensities."""

    w20: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.w20) and self.w20 >= 0.0):
            raise ValueError(f"turbulence: w20 must be a wind speed >= 0 in m/s, not {self.w20}")


@kernel
def low_altitude(height: float, w20: float) -> tuple[float, float, float, float]:
    """sigma_uv, sigma_w [m/s], L_uv, L_w [m] at `height` [m] above ground, for the wind `w20` [m/s] at 20 ft.

    Heights outside 10..1,000 ft are taken as the nearer end, where the model stops being defined: at the ground the
    vertical scale would vanish, above 1,000 ft turbulence is isotropic and another model continues.

    Source     MIL-F-8785C, section 3.7.3.4, figs. 10 and 11.
    """
    h = height / FOOT
    if h < 10.0:
        h = 10.0
    elif h > 1000.0:
        h = 1000.0
    base = 0.177 + 0.000823 * h
    sigma_w = 0.1 * w20
    return sigma_w / base**0.4, sigma_w, FOOT * h / base**1.2, FOOT * h


def spectrum_8785c(omega: Array, height: float, w20: float, airspeed: float) -> tuple[Array, Array, Array]:
    """One-sided spectra [m^2/s^2 per rad/s] of u, v, w at omega (n,) [rad/s], as MIL-F-8785C has them."""
    sigma_uv, sigma_w, L_uv, L_w = low_altitude(height, w20)

    def transverse(sigma: float, L: float) -> Array:
        a = (L * omega / airspeed) ** 2
        return sigma**2 * L / (math.pi * airspeed) * (1.0 + 3.0 * a) / (1.0 + a) ** 2

    return _along(omega, sigma_uv, L_uv, airspeed), transverse(sigma_uv, L_uv), transverse(sigma_w, L_w)


def spectrum_1797(omega: Array, height: float, w20: float, airspeed: float) -> tuple[Array, Array, Array]:
    """The same as MIL-HDBK-1797 has them: L_v = L_u / 2, L_w = h / 2."""
    sigma_uv, sigma_w, L_u, h = low_altitude(height, w20)

    def transverse(sigma: float, L: float) -> Array:
        a = (L * omega / airspeed) ** 2
        return 2.0 * sigma**2 * L / (math.pi * airspeed) * (1.0 + 12.0 * a) / (1.0 + 4.0 * a) ** 2

    return _along(omega, sigma_uv, L_u, airspeed), transverse(sigma_uv, 0.5 * L_u), transverse(sigma_w, 0.5 * h)


def _along(omega: Array, sigma: float, L: float, airspeed: float) -> Array:
    return 2.0 * sigma**2 * L / (math.pi * airspeed) / (1.0 + (L * omega / airspeed) ** 2)


@uncounted
def _transverse(state: Array, at: int, r: float, n1: float, n2: float) -> float:
    """Advance xi1, xi2 = state[at : at + 2] over r = V dt / L; return the unit-variance v or w.

    (1 + sqrt3 T s) / (1 + T s)^2 split into xi1' = (n - xi1) / T, xi2' = (xi1 - xi2) / T with var xi1 = 1 has the
    stationary covariance P = [[1, 1/2], [1/2, 1/2]] whatever T is, so that T may vary; the step's noise has the
    covariance Q = P - F P F', F = exp(-r) [[1, 0], [r, 1]], here by its Cholesky factor.
    """
    f, e = math.exp(-r), math.exp(-2.0 * r)
    q11 = -math.expm1(-2.0 * r)
    q12 = 0.5 * q11 - e * r
    q22 = 0.5 * q11 - e * r * (r + 1.0)
    l11 = math.sqrt(q11)
    l21 = q12 / l11 if l11 > 0.0 else 0.0
    l22 = math.sqrt(max(0.0, q22 - l21 * l21))
    xi1, xi2 = state[at], state[at + 1]
    state[at] = f * xi1 + l11 * n1
    state[at + 1] = f * (r * xi1 + xi2) + l21 * n1 + l22 * n2
    # sqrt3 xi1 + (1 - sqrt3) xi2 has the variance 2
    return (_SQRT3 * state[at] + (1.0 - _SQRT3) * state[at + 1]) / math.sqrt(2.0)


@uncounted
def _advance(
    state: Array, normals: Array, at: int, distance: float, height: float, w20: float
) -> tuple[float, float, float]:
    """u, v, w [m/s] after flying `distance` [m] through the air, from normals[at : at + 5]."""
    sigma_uv, sigma_w, L_uv, L_w = low_altitude(height, w20)
    r = distance / L_uv
    state[0] = math.exp(-r) * state[0] + math.sqrt(-math.expm1(-2.0 * r)) * normals[at]
    v = _transverse(state, 1, r, normals[at + 1], normals[at + 2])
    w = _transverse(state, 3, distance / L_w, normals[at + 3], normals[at + 4])
    return sigma_uv * state[0], sigma_uv * v, sigma_w * w


class DrydenTurbulence:
    """Forming filters of unit variance, discretised exactly for whatever time has passed, scaled by height.

    The statistics do not depend on how often it is called, and the variance at a height is that height's at once.
    """

    __slots__ = ("_at", "_gust", "_noise", "_normals", "_state", "_t", "_w20")

    def __init__(self, config: Turbulence, noise: NoiseStream) -> None:
        n = noise.normal(_DRAWS)
        # a stationary start: the Cholesky factor of P is [[1, 0], [1/2, 1/2]]
        self._state: Array = np.array([n[0], n[1], 0.5 * (n[1] + n[2]), n[3], 0.5 * (n[3] + n[4])])
        self._noise = noise
        self._normals: Array = np.empty(0)
        self._at = 0
        self._w20 = config.w20
        self._t = math.nan
        self._gust = (0.0, 0.0, 0.0)

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        """u, v, w [m/s] along R's x, y, z at time t; the same time again gives the same gust.

        Raises ValueError when time runs backwards.
        """
        if t == self._t:
            return self._gust
        dt = 0.0 if math.isnan(self._t) else t - self._t
        if dt < 0.0:
            raise ValueError(f"turbulence: time went back from {self._t} s to {t} s; make a new one for a new run")
        if self._at == len(self._normals):
            self._normals = self._noise.normal(_DRAWS * _BLOCK)
            self._at = 0
        self._gust = _advance(self._state, self._normals, self._at, airspeed * dt, height, self._w20)
        self._at += _DRAWS
        self._t = t
        return self._gust
