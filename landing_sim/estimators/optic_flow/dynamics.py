"""The lander in its vertical plane, as it is believed: what the reference is made with and the filters predict with.

    Vx' = sin(theta) u_th/m,   Vz' = cos(theta) u_th/m - g,   q' = (R/I) u_theta,   theta' = q,   h' = Vz
    m' = -u_th/(Isp_th g_E) - |u_theta|/(Isp_theta g_E)                                                        (2)

and the same in X = [h, q, omega_x, omega_z, theta], where h is all that is left of the scale.

Source     Sabiron et al. 2014, section II. I and R are not published: ours, of a 758 kg lander.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array

G_EARTH = 9.81  # [m/s^2] of the specific impulses, as the paper has it


@dataclass(frozen=True, slots=True)
class Lander:
    """Constants of eq. (2)."""

    gravity: float = 1.63  # [m/s^2]
    inertia: float = 1000.0  # [kg m^2] I
    arm: float = 1.0  # [m] R, of the attitude thrusters
    isp_main: float = 325.0  # [s]
    isp_attitude: float = 287.0

    @property
    def agility(self) -> float:
        """R/I [rad/s^2 per N]."""
        return self.arm / self.inertia

    def burn(self, thrust: float, attitude: float) -> float:
        """[kg/s] used by thrust u_th and attitude force u_theta [N]."""
        return thrust / (self.isp_main * G_EARTH) + abs(attitude) / (self.isp_attitude * G_EARTH)

    def rates(self, state: Array, thrust: float, attitude: float) -> Array:
        """d/dt of [x, h, Vx, Vz, theta, q, m]: eq. (2) in metres."""
        _, _, vx, vz, theta, q, m = state
        a = thrust / m
        return np.array(
            [
                *(vx, vz, a * math.sin(theta), a * math.cos(theta) - self.gravity),
                *(q, self.agility * attitude, -self.burn(thrust, attitude)),
            ]
        )


@kernel
def state_rates(X: Array, a: float, spin: float, g: float, out: Array) -> None:
    """out (5,) = X' under thrust acceleration a = u_th/m [m/s^2] and spin = (R/I) u_theta [rad/s^2]."""
    h, q, wx, wz, th = X[0], X[1], X[2], X[3], X[4]
    out[0] = wz * h
    out[1] = spin
    out[2] = a * math.sin(th) / h - wx * wz
    out[3] = (a * math.cos(th) - g) / h - wz * wz
    out[4] = q


@kernel
def state_jacobian(X: Array, a: float, g: float, A: Array) -> None:
    """A (5, 5) = dX'/dX: eq. (13) at X."""
    h, wx, wz, s, c = X[0], X[2], X[3], math.sin(X[4]), math.cos(X[4])
    A[:, :] = 0.0
    A[0, 0] = wz
    A[0, 3] = h
    A[2, 0] = -a * s / (h * h)
    A[2, 2] = -wz
    A[2, 3] = -wx
    A[2, 4] = a * c / h
    A[3, 0] = (g - a * c) / (h * h)
    A[3, 3] = -2.0 * wz
    A[3, 4] = -a * s / h
    A[4, 1] = 1.0


@kernel
def advance(X: Array, a: float, spin: float, g: float, dt: float) -> Array:
    """X (5,) after dt [s] by one Runge-Kutta step."""
    k1, k2, k3, k4 = np.empty(5), np.empty(5), np.empty(5), np.empty(5)
    state_rates(X, a, spin, g, k1)
    state_rates(X + 0.5 * dt * k1, a, spin, g, k2)
    state_rates(X + 0.5 * dt * k2, a, spin, g, k3)
    state_rates(X + dt * k3, a, spin, g, k4)
    return X + (dt / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@kernel
def exponential(A: Array, dt: float) -> Array:
    """exp(A dt) for |A dt| well below 1: eight terms of its series."""
    n = A.shape[0]
    out, term = np.eye(n), np.eye(n)
    for k in range(1, 9):
        term = term @ A * (dt / k)
        out = out + term
    return out
