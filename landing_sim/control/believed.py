"""Reads the aircraft's state out of an Estimate by name, once per layout of names."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from operator import itemgetter

from landing_sim.records import record
from landing_sim.signals import Estimate

NAMES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz")
_WIND = ("wx", "wy", "wz")


@record
class Believed:
    """The estimate as plain floats, SI and rad; wind zero if it is not estimated."""

    u: float
    v: float
    w: float
    p: float
    q: float
    r: float
    phi: float
    theta: float
    psi: float
    x: float
    y: float
    H: float
    wx: float
    wy: float
    wz: float


@record
class Motion:
    """What follows from Believed: velocity over the ground in R and velocity through the air in B [m/s]."""

    x_dot: float
    y_dot: float
    H_dot: float
    u_air: float
    v_air: float
    w_air: float
    airspeed: float


@lru_cache(maxsize=16)
def _picked(names: tuple[str, ...]) -> Callable[[list[float]], tuple[float, ...]]:
    missing = [name for name in NAMES if name not in names and name not in _WIND]
    if missing:
        raise ValueError(f"the controller needs {', '.join(missing)} in the estimate, which names {', '.join(names)}")
    return itemgetter(*[names.index(name) for name in NAMES if name in names])


def believed(estimate: Estimate) -> Believed:
    """Raises     ValueError if a state other than the wind is not estimated."""
    values = _picked(estimate.names)(estimate.mean.tolist())
    return Believed(*(values if len(values) == len(NAMES) else _with_wind(estimate, values)))


def _with_wind(estimate: Estimate, values: tuple[float, ...]) -> tuple[float, ...]:
    return (*values[:12], *(estimate.get(name, 0.0) for name in _WIND))


def moving(estimate: Estimate) -> tuple[Believed, Motion]:
    """`believed` and its `motion`."""
    b = believed(estimate)
    return b, motion(b)


def motion(b: Believed) -> Motion:
    """Velocities over the ground and through the air."""
    sph, cph = math.sin(b.phi), math.cos(b.phi)
    sth, cth = math.sin(b.theta), math.cos(b.theta)
    sps, cps = math.sin(b.psi), math.cos(b.psi)
    forward = b.u * cth + (b.v * sph + b.w * cph) * sth
    side = b.v * cph - b.w * sph
    down = -b.u * sth + (b.v * sph + b.w * cph) * cth
    ahead, across = b.wx * cps + b.wy * sps, -b.wx * sps + b.wy * cps
    through = ahead * sth + b.wz * cth
    u = b.u - (ahead * cth - b.wz * sth)
    v = b.v - (across * cph + through * sph)
    w = b.w - (-across * sph + through * cph)
    return Motion(
        forward * cps - side * sps, forward * sps + side * cps, -down, u, v, w, math.sqrt(u * u + v * v + w * w)
    )
