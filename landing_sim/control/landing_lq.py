"""The landing controller: scheduled full-state feedback in the air, a yaw loop on the wheels, and the camera platform.

In the air  u = u_ref - K (x - x_ref), longitudinal (u w q theta H int_V int_H) and lateral (v p r phi psi y) apart.
u, v, w are velocities through the air, so that what acts on the wing is fed back, and the wind enters as a reference:
theta_ref carries the updraught, psi_ref (from guidance) the crab. A gust along the nose changes lift at once and airspeed
for a moment: it is taken out of the airspeed fed back, since engines are slower than it, and the elevator answers it by
itself. That a reported wind falls towards the ground is no gust: engines make up for it as it comes. Gains and trim are
interpolated over airspeed, those of the surfaces as moments (times V²).

Source     Dickmanns & Schell 1992, section 6: state feedback with integral action on speed and altitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.control.believed import Believed, Motion, moving
from landing_sim.control.blind_climb import climb
from landing_sim.control.design import Design, PointDesign
from landing_sim.control.pointing import look_along
from landing_sim.control.rollout import Rollout, RolloutMemory
from landing_sim.control.settings import ThrustSettings
from landing_sim.control.shear import expected_share
from landing_sim.control.tables import Schedule, interpolate
from landing_sim.records import record
from landing_sim.signals import Command, Estimate, Reference

GRAVITY = 9.80665
ON_TOUCHDOWN = RolloutMemory()


@record
class ControlMemory:
    """Integrals and the commands of the last cycle, from which rates are limited."""

    t: float = -math.inf
    mode: str = "acquire"
    int_V: float = 0.0  # [m]
    int_H: float = 0.0  # [m s]
    elevator: float = math.nan  # [rad]
    aileron: float = 0.0
    rudder: float = 0.0
    tailwind: float = math.nan  # [m/s] smoothed, along the nose, less what is expected
    asked: float = math.nan  # [rad] of the elevator, before its limits; where these are recovered from slowly
    rollout: RolloutMemory = ON_TOUCHDOWN


class LandingController:
    """interfaces.Controller. Constants only; all memory is in ControlMemory."""

    __slots__ = ("_camera", "_flaps", "_ground_effect", "_gust", "_integral", "_limits", "_look", "_per_gust", "_recovery",
                 "_reported", "_rollout", "_schedule", "_slowest", "_thrust", "_trim")  # fmt: skip

    def __init__(
        self, design: Design, look: tuple[float, float] = (0.0, 0.0), reported: tuple[float, float] | None = None
    ) -> None:
        """look: pan and tilt [rad] that the platform is held at until the runway is found; reported: the air's velocity
        [m/s] along R's x and y at 33 ft, if the tower has told.
        """
        s = design.settings
        points = sorted(design.points, key=lambda p: p.model.airspeed)
        self._schedule = Schedule(tuple(p.model.airspeed for p in points), tuple(_row(p) for p in points))
        self._slowest = 0.7 * points[0].model.airspeed
        approach = design.points[0].model
        self._thrust = ThrustMap(s.thrust)
        self._trim = (float(approach.inputs[0]), self._thrust.throttle(float(approach.inputs[1]), approach.airspeed))
        self._limits = tuple((math.radians(a.max_deg), math.radians(a.rate_dps), a.smoothing_s)
                             for a in (s.elevator, s.aileron, s.rudder))  # fmt: skip
        self._recovery = s.elevator.recovery_s
        self._integral = (s.integral_limits["int_V"], s.integral_limits["int_H"])
        c = s.camera
        self._camera, self._look = (math.radians(c.elevation_deg), math.radians(c.max_deg)), look
        self._reported = reported
        self._flaps = (s.flap, s.flap if s.rollout.flap is None else s.rollout.flap)
        self._ground_effect = s.ground_effect
        self._gust = s.gust
        self._per_gust = 0.0 if s.gust is None else math.radians(s.gust.elevator_deg_per_mps) * s.gust.airspeed_mps**2
        self._rollout = Rollout(s.rollout)

    def init(self) -> ControlMemory:
        return ControlMemory()

    def step(self, memory: ControlMemory, estimate: Estimate, reference: Reference) -> tuple[ControlMemory, Command]:
        elevation, most = self._camera
        blind = "blind" in reference.extra
        if reference.mode == "acquire" or (blind and not estimate.get("u") > 0.0):
            # nothing to fly by: the trim it began in, or with full power a blind climb
            elevator, throttle = self._trim
            throttle = 1.0 if reference.mode == "go_around" else throttle
            return ControlMemory(estimate.t, "acquire", elevator=elevator), Command(
                elevator, 0.0, 0.0, throttle, self._flaps[0], 0.0, 0.0, *self._look
            )
        b, m = moving(estimate)
        pan, tilt = self._look if blind else look_along(b.phi, b.theta, b.psi, 0.0, elevation)
        dt = min(max(estimate.t - memory.t, 0.0), 0.5)
        if blind:
            V = max(b.u, self._slowest)
            elevator, aileron, rudder, int_V = climb(
                self._schedule(V), V, b, b.u - reference.airspeed, memory.int_V, dt
            )
            throttle, int_H, tailwind = 1.0, 0.0, math.nan
            ground, left, right, flap = ON_TOUCHDOWN, 0.0, 0.0, self._flaps[0]
        elif reference.mode == "rollout" or reference.mode == "stopped":
            ground = memory.rollout
            if memory.mode not in ("rollout", "stopped"):
                ground = RolloutMemory(b.theta, memory.elevator if math.isfinite(memory.elevator) else 0.0)
            ground, (elevator, aileron, rudder, left, right) = self._rollout.step(ground, b, m, reference, dt)
            throttle = int_V = int_H = 0.0
            tailwind = math.nan
            flap = self._flaps[1]
        else:
            expected, shear = self._expected(b, m)
            tailwind, gust = self._gusts(memory, b, dt, expected)
            elevator, throttle, aileron, rudder, int_V, int_H = self._fly(memory, b, m, reference, dt, gust, shear)
            ground, left, right, flap = ON_TOUCHDOWN, 0.0, 0.0, self._flaps[0]
        last = memory.elevator if memory.elevator == memory.elevator else elevator
        asked = math.nan
        if self._recovery > 0.0:
            before = memory.asked if math.isfinite(memory.asked) else last
            asked = _smoothed(elevator, before, dt, self._limits[0][2])
            elevator = _followed(asked, before, last, dt, *self._limits[0][:2], self._recovery)
        else:
            elevator = _limited(elevator, last, dt, *self._limits[0])
        aileron = _limited(aileron, memory.aileron, dt, *self._limits[1])
        rudder = _limited(rudder, memory.rudder, dt, *self._limits[2])
        memory = ControlMemory(
            estimate.t, reference.mode, int_V, int_H, elevator, aileron, rudder, tailwind, asked, ground
        )
        return memory, Command(
            elevator, aileron, rudder, throttle, flap, left, right, _clip(pan, most), _clip(tilt, most)
        )

    def _expected(self, b: Believed, m: Motion) -> tuple[float, float]:
        """Tailwind along the nose [m/s] as reported, for this height, and the rate [m/s²] at which that changes."""
        if self._reported is None:
            return 0.0, 0.0
        share, slope = expected_share(b.H)
        along = self._reported[0] * math.cos(b.psi) + self._reported[1] * math.sin(b.psi)
        return along * share, along * slope * m.H_dot

    def _gusts(self, memory: ControlMemory, b: Believed, dt: float, expected: float) -> tuple[float, float]:
        """Tailwind along the nose less what is expected [m/s]: smoothed, and what is faster; without settings, none."""
        if self._gust is None:
            return math.nan, 0.0
        now = b.wx * math.cos(b.psi) + b.wy * math.sin(b.psi) - expected
        slow = memory.tailwind if math.isfinite(memory.tailwind) else now
        slow += dt / (dt + self._gust.filter_s) * (now - slow)
        return slow, now - slow

    def _fly(
        self, memory: ControlMemory, b: Believed, m: Motion, ref: Reference, dt: float, gust: float, shear: float
    ) -> tuple[float, float, float, float, float, float]:
        """elevator [rad], throttle, aileron, rudder [rad], int_V, int_H.

        gust: tailwind [m/s] that will not last; shear: rate [m/s²] of the one that does
        """
        extra = ref.extra.get
        V = max(m.airspeed + gust, self._slowest)
        (ke_u, ke_w, ke_q, ke_th, ke_H, ke_iV, ke_iH, kt_u, kt_w, kt_q, kt_th, kt_H, kt_iV, kt_iH,
         ka_v, ka_p, ka_r, ka_ph, ka_ps, ka_y, kr_v, kr_p, kr_r, kr_ph, kr_ps, kr_y,
         alpha, elevator0, thrust0, path0, mass, w_pull, el_pull, ph_slip, a_slip, r_slip, a_turn, r_turn,
         ) = self._schedule(V)  # fmt: skip
        per_q = 1.0 / (V * V)
        if self._ground_effect is not None and "wheel_height" in ref.extra:
            g, height = self._ground_effect, ref.extra["wheel_height"]
            if height < g.height_m[-1]:
                elevator0 += math.radians(interpolate(height, g.height_m, g.elevator_deg))
                alpha += math.radians(interpolate(height, g.height_m, g.alpha_deg))
        # What the reference asks for: a flight path through the air, its curvature, a speed and its change.
        wz = extra("downdraught", b.wz)
        path = (ref.climb_rate + wz) / V
        q_ref = extra("pull", 0.0) / V
        e_u = m.u_air + gust - ref.airspeed * math.cos(alpha)
        # Gusts faster than the wind that attitude is corrected for must not be taken for angle of attack, nor below for
        # sideslip: with attitude uncorrected, feedback of w and v is feedback of path and course.
        e_w = (
            m.w_air
            + (b.wz - wz) * math.cos(b.theta) * math.cos(b.phi)
            - ref.airspeed * math.sin(alpha)
            - w_pull * q_ref
        )
        e_q = b.q - q_ref
        e_th = b.theta - (alpha + path + ref.theta_ff + w_pull * q_ref / V)
        e_H = b.H - ref.height
        e_V = m.airspeed - ref.airspeed
        int_V = _clip(memory.int_V + e_V * dt, self._integral[0])
        int_H = _clip(memory.int_H + e_H * dt, self._integral[1])
        elevator = (
            elevator0
            + el_pull * q_ref
            - per_q * (ke_u * e_u + ke_w * e_w + ke_q * e_q + ke_th * e_th + ke_H * e_H + ke_iV * int_V + ke_iH * int_H)
            - per_q * self._per_gust * gust
        )
        thrust = (
            thrust0
            + mass * (GRAVITY * (path - path0) + extra("acceleration", 0.0) + shear)
            - (kt_u * e_u + kt_w * e_w + kt_q * e_q + kt_th * e_th + kt_H * e_H + kt_iV * int_V + kt_iH * int_H)
        )
        throttle = self._thrust.throttle(thrust, V)
        # An integral must not run on where its actuator is at its end or its error is not the true one.
        if not 0.0 <= throttle <= 1.0:
            int_V = memory.int_V if (throttle > 1.0) == (e_V < 0.0) else int_V
            throttle = min(max(throttle, 0.0), 1.0)
        if extra("idle", 0.0):
            int_V, throttle = memory.int_V, 0.0
        if abs(elevator) > self._limits[0][0] or not extra("on_path", 1.0):
            int_H = memory.int_H
        slip = V * extra("sideslip", 0.0)
        e_v = m.v_air + (b.wy - extra("crosswind", b.wy)) * math.cos(b.psi) * math.cos(b.phi) - slip
        e_r = b.r - ref.r_ff
        e_ph = b.phi - ref.phi - ph_slip * slip
        e_ps = math.remainder(b.psi - ref.psi, 2.0 * math.pi)
        e_y = b.y - ref.y
        aileron = (
            a_slip * slip
            + a_turn * ref.r_ff
            - per_q * (ka_v * e_v + ka_p * b.p + ka_r * e_r + ka_ph * e_ph + ka_ps * e_ps + ka_y * e_y)
        )
        rudder = (
            r_slip * slip
            + r_turn * ref.r_ff
            - per_q * (kr_v * e_v + kr_p * b.p + kr_r * e_r + kr_ph * e_ph + kr_ps * e_ps + kr_y * e_y)
        )
        return elevator, throttle, aileron, rudder, int_V, int_H


@dataclass(frozen=True, slots=True)
class ThrustMap:
    """Throttle for a thrust of all engines [N] at an airspeed: idle to full, linear; outside 0..1 where none will do."""

    settings: ThrustSettings

    def throttle(self, thrust: float, V: float) -> float:
        s = self.settings
        idle, full = interpolate(V, s.airspeed_mps, s.idle_n), interpolate(V, s.airspeed_mps, s.full_n)
        return (thrust - idle) / (full - idle)


def _row(point: PointDesign) -> np.ndarray:
    """What is scheduled, in the order in which _fly unpacks it."""
    m = point.model
    V2 = m.airspeed**2
    K, G = point.longitudinal.solution.K, point.lateral.solution.K
    alpha = math.atan2(m.state[2], m.state[0])
    trim = [alpha, m.inputs[0], m.inputs[1], m.flight_path, m.mass]
    return np.concatenate([K[0] * V2, K[1], G[0] * V2, G[1] * V2, trim, point.pull, point.sideslip, point.turn])


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _limited(value: float, last: float, dt: float, limit: float, rate: float, smoothing: float) -> float:
    """Smoothed with a time constant, within rate dt of the last value and within ±limit.

    Noise that runs a servo at its rate limit takes the loop's phase: it is kept from it.
    """
    if dt > 0.0:
        value = _smoothed(value, last, dt, smoothing)
        value = min(max(value, last - rate * dt), last + rate * dt)
    return min(max(value, -limit), limit)


def _smoothed(value: float, last: float, dt: float, smoothing: float) -> float:
    return last + dt / (dt + smoothing) * (value - last) if dt > 0.0 else value


def _followed(asked: float, before: float, last: float, dt: float, limit: float, rate: float, recovery: float) -> float:
    """Next command after `last`, where `asked` has come after `before`: the changes of what is asked, within the limits,
    and what these kept back, with the time constant `recovery` [s].

    Where no limit was met it is what is asked for. A limiter that makes for what is asked at its full rate goes on away
    from it until the two meet, long after it has turned back: with an elevator that is fast to saturate that is a lag of
    90 deg, and the aircraft is kept swinging.

    Source     The idea of phase-compensated rate limiting (Rundqwist & Stahl-Gunnarsson 1996), reduced to one state.
    """
    step = asked - before + dt / (dt + recovery) * (before - last)
    return min(max(last + min(max(step, -rate * dt), rate * dt), -limit), limit)
