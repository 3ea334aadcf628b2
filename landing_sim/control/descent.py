"""Lunar descent on optic flow: guidance along a reference, attitude and thrust. Nothing but flows and pitch is used.

Guidance asks for the accelerations that let the errors of both flows die out,

    a_x = h* (omega_x*' + omega_x omega_z - k (omega_x - omega_x*)),   a_z alike with omega_z^2,

from which follow the thrust and the pitch that make them. h* is the reference's height: where the lander is higher by some
share it stays so, for equal flows keep h/h* as it is, and flies as much faster. At the reference's end omega_z is held:
height and sink rate then fall together, until a foot touches and the engine is cut.

Source     ours; Sabiron et al. 2014, section VI, names it as the next step, and the two ways to damp attitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from landing_sim.signals import Command, Estimate, Reference
from landing_sim.types import Array

Plan = Callable[[float], Array]
"""t -> (9,) X* (5,), a*, spin*, m*, x*: estimators.optic_flow.reference.Reference.at."""


@dataclass(frozen=True, slots=True)
class DescentSettings:
    """Bandwidths [1/s], limits [rad], constants of the lander."""

    flow_x: float = 0.25  # k of omega_x
    flow_z: float = 0.25
    attitude: float = 0.9  # [rad/s] of the pitch loop
    damping: float = 0.9
    lean: float = math.radians(10.0)  # pitch may differ by this from the reference's
    patience: float = 4.0  # [s] before the estimate is flown: its first guess must be forgotten
    rate: Literal["position", "estimate", "combined"] = "combined"  # what damps the attitude
    smoothing: float = 0.6  # [s] of the derivative of pitch
    gravity: float = 1.63  # [m/s^2]
    inertia: float = 1000.0  # [kg m^2] over the thrusters' arm [m]
    full_thrust: float = 3500.0  # [N]
    full_attitude: float = 60.0
    dry_mass: float = 658.0  # [kg]
    lowest: float = 1.5  # [m] that h* may fall to


@dataclass(frozen=True, slots=True)
class DescentGuidance:
    """interfaces.Guidance. Modes: "glide" along the reference, "flare" with omega_z held, "stopped" on the ground.

    Pitch is nose up outside; `extra` holds thrust acceleration [m/s^2] and the flows wanted [rad/s].
    """

    plan: Plan
    duration: float
    settings: DescentSettings

    def init(self) -> bool:
        """Whether a foot has touched."""
        return False

    def step(self, landed: bool, estimate: Estimate) -> tuple[bool, Reference]:
        s, t = self.settings, estimate.t
        landed = landed or bool(estimate.flags.get("on_ground", False))
        row, slope = self.wanted(t)
        h, q, wx, wz, theta = row[:5].tolist()
        a = float(row[5])
        extra = {"flow_x": wx, "flow_z": wz, "spin": float(row[6])}
        if landed:
            return True, _reference("stopped", h, 0.0, 0.0, 0.0, {**extra, "thrust_mps2": 0.0})
        if t >= s.patience:
            seen_x, seen_z = estimate["flow_x"], estimate["flow_z"]
            ax = h * (slope[0] + seen_x * seen_z - s.flow_x * (seen_x - wx))
            az = h * (slope[1] + seen_z * seen_z - s.flow_z * (seen_z - wz)) + s.gravity
            lean = math.atan2(ax, max(az, 0.2))
            theta_wanted = min(max(lean, theta - s.lean), theta + s.lean)
            a = max(0.0, az) / max(0.3, math.cos(-estimate["theta"]))
            theta = theta_wanted
        extra["thrust_mps2"] = a
        return False, _reference("glide" if t < self.duration else "flare", h, h * wz, -theta, -q, extra)

    def wanted(self, t: float) -> tuple[Array, tuple[float, float]]:
        """The reference's row at t, and omega_x*', omega_z*' there; after its end, omega_z held and the rest upright."""
        if t < self.duration:
            row = self.plan(t).copy()
            after = self.plan(min(t + 0.05, self.duration))
            dt = min(t + 0.05, self.duration) - t
            if dt < 1e-3:
                return row, (0.0, 0.0)
            return row, (float(after[2] - row[2]) / dt, float(after[3] - row[3]) / dt)
        row = self.plan(self.duration).copy()
        row[0] = max(self.settings.lowest, row[0] * math.exp(row[3] * (t - self.duration)))
        row[1] = row[2] = row[4] = 0.0
        row[6] = 0.0
        row[5] = self.settings.gravity + row[0] * row[3] ** 2
        return row, (0.0, 0.0)


def _reference(mode: str, h: float, climb: float, theta: float, q: float, extra: dict[str, float]) -> Reference:
    return Reference(mode, 0.0, h, climb, 0.0, 0.0, 0.0, theta, q, extra)


@dataclass(frozen=True, slots=True)
class AttitudeMemory:
    """Pitch before, its smoothed derivative, the rate's low-passed estimate (all nose up), the mass [kg], and when."""

    t: float
    theta: float
    slope: float
    slow: float
    mass: float


@dataclass(frozen=True, slots=True)
class DescentController:
    """interfaces.Controller: thrust over the mass left, attitude by pitch and a rate that is damped as settings say.

    burn : [kg/s] of (thrust, attitude force) [N]
    """

    settings: DescentSettings
    mass: float
    burn: Callable[[float, float], float]

    def init(self) -> AttitudeMemory:
        return AttitudeMemory(math.nan, 0.0, 0.0, 0.0, self.mass)

    def step(self, memory: AttitudeMemory, estimate: Estimate, reference: Reference) -> tuple[AttitudeMemory, Command]:
        s, t, theta, q = self.settings, estimate.t, estimate["theta"], estimate["q"]
        if reference.mode == "stopped":
            return memory, Command()
        if math.isnan(memory.t):
            memory = AttitudeMemory(t, theta, reference.r_ff, q, memory.mass)
        dt = t - memory.t
        slope, slow = memory.slope, memory.slow
        if dt > 0.0:
            share = 1.0 - math.exp(-dt / s.smoothing)
            slope += share * ((theta - memory.theta) / dt - slope)
            slow += share * (q - slow)
        # combined: what pitch says slowly, and what the estimate of the rate says fast
        rate = {"position": slope, "estimate": q, "combined": slope + q - slow}[s.rate]
        wanted = s.attitude**2 * (reference.theta_ff - theta) + 2.0 * s.damping * s.attitude * (reference.r_ff - rate)
        if t < s.patience:
            wanted = 0.0
        spin = -wanted + reference.extra.get("spin", 0.0)  # the thruster's sign: nose down
        attitude = min(1.0, max(-1.0, s.inertia * spin / s.full_attitude))
        throttle = min(1.0, max(0.0, memory.mass * reference.extra["thrust_mps2"] / s.full_thrust))
        mass = max(s.dry_mass, memory.mass - dt * self.burn(throttle * s.full_thrust, attitude * s.full_attitude))
        return AttitudeMemory(t, theta, slope, slow, mass), Command(elevator=attitude, throttle=throttle)
