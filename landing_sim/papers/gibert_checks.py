"""What Gibert et al. 2015 states as equations, checked against differences and projections: no simulation."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.linalg import expm

from landing_sim.estimators.ranging import perspective
from landing_sim.estimators.ranging.gains import HighGain
from landing_sim.geometry.so3 import from_euler
from landing_sim.papers.academic_example import A, B, course
from landing_sim.types import Array

FOCAL = 1500.0  # [px]


def psi_printed(x: Array) -> Array:
    """Psi as (3) prints it: with x1'/x3 where y1' is meant."""
    return np.array([x[0] / x[2], (A[0] @ x + B[0]) / x[2], x[1] / x[2]])


def rate_error_of_print() -> float:
    """[1/s] largest difference of x1'/x3 from the true rate of y1 over the example's first 8 s."""
    step = 1e-3
    x = course(step, 8.0)
    y1 = x[:, 0] / x[:, 2]
    true = (y1[2:] - y1[:-2]) / (2.0 * step)
    return float(np.max(np.abs([psi_printed(p)[1] for p in x[1:-1]] - true)))


def differences(psi: object, x: Array, step: float = 1e-6) -> Array:
    """(3, 3) central differences of a function of x (3,)."""
    assert callable(psi)
    columns = [(psi(x + step * e) - psi(x - step * e)) / (2.0 * step) for e in np.eye(3)]
    return np.column_stack(columns)


def determinant_error(output: int = 1) -> float:
    """Largest relative difference of d/x3^4 from |dPsi/dx| by differences, along the example where |d| > 0.05 m/s."""
    errors = []
    for x in course(0.1, 8.0):
        if abs(B[output - 1] - B[2] * x[output - 1] / x[2]) > 0.05:
            numeric = np.linalg.det(differences(lambda p: perspective.psi(p, A, B, output), x))
            errors.append(abs(numeric / perspective.determinant(x, B, output) - 1.0))
    return float(max(errors))


def determinant_of_print() -> float:
    """x3^4 |dPsi/dx| [m/s] of the printed Psi at t = 0: b1, where (5) has b1 - b3 y1."""
    x = course(1.0, 0.0)[0]
    return float(np.linalg.det(differences(psi_printed, x)) * x[2] ** 4)


def first_singularity() -> float:
    """[s] when d1 first vanishes in the example."""
    x = course(1e-3, 12.0)
    d1 = B[0] - B[2] * x[:, 0] / x[:, 2]
    return 1e-3 * float(np.argmax(d1 < 0.0))


def polynomial_error(kappa: HighGain) -> float:
    """Largest difference of F - K C's characteristic polynomial from (s + alpha)(s^2 + 2 xi omega s + omega^2), F 3 x 3."""
    k1, k2, k3 = kappa.continuous()
    closed = np.array([[-k1, 1.0, 0.0], [-k2, 0.0, 0.0], [0.0, 0.0, -k3]])
    wanted = np.polymul([1.0, kappa.alpha], [1.0, 2.0 * kappa.xi * kappa.omega, kappa.omega**2])
    return float(np.max(np.abs(np.poly(closed) - wanted)))


def motion_error(sign: float) -> float:
    """[m/s] by how much x' = sign ([omega]x x + v) misses the rate of a ground point, 5 km ahead of a camera that moves so.

    v and omega are the camera's own velocity and rate, in its axes.
    """
    v, w = np.array([2.0, 1.0, 70.0]), np.array([0.02, 0.05, -0.03])
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    point = np.array([-300.0, 250.0, 5000.0])  # seen at t = 0, where camera axes and ground axes agree

    def seen(t: float) -> Array:
        return np.asarray(expm(cross * t).T @ (point - v * t))

    true = (seen(1e-4) - seen(-1e-4)) / 2e-4
    return float(np.max(np.abs(sign * (cross @ point + v) - true)))


def rotation_error() -> float:
    """Largest entry of R_phi R_theta R_psi - R_BR over a grid of attitudes (remark 2)."""
    worst = 0.0
    for phi, theta, psi in _attitudes():
        c, s = math.cos, math.sin
        roll = np.array([[1, 0, 0], [0, c(phi), s(phi)], [0, -s(phi), c(phi)]])
        pitch = np.array([[c(theta), 0, -s(theta)], [0, 1, 0], [s(theta), 0, c(theta)]])
        yaw = np.array([[c(psi), s(psi), 0], [-s(psi), c(psi), 0], [0, 0, 1]])
        worst = max(worst, float(np.max(np.abs(roll @ pitch @ yaw - from_euler(phi, theta, psi).T))))
    return worst


def vanishing_point(phi: float, theta: float, heading: float) -> tuple[float, float, float]:
    """u, v [px] where the runway's side lines meet, and v where the horizon crosses u = 0, by projection.

    heading : the aircraft's, minus the runway's [rad]. The camera's axes are the aircraft's; u right, v down.
    """
    R_BR = from_euler(phi, theta, heading).T
    along, down = R_BR @ np.array([1.0, 0.0, 0.0]), R_BR @ np.array([0.0, 0.0, 1.0])
    return FOCAL * along[1] / along[0], FOCAL * along[2] / along[0], -FOCAL * down[0] / down[2]


READINGS = ("along the horizon, from the image's vertical mid-line", "horizontal", "from the foot of the perpendicular")


def feature(reading: int, phi: float, theta: float, heading: float) -> float:
    """d_F [px] as READINGS name it, positive to the right."""
    u, v, crossing = vanishing_point(phi, theta, heading)
    if reading == 0:
        return math.copysign(math.hypot(u, v - crossing), u)
    if reading == 1:
        return u
    slope = (v - crossing) / u  # the horizon's; the perpendicular from the image's centre meets it at foot
    foot = -slope * crossing / (1.0 + slope * slope)
    return math.copysign(math.hypot(1.0, slope) * abs(u - foot), u - foot)


def runway_heading(d_F: float, phi: float, theta: float) -> float:
    """Delta_psi [rad] by (19): the runway's heading minus the aircraft's."""
    return math.atan(math.cos(theta) * (d_F / FOCAL - math.tan(phi) * math.tan(theta)))


def heading_error(reading: int) -> float:
    """[rad] largest error of (19) for |roll| <= 35 deg."""
    return max(
        abs(runway_heading(feature(reading, phi, theta, psi), phi, theta) + psi) for phi, theta, psi in _attitudes()
    )


def _attitudes() -> Iterator[tuple[float, float, float]]:
    for phi in np.radians(np.linspace(-35.0, 35.0, 15)):
        for theta in np.radians([-6.0, -2.5, 0.0, 3.0, 5.0, 10.0]):
            for psi in np.radians([-19.0, -6.0, -3.0, -0.5, 0.7, 3.0, 8.0, 20.0]):
                yield float(phi), float(theta), float(psi)
