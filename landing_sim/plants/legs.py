"""Legs on ground and box tops: a spring, a damper and friction at each point, on the surface beneath that very point.

Tops are level where they are touched, so forces are along the vertical and across it. A box's side is no wall: what comes
from beside passes into it, and what hangs over an edge finds the ground below; a vehicle with its centre of gravity beyond
its feet tips over the edge.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from landing_sim.plants.jsbsim_quadrotor import Contact

STEP = 0.02  # [m] a surface higher than this above a point is beside it, not below
SLIP = 0.02  # [m/s] friction is viscous below this speed
VISCOUS = 60.0  # [N s/m] and never stiffer than this, which a step of 2 ms still integrates

Vector = tuple[float, float, float]
NOTHING: Vector = (0.0, 0.0, 0.0)


class Legs:
    """The points `contacts` over height(x, y) [m], the surface's height above z = 0."""

    def __init__(self, contacts: Sequence[Contact], height: Callable[[float, float], float]) -> None:
        self._contacts, self._height = tuple(contacts), height
        self.reset()

    def reset(self) -> None:
        """Forget which surface every point was above."""
        self._floor = [-math.inf] * len(self._contacts)
        self.clearance = [math.inf] * len(self._contacts)
        """[m] of every point above its surface at the last `reactions`; below 0 it is pressed in."""

    def reactions(self, p: Vector, R: Sequence[Vector], v: Vector, w: Vector) -> tuple[Vector, Vector]:
        """Force in R [N] and moment in B [N m] at the cg.

        p, v (3,) [m, m/s] of the cg in R; R rows of R_RB; w (3,) [rad/s] in B.
        """
        (a, b, c), (d, e, f), (g, h, i) = R
        fx = fy = fz = mx = my = mz = 0.0
        for k, contact in enumerate(self._contacts):
            bx, by, bz = contact.p_B
            up = -(p[2] + g * bx + h * by + i * bz)
            x, y = p[0] + a * bx + b * by + c * bz, p[1] + d * bx + e * by + f * bz
            below = self._height(x, y)
            if below <= up + STEP or self._floor[k] == -math.inf:
                self._floor[k] = below
            gap = self.clearance[k] = up - self._floor[k]
            if gap >= 0.0:
                continue
            ux, uy, uz = w[1] * bz - w[2] * by, w[2] * bx - w[0] * bz, w[0] * by - w[1] * bx
            vx, vy = v[0] + a * ux + b * uy + c * uz, v[1] + d * ux + e * uy + f * uz
            vz = v[2] + g * ux + h * uy + i * uz
            normal = -contact.stiffness * gap + contact.damping * vz
            if normal <= 0.0:
                continue
            viscous = min(contact.friction * normal / max(math.hypot(vx, vy), SLIP), VISCOUS)
            rx, ry, rz = -viscous * vx, -viscous * vy, -normal
            tx, ty, tz = a * rx + d * ry + g * rz, b * rx + e * ry + h * rz, c * rx + f * ry + i * rz  # in B
            fx, fy, fz = fx + rx, fy + ry, fz + rz
            mx, my, mz = mx + by * tz - bz * ty, my + bz * tx - bx * tz, mz + bx * ty - by * tx
        return (fx, fy, fz), (mx, my, mz)
