"""What one image says of an unknown runway, free of its scale: bearings, angular width, borders.

In levelled axes along the runway, from the camera, with the threshold's middle at (X, Y, Z) ahead, right, down:

    y1 = Y / X,   y2 = Z / X,   s = W / X,      k = (Y -+ W/2) / Z     (lateral over height of the borders)

Source     Gibert et al. 2015, eq. (2) and the appendix (heading from the vanishing point). Departs: the corners' rays are
           turned into the runway's levelled axes before they are divided, so that rotation drops out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from landing_sim.estimators.lines import RunwayLines, runway_lines, threshold_direction
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import camera_from_body, from_euler, to_euler
from landing_sim.geometry.vanishing import down_from_level_line, heading_from_point, roll_and_pitch
from landing_sim.signals import EdgeSet, Feature, Status
from landing_sim.types import Array

LEVEL_SIGMA = 2e-3  # [rad] of the roll that is believed
SHORT = 20.0  # [px] between windows that then tell the threshold's direction worse than the roll does


@dataclass(frozen=True, slots=True)
class Bearings:
    """Of one image; None what it does not show."""

    turned: tuple[Array, Array] | None  # (2,) [rad] runway's heading less the believed, vanishing point's rise; (2, 2)
    pitched: float | None  # [rad] pitch less that of the horizon, whose dip is taken for that from `height`
    threshold: tuple[Array, Array] | None  # y1, y2, s and their variances (3,), (3,)
    borders: tuple[Array, Array] | None  # k of the left and right border and their variances (2,), (2,)


def bearings(
    z: Array,
    R: Array,
    edges: EdgeSet,
    lens: Intrinsics,
    R_RB: Array,
    camera_error: tuple[float, float],
    height: float,
    attitude: Literal["inertial", "horizon"] = "inertial",
) -> Bearings:
    """From the edges of an image (measurement "edges": z, R, geometry).

    R_RB (3, 3): attitude as believed; camera_error [rad]: of the pan and tilt read; height [m] of the camera, for the dip.
    "horizon" takes roll and pitch from the image, where it shows the horizon, and "inertial" from R_RB.
    """
    R_CB = camera_from_body(edges.pan - camera_error[0], edges.tilt - camera_error[1])
    lines = runway_lines(z, R, edges, lens, horizon_dip(height), None, _level_threshold(edges, R_CB @ R_RB.T, lens))
    if attitude == "horizon" and lines.horizon is not None:
        phi, theta = roll_and_pitch(down_from_level_line(lines.horizon.homogeneous, lens), R_CB)
        R_RB = from_euler(phi, theta, to_euler(R_RB)[2])
    pitched = None
    if lines.horizon is not None:
        theta = roll_and_pitch(down_from_level_line(lines.horizon.homogeneous, lens), R_CB)[1]
        pitched = float(to_euler(R_RB)[1]) - theta
    R_RC = R_RB @ R_CB.T
    point, turned = lines.vanishing, None
    if point is not None and _ahead(R_RC, point.uv[0], lens):
        J = _turn_by_pixel(R_RC, point.uv[0], lens)
        turned = np.array(heading_from_point(point.uv[0], R_RC, lens)), J @ point.cov @ J.T
    return Bearings(turned, pitched, _threshold(lines, R_RC, lens), _borders(lines, R_RC, lens))


def _level_threshold(edges: EdgeSet, R_CR: Array, lens: Intrinsics) -> tuple[Array, float] | None:
    """The direction that a level threshold across the runway must have, where its windows are too close to tell."""
    seen = edges.centre[(edges.feature == Feature.THRESHOLD) & (edges.status == Status.FOUND)]
    if len(seen) == 0 or np.ptp(seen, axis=0).max() > SHORT:
        return None
    return threshold_direction(seen.mean(axis=0), R_CR, 0.0, lens), LEVEL_SIGMA


def _ray(R_RC: Array, uv: Array, lens: Intrinsics) -> Array:
    return np.asarray(R_RC @ np.array([(uv[0] - lens.cx) / lens.f, (uv[1] - lens.cy) / lens.f, 1.0]))


def _turn_by_pixel(R_RC: Array, uv: Array, lens: Intrinsics) -> Array:
    """(2, 2) derivative of heading and rise of a point at infinity by its pixel."""
    w = _ray(R_RC, uv, lens)
    ahead = math.hypot(w[0], w[1])
    along = (w[0] * R_RC[0, :2] + w[1] * R_RC[1, :2]) / ahead
    heading = (w[0] * R_RC[1, :2] - w[1] * R_RC[0, :2]) / ahead**2
    rise = -(ahead * R_RC[2, :2] - w[2] * along) / (ahead**2 + w[2] ** 2)
    return np.array([heading, rise]) / lens.f


def _ahead(R_RC: Array, uv: Array, lens: Intrinsics) -> bool:
    return bool(_ray(R_RC, uv, lens)[0] > 0.05)


def _threshold(lines: RunwayLines, R_RC: Array, lens: Intrinsics) -> tuple[Array, Array] | None:
    corners = lines.corners
    if corners is None:
        return None
    left, right = (_ray(R_RC, uv, lens) for uv in corners.uv)
    if left[0] <= 0.05 or right[0] <= 0.05:
        return None
    a, b = left[1:] / left[0], right[1:] / right[0]
    # d(r_i / r_1) by the pixel
    J = np.zeros((3, 4))
    for k, ray in enumerate((left, right)):
        g = (R_RC[1:, :2] - np.outer(ray[1:] / ray[0], R_RC[0, :2])) / (lens.f * ray[0])
        J[:2, 2 * k : 2 * k + 2] = 0.5 * g
        J[2, 2 * k : 2 * k + 2] = g[0] if k else -g[0]
    y = np.array([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), b[0] - a[0]])
    if not y[2] > 0.0:
        return None
    return y, np.einsum("ij,jk,ik->i", J, corners.cov, J)


def _borders(lines: RunwayLines, R_RC: Array, lens: Intrinsics) -> tuple[Array, Array] | None:
    """At the middle of what is seen of each, where a wrong heading matters least for the least noise."""
    k, var = np.empty(2), np.empty(2)
    for i, line in enumerate((lines.left, lines.right)):
        if line is None:
            return None
        ray = _ray(R_RC, line.centre, lens)
        if ray[2] <= 1e-3 * math.hypot(ray[0], ray[1]):
            return None
        k[i] = ray[1] / ray[2]
        across = (R_RC[1, :2] - k[i] * R_RC[2, :2]) @ line.n / (lens.f * ray[2])
        var[i] = across * across * line.cov[0, 0]
    return (k, var) if k[1] > k[0] else None
