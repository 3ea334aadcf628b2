"""Steady wind that grows with height: the two laws that autoland certification uses.

Both are exact for the headwind and crosswind they are given at their reference height and keep the wind's direction.
Heights outside a law's range are taken as its nearer end: at the ground a logarithm has no value.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

FOOT = 0.3048  # [m]
AT_33FT = 33.0 * FOOT  # [m] where the mean wind of CS-AWO and of AC 120-28D is measured
CATEGORY_C_ROUGHNESS = 0.15 * FOOT  # [m] MIL-F-8785C: take-off, approach and landing


def log_law(height: float, reference_height: float, roughness: float) -> float:
    """Wind at `height` over that at `reference_height`: ln(h/z0) / ln(h_ref/z0), 3 ft <= h <= 1,000 ft; all in m.

    Source     MIL-F-8785C (1980), section 3.7.3.2, with h_ref = 20 ft and z0 = 0.15 ft near runways.
    """
    h = min(max(height, 3.0 * FOOT, roughness), 1000.0 * FOOT)
    return math.log(h / roughness) / math.log(reference_height / roughness)


def certification_shear(height: float) -> float:
    """Wind at `height` [m] over that at 33 ft: 0.43 log10 z + 0.35, z = height in FEET, not below 1 ft.

    Source     CS-AWO and AC 120-28D, from memory. That z is in feet follows from the formula itself: it gives 1.00 at
               33 ft, and 1.64 at 300 m where the landing challenge of Biannic & Boada-Bauxell (2016) says "about 1.6".
    """
    return 0.43 * math.log10(max(height / FOOT, 1.0)) + 0.35


def _check(part: object, values: tuple[float, ...]) -> None:
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"{type(part).__name__}: every value must be a finite number, got {values}")


@dataclass(frozen=True, slots=True)
class LogWind:
    """Headwind and crosswind [m/s] at reference_height [m], growing with the logarithm of height: `log_law`."""

    headwind: float = 0.0
    crosswind: float = 0.0
    reference_height: float = AT_33FT
    roughness: float = CATEGORY_C_ROUGHNESS

    def __post_init__(self) -> None:
        _check(self, astuple(self))
        if not 0.0 < self.roughness < self.reference_height:
            raise ValueError(
                f"LogWind: the wind is zero at the roughness height {self.roughness:g} m; it must be > 0 and below the "
                f"reference height {self.reference_height:g} m"
            )

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        share = log_law(height, self.reference_height, self.roughness)
        return -self.headwind * share, self.crosswind * share, 0.0


@dataclass(frozen=True, slots=True)
class CertificationWind:
    """Headwind and crosswind [m/s] at 33 ft, growing as the certification of autoland wants: `certification_shear`."""

    headwind: float = 0.0
    crosswind: float = 0.0

    def __post_init__(self) -> None:
        _check(self, astuple(self))

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        share = certification_shear(height)
        return -self.headwind * share, self.crosswind * share, 0.0
