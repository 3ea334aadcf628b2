"""Measurement equation of the edge windows and its Jacobian (eqs. 4 and 7), closed form, compiled.

Window i looks from centre c along the unit vector s for the image of a straight edge; with the edge's plane normal n
through the camera centre and the rays r_c = K^-1 (c, 1), r_s = K^-1 (s, 0),

    h  = -(m . r_c) / (m . r_s),         m = R_CR n
    dh = -(dm . rho) / (m . r_s),        rho = r_c + h r_s   (the ray through the predicted edge point)

Source     Dickmanns & Schell 1992, eqs. (4), (7). Departs: displacement of a line along a search path instead of image
           coordinates of a point, so that nothing is divided by a depth.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.estimators.states import EPAN, ETILT, JPAN, JTILT, PHI, PSI, THETA, WIDTH, H, X, Y
from landing_sim.geometry.runway_image import EARTH_RADIUS, HORIZON, LEFT, RIGHT, THRESHOLD, horizon_dip, plane
from landing_sim.geometry.so3 import camera_from_body, from_euler, product, turned
from landing_sim.jit import kernel
from landing_sim.types import Array


@kernel
def edge_model(
    x: Array,
    feature: Array,
    centre: Array,
    direction: Array,
    pan: float,
    tilt: float,
    lever: Array,
    focal: Array,
    slope: float,
    h: Array,
    Hx: Array,
) -> None:
    """Fill h (n,) [px] and Hx (n, 26) = dh/dx for n windows.

    x (26,) layout of `states`; feature (n,) Feature codes; centre, direction (n, 2) [px]; pan, tilt [rad] as the encoders
    say (their errors are part of x: reading = true + bias + noise); lever (3,) camera in body axes [m]; focal (3,) f, cx,
    cy [px].
    """
    f, cx, cy = focal[0], focal[1], focal[2]
    phi, theta, psi = x[PHI], x[THETA], x[PSI]
    R_RB = from_euler(phi, theta, psi)
    true_pan = pan - x[EPAN] - x[JPAN]
    R_CB = camera_from_body(true_pan, tilt - x[ETILT] - x[JTILT])
    R_BR = R_RB.T.copy()
    R_CR = product(R_CB, R_BR)
    p_RC, arm = np.empty(3), turned(R_RB, lever[0], lever[1], lever[2])
    p_RC[0], p_RC[1], p_RC[2] = arm[0] + x[X], arm[1] + x[Y], arm[2] - x[H]
    cph, sph, cth, sth = math.cos(phi), math.sin(phi), math.cos(theta), math.sin(theta)
    # axes in B about which phi, theta, psi turn the body, then pan and tilt the camera
    axes = np.zeros((5, 3))
    axes[0, 0] = 1.0
    axes[1, 1], axes[1, 2] = cph, -sph
    axes[2, 0], axes[2, 1], axes[2, 2] = -sth, cth * sph, cth * cph
    axes[3, 2] = -1.0  # true pan = reading - errors
    axes[4, 0], axes[4, 1] = math.sin(true_pan), -math.cos(true_pan)

    for i in range(Hx.shape[0]):
        for k in range(Hx.shape[1]):
            Hx[i, k] = 0.0
    ray = np.empty(3)
    rho_R = np.empty(3)
    g = np.empty(3)
    for i in range(feature.shape[0]):
        kind = feature[i]
        ray[0], ray[1], ray[2] = (centre[i, 0] - cx) / f, (centre[i, 1] - cy) / f, 1.0
        azimuth = 0.0
        if kind == HORIZON:
            dx = R_CR[0, 0] * ray[0] + R_CR[1, 0] * ray[1] + R_CR[2, 0]
            dy = R_CR[0, 1] * ray[0] + R_CR[1, 1] * ray[1] + R_CR[2, 1]
            azimuth = math.atan2(dy, dx)
        n = plane(kind, p_RC, x[WIDTH], slope, azimuth)
        m = turned(R_CR, n[0], n[1], n[2])
        den = (m[0] * direction[i, 0] + m[1] * direction[i, 1]) / f
        if den == 0.0:
            h[i] = math.inf
            continue
        h[i] = -(m[0] * ray[0] + m[1] * ray[1] + m[2]) / den
        rho_x = ray[0] + h[i] * direction[i, 0] / f
        rho_y = ray[1] + h[i] * direction[i, 1] / f
        for k in range(3):
            rho_R[k] = R_CR[0, k] * rho_x + R_CR[1, k] * rho_y + R_CR[2, k]
        # gradient of (dm . rho) with respect to the camera's position: n = (P - C) x d
        g[0] = g[1] = g[2] = 0.0
        if kind == HORIZON:
            height = -p_RC[2]
            dip = horizon_dip(height)
            d_dip = EARTH_RADIUS / (EARTH_RADIUS + height) ** 2 / math.sin(dip) if height > 0.01 else 0.0
            cd, sd = math.cos(dip), math.sin(dip)
            g[2] = -d_dip * (-cd * (math.cos(azimuth) * rho_R[0] + math.sin(azimuth) * rho_R[1]) - sd * rho_R[2])
        else:
            e0, e1, e2 = 0.0, 1.0, 0.0
            if kind != THRESHOLD:
                e0, e1, e2 = math.cos(slope), 0.0, -math.sin(slope)
            # -(d x rho)
            g[0] = -(e1 * rho_R[2] - e2 * rho_R[1])
            g[1] = -(e2 * rho_R[0] - e0 * rho_R[2])
            g[2] = -(e0 * rho_R[1] - e1 * rho_R[0])
            if kind == LEFT:
                Hx[i, WIDTH] = 0.5 * g[1]
            elif kind == RIGHT:
                Hx[i, WIDTH] = -0.5 * g[1]
        Hx[i, X], Hx[i, Y], Hx[i, H] = g[0], g[1], -g[2]
        n_B = turned(R_BR, n[0], n[1], n[2])
        rho_B = turned(R_BR, rho_R[0], rho_R[1], rho_R[2])
        g_B = turned(R_BR, g[0], g[1], g[2])
        t0 = rho_B[1] * n_B[2] - rho_B[2] * n_B[1]
        t1 = rho_B[2] * n_B[0] - rho_B[0] * n_B[2]
        t2 = rho_B[0] * n_B[1] - rho_B[1] * n_B[0]
        l0 = lever[1] * g_B[2] - lever[2] * g_B[1]
        l1 = lever[2] * g_B[0] - lever[0] * g_B[2]
        l2 = lever[0] * g_B[1] - lever[1] * g_B[0]
        for k in range(3):
            Hx[i, PHI + k] = axes[k, 0] * (t0 + l0) + axes[k, 1] * (t1 + l1) + axes[k, 2] * (t2 + l2)
        Hx[i, EPAN] = axes[3, 0] * t0 + axes[3, 1] * t1 + axes[3, 2] * t2
        Hx[i, ETILT] = axes[4, 0] * t0 + axes[4, 1] * t1 + axes[4, 2] * t2
        for k in range(PHI, WIDTH + 1):
            Hx[i, k] *= -1.0 / den
        Hx[i, JPAN], Hx[i, JTILT] = Hx[i, EPAN], Hx[i, ETILT]
