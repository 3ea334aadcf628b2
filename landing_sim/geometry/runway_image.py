"""How the runway's straight edges and the horizon appear in a pinhole image: closed form, no divide, no near plane.

An image line is l (3,) with l . (u, v, 1) = 0. A straight edge through the point P along d, seen from C, spans with C a
plane of normal n = (P - C) x d, and its image is l = K^-T R_CR n, for any position of the camera: also when one end lies
behind it. Both the filter's measurement equation and the placing of windows use these lines; the renderer does not
(it projects polygons), so that each checks the other.

Source     Dickmanns & Schell 1992, eq. (4), written for lines instead of points.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array

Vector = tuple[float, float, float]

EARTH_RADIUS = 6.371e6  # [m] mean; the horizon dips by acos(R / (R + h))

LEFT, RIGHT, THRESHOLD, HORIZON = 0, 1, 2, 3  # values of signals.Feature


@kernel
def horizon_dip(height: float) -> float:
    """Depression of the horizon [rad] seen from `height` [m] above the ground; 4.0 mrad at 51 m. Zero below ground."""
    h = max(height, 0.0)
    return math.acos(EARTH_RADIUS / (EARTH_RADIUS + h))


@kernel
def plane_normal(feature: int, p_RC: Array, width: float, slope: float, azimuth: float) -> Array:
    """n (3,), frame R, of the plane through the camera centre and the feature. Not normalised.

    width [m] of the runway; slope [rad] > 0 uphill along x; azimuth [rad] in R, where the horizon is looked at: there
    the plane touches the dip cone.
    """
    n = np.empty(3)
    n[0], n[1], n[2] = plane(feature, p_RC, width, slope, azimuth)
    return n


@uncounted
def plane(feature: int, p_RC: Array, width: float, slope: float, azimuth: float) -> Vector:
    """`plane_normal` as three floats: hundreds are wanted a frame, and an array each would cost as much as the rest."""
    if feature == HORIZON:
        dip = horizon_dip(-p_RC[2])
        return -math.sin(dip) * math.cos(azimuth), -math.sin(dip) * math.sin(azimuth), math.cos(dip)
    a, c = -p_RC[0], -p_RC[2]
    if feature == THRESHOLD:
        return -c, 0.0, a
    b = (-0.5 if feature == LEFT else 0.5) * width - p_RC[1]
    dx, dz = math.cos(slope), -math.sin(slope)
    return b * dz, c * dx - a * dz, -b * dx


@kernel
def image_line(n_R: Array, R_CR: Array, f: float, cx: float, cy: float) -> Array:
    """l (3,) = K^-T R_CR n: image of the plane with normal n through the camera centre. f, cx, cy [px]."""
    l = np.empty(3)
    l[0], l[1], l[2] = line_of((n_R[0], n_R[1], n_R[2]), R_CR, f, cx, cy)
    return l


@uncounted
def line_of(n_R: Vector, R_CR: Array, f: float, cx: float, cy: float) -> Vector:
    """`image_line` as three floats."""
    a = R_CR[0, 0] * n_R[0] + R_CR[0, 1] * n_R[1] + R_CR[0, 2] * n_R[2]
    b = R_CR[1, 0] * n_R[0] + R_CR[1, 1] * n_R[1] + R_CR[1, 2] * n_R[2]
    c = R_CR[2, 0] * n_R[0] + R_CR[2, 1] * n_R[1] + R_CR[2, 2] * n_R[2]
    return a / f, b / f, c - (a * cx + b * cy) / f


@uncounted
def displacement(l: Array | Vector, cu: float, cv: float, su: float, sv: float) -> float:
    """Signed distance [px] from (cu, cv) to the line l along the unit vector (su, sv); inf if parallel."""
    den = l[0] * su + l[1] * sv
    if den == 0.0:
        return math.inf
    return -(l[0] * cu + l[1] * cv + l[2]) / den
