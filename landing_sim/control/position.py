"""Where the quadrotor is into the tilt and thrust that bring it where it is wanted: one PID an axis of R.

    a = wn^2 (p* - p) + 2 zeta wn (v* - v) + wn^3 k_i ∫(p* - p) dt + a*

and a, with gravity, is the specific force to make: its direction is the tilt, its length the thrust. The integral finds
steady wind, thrust that is not as believed, and the tilt that the firmware's attitude is wrong by; it stands still while
a limit holds. The firmware follows the tilt.

Source     Brockers et al. 2012, section 3.1 ("three PID position controllers, one for each axis"); gains are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from landing_sim.signals import Command, Estimate, Reference

EPS = 1e-9  # [s]
MOTORS_OFF = ("wait", "cut")
"""Modes in which nothing turns."""
BLIND = "land_blind"


@dataclass(frozen=True, slots=True)
class PositionSettings:
    """Gains, limits, and the vehicle as it is believed.

    period : [s] between two commands; the last one holds
    bandwidth, damping : wn [rad/s] and zeta of the horizontal axes; `vertical` [rad/s] of the height
    integral : k_i, share of wn^3
    longest_error : [m] a position error counts no more than this
    """

    period: float = 0.02
    bandwidth: float = 3.6
    damping: float = 1.0
    vertical: float = 3.6
    vertical_damping: float = 1.0
    integral: float = 0.15
    longest_error: float = 0.5
    tilt: float = math.radians(20.0)
    climb: float = 3.0  # [m/s^2] that thrust may add to or take from the weight's
    trim: float = 1.5  # [m/s^2] that the integral may reach
    heading: float = 1.5  # [1/s] yaw rate over heading error
    turn: float = 1.0  # [rad/s] fastest
    mass: float = 1.0  # [kg]
    full_thrust: float = 28.05  # [N]
    gravity: float = 9.797  # [m/s^2]


FUSED = PositionSettings()
UNFUSED = PositionSettings(
    period=0.05, bandwidth=1.8, damping=0.85, vertical=1.9, vertical_damping=0.9, integral=0.2
)  # fmt: skip
"""Each the best that was found for its estimates: gusts of 0.23 N, latency 150 ms, hover."""

Vector = tuple[float, float, float]


class Memory(NamedTuple):
    """The command that holds until `due`; the integral (x, y, z of R) [m/s^2]."""

    due: float = -math.inf
    last: float = math.nan
    integral: Vector = (0.0, 0.0, 0.0)
    command: Command = Command()


class PositionController:
    """interfaces.Controller. Reads x y H vx vy vz psi; the reference's extra brings x, vx, vy [m, m/s] and, if it likes,
    ax, ay, az [m/s^2] in R.

    In the modes MOTORS_OFF there is no thrust and no integral. BLIND flies velocity alone: no position is believed.
    """

    def __init__(self, settings: PositionSettings | None = None) -> None:
        self.settings = settings or PositionSettings()

    def init(self) -> Memory:
        return Memory()

    def step(self, memory: Memory, estimate: Estimate, reference: Reference) -> tuple[Memory, Command]:
        if reference.mode in MOTORS_OFF:
            memory = Memory()
            return memory, memory.command
        s, t = self.settings, estimate.t
        if t < memory.due - EPS:
            return memory, memory.command
        dt = s.period if math.isnan(memory.last) else t - memory.last
        extra, blind = reference.extra, reference.mode == BLIND
        errors = (
            (extra["x"] - estimate["x"], extra["vx"] - estimate["vx"], extra.get("ax", 0.0)),
            (reference.y - estimate["y"], extra["vy"] - estimate["vy"], extra.get("ay", 0.0)),
            (estimate["H"] - reference.height, -reference.climb_rate - estimate["vz"], extra.get("az", 0.0)),
        )
        wanted, grown = [], []
        for axis, (e, e_dot, forward) in enumerate(errors):
            wn, zeta = (s.bandwidth, s.damping) if axis < 2 else (s.vertical, s.vertical_damping)
            e = 0.0 if blind else min(max(e, -s.longest_error), s.longest_error)
            wanted.append(wn * wn * e + 2.0 * zeta * wn * e_dot + memory.integral[axis] + forward)
            grown.append(memory.integral[axis] + dt * s.integral * wn**3 * e)
        across, up, limited = self._limit(wanted)
        kept = tuple(
            old if limited[axis] and abs(new) > abs(old) else min(max(new, -s.trim), s.trim)
            for axis, (old, new) in enumerate(zip(memory.integral, grown))
        )
        command = self._command(across, up, estimate["psi"], reference.psi)
        return Memory(t + s.period, t, (kept[0], kept[1], kept[2]), command), command

    def _limit(self, wanted: list[float]) -> tuple[tuple[float, float], float, tuple[bool, bool, bool]]:
        """Horizontal part of the specific force (x, y of R), its part upwards, and which axes were cut."""
        s = self.settings
        climb = min(max(-wanted[2], -s.climb), s.climb)
        up = s.gravity + climb
        longest, asked = up * math.tan(s.tilt), math.hypot(wanted[0], wanted[1])
        share = min(1.0, longest / asked) if asked > 0.0 else 1.0
        cut = share < 1.0
        return (share * wanted[0], share * wanted[1]), up, (cut, cut, climb != -wanted[2])

    def _command(self, across: tuple[float, float], up: float, psi: float, heading: float) -> Command:
        """Tilt that points the thrust, -z of the body, along the specific force, at the heading psi.

        f = -|f| R_RB e_z: in axes turned by psi, tan theta = -f_x / f_up and sin phi = f_y / |f|, theta nose up.
        """
        s = self.settings
        cos, sin = math.cos(psi), math.sin(psi)
        ahead, right = cos * across[0] + sin * across[1], cos * across[1] - sin * across[0]
        force = math.sqrt(ahead * ahead + right * right + up * up)
        error = math.remainder(heading - psi, math.tau)
        return Command(
            elevator=math.atan2(ahead, up),
            aileron=math.asin(right / force),
            rudder=-min(max(s.heading * error, -s.turn), s.turn),
            throttle=min(1.0, s.mass * force / s.full_thrust),
        )
