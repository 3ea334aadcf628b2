"""Where a straight edge of the runway, or the horizon, crosses a search path in the image, and how that moves: closed form.

From the centre c along the unit vector s, with the normal n of the edge's plane through the camera centre and the rays
r_c = K^-1 (c, 1), r_s = K^-1 (s, 0),

    h  = -(m . r_c) / (m . r_s),         m = R_CR n
    dh = -(dm . rho) / (m . r_s),        rho = r_c + h r_s   (the ray through the point of the edge)

The filter's measurement equation and the placing of windows are both this.

Source     Dickmanns & Schell 1992, eqs. (4), (7). Departs: displacement of a line along a search path instead of image
           coordinates of a point, so that nothing is divided by a depth.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import EARTH_RADIUS, HORIZON, LEFT, RIGHT, THRESHOLD, horizon_dip, plane
from landing_sim.geometry.so3 import back, turned
from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array

BY_X, BY_Y, BY_H, BY_PHI, BY_THETA, BY_PSI, BY_PAN, BY_TILT, BY_WIDTH = range(9)  # columns of the derivatives


@kernel
def turning_axes(phi: float, theta: float, pan: float) -> Array:
    """(5, 3) axes in B about which phi, theta, psi [rad] turn the body, then pan and tilt the camera."""
    cph, sph, cth, sth = math.cos(phi), math.sin(phi), math.cos(theta), math.sin(theta)
    axes = np.zeros((5, 3))
    axes[0, 0] = 1.0
    axes[1, 1], axes[1, 2] = cph, -sph
    axes[2, 0], axes[2, 1], axes[2, 2] = -sth, cth * sph, cth * cph
    axes[3, 2] = 1.0
    axes[4, 0], axes[4, 1] = -math.sin(pan), math.cos(pan)
    return axes


@uncounted
def crossing(
    kind: int, cu: float, cv: float, su: float, sv: float, p_RC: Array, R_CR: Array, R_RB: Array, axes: Array,
    lever: Array, lens: Array, width: float, slope: float, J: Array, i: int,
) -> float:  # fmt: skip
    """h [px] of the feature `kind` from (cu, cv) along (su, sv), inf if parallel; row i of J (n, 9) becomes dh by x, y, H,
    phi, theta, psi of the body, pan, tilt of the camera and the runway's width [m, rad].

    p_RC, R_CR : the camera; R_RB, lever (3,) [m] : the body it is on, and its place there; axes : `turning_axes`
    lens : f, cx, cy [px]; slope [rad] of the runway
    """
    f = lens[0]
    ray_x, ray_y = (cu - lens[1]) / f, (cv - lens[2]) / f
    azimuth = 0.0
    if kind == HORIZON:
        r = back(R_CR, ray_x, ray_y, 1.0)
        azimuth = math.atan2(r[1], r[0])
    n = plane(kind, p_RC, width, slope, azimuth)
    m = turned(R_CR, n[0], n[1], n[2])
    den = (m[0] * su + m[1] * sv) / f
    if den == 0.0:
        for k in range(9):
            J[i, k] = 0.0
        return math.inf
    h = -(m[0] * ray_x + m[1] * ray_y + m[2]) / den
    rho = back(R_CR, ray_x + h * su / f, ray_y + h * sv / f, 1.0)
    # gradient of (dm . rho) with respect to the camera's position: n = (P - C) x d
    g0 = g1 = g2 = by_width = 0.0
    if kind == HORIZON:
        height = -p_RC[2]
        dip = horizon_dip(height)
        d_dip = EARTH_RADIUS / (EARTH_RADIUS + height) ** 2 / math.sin(dip) if height > 0.01 else 0.0
        cd, sd = math.cos(dip), math.sin(dip)
        g2 = -d_dip * (-cd * (math.cos(azimuth) * rho[0] + math.sin(azimuth) * rho[1]) - sd * rho[2])
    else:
        d0, d1, d2 = 0.0, 1.0, 0.0
        if kind != THRESHOLD:
            d0, d1, d2 = math.cos(slope), 0.0, -math.sin(slope)
        # -(d x rho)
        g0, g1, g2 = -(d1 * rho[2] - d2 * rho[1]), -(d2 * rho[0] - d0 * rho[2]), -(d0 * rho[1] - d1 * rho[0])
        by_width = 0.5 * g1 if kind == LEFT else -0.5 * g1 if kind == RIGHT else 0.0
    n_B, rho_B, g_B = back(R_RB, n[0], n[1], n[2]), back(R_RB, rho[0], rho[1], rho[2]), back(R_RB, g0, g1, g2)
    t0 = rho_B[1] * n_B[2] - rho_B[2] * n_B[1]
    t1 = rho_B[2] * n_B[0] - rho_B[0] * n_B[2]
    t2 = rho_B[0] * n_B[1] - rho_B[1] * n_B[0]
    l0 = lever[1] * g_B[2] - lever[2] * g_B[1]
    l1 = lever[2] * g_B[0] - lever[0] * g_B[2]
    l2 = lever[0] * g_B[1] - lever[1] * g_B[0]
    scale = -1.0 / den
    J[i, BY_X], J[i, BY_Y], J[i, BY_H], J[i, BY_WIDTH] = g0 * scale, g1 * scale, -g2 * scale, by_width * scale
    for k in range(3):
        J[i, BY_PHI + k] = (axes[k, 0] * (t0 + l0) + axes[k, 1] * (t1 + l1) + axes[k, 2] * (t2 + l2)) * scale
    for k in range(3, 5):
        J[i, BY_PHI + k] = (axes[k, 0] * t0 + axes[k, 1] * t1 + axes[k, 2] * t2) * scale
    return h
