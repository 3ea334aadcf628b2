"""Steering and stopping on the wheels."""

from __future__ import annotations

import math

from landing_sim.control.believed import Believed, Motion
from landing_sim.control.settings import RolloutSettings
from landing_sim.control.tables import interpolate
from landing_sim.records import record
from landing_sim.signals import Reference


@record
class RolloutMemory:
    """What the schedules have reached: attitude [rad], elevator [rad] without feedback, mean brake."""

    attitude: float = 0.0
    elevator: float = 0.0
    brake: float = 0.0


class Rollout:
    """Yaw loop on offset and heading by rudder and differential brake, wings level, attitude and brakes by schedule."""

    __slots__ = ("settings",)

    def __init__(self, settings: RolloutSettings) -> None:
        self.settings = settings

    def step(
        self, memory: RolloutMemory, b: Believed, m: Motion, ref: Reference, dt: float
    ) -> tuple[RolloutMemory, tuple[float, float, float, float, float]]:
        """The next memory, and elevator, aileron, rudder [rad], left and right brake."""
        s = self.settings
        speed = math.hypot(m.x_dot, m.y_dot)
        at = s.groundspeed_mps
        attitude = _towards(interpolate(speed, at, s.attitude_deg), memory.attitude, s.attitude_rate_dps * dt)
        feed = _towards(interpolate(speed, at, s.elevator_deg), memory.elevator, s.elevator_rate_dps * dt)
        elevator = feed + s.attitude_gain * (b.theta - attitude) + s.pitch_rate_gain_s * b.q
        aileron = -s.roll_gain * b.phi - s.roll_rate_gain_s * b.p
        limit = math.radians(s.heading_limit_deg)
        heading = ref.psi + min(max(math.radians(s.y_gain_deg_per_m) * (ref.y - b.y), -limit), limit)
        error = math.remainder(heading - b.psi, 2.0 * math.pi)
        steer = s.heading_gain * error - s.yaw_rate_gain_s * b.r
        # The rudder's moment goes with airspeed squared; at low speed the brakes take over.
        rudder = -steer * min((s.steering_mps / max(m.airspeed, 1.0)) ** 2, 4.0)
        level = 1.0 if ref.mode == "stopped" else interpolate(speed, at, s.brake)
        brake = min(level, memory.brake + s.brake_rate_per_s * dt)
        turn = s.brake_steering_per_deg * math.degrees(steer) if ref.mode == "rollout" else 0.0
        left, right = min(max(brake - turn, 0.0), 1.0), min(max(brake + turn, 0.0), 1.0)
        return RolloutMemory(attitude, feed, brake), (elevator, aileron, rudder, left, right)


def _towards(wanted_deg: float, now: float, step_deg: float) -> float:
    """`now` [rad] moved towards wanted_deg by at most step_deg."""
    step = math.radians(step_deg)
    return min(max(math.radians(wanted_deg), now - step), now + step)
