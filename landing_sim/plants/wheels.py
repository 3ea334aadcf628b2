"""Wheels and skids on the runway's surface: a plane through the threshold, level across and sloping along.

JSBSim's own gear knows only level terrain. The figures are the ones its file gives under ground_reactions, with the same
meaning: a linear spring and damper along the surface's normal, rolling friction, brakes as a fraction of static friction.
The tangential force is a bristle: a spring that is dragged along. At rest it holds; rolling, its side deflection relaxes
over a distance sigma, which gives a cornering stiffness k_t sigma; it slips at the friction limit.

Source     relaxation length: Pacejka, "Tire and Vehicle Dynamics", chapter 5 (stretched string). Bristles at rest:
           Canudas de Wit et al. 1995 (LuGre).
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.plants.jsbsim import PlantError
from landing_sim.types import Array

K, C, C_REBOUND, MU, MU_ROLL, BRAKE, SKID = range(7)  # columns of Contacts.values
TANGENTIAL_STIFFNESS = 1.5  # of the leg's: estimate
TANGENTIAL_DAMPING = 0.12  # [s] of the tangential stiffness: bristles at rest settle in a few swings
RELAXATION = 0.35  # [m] sigma: some half a wheel diameter
NO_BRAKE, LEFT, RIGHT = 0.0, 1.0, 2.0

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Contacts:
    """The points that may touch the ground: left main, right main, tail or nose wheel, then skids."""

    names: tuple[str, ...]
    p_B: Array  # (n, 3) [m] bottom of the extended wheel from the nominal cg
    values: Array  # (n, 7) K [N/m], C, C_REBOUND [N s/m], MU, MU_ROLL, BRAKE group, SKID 0 or 1


def read_contacts(path: Path, origin: Array) -> Contacts:
    """The contacts of a JSBSim file; `origin` (3,) [m] of the nominal cg in its structural frame. Raises PlantError."""

    def number(contact: ElementTree.Element, name: str, unit: str | None = None) -> float:
        element = contact.find(name)
        if element is None or element.text is None or element.get("unit") != unit:
            raise PlantError(
                f"{path.name}: contact {contact.get('name')} needs {name}" + (f" in {unit}" if unit else "")
            )
        return float(element.text)

    rows: list[tuple[float, str, Array, Array]] = []
    for contact in ElementTree.parse(path).getroot().iterfind("ground_reactions/contact"):
        location = contact.find("location")
        if location is None or location.get("unit") != "M":
            raise PlantError(f"{path.name}: contact {contact.get('name')} needs its location in M")
        p = np.array([number(location, axis) for axis in "xyz"]) - origin
        skid = contact.get("type") != "BOGEY"
        k, c = number(contact, "spring_coeff", "N/M"), number(contact, "damping_coeff", "N/M/SEC")
        mu = number(contact, "static_friction")
        group = (contact.findtext("brake_group") or "NONE").strip()
        brake = {"LEFT": LEFT, "RIGHT": RIGHT}.get(group, NO_BRAKE)
        rebound = c if skid else number(contact, "damping_coeff_rebound", "N/M/SEC")
        rolling = mu if skid else number(contact, "rolling_friction")
        order = 4.0 if skid else (brake or 3.0)
        values = np.array([k, c, rebound, mu, rolling, brake, float(skid)])
        rows.append((order, contact.get("name", ""), p * np.array([-1.0, 1.0, -1.0]), values))
    rows.sort(key=lambda row: row[0])
    if [row[0] for row in rows[:3]] != [1.0, 2.0, 3.0]:
        raise PlantError(f"{path.name}: needs a left and a right main wheel (by brake_group) and one other wheel")
    return Contacts(tuple(r[1] for r in rows), np.array([r[2] for r in rows]), np.array([r[3] for r in rows]))


@uncounted
def heights(p_RB: Array, R_RB: Array, slope: float, p_B: Array, out: Array) -> float:
    """Height [m] of each point p_B (n, 3) above the surface, along its normal, into out (n,); returns the least.

    slope [rad] > 0 uphill along x. A wheel's height is that of its extended leg: on the ground it is below zero.
    """
    s, c = math.sin(slope), math.cos(slope)
    least = math.inf
    for i in range(p_B.shape[0]):
        x, z = p_RB[0], p_RB[2]
        for j in range(3):
            x += R_RB[0, j] * p_B[i, j]
            z += R_RB[2, j] * p_B[i, j]
        out[i] = -s * x - c * z
        least = min(least, out[i])
    return least


@kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@uncounted
def reactions(
    R_RB: Array, v_R: Array, w_B: Array, slope: float, brake_left: float, brake_right: float, dt: float,
    p_B: Array, values: Array, height: Array, bristle: Array, out: Array,
) -> None:  # fmt: skip
    """Force [N] and moment about B's origin [N m], body axes, into the rows of out (2, 3).

    v_R (3,) [m/s] of B's origin; w_B (3,) [rad/s]; height (n,) [m] from `heights`; bristle (n, 2) [m] along and across,
    carried from step to step.
    """
    x, z = -math.sin(slope), -math.cos(slope)  # the surface's normal in R, upwards; then in B
    n = (R_RB[0, 0] * x + R_RB[2, 0] * z, R_RB[0, 1] * x + R_RB[2, 1] * z, R_RB[0, 2] * x + R_RB[2, 2] * z)
    # along: body x laid on the surface; across: to its right
    flat = math.sqrt((1.0 - n[0] * n[0]) ** 2 + (n[0] * n[1]) ** 2 + (n[0] * n[2]) ** 2)
    along = ((1.0 - n[0] * n[0]) / flat, -n[0] * n[1] / flat, -n[0] * n[2] / flat)
    across = _cross(along, n)
    turn = (w_B[0], w_B[1], w_B[2])
    v = (
        R_RB[0, 0] * v_R[0] + R_RB[1, 0] * v_R[1] + R_RB[2, 0] * v_R[2],
        R_RB[0, 1] * v_R[0] + R_RB[1, 1] * v_R[1] + R_RB[2, 1] * v_R[2],
        R_RB[0, 2] * v_R[0] + R_RB[1, 2] * v_R[1] + R_RB[2, 2] * v_R[2],
    )
    for j in range(3):
        out[0, j] = out[1, j] = 0.0
    for i in range(p_B.shape[0]):
        h = height[i]
        if h >= 0.0:
            bristle[i, 0] = bristle[i, 1] = 0.0
            continue
        arm = (p_B[i, 0] - h * n[0], p_B[i, 1] - h * n[1], p_B[i, 2] - h * n[2])
        swept = _cross(turn, arm)
        moving = (v[0] + swept[0], v[1] + swept[1], v[2] + swept[2])
        closing = -_dot(moving, n)
        normal = -values[i, K] * h + closing * (values[i, C] if closing > 0.0 else values[i, C_REBOUND])
        if normal <= 0.0:
            continue
        v_along, v_across = _dot(moving, along), _dot(moving, across)
        brake = brake_left if values[i, BRAKE] == LEFT else brake_right if values[i, BRAKE] == RIGHT else 0.0
        mu, rolling = values[i, MU], values[i, MU_ROLL]
        k = TANGENTIAL_STIFFNESS * values[i, K]
        c = TANGENTIAL_DAMPING * k
        grip = mu * normal

        limit = (rolling + brake * (mu - rolling)) * normal
        a = bristle[i, 0] + dt * v_along
        f_along = -k * a - c * v_along
        if abs(f_along) > limit:
            f_along = math.copysign(limit, f_along)
            a = -f_along / k
        bristle[i, 0] = a

        old = bristle[i, 1]
        roll = 0.0 if values[i, SKID] > 0.0 else abs(v_along)
        b = (old + dt * v_across) / (1.0 + dt * roll / RELAXATION)
        f_across = -k * b - c * (b - old) / dt
        limit = math.sqrt(max(grip * grip - f_along * f_along, 0.0))
        if abs(f_across) > limit:
            f_across = math.copysign(limit, f_across)
            # no further than the spring alone slips: set there, it would swing back within a step and push the other way
            b = min(max(b, -limit / k), limit / k)
        bristle[i, 1] = b

        force = (
            normal * n[0] + f_along * along[0] + f_across * across[0],
            normal * n[1] + f_along * along[1] + f_across * across[1],
            normal * n[2] + f_along * along[2] + f_across * across[2],
        )
        moment = _cross(arm, force)
        for j in range(3):
            out[0, j] += force[j]
            out[1, j] += moment[j]
