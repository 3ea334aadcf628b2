"""The moving air: a sum of parts, each giving the velocity of the air in R at the aircraft.

Signs      parts answer in R: x along the landing direction, y right, z DOWN. In the settings `headwind` is positive on
           the nose (-x); `crosswind` and `lateral` are positive blowing towards +y (to the right, from the left);
           `vertical` is positive blowing UP (-z), as height is.
A further kind of wind is one more part: a frozen dataclass with `velocity` if it depends on place and time only, a small
class made from one if it remembers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Protocol

from landing_sim.noise import NoiseStream
from landing_sim.world.dryden import DrydenTurbulence, Turbulence
from landing_sim.world.first_order import FirstOrder, FirstOrderTurbulence
from landing_sim.world.gusts import DiscreteGust, MetDiscreteGust
from landing_sim.world.microburst import Microburst
from landing_sim.world.shear import CertificationWind, LogWind


class WindPart(Protocol):
    """One contribution to the wind."""

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        """Velocity of the air in R [m/s]; t [s], x, y and height [m] of the cg in R, true airspeed."""


def _check_finite(part: str, values: Sequence[float]) -> None:
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"{part}: every value must be a finite number, got {tuple(values)}")


@dataclass(frozen=True, slots=True)
class SteadyWind:
    """The same everywhere and always [m/s]."""

    headwind: float = 0.0
    crosswind: float = 0.0

    def __post_init__(self) -> None:
        _check_finite("steady wind", astuple(self))

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        return -self.headwind, self.crosswind, 0.0


@dataclass(frozen=True, slots=True)
class CrosswindStep:
    """A crosswind that blows beyond x = at_x only, risen as half a cosine over the distance `over` [m]; 0 is a step.

    Source     Dickmanns & Schell 1992, section 7.1: -1 m/s from 800 m before the threshold.
    """

    at_x: float = -800.0
    crosswind: float = -1.0
    over: float = 0.0

    def __post_init__(self) -> None:
        _check_finite("crosswind step", astuple(self))
        if self.over < 0.0:
            raise ValueError(f"crosswind step: 'over' is the distance of the rise in m and cannot be {self.over}")

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        inside = x - self.at_x
        if inside <= 0.0:
            return 0.0, 0.0, 0.0
        if inside >= self.over:
            return 0.0, self.crosswind, 0.0
        return 0.0, 0.5 * self.crosswind * (1.0 - math.cos(math.pi * inside / self.over)), 0.0


@dataclass(frozen=True, slots=True)
class ExponentialGust:
    """A gust met when x first passes at_x, decaying in time as exp(-t / tau); who starts beyond it meets it at once.

    Source     Dickmanns & Schell 1992, section 7.1: 650 m before the threshold, 2 m/s lateral, 1 m/s vertical, 6 s.
               The paper gives no signs. Lateral with the sign of its crosswind reproduces its 2 deg of crab at
               200 m before the threshold; vertical is taken as an updraught.
    """

    at_x: float = -650.0
    lateral: float = -2.0
    vertical: float = 1.0
    tau: float = 6.0

    def __post_init__(self) -> None:
        _check_finite("gust", astuple(self))
        if self.tau <= 0.0:
            raise ValueError(f"gust: the decay time tau must be > 0 s, not {self.tau}")


class _MetGust:
    """An ExponentialGust that remembers when it was met."""

    __slots__ = ("_gust", "_t_met")

    def __init__(self, gust: ExponentialGust) -> None:
        self._gust = gust
        self._t_met = math.nan

    def velocity(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        gust = self._gust
        if math.isnan(self._t_met):
            if x <= gust.at_x:
                return 0.0, 0.0, 0.0
            self._t_met = t
        elif t < self._t_met:
            raise ValueError(f"gust: time went back to {t} s, before it was met; make a new Wind for a new run")
        decay = math.exp((self._t_met - t) / gust.tau)
        return 0.0, gust.lateral * decay, -gust.vertical * decay


@dataclass(frozen=True, slots=True)
class WindConfig:
    """What blows; a part that is None does not."""

    steady: SteadyWind | LogWind | CertificationWind = SteadyWind()
    step: CrosswindStep | None = None
    gust: ExponentialGust | None = None
    turbulence: Turbulence | FirstOrder | None = None
    discrete: DiscreteGust | None = None
    microburst: Microburst | None = None


class Wind:
    """interfaces.World: the sum of what a WindConfig names. One per run, since gusts and turbulence remember.

    Parameters
    ----------
    config : what blows
    noise : stream of the turbulence; needed with turbulence only
    slope : tangent of the runway's slope: parts are told the height above its surface, level before the threshold

    Raises ValueError for turbulence without a noise stream, for a slope that is not finite.
    """

    __slots__ = ("_slope", "_steady", "_velocities")

    def __init__(self, config: WindConfig, noise: NoiseStream | None = None, slope: float = 0.0) -> None:
        _check_finite("wind", (slope,))
        self._slope = slope
        parts: list[WindPart] = []
        self._steady = (0.0, 0.0, 0.0)  # what needs not be asked for every time
        if isinstance(config.steady, SteadyWind):
            x, y, z = config.steady.velocity(0.0, 0.0, 0.0, 0.0, 0.0)
            self._steady = (0.0 + x, 0.0 + y, 0.0 + z)  # as a sum that begins with zero: there is no -0.0
        else:
            parts.append(config.steady)
        if config.step is not None:
            parts.append(config.step)
        if config.gust is not None:
            parts.append(_MetGust(config.gust))
        if config.discrete is not None:
            parts.append(MetDiscreteGust(config.discrete))
        if config.microburst is not None:
            parts.append(config.microburst)
        if config.turbulence is not None:
            if noise is None:
                raise ValueError("wind: turbulence needs a noise stream, e.g. Noise(seed, 'turbulence', run)")
            if isinstance(config.turbulence, Turbulence):
                parts.append(DrydenTurbulence(config.turbulence, noise))
            else:
                parts.append(FirstOrderTurbulence(config.turbulence, noise))
        self._velocities = tuple(part.velocity for part in parts)

    def wind(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        """Velocity of the air in R at the aircraft [m/s]."""
        if x > 0.0:
            height -= self._slope * x
        wx, wy, wz = self._steady
        for velocity in self._velocities:
            a, b, c = velocity(t, x, y, height, airspeed)
            wx += a
            wy += b
            wz += c
        return wx, wy, wz
