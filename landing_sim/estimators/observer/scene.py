"""The unknown runway as an observer carries it, and how the aircraft's own motion moves it.

A camera sees the scene only up to its scale: x, y, H and the runway's width W can all be too large alike and nothing in an
image tells. What tells is the motion, which inertial data give in metres.

    x_R' = R_RN (v_N - b_v),      W' = 0                        (Gibert et al. 2015, eqs. (1), (17), in the runway's axes)

Source     Gibert et al. 2015, section 4.2. Departs: eq. (17) holds as printed only if omega and v are the motion of the
           point relative to the camera; the state is carried in levelled axes along the runway, where A = 0 and
           B = -v_RC, which makes the propagation over a step exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from landing_sim.geometry.earth import level_at
from landing_sim.geometry.so3 import from_euler, product, turned
from landing_sim.jit import kernel
from landing_sim.signals import Residuals
from landing_sim.types import Array

X, Y, H, COURSE, WIDTH, EPAN, ETILT, EROLL, SIDE, NEAR, BX, BY, BZ = range(13)
N = 13


class Scene(NamedTuple):
    """What is believed of the runway and of the way to it. s (N,): x, y, H of the camera [m], the runway's true course
    [rad], its width [m], the camera's pan, tilt and roll error [rad], by how much borders and threshold are measured too
    far inside [px], and the inertial velocity's bias [m/s] in R."""

    s: Array
    P: Array  # (N, N)
    spread: float  # 1 sigma of the range, relative: what is trusted to be the scale's error
    t_image: float  # [s] of the last image used
    t_start: float = 0.0  # [s] of the acquisition
    d: tuple[float, float, float] = (0.0, 0.0, 0.0)  # d1, d2 of the threshold, and that of its width [m/s]
    misses: int = 0  # images in a row that showed nothing
    threshold_in_view: bool = False
    frames: int = 0
    own: Array | None = None  # what the ranging keeps for itself
    residuals: Residuals | None = None


class Carriage(NamedTuple):
    """The aircraft in the runway's frame: what an inertial reading says under a believed course and place."""

    R_RB: Array  # (3, 3)
    v_R: Array  # (3,) [m/s] of the cg


@kernel
def carriage(z: Array, s: Array) -> Carriage:
    """`z` (12,) of an "inertial" measurement seen from the runway `s` (N,).

    The unit is level where the aircraft is, R at the threshold: 0.045 degrees and two metres apart over 5 km.
    """
    R_RN = from_course(s)
    v_R, over = np.empty(3), turned(R_RN, z[6], z[7], z[8])
    for k in range(3):
        v_R[k] = over[k] - s[BX + k]
    return Carriage(product(R_RN, from_euler(z[0], z[1], z[2])), v_R)


@kernel
def from_course(s: Array) -> Array:
    """R_RN (3, 3) where the aircraft is."""
    R_LR = level_at(np.array([s[X], s[Y], -s[H]]))
    R_NL = from_euler(0.0, 0.0, s[COURSE])
    return product(R_NL, R_LR).T.copy()


@kernel
def moved(s: Array, way_R: Array, dt: float) -> Array:
    """`s` after the camera has moved by way_R (3,) [m] in dt [s], as the inertial unit says."""
    out = s.copy()
    out[X] += way_R[0] - s[BX] * dt
    out[Y] += way_R[1] - s[BY] * dt
    out[H] -= way_R[2] - s[BZ] * dt
    return out


def observability(s: Array, v_R: Array) -> tuple[float, float, float]:
    """d1, d2 of the threshold's middle and that of its width [m/s]: how fast 1 / range moves them through the image."""
    ahead = max(abs(s[X]), 1.0)
    y1, y2 = -s[Y] / ahead, s[H] / ahead
    return float(v_R[0] * y1 - v_R[1]), float(v_R[0] * y2 - v_R[2]), float(v_R[0] * s[WIDTH] / ahead)
