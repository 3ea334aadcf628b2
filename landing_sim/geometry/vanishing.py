"""Attitude from straight lines: heading from where the borders meet, roll and pitch from the horizon.

A level runway's borders meet at a point of the horizon. With the camera's axes forward, right, down rolled by phi and
pitched by theta, and dpsi = psi_runway - psi_camera (> 0: the runway points to the right of the optical axis), it lies at

    u = f (sin phi tan theta + cos phi tan dpsi / cos theta),     u to the right, v down of the image's centre,
    v = f (cos phi tan theta - sin phi tan dpsi / cos theta).

In R the camera's own heading is psi = -dpsi. All of it is exact, for any angles with the point in front of the camera.

Source     Gibert et al. 2015, eqs. (18), (19). They hold exactly when d_F is measured along the tilted horizon from where
           it crosses the image's vertical mid-line (u = 0), not from the foot of the centre's perpendicular, nor along u.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import Vector
from landing_sim.jit import kernel
from landing_sim.types import Array


def vanishing_point(phi: float, theta: float, dpsi: float, lens: Intrinsics) -> Array:
    """(2,) [px] where level lines appear to meet that run dpsi [rad] to the right of the optical axis."""
    across = math.tan(dpsi) / math.cos(theta)
    u = math.sin(phi) * math.tan(theta) + math.cos(phi) * across
    v = math.cos(phi) * math.tan(theta) - math.sin(phi) * across
    return np.array([lens.cx + lens.f * u, lens.cy + lens.f * v])


def horizon_distance(phi: float, theta: float, dpsi: float, f: float) -> float:
    """d_F [px] of the vanishing point along the horizon: f (tan dpsi / cos theta + tan phi tan theta).

    Source     Gibert et al. 2015, eq. (18).
    """
    return f * (math.tan(dpsi) / math.cos(theta) + math.tan(phi) * math.tan(theta))


def heading_from_distance(d_F: float, phi: float, theta: float, f: float) -> float:
    """dpsi [rad] = atan(cos theta (d_F / f - tan phi tan theta)), the inverse of `horizon_distance`.

    Source     Gibert et al. 2015, eq. (19).
    """
    return math.atan(math.cos(theta) * (d_F / f - math.tan(phi) * math.tan(theta)))


def distance_along_horizon(uv: Array, line: Array, lens: Intrinsics) -> float:
    """d_F [px] of a point (2,) from where the horizon crosses the image's vertical mid-line, > 0 to the right.

    line (3,): a u + b v + c = 0 [px], any scale. The point is taken at its foot on the line. Raises ValueError for a
    horizon along the mid-line, which it does not cross.
    """
    a, b, c = (float(k) for k in line)
    norm = math.hypot(a, b)
    if abs(b) <= 1e-12 * norm or norm == 0.0:
        raise ValueError(f"the horizon {line.tolist()} does not cross the image's vertical mid-line")
    v0 = -(a * lens.cx + c) / b
    return ((uv[0] - lens.cx) * b - (uv[1] - v0) * a) / math.copysign(norm, b)


def heading_from_point(uv: Array, R_LC: Array, lens: Intrinsics) -> tuple[float, float]:
    """dpsi [rad], and the angle [rad] by which the point lies above the level: a check, zero for a level runway.

    R_LC (3, 3): camera axes (right, down, forward) to level ones (forward, right, down) with the heading of whatever dpsi
    is wanted for: `from_euler(phi, theta, 0) @ camera_from_body(pan, tilt).T` for a body's.
    """
    w = R_LC @ np.array([(uv[0] - lens.cx) / lens.f, (uv[1] - lens.cy) / lens.f, 1.0])
    return math.atan2(w[1], w[0]), math.atan2(-w[2], math.hypot(w[0], w[1]))


def heading_variance(uv: Array, cov: Array, R_LC: Array, lens: Intrinsics) -> float:
    """[rad^2] of `heading_from_point` for a point of covariance (2, 2) [px^2], the attitude taken as exact."""
    w = R_LC @ np.array([(uv[0] - lens.cx) / lens.f, (uv[1] - lens.cy) / lens.f, 1.0])
    g = (w[0] * R_LC[1, :2] - w[1] * R_LC[0, :2]) / (lens.f * (w[0] * w[0] + w[1] * w[1]))
    return float(g @ cov @ g)


def down_from_level_line(line: Array, lens: Intrinsics) -> Array:
    """(3,) unit vector down, camera axes, from the image (3,) of the level's horizon, a u + b v + c > 0 above it.

    That is where level lines vanish; the sea's horizon lies `geometry.runway_image.horizon_dip` below: `lifted` raises it.
    """
    a, b, c = (float(k) for k in line)
    return np.array(down_of(a, b, c, lens.f, lens.cx, lens.cy))


@kernel
def down_of(a: float, b: float, c: float, f: float, cx: float, cy: float) -> Vector:
    """`down_from_level_line` of a u + b v + c = 0, as three floats."""
    x, y, z = -f * a, -f * b, -(a * cx + b * cy + c)
    norm = math.sqrt(x * x + y * y + z * z)
    return x / norm, y / norm, z / norm


def roll_and_pitch(down_C: Array, R_CB: Array) -> tuple[float, float]:
    """phi, theta [rad] of the body from the direction down (3,) in camera axes.

    R_CB (3, 3) as it is mounted; `camera_from_body(0, 0)` gives the camera's own.
    """
    d = R_CB.T @ down_C
    return math.atan2(d[1], d[2]), math.asin(min(1.0, max(-1.0, -d[0])))


def lifted(uv: Array, down_C: Array, dip: float, lens: Intrinsics) -> Array:
    """(n, 2) [px] the points (n, 2) raised by `dip` [rad]: what is seen of the sea's horizon, put on the level.

    The sea's horizon is a cone, its image no straight line: 1.2 px of sag over 1280 at f = 1500 px from 260 m.
    """
    down = (float(down_C[0]), float(down_C[1]), float(down_C[2]))
    return np.array([raised_point(u, v, down, dip, lens.f, lens.cx, lens.cy) for u, v in uv])


@kernel
def raised_point(u: float, v: float, down_C: Vector, dip: float, f: float, cx: float, cy: float) -> tuple[float, float]:
    """One of the points of `lifted`."""
    a, b, sine = (u - cx) / f, (v - cy) / f, math.sin(dip)
    norm = math.sqrt(a * a + b * b + 1.0)
    z = 1.0 / norm - sine * down_C[2]
    return cx + f * (a / norm - sine * down_C[0]) / z, cy + f * (b / norm - sine * down_C[1]) / z
