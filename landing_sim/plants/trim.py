"""Steady flight and its linear model, by our own Newton steps and central differences on the flight model.

JSBSim's own linearisation leaves out actuators and delays, stops the clock and can hang. Here actuators follow at once;
the engine's lag is left out because thrust itself is an input; the delayed downwash enters as its alpha-dot equivalent.
Earth turns under the aircraft, so an accurately level state has some 5e-3 m/s^2 of side acceleration: left in the residual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landing_sim.plants.jsbsim import FT, FlightModel, PlantError
from landing_sim.types import Array

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H")
INPUTS = ("elevator", "thrust", "aileron", "rudder")
PLACE = (math.radians(45.0), 0.0)  # latitude, longitude where gravity is taken, unless told otherwise; heading north

NO_GROUND = -1e5  # [ft] elevation of terrain too far below to matter


@dataclass(frozen=True, slots=True)
class TrimPoint:
    """Steady straight flight, wings level, still air."""

    airspeed: float  # [m/s] true
    gamma: float  # [rad] > 0 climbing
    flap: float  # 0..1
    mass: float  # [kg]
    height: float  # [m] above sea level
    alpha: float  # [rad]
    theta: float  # [rad]
    elevator: float  # [rad]
    throttle: float  # 0..1, each engine
    thrust: float  # [N] total
    max_thrust: float  # [N] total at this airspeed
    stabiliser: float | None = None  # [rad] as the elevator angle worth as much; None where there is none


@dataclass(frozen=True, slots=True)
class LinearModel:
    """dx/dt = A x + B u + G w + G_dot dw/dt about a trim: x STATES, u INPUTS, w (3,) [m/s] the air's velocity, body axes.

    u v w [m/s] inertial velocity, p q r [rad/s], phi theta psi [rad], x y H [m] in R with psi = 0 along x.
    """

    A: Array  # (12, 12)
    B: Array  # (12, 4)
    G: Array  # (12, 3)
    G_dot: Array  # (12, 3)
    states: tuple[str, ...]
    inputs: tuple[str, ...]


def trim(
    folder: Path, airspeed: float, gamma: float, flap: float, mass: float | None = None, height: float = 50.0,
    cg_offset_B: Array | None = None, clearance: float = math.inf, place: tuple[float, float] = PLACE,
    model: FlightModel | None = None, stabiliser: float | None = None,
) -> TrimPoint:  # fmt: skip
    """Find alpha, elevator and throttle for steady flight `height` [m] above sea level, `clearance` [m] above ground.

    Infinitely far from it there is no ground effect. `model` saves loading one. An aircraft with a stabiliser is trimmed
    by it and its elevator centred, unless the stabiliser [rad] is given: it is slow, so flight near an earlier trim is on
    the elevator. Raises PlantError, with what was reached, where there is no such flight.
    """
    m = FlightModel(folder, 0.005, mass, cg_offset_B) if model is None else model
    if stabiliser is not None:
        m.stabilise(stabiliser)
    by_stabiliser = m.stabiliser_limits is not None and stabiliser is None
    name, (low, high) = "elevator", (-m.ranges[0], m.ranges[0])
    if by_stabiliser and m.stabiliser_limits is not None:
        name, (low, high) = "stabiliser", m.stabiliser_limits

    def residual(z: Array) -> Array:
        """du, dw [m/s^2], dq [rad/s^2] for alpha, elevator or stabiliser, throttle."""
        alpha = float(z[0])
        if by_stabiliser:
            m.stabilise(float(z[1]))
        m.controls(0.0 if by_stabiliser else float(z[1]), 0.0, 0.0, float(z[2]), flap)
        m.set_terrain_ft(max(NO_GROUND, (height - clearance) / FT))
        uvw = airspeed * np.array([math.cos(alpha), 0.0, math.sin(alpha)])
        m.place((*place, height), np.array([0.0, alpha + gamma, 0.0]), uvw)
        return m.accelerations()[0][[0, 2, 4]]

    z, h = np.array([0.05, 0.0, 0.3]), 1e-4
    for _ in range(40):
        f = residual(z)
        if np.max(np.abs(f)) < 1e-9:
            break
        J = np.column_stack([(residual(z + d) - residual(z - d)) / (2.0 * h) for d in h * np.eye(3)])
        try:
            z = z + np.clip(np.linalg.solve(J, -f), -0.1, 0.1)
        except np.linalg.LinAlgError:
            break
        z[2] = min(max(z[2], 0.0), 1.0)
        if by_stabiliser:
            z[1] = min(max(z[1], low), high)
    f = residual(z)
    thrust = m.accelerations()[1]
    if not np.max(np.abs(f)) < 1e-6 or not low <= z[1] <= high:
        raise PlantError(
            f"no trim at {airspeed:g} m/s, gamma {math.degrees(gamma):g} deg, flap {flap:g}: reached alpha "
            f"{math.degrees(z[0]):.1f} deg, {name} {z[1]:.3f} of {low:g} ... {high:g} rad, throttle {z[2]:.2f} with "
            f"accelerations {f[0]:.2g}, {f[1]:.2g} m/s^2, {f[2]:.2g} rad/s^2"
        )
    residual(np.array([z[0], z[1], 1.0]))
    full = m.accelerations()[1]
    return TrimPoint(
        airspeed=airspeed, gamma=gamma, flap=flap, mass=m.mass, height=height, alpha=float(z[0]),
        theta=float(z[0]) + gamma, elevator=0.0 if by_stabiliser else float(z[1]), throttle=float(z[2]), thrust=thrust,
        max_thrust=full, stabiliser=float(z[1]) if by_stabiliser else stabiliser,
    )  # fmt: skip


def linearise(folder: Path, point: TrimPoint, model: FlightModel | None = None) -> LinearModel:
    """A, B, G about `point`, by central differences of the flight model's accelerations.

    Thrust [N] is the input and held: its fall with speed is not in A (subtract B_thrust dT/du to add it back).
    Where the flight model has a delayed downwash, the tail feels it tau late, eps(t - tau) ~ eps - tau deps/dt; with
    dalpha/dt from dw/dt and du/dt this is x' = A0 x + D c x', so A = (I - D c)^-1 A0, the same for B and G. Wind enters
    forces only, as -A0[:6, u v w], and dalpha/dt by its own rate: G_dot = -(I - D c)^-1 D c[u v w].
    Position and heading do not act on the forces, but height does (density).
    """
    m = FlightModel(folder, 0.005, point.mass) if model is None else model
    if point.stabiliser is not None:
        m.stabilise(point.stabiliser)
    V, alpha, theta = point.airspeed, point.alpha, point.theta
    x0 = np.array([V * math.cos(alpha), 0.0, V * math.sin(alpha), 0.0, 0.0, 0.0, 0.0, theta, point.height])
    u0 = np.array([point.elevator, point.throttle, 0.0, 0.0])

    def force(x: Array, u: Array) -> tuple[Array, float]:
        m.controls(u[0], u[2], u[3], u[1], point.flap)
        m.set_terrain_ft(NO_GROUND)
        m.place((*PLACE, x[8]), np.array([x[6], x[7], 0.0]), x[:3], x[3:6])
        return m.accelerations()

    def slope(of_input: bool, i: int, h: float) -> tuple[Array, float]:
        d = np.zeros(4 if of_input else 9)
        d[i] = h
        p, n = (force(x0, u0 + d), force(x0, u0 - d)) if of_input else (force(x0 + d, u0), force(x0 - d, u0))
        return (p[0] - n[0]) / (2 * h), (p[1] - n[1]) / (2 * h)

    columns = [slope(True, i, 1e-3) for i in range(4)]
    per_newton = columns[1][0] / columns[1][1]
    B = np.zeros((12, 4))
    for i in (0, 2, 3):
        B[:6, i] = columns[i][0]
    B[:6, 1] = per_newton
    A = np.zeros((12, 12))
    for i, (column, h) in enumerate(
        zip((0, 1, 2, 3, 4, 5, 6, 7, 11), (0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 5.0))
    ):
        a, t = slope(False, i, h)
        A[:6, column] = a - per_newton * t
    _kinematics(A, x0)
    G = np.zeros((12, 3))
    G[:6] = -A[:6, :3]

    if not m.has("aero/downwash-now-rad"):
        return LinearModel(A, B, G, np.zeros((12, 3)), STATES, INPUTS)

    # (I - D c) x' = A0 x + B0 u + G0 w
    path, h = "aero/downwash-shift-rad", 1e-3
    shift = []
    for sign in (1.0, -1.0):
        m.set(path, sign * h)
        shift.append(force(x0, u0)[0])
    m.set(path, 0.0)
    delay = m.get("aero/downwash-delay-sec")
    force(x0 + np.array([0, 0, 1e-2, 0, 0, 0, 0, 0, 0]), u0)
    eps_plus = m.get("aero/downwash-now-rad")
    force(x0 - np.array([0, 0, 1e-2, 0, 0, 0, 0, 0, 0]), u0)
    eps_alpha = (eps_plus - m.get("aero/downwash-now-rad")) / 2e-2 * V / math.cos(alpha)
    D = np.zeros((12, 1))
    D[:6, 0] = (shift[0] - shift[1]) / (2 * h) * (-delay * eps_alpha)
    c = np.zeros((1, 12))
    c[0, 0], c[0, 2] = -math.sin(alpha) / V, math.cos(alpha) / V
    lag = np.linalg.inv(np.eye(12) - D @ c)
    return LinearModel(lag @ A, lag @ B, lag @ G, -lag @ D @ c[:, :3], STATES, INPUTS)


def _kinematics(A: Array, x0: Array) -> None:
    """Rows phi theta psi x y H, wings level, psi = 0."""
    u, w, theta = x0[0], x0[2], x0[7]
    c, s = math.cos(theta), math.sin(theta)
    A[6, 3], A[6, 5] = 1.0, math.tan(theta)
    A[7, 4] = 1.0
    A[8, 5] = 1.0 / c
    A[9, 0], A[9, 2], A[9, 7] = c, s, -u * s + w * c
    A[10, 1], A[10, 6], A[10, 8] = 1.0, -w, u * c + w * s
    A[11, 0], A[11, 2], A[11, 7] = s, -c, u * c + w * s
