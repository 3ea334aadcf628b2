"""What every range observer takes and gives, so that one can stand for another.

A point fixed to the ground is seen from a moving camera. In axes that move with the camera, depth along the third axis,

    x' = A x + B,   y = (x1/x3, x2/x3)                                        (eqs. 1, 2 with f = 1)

For a camera with velocity v_C and rate w_C in its own axes, A = -[w_C]x and B = -v_C. (Eq. 17 prints both with a plus:
it holds if omega and v are the motion of the point as seen from the camera.)

Source     Gibert et al. 2015, sections 2 and 4.2. Departs: a third output, an object's angular width s = W/x3, is allowed
           by the observers that say so; it needs axes whose depth axis is perpendicular to that width (runway axes).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

import numpy as np

from landing_sim.types import Array

NEAR_RAY = math.radians(20.0)  # a first guess farther off the measured ray than this is not a guess of that point


class Flag(IntEnum):
    """Whether the range may be trusted now."""

    GOOD = 0
    UNOBSERVABLE = 1  # the point moves too slowly through the image: range is carried by the motion alone
    LIMITED = 2  # a correction was larger than allowed, or led behind the camera: it was cut, or left out


class OffRayWarning(UserWarning):
    """A first guess did not lie on the measured ray and was moved there."""


class OffRayError(ValueError):
    """A first guess that cannot belong to what is measured."""


@dataclass(frozen=True, slots=True)
class Motion:
    """How points fixed to the ground move in camera axes over one step: x' = A x + B, and exactly x_after = R x + t."""

    A: Array  # (3, 3) [1/s]
    B: Array  # (3,) [m/s]
    R: Array  # (3, 3)
    t: Array  # (3,) [m]


def steady_motion(A: Array, B: Array, dt: float) -> Motion:
    """A and B constant over dt [s]; R, t by the matrix exponential. A need not be a rotation."""
    from scipy.linalg import expm

    both = np.zeros((4, 4))
    both[:3, :3], both[:3, 3] = A, B
    step = expm(both * dt)
    return Motion(np.asarray(A, dtype=float), np.asarray(B, dtype=float), step[:3, :3].copy(), step[:3, 3].copy())


def motion_between(R_CR: Array, p_RC: Array, R_CR_after: Array, p_RC_after: Array, dt: float) -> Motion:
    """From two poses of the camera, R_CR (3, 3) and p_RC (3,) [m], dt [s] apart: what inertial increments give.

    R and t are exact whatever the camera did in between; A and B are the steady motion that has the same effect.
    """
    R = R_CR_after @ R_CR.T
    return increments(R, R_CR_after @ (p_RC - p_RC_after), dt)


def increments(R: Array, t: Array, dt: float) -> Motion:
    """The motion x_after = R x + t over dt [s], with R a rotation of less than half a turn."""
    from scipy.linalg import logm

    both = np.eye(4)
    both[:3, :3], both[:3, 3] = R, t
    rate = np.real(logm(both)) / dt
    return Motion(rate[:3, :3].copy(), rate[:3, 3].copy(), R, t)


@dataclass(frozen=True, slots=True)
class State:
    """What an observer knows after a step. `inner` are its own variables, empty at the start if they need motion."""

    x: Array  # (3,) [m] the point in camera axes
    y: Array  # (2,) or (3,) the latest outputs
    inner: Array
    d1: float = math.nan  # [m/s] b1 - b3 y1: how fast 1/x3 moves y1 through the image; NaN before the first step
    d2: float = math.nan
    flag: Flag = Flag.UNOBSERVABLE


class RangeObserver(Protocol):
    """Frozen settings and pure functions; the state is a value. y (2,) are a point's image coordinates at f = 1."""

    def start(self, y: Array, range_guess: float) -> State:
        """On the measured ray, at depth `range_guess` [m]. Raises ValueError if that is not positive and finite."""

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        """One step of dt [s] with this motion, at whose end y is measured; NaN in y: it was not, the motion carries on."""

    def estimate(self, state: State) -> Array:
        """x_hat (3,) [m]."""


def on_ray(y: Array, depth: float) -> Array:
    """The point (3,) at this depth [m] that is seen at y."""
    y = np.asarray(y, dtype=float)
    if not (math.isfinite(depth) and depth > 0.0):
        raise ValueError(f"a first range must be positive and finite, not {depth}")
    if not np.isfinite(y[:2]).all():
        raise ValueError(f"an observer starts from a measured direction, not from {y}")
    return np.array([y[0], y[1], 1.0]) * depth


def begin(y: Array, range_guess: float) -> State:
    """`RangeObserver.start` of an observer whose own variables need a motion first."""
    y = np.asarray(y, dtype=float)
    return State(on_ray(y, range_guess), y, np.empty(0))


def guess_on_ray(guess: Array, y: Array, refuse_beyond: float = NEAR_RAY) -> float:
    """The depth [m] to start with from a guessed position (3,) [m]: that of its nearest point on the measured ray.

    Observers are made for starts on the ray: the bearing is measured, only the range is not. Started beside it, the bearing
    error is taken for a range error, and the high-gain forms may diverge. A guess beside the ray is moved onto it and an
    OffRayWarning says by how much; one farther off than `refuse_beyond` [rad], or behind the camera, raises OffRayError.
    """
    guess = np.asarray(guess, dtype=float)
    ray = on_ray(y, 1.0)
    depth = float(guess @ ray / (ray @ ray))
    off = math.acos(min(1.0, max(-1.0, depth * math.sqrt(float(ray @ ray)) / float(np.linalg.norm(guess)))))
    if depth <= 0.0 or not off <= refuse_beyond:
        raise OffRayError(f"the first guess {guess} m is {math.degrees(off):.1f} deg off the measured direction")
    if off > 1e-6:
        told = f"the first guess was {math.degrees(off):.3g} deg off the measured direction: moved onto it"
        warnings.warn(f"{told}, depth {depth:.4g} m", OffRayWarning, stacklevel=2)
    return depth


def arrive(
    before: State, x: Array, y: Array, motion: Motion, inner: Array, d: tuple[float, float], seen: bool, limit: float
) -> State:
    """The state after a step that led to x (3,), if x may be believed.

    A depth that is not positive and finite is not taken: the old estimate is carried by the motion, or, where that leads
    through zero, kept. A correction of the depth by more than the share `limit` is cut to that; bearings stay. `seen` tells
    whether range was observable.
    """
    carried = motion.R @ before.x + motion.t
    ahead = carried[2] > 0.0
    flag = Flag.GOOD if seen else Flag.UNOBSERVABLE
    if not (np.isfinite(x).all() and x[2] > 0.0):
        x, flag = carried if ahead else before.x, Flag.LIMITED
    elif ahead and abs(x[2] / carried[2] - 1.0) > limit:
        allowed = carried[2] * (1.0 + math.copysign(limit, x[2] - carried[2]))
        x, flag = x * (allowed / x[2]), Flag.LIMITED
    return State(x, np.asarray(y, dtype=float), inner, d[0], d[1], flag)


def coast(before: State, motion: Motion) -> State:
    """The state after a step without a measurement: the motion carries the estimate, and stands for what was not seen."""
    x = motion.R @ before.x + motion.t
    if not x[2] > 0.0:
        return replace(before, flag=Flag.LIMITED)
    return replace(before, x=x, y=x[:2] / x[2], flag=Flag.UNOBSERVABLE)
