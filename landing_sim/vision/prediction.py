"""What is believed of pose, platform and width makes of the runway's edges: lines, displacements, their uncertainty.

All that may be uncertain is one vector, the sight: x, y, H [m] of the cg, phi, theta, psi, pan, tilt [rad], width [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from landing_sim.geometry.runway_edge import crossing, turning_axes
from landing_sim.geometry.runway_image import HORIZON, LEFT, RIGHT, THRESHOLD, Vector, displacement, line_of, plane
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array

SIGHT = ("x", "y", "H", "phi", "theta", "psi", "pan", "tilt", "W")
PAN, TILT, WIDTH = 6, 7, 8

NEAR = 1.0  # [m] nothing nearer to the camera is looked at


class View(NamedTuple):
    """The scene from one believed camera. q: homogeneous image points; s [m] along the runway, y [m] to the right.

    A point (s, y) of the runway's plane appears at q = threshold + s along + y across; ground = the inverse of that map.
    Lines have unit normals towards the brighter side: into the runway, up to the sky.
    """

    p_RC: Array
    R_CR: Array
    lens: Array  # f, cx, cy [px]
    frame: Array  # width, height [px]
    width: float  # [m] of the runway
    length: float
    slope: float  # [rad]
    along: Array
    across: Array
    threshold: Array
    up: Array
    ground: Array  # (3, 3)
    lines: Array  # (4, 3) by Feature


@kernel
def camera_pose(sight: Array, lever: Array) -> tuple[Array, Array]:
    """p_RC (3,), R_CR (3, 3) of the camera at `lever` (3,) [m] from the cg, frame B."""
    R_RB = from_euler(sight[3], sight[4], sight[5])
    R_CB = camera_from_body(sight[PAN], sight[TILT])
    p, R = np.empty(3), np.empty((3, 3))
    p[0], p[1], p[2] = sight[0], sight[1], -sight[2]
    for i in range(3):
        for j in range(3):
            p[i] += R_RB[i, j] * lever[j]
            R[i, j] = R_CB[i, 0] * R_RB[j, 0] + R_CB[i, 1] * R_RB[j, 1] + R_CB[i, 2] * R_RB[j, 2]
    return p, R


@kernel
def sight_from(
    entries: np.ndarray, signs: Array, mean: Array, cov: Array, pan: float, tilt: float, width: float
) -> tuple[Array, Array, bool]:
    """Sight (9,) and its covariance (9, 9), and whether the sight is finite.

    entries (m, 2), signs (m,): which element of the sight has which state in it, and whether it is added or taken off;
    mean (n,), cov (n, n) of the states; pan, tilt [rad] as read; width [m] where no state is one.
    """
    sight, across, spread = np.zeros(9), np.zeros((9, len(mean))), np.zeros((9, 9))
    for m in range(len(signs)):
        i, k = entries[m, 0], entries[m, 1]
        sight[i] += signs[m] * mean[k]
        for j in range(len(mean)):
            across[i, j] += signs[m] * cov[k, j]
    for m in range(len(signs)):
        i, k = entries[m, 0], entries[m, 1]
        for j in range(9):
            spread[j, i] += signs[m] * across[j, k]
    sight[PAN] += pan
    sight[TILT] += tilt
    if sight[WIDTH] == 0.0:
        sight[WIDTH] = width
    return sight, spread, math.isfinite(sight.sum())


@uncounted
def feature_line(
    feature: int, p_RC: Array, R_CR: Array, lens: Array, width: float, slope: float, u: float, v: float
) -> Vector:
    """l of the feature; the horizon's where the ray of pixel (u, v) looks."""
    azimuth = 0.0
    if feature == HORIZON:
        a, b = (u - lens[1]) / lens[0], (v - lens[2]) / lens[0]
        azimuth = math.atan2(a * R_CR[0, 1] + b * R_CR[1, 1] + R_CR[2, 1], a * R_CR[0, 0] + b * R_CR[1, 0] + R_CR[2, 0])
    return line_of(plane(feature, p_RC, width, slope, azimuth), R_CR, lens[0], lens[1], lens[2])


@uncounted
def dot(l: Array, q: Array) -> float:
    return l[0] * q[0] + l[1] * q[1] + l[2] * q[2]


@uncounted
def oriented(l: Vector, q: Array, out: Array) -> None:
    """`out` (3,) = l scaled to a unit normal, positive on the side of the homogeneous point or direction q."""
    norm = max(math.hypot(l[0], l[1]), 1e-12 * abs(l[2]), 1e-300)  # no direction: seen from its own plane, end on
    scale = (1.0 if l[0] * q[0] + l[1] * q[1] + l[2] * q[2] >= 0.0 else -1.0) / norm
    out[0], out[1], out[2] = l[0] * scale, l[1] * scale, l[2] * scale


@kernel
def _image_of(x: float, y: float, z: float, R: Array, lens: Array) -> Array:
    q = np.empty(3)
    a = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
    b = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
    q[2] = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
    q[0], q[1] = lens[0] * a + lens[1] * q[2], lens[0] * b + lens[2] * q[2]
    return q


@kernel
def point(q: Array, way: Array, s: float) -> Array:
    """The homogeneous point q + s way; by a loop, for numba takes longer to compile a sum of arrays."""
    out = np.empty(3)
    for i in range(3):
        out[i] = q[i] + s * way[i]
    return out


@kernel
def _inverse(a: Array, b: Array, c: Array) -> Array:
    """Inverse, up to scale, of the matrix with the columns a, b, c."""
    out = np.empty((3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[0, i] = b[j] * c[k] - b[k] * c[j]
        out[1, i] = c[j] * a[k] - c[k] * a[j]
        out[2, i] = a[j] * b[k] - a[k] * b[j]
    return out


@kernel
def look(sight: Array, lever: Array, lens: Array, frame: Array, length: float, slope: float) -> View:
    """The scene as it should appear. lens: f, cx, cy; frame: width, height [px]; length [m], slope [rad] of the runway."""
    p, R = camera_pose(sight, lever)
    width = sight[WIDTH]
    along = _image_of(math.cos(slope), 0.0, -math.sin(slope), R, lens)
    across = _image_of(0.0, 1.0, 0.0, R, lens)
    threshold = _image_of(-p[0], -p[1], -p[2], R, lens)
    up = _image_of(0.0, 0.0, -1.0, R, lens)
    u, v = (along[0] / along[2], along[1] / along[2]) if along[2] > 0.0 else (lens[1], lens[2])
    lines = np.empty((4, 3))
    for feature, side in enumerate((across, -across, along, up)):
        oriented(feature_line(feature, p, R, lens, width, slope, u, v), side, lines[feature])
    ground = _inverse(along, across, threshold)
    return View(p, R, lens, frame, width, length, slope, along, across, threshold, up, ground, lines)


@kernel
def jacobian(
    feature: np.ndarray, centre: Array, direction: Array, sight: Array, lever: Array, lens: Array, slope: float
) -> tuple[Array, Array]:
    """Predicted displacements h (n,) [px] and dh/dsight (n, 9) by central differences.

    Of the placing itself, so with the azimuth at which the horizon is looked at; `spread`, which is asked in every frame,
    takes the closed form.
    """
    n = len(feature)
    h, J = np.empty(n), np.empty((n, 9))
    p, R = camera_pose(sight, lever)
    for i in range(n):
        c, s = centre[i], direction[i]
        l = feature_line(feature[i], p, R, lens, sight[WIDTH], slope, c[0], c[1])
        h[i] = displacement(l, c[0], c[1], s[0], s[1])
    moved = sight.copy()
    for j in range(9):
        eps = 1e-5 if 3 <= j < WIDTH else 1e-3
        moved[j] = sight[j] + eps
        p_up, R_up = camera_pose(moved, lever)
        w_up = moved[WIDTH]
        moved[j] = sight[j] - eps
        p_dn, R_dn = camera_pose(moved, lever)
        w_dn = moved[WIDTH]
        moved[j] = sight[j]
        for i in range(n):
            c, s = centre[i], direction[i]
            up = feature_line(feature[i], p_up, R_up, lens, w_up, slope, c[0], c[1])
            dn = feature_line(feature[i], p_dn, R_dn, lens, w_dn, slope, c[0], c[1])
            J[i, j] = displacement(up, c[0], c[1], s[0], s[1]) - displacement(dn, c[0], c[1], s[0], s[1])
            J[i, j] /= 2.0 * eps
    return h, J


@kernel
def cut(a: float, b: float, lo: float, hi: float) -> tuple[float, float]:
    """The part of lo..hi where a + b s >= 0; lo > hi if there is none."""
    if b > 0.0:
        return max(lo, -a / b), hi
    if b < 0.0:
        return lo, min(hi, -a / b)
    if a >= 0.0:
        return lo, hi
    return 1.0, 0.0


@uncounted
def in_image(q0: Array, qd: Array, lo: float, hi: float, mu: float, mv: float, frame: Array) -> tuple[float, float]:
    """The part of lo..hi for which the point q0 + qd s is in front and inside the margins mu, mv [px]. No divide."""
    lo, hi = cut(q0[2] - NEAR, qd[2], lo, hi)
    lo, hi = cut(q0[0] - mu * q0[2], qd[0] - mu * qd[2], lo, hi)
    lo, hi = cut((frame[0] - 1.0 - mu) * q0[2] - q0[0], (frame[0] - 1.0 - mu) * qd[2] - qd[0], lo, hi)
    lo, hi = cut(q0[1] - mv * q0[2], qd[1] - mv * qd[2], lo, hi)
    return cut((frame[1] - 1.0 - mv) * q0[2] - q0[1], (frame[1] - 1.0 - mv) * qd[2] - qd[1], lo, hi)


@kernel
def spread(view: View, sight: Array, cov: Array, lever: Array, extra: float) -> Array:
    """sigma (4,) [px] of each feature's line normal to itself, the larger one of two places on it; cov (9, 9).

    The places: the visible ends of a borderline, the corners for the threshold, and for the horizon (or whatever is not in
    view) left and right of the centre. `extra` [px] is added in quadrature.
    """
    R_RB, axes, J = (
        from_euler(sight[3], sight[4], sight[5]),
        turning_axes(sight[3], sight[4], sight[PAN]),
        np.empty((8, 9)),
    )
    for i in range(8):
        side, which = i // 2, i % 2
        u, v = view.lens[1] + (which - 0.5) * 0.8 * view.frame[0], view.lens[2]
        q = np.zeros(3)
        if side in (LEFT, RIGHT):
            q0 = point(view.threshold, view.across, (side - 0.5) * view.width)
            lo, hi = in_image(q0, view.along, 0.0, view.length, 0.0, 0.0, view.frame)
            if lo < hi:
                q = point(q0, view.along, lo if which == 0 else hi)
        elif side == THRESHOLD:
            q = point(view.threshold, view.across, (which - 0.5) * view.width)
        if q[2] >= 0.5 * NEAR:
            u, v = q[0] / q[2], q[1] / q[2]
        crossing(
            side, u, v, view.lines[side, 0], view.lines[side, 1], view.p_RC, view.R_CR, R_RB, axes, lever, view.lens,
            view.width, view.slope, J, i,
        )  # fmt: skip
    sigma = np.zeros(4)
    for i in range(8):
        var = extra * extra
        for j in range(9):
            along = 0.0
            for k in range(9):
                along += cov[j, k] * J[i, k]
            var += J[i, j] * along
        sigma[i // 2] = max(sigma[i // 2], math.sqrt(max(0.0, var)))
    return sigma
