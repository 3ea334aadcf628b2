"""What the quadrotor does next: take off, hover, traverse, and once a landing place is known hover above it, descend, cut.

    wait -> take_off -> hover -> traverse -> hover_above -> descend -> cut
                                    | end of the way, nothing found -> refuse
    in flight, localisation lost -> hold -> where it was | land_blind -> cut

Decisions fall at 5 Hz; between them the wanted point moves on smoothly. Nothing takes off that is not localised.

Source     Brockers et al. 2012, sections 3.1 and 3.4; what happens when localisation is lost is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from landing_sim.signals import Estimate, Reference

MODES = ("wait", "take_off", "hover", "traverse", "hover_above", "descend", "cut", "hold", "land_blind", "refuse")
EPS = 1e-9  # [s]
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class AutonomySettings:
    """Speeds [m/s], heights [m], times [s].

    goal : (x, y) [m] in R where the traverse ends
    legs : [m] of the cg over the feet
    clearance : [m] of the feet over the landing place at which motors are cut
    hold : [s] of steady hover before the next leg; steady is within `near` [m] and `slow` [m/s] of what is wanted
    off : [m] horizontal error at which the descent, and the cut, wait
    search : [s] at the traverse's end before the place is given up
    patience : [s] without localisation before the blind landing, at `blind` [m/s] down
    """

    task: Literal["hover", "land"] = "land"
    height: float = 1.0
    goal: tuple[float, float] = (2.0, 0.0)
    heading: float = 0.0
    climb: float = 0.2
    traverse: float = 0.10
    descent: float = 0.05
    acceleration: float = 0.4  # [m/s^2] of the wanted point
    hold: float = 3.0
    near: float = 0.25
    slow: float = 0.35
    off: float = 0.12
    search: float = 5.0
    legs: float = 0.12
    clearance: float = 0.06
    settled: float = 1.0  # [s] localised on the ground before the take-off
    patience: float = 3.0
    blind: float = 0.3
    period: float = 0.2  # [s] between decisions


SLOW = AutonomySettings()
FAST = replace(SLOW, traverse=0.50, descent=0.22, hold=0.7)


class Memory(NamedTuple):
    """The phase; the wanted point p, v in R (z down) that moves towards `target`; when things began."""

    mode: str = "wait"
    t: float = math.nan
    due: float = -math.inf  # of the next decision
    since: float = -math.inf  # of the phase
    steady: float = math.nan  # since when it has hovered steadily, or been localised on the ground
    p: Vector = (0.0, 0.0, 0.0)
    v: Vector = (0.0, 0.0, 0.0)
    target: Vector = (0.0, 0.0, 0.0)
    place: Vector = (0.0, 0.0, 0.0)  # the landing place
    before: str = ""  # the phase that localisation was lost in


class Autonomy:
    """interfaces.Guidance. Reads x y H vx vy vz lx ly lH and the flags "localised", "platform".

    Reference: mode one of MODES, height, climb_rate, y, psi; extra x, vx, vy, and with a landing place lx, ly, lH.
    """

    def __init__(self, settings: AutonomySettings | None = None) -> None:
        self.settings = settings or AutonomySettings()

    def init(self) -> Memory:
        return Memory()

    def step(self, memory: Memory, estimate: Estimate) -> tuple[Memory, Reference]:
        s, t = self.settings, estimate.t
        if t >= memory.due - EPS:
            memory = self.decide(memory, estimate)._replace(due=t + s.period)
        dt = 0.0 if math.isnan(memory.t) else t - memory.t
        memory = self._move(memory._replace(t=t), estimate, dt)
        extra = {"x": memory.p[0], "vx": memory.v[0], "vy": memory.v[1]}
        if memory.mode in ("hover_above", "descend", "cut"):
            extra |= {"lx": memory.place[0], "ly": memory.place[1], "lH": -memory.place[2]}
        p, v = memory.p, memory.v
        return memory, Reference(memory.mode, 0.0, -p[2], -v[2], p[1], s.heading, 0.0, extra=extra)

    def decide(self, m: Memory, estimate: Estimate) -> Memory:
        """The phase at estimate.t."""
        s, t, mode = self.settings, estimate.t, m.mode
        localised = estimate.valid and estimate.flags.get("localised", False)
        if mode in ("cut", "land_blind"):
            return self._enter(m, "cut", t) if mode == "land_blind" and self._down(m, t) else m
        if mode == "wait":
            if not localised:
                return m._replace(steady=math.nan)
            if math.isnan(m.steady):
                return m._replace(steady=t)
            if t - m.steady < s.settled - EPS:
                return m
            x, y, z = _position(estimate)
            m = m._replace(p=(x, y, z), v=(0.0, 0.0, 0.0))
            return self._enter(m, "take_off", t, (x, y, -s.height))
        if mode == "hold":
            if localised:
                x, y, z = _position(estimate)
                m = m._replace(p=(x, y, z), v=(0.0, 0.0, 0.0))
                return self._enter(m, m.before, t, self._target(m, m.before))
            return self._enter(m, "land_blind", t) if t - m.since >= s.patience - EPS else m
        if not localised:
            here = _position(estimate)
            m = m._replace(before=mode, p=here, v=(0.0, 0.0, 0.0))
            return self._enter(m, "hold", t, here)
        return self._on_the_way(m, estimate)

    def _on_the_way(self, m: Memory, estimate: Estimate) -> Memory:
        """Phases with localisation, in the order of a landing."""
        s, t = self.settings, estimate.t
        steady = self._steady(m, estimate)
        m = m._replace(steady=(t if math.isnan(m.steady) else m.steady) if steady else math.nan)
        held = steady and t - m.steady >= s.hold - EPS
        if m.mode == "take_off" and steady:
            return self._enter(m, "hover", t, m.target)
        if m.mode == "hover" and held and s.task == "land":
            return self._enter(m, "traverse", t, (*s.goal, -s.height))
        if m.mode == "traverse":
            if estimate.flags.get("platform", False):
                m = m._replace(place=_place(estimate))
                return self._enter(m, "hover_above", t, self._target(m, "hover_above"))
            if steady and t - m.steady >= s.search - EPS:
                return self._enter(m, "refuse", t, m.target)
        if m.mode == "hover_above":
            m = m._replace(place=_place(estimate))
            m = m._replace(target=self._target(m, "hover_above"))
            return self._enter(m, "descend", t, self._target(m, "descend")) if held else m
        if m.mode == "descend" and estimate["H"] + m.place[2] - s.legs <= s.clearance and self._above(m, estimate):
            return self._enter(m, "cut", t)
        return m

    def _enter(self, m: Memory, mode: str, t: float, target: Vector | None = None) -> Memory:
        return m._replace(mode=mode, since=t, steady=math.nan, target=m.p if target is None else target)

    def _target(self, m: Memory, mode: str) -> Vector:
        """Where the wanted point goes in a phase that is entered again or aims at the landing place."""
        s = self.settings
        if mode == "traverse":
            return (*s.goal, -s.height)
        if mode == "hover_above":
            return m.place[0], m.place[1], -s.height
        if mode == "descend":  # half a clearance below the cut, so that it is not crept up to
            return m.place[0], m.place[1], m.place[2] - s.legs - 0.5 * s.clearance
        return m.p[0], m.p[1], -s.height

    def _steady(self, m: Memory, estimate: Estimate) -> bool:
        """Hovers where it is wanted in the end."""
        s, here = self.settings, _position(estimate)
        speed = math.sqrt(estimate["vx"] ** 2 + estimate["vy"] ** 2 + estimate["vz"] ** 2)
        return math.dist(here, m.target) <= s.near and speed <= s.slow and math.dist(m.p, m.target) < 1e-3

    def _above(self, m: Memory, estimate: Estimate) -> bool:
        return math.hypot(estimate["x"] - m.place[0], estimate["y"] - m.place[1]) <= self.settings.off

    def _down(self, m: Memory, t: float) -> bool:
        """Blindly down for so long that the ground must have been reached, twice over."""
        return t - m.since >= 2.0 * self.settings.height / self.settings.blind

    def _move(self, m: Memory, estimate: Estimate, dt: float) -> Memory:
        """The wanted point after dt."""
        s = self.settings
        if m.mode == "land_blind":
            return m._replace(p=_position(estimate), v=(0.0, 0.0, s.blind))
        if m.mode in ("wait", "cut", "hold", "refuse") or dt <= 0.0:
            return m
        target = m.target
        if m.mode == "descend" and not self._above(m, estimate):
            target = (target[0], target[1], m.p[2])
        speed = {"take_off": s.climb, "descend": s.descent}.get(m.mode, s.traverse)
        p, v = moved(m.p, m.v, target, speed, s.acceleration, dt)
        return m._replace(p=p, v=v)


def moved(p: Vector, v: Vector, target: Vector, speed: float, acceleration: float, dt: float) -> tuple[Vector, Vector]:
    """Where a point is after dt that goes to `target` and stops there, within these limits. [m], [m/s], [m/s^2]"""
    gap = (target[0] - p[0], target[1] - p[1], target[2] - p[2])
    far = math.sqrt(gap[0] ** 2 + gap[1] ** 2 + gap[2] ** 2)
    step = acceleration * dt
    # so fast that it stops in time: from v, one step of dt, then braking
    fastest = min(speed, math.sqrt(2.0 * acceleration * far + 0.25 * step * step) - 0.5 * step)
    scale = fastest / far if far > 0.0 else 0.0
    change = [scale * g - w for g, w in zip(gap, v)]
    size = math.sqrt(sum(c * c for c in change))
    share = min(1.0, step / size) if size > 0.0 else 1.0
    v = tuple(w + share * c for w, c in zip(v, change))  # type: ignore[assignment]
    new = tuple(a + dt * w for a, w in zip(p, v))
    if math.dist(new, target) < 1e-4 and math.hypot(*v) <= step:
        return target, (0.0, 0.0, 0.0)
    return (new[0], new[1], new[2]), v


def _position(estimate: Estimate) -> Vector:
    return estimate["x"], estimate["y"], -estimate["H"]


def _place(estimate: Estimate) -> Vector:
    return estimate["lx"], estimate["ly"], -estimate["lH"]
