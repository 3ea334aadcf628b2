"""What to fly: hold until range is known, capture of the centreline, glide, flare, decrab, rollout, and when to give up.

Heights along the path are those of the main wheels, at the wheels' place along the runway: the cg is most of two metres
higher, which at a flare's angle is most of a hundred metres of runway.

Source     Dickmanns & Schell 1992, section 6 and fig. 8 (shape of the trajectory), section 7.1 (its figures).
           Departs: the centreline is captured by a turn of constant bank that meets a linear law tangentially, and the
           flare aims below the surface, since one that ends at zero height floats.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from landing_sim.control.believed import Believed, Motion, moving
from landing_sim.control.path_settings import GearSettings, GuidanceSettings, PathSettings
from landing_sim.records import record
from landing_sim.signals import Estimate, Reference

GRAVITY = 9.80665
MOST_DRAUGHT = 10.0  # [m/s] that attitude is corrected for: what is beyond is an estimate gone wrong, not air
AIRBORNE = ("acquire", "hold", "capture", "glide", "flare", "decrab")


@record
class GuidanceMemory:
    """Phase of flight and what it remembers."""

    mode: str = "acquire"
    t: float = -math.inf  # [s] of the last step
    seen: float = -math.inf  # [s] when the estimate was last valid
    crosswind: float = 0.0  # [m/s] smoothed, R's y
    downdraught: float = 0.0  # [m/s] smoothed, R's z
    waiting: float = 0.0  # [s] for how long touchdown or instability has been suspected
    bounced: bool = False  # airborne again after touchdown
    blind: float = 0.0  # [s] looked for the runway in vain
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of a go-around: time [s], height [m], climb rate [m/s]; of a
    # second flare: time, wheel height
    heading: float = 0.0  # [rad] held while the range is not known
    aside: float = 0.0  # [m] where the lateral feedback is asked to, so that the aircraft comes to the centreline


@dataclass(frozen=True, slots=True)
class Path:
    """Glide and exponential flare of the wheels over x, with continuous height and slope; airspeed over x."""

    slope: float  # tan of the glide angle
    flare_x: float  # [m] where the flare begins
    top: float  # [m] flare height + sink height
    length: float  # [m] of the exponential
    sink_height: float
    touchdown_x: float
    approach: float  # [m/s]
    touchdown: float
    rise: float = 0.0  # tangent of the runway's slope, > 0 uphill
    straight_x: float = math.inf  # [m] from where the level flare's slope stays as it is

    @staticmethod
    def from_settings(s: PathSettings, rise: float = 0.0) -> Path:
        slope = math.tan(math.radians(s.glide_deg))
        top = s.flare_height_m + s.sink_height_m
        length = top / slope
        straight_x = math.inf
        if s.straight_from_m is None:
            flare_x = s.touchdown_x_m - length * math.log(top / s.sink_height_m)
        else:
            left = s.straight_from_m + s.sink_height_m
            straight_x = s.touchdown_x_m - length * s.straight_from_m / left
            flare_x = straight_x - length * math.log(top / left)
        return Path(
            slope,
            flare_x,
            top,
            length,
            s.sink_height_m,
            s.touchdown_x_m,
            s.approach_mps,
            s.touchdown_mps,
            rise,
            straight_x,
        )

    def height(self, x: float) -> tuple[float, float, float]:
        """Height of the wheels over the threshold [m], dH/dx and d2H/dx2 [1/m] at x; past touchdown below the surface.

        The flare is that of a level runway on top of the sloping one, whose slope fades in while the flare begins: over as
        long a way beyond the threshold as before it.
        """
        if x <= self.flare_x:
            return self.top - self.sink_height + (self.flare_x - x) * self.slope, -self.slope, 0.0
        falling = self.top * math.exp(-(min(x, self.straight_x) - self.flare_x) / self.length)
        level = falling - self.sink_height, -falling / self.length, falling / self.length**2
        if x > self.straight_x:
            level = level[0] + (x - self.straight_x) * level[1], level[1], 0.0
        a, into = -self.flare_x, x - self.flare_x
        if into >= 2.0 * a:
            return level[0] + self.rise * x, level[1] + self.rise, level[2]
        ramp = self.rise / (4.0 * a)
        return level[0] + ramp * into * into, level[1] + 2.0 * ramp * into, level[2] + 2.0 * ramp

    def surface(self, x: float) -> float:
        """Height [m] of the ground over the threshold."""
        return self.rise * x

    def speed(self, x: float) -> tuple[float, float]:
        """Airspeed [m/s] and dV/dx [1/s]: V² falls linearly, so that the deceleration is constant in still air."""
        if x <= self.flare_x or x >= self.touchdown_x:
            return (self.approach, 0.0) if x <= self.flare_x else (self.touchdown, 0.0)
        gradient = (self.touchdown**2 - self.approach**2) / (self.touchdown_x - self.flare_x)
        V = math.sqrt(self.approach**2 + gradient * (x - self.flare_x))
        return V, 0.5 * gradient / V


@dataclass(frozen=True, slots=True)
class Capture:
    """Course over offset: a turn of constant radius that runs tangentially into a course proportional to the offset."""

    join: float  # [m] |y| where the turn meets the linear end
    radius: float  # [m]
    limit: float  # [rad] of the course

    def course(self, y: float) -> tuple[float, float]:
        """Course [rad] wanted at offset y [m] and its derivative [rad/m].

        |y| <= join: -y / sqrt(join radius);  beyond: -sgn(y) sqrt((2 |y| - join) / radius).
        """
        size = abs(y)
        if size <= self.join:
            slope = 1.0 / math.sqrt(self.join * self.radius)
            return -slope * y, -slope
        course = math.sqrt((2.0 * size - self.join) / self.radius)
        if course >= self.limit:
            return -math.copysign(self.limit, y), 0.0
        return -math.copysign(course, y), -1.0 / (self.radius * course)


class LandingGuidance:
    """interfaces.Guidance for an aircraft on wheels. Constants only; all memory is in GuidanceMemory."""

    __slots__ = ("capture", "path", "settings")

    def __init__(self, settings: GuidanceSettings, slope: float = 0.0) -> None:
        """slope [rad] of the runway as believed, > 0 uphill."""
        self.settings = settings
        self.path = Path.from_settings(settings.path, math.tan(slope))
        c = settings.capture
        radius = self.path.approach**2 / (GRAVITY * math.tan(math.radians(c.bank_deg)))
        self.capture = Capture(c.join_m, radius, math.radians(c.intercept_limit_deg))

    def init(self) -> GuidanceMemory:
        return GuidanceMemory()

    def step(self, memory: GuidanceMemory, estimate: Estimate) -> tuple[GuidanceMemory, Reference]:
        if not estimate.valid and not math.isfinite(memory.seen):
            blind = memory.blind + (estimate.t - memory.t if math.isfinite(memory.t) else 0.0)
            mode = "acquire" if blind < self.settings.go_around.acquire_s else "go_around"
            return replace(memory, mode=mode, t=estimate.t, blind=blind), Reference(
                mode,
                self.path.approach,
                0.0,
                -self.path.slope * self.path.approach,
                0.0,
                0.0,
                0.0,
                extra={"blind": 1.0},
            )
        b, m = moving(estimate)
        wheels = self._lowest_wheel(b, self.settings.gear)
        mode, waiting = self._phase(memory, estimate, b, m, wheels)
        dt = min(max(estimate.t - memory.t, 0.0), 1.0)
        share = dt / (dt + self.settings.decrab.wind_filter_s) if math.isfinite(memory.seen) else 1.0
        crosswind = memory.crosswind + share * (b.wy - memory.crosswind)
        draught = min(max(b.wz, -MOST_DRAUGHT), MOST_DRAUGHT)
        downdraught = memory.downdraught + share * (draught - memory.downdraught)
        started = mode == "go_around" and (memory.mode != mode or not math.isfinite(memory.seen))
        bounced = memory.mode == "rollout" and mode == "decrab"
        start = (estimate.t, b.H, m.H_dot) if started else (estimate.t, wheels[0], 0.0) if bounced else memory.start
        memory = GuidanceMemory(
            mode,
            estimate.t,
            estimate.t if estimate.valid else memory.seen,
            crosswind,
            downdraught,
            waiting,
            memory.bounced or bounced,
            memory.blind,
            start,
            b.psi if mode == "hold" and memory.mode != mode else memory.heading,
            self._aside(memory, mode, b.y, dt),
        )
        if mode == "rollout" or mode == "stopped":
            return memory, Reference(mode, 0.0, b.H, 0.0, 0.0, 0.0, 0.0)
        if mode == "go_around":
            return memory, self._go_around(memory, b, m)
        if mode == "hold":
            return memory, self._hold(memory, b, m, wheels[0])
        return memory, self._approach(memory, b, m, wheels)

    # ------------------------------------------------------------------------------------------------ references

    def _approach(self, memory: GuidanceMemory, b: Believed, m: Motion, wheels: tuple[float, float]) -> Reference:
        s, path = self.settings, self.path
        height, wheel_x = wheels
        H_path, slope, curvature = path.height(wheel_x)
        over_path = height + path.surface(wheel_x) - H_path
        V, V_slope = path.speed(wheel_x)
        if memory.bounced:  # a flare from where it came off the ground, over time
            t0, height0, _ = memory.start
            falling = max(height0, 0.0) + path.sink_height
            falling *= math.exp(-(memory.t - t0) * max(m.x_dot, 0.0) / path.length)
            over_path = height - (falling - path.sink_height)
            slope, curvature = path.rise - falling / path.length, falling / path.length**2
            V, V_slope = path.touchdown, 0.0
        limit = s.path.height_error_limit_m
        error = min(max(-over_path, -limit), limit) * self._firmness(height)
        crab = -memory.crosswind / max(m.airspeed, 0.5 * path.touchdown)
        d = s.decrab
        aligned = d.fraction * min(max((d.start_height_m - height) / (d.start_height_m - d.end_height_m), 0.0), 1.0)
        y, course, phi, r = memory.aside, 0.0, 0.0, 0.0
        if memory.mode == "capture":
            # The law needs no offset error: course is a function of where the aircraft is.
            y, (course, gradient) = b.y, self.capture.course(b.y)
            bank_limit = math.radians(s.capture.bank_limit_deg)
            phi = math.atan(gradient * m.y_dot * m.airspeed / GRAVITY)
            phi = min(max(phi, -bank_limit), bank_limit)
            r = GRAVITY * math.tan(phi) / max(m.airspeed, 1.0)
        psi = course + (1.0 - aligned) * crab
        if memory.mode == "capture":
            off = math.radians(s.capture.heading_error_limit_deg)
            psi = b.psi + min(max(psi - b.psi, -off), off)
        extra: Mapping[str, float] = {
            "acceleration": V_slope * m.x_dot,  # [m/s²] of the airspeed
            "pull": curvature * m.x_dot * m.x_dot,  # [m/s²] of the path, > 0 upwards
            "sideslip": aligned * crab,  # [rad]
            "crosswind": memory.crosswind,  # [m/s] what crab and sideslip are meant for
            "downdraught": memory.downdraught,  # [m/s] what pitch is to be corrected for
            "wheel_height": height,  # [m]
            "on_path": float(abs(over_path) < limit),
            "idle": float(wheel_x > path.touchdown_x and math.isfinite(path.straight_x)),
        }
        return Reference(memory.mode, V, b.H + error, slope * m.x_dot, y, psi, phi, 0.0, r, extra)

    def _firmness(self, height: float) -> float:
        """Share of a height error that is flown back, at a height [m] of the wheels."""
        h = self.settings.path.hold_off
        if h is None or height >= h.from_height_m:
            return 1.0
        near = min((h.from_height_m - height) / (h.from_height_m - h.to_height_m), 1.0)
        return 1.0 - (1.0 - h.share) * near

    def _hold(self, memory: GuidanceMemory, b: Believed, m: Motion, height: float) -> Reference:
        """Straight on down the glide's angle, for want of a place to steer for: only velocity and attitude are known."""
        extra = {
            "crosswind": memory.crosswind,
            "downdraught": memory.downdraught,
            "wheel_height": height,
            "on_path": 0.0,
        }
        fall = -self.path.slope * math.hypot(m.x_dot, m.y_dot)
        return Reference("hold", self.path.approach, b.H, fall, b.y, memory.heading, 0.0, extra=extra)

    def _aside(self, memory: GuidanceMemory, mode: str, y: float, dt: float) -> float:
        """[m] next lateral trim; it stands while the aircraft is turned into the runway's direction."""
        c = self.settings.capture
        step = c.integral_per_s * y * dt if mode in ("glide", "flare") else 0.0
        return min(max(memory.aside - step, -c.end_m), c.end_m)

    def _go_around(self, memory: GuidanceMemory, b: Believed, m: Motion) -> Reference:
        """Round out at a constant pull into a steady climb, wings level, heading kept along the runway."""
        g = self.settings.go_around
        climb = self.path.approach * math.sin(math.radians(g.climb_deg))
        t0, H0, rate = memory.start
        pulling = min(memory.t - t0, max(climb - rate, 0.0) / g.pull_mps2)
        steady = memory.t - t0 - pulling
        height = H0 + (rate + 0.5 * g.pull_mps2 * pulling) * pulling + climb * steady
        limit = self.settings.path.height_error_limit_m
        error = min(max(height - b.H, -limit), limit)
        crab = -memory.crosswind / max(m.airspeed, 0.5 * self.path.touchdown)
        extra = {
            "pull": g.pull_mps2 if steady <= 0.0 else 0.0,
            "crosswind": memory.crosswind,
            "downdraught": memory.downdraught,
        }
        rate = climb if steady > 0.0 else rate + g.pull_mps2 * pulling
        return Reference("go_around", self.path.approach, b.H + error, rate, b.y, crab, 0.0, extra=extra)

    # ------------------------------------------------------------------------------------------------ phases

    def _phase(
        self, memory: GuidanceMemory, estimate: Estimate, b: Believed, m: Motion, wheels: tuple[float, float]
    ) -> tuple[str, float]:
        """The phase now, and for how long [s] the next one has been suspected."""
        s, mode = self.settings, memory.mode
        dt = estimate.t - memory.t if math.isfinite(memory.t) else 0.0
        height, wheel_x = wheels
        if mode == "go_around" or mode == "stopped":
            return mode, 0.0
        down = estimate.flags.get("on_ground")
        g = s.go_around
        if mode in ("acquire", "hold") and not down and not estimate.flags.get("range_valid", True):
            waiting = memory.waiting + dt if mode == "hold" else 0.0
            lost = not estimate.valid and estimate.t - memory.seen > g.blackout_s
            return ("go_around", 0.0) if lost or waiting > g.hold_s or height < g.hold_height_m else ("hold", waiting)
        if mode == "rollout":
            if height > s.bounce_height_m and not down:
                return "decrab", 0.0
            return ("stopped" if math.hypot(m.x_dot, m.y_dot) < s.stopped_mps else mode), 0.0
        if down or (down is None and height <= s.touchdown_height_m):
            waiting = memory.waiting + dt
            if down or waiting >= s.touchdown_confirm_s:
                return "rollout", 0.0
            return mode, waiting
        if down is not None and height < -g.underground_m:
            return "go_around", 0.0  # no wheel bears weight: not the aircraft, the estimate is lost
        waiting = 0.0
        over = height + self.path.surface(min(wheel_x, 0.0))  # the threshold: a slope does not go on before it
        if over > g.decision_height_m and mode != "acquire":
            if not estimate.valid and estimate.t - memory.seen > g.blackout_s:
                return "go_around", 0.0
            if over < g.stable_by_m and self._unstable(b, m, wheels):
                waiting = memory.waiting + dt
                if waiting > g.unstable_s:
                    return "go_around", 0.0
        if mode in ("acquire", "hold", "capture") and abs(b.y) > s.capture.end_m:
            mode = "capture"
        elif height <= s.decrab.start_height_m:
            mode = "decrab"
        elif mode != "decrab":
            mode = "flare" if wheel_x > self.path.flare_x else "glide"
        return mode, waiting

    def _unstable(self, b: Believed, m: Motion, wheels: tuple[float, float]) -> bool:
        g = self.settings.go_around
        height, wheel_x = wheels
        return (
            abs(b.y) > g.max_y_m
            or abs(height + self.path.surface(wheel_x) - self.path.height(wheel_x)[0]) > g.max_height_error_m
            or abs(m.airspeed - self.path.speed(wheel_x)[0]) > g.max_speed_error_mps
        )

    def _lowest_wheel(self, b: Believed, gear: GearSettings) -> tuple[float, float]:
        """Height [m] of the lower main wheel over the surface, and x [m] of the mains."""
        cth, sth = math.cos(b.theta), math.sin(b.theta)
        drop = cth * (gear.down_m * math.cos(b.phi) + gear.side_m * abs(math.sin(b.phi))) - gear.forward_m * sth
        x = b.x + (gear.forward_m * cth + gear.down_m * sth) * math.cos(b.psi)
        return b.H - drop - self.path.surface(x), x
