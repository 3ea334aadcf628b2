"""The quadrotor's states: what leads from each to which, what moves the wanted point, and what it asks for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from landing_sim.control.autonomy import FAST, MODES, SLOW, Autonomy, AutonomySettings, Memory, moved
from landing_sim.estimators.strapdown_ekf import NAMES
from landing_sim.signals import Estimate, Reference

S = AutonomySettings()
STEP = 0.01

FLYING = ("take_off", "hover", "traverse", "hover_above", "descend", "refuse")
"""Modes that need localisation."""


def seen(t: float, localised: bool = True, platform: bool = False, valid: bool = True, **values: float) -> Estimate:
    values = (
        {"lx": math.nan, "ly": math.nan, "lH": math.nan}
        | ({"lx": 1.2, "ly": 0.1, "lH": 0.14} if platform else {})
        | values
    )
    mean = np.array([values.get(name, 0.0) for name in NAMES])
    return Estimate(t, NAMES, mean, None, valid, {"localised": localised, "platform": platform})


def fly(
    autonomy: Autonomy,
    seconds: float,
    told: Callable[[float, Reference | None], Estimate],
    memory: Memory | None = None,
) -> tuple[Memory, list[Reference]]:
    """Steps of 10 ms; `told` makes the estimate of the time and what was wanted last."""
    memory, out = memory or autonomy.init(), []
    start = 0.0 if math.isnan(memory.t) else memory.t + STEP
    for k in range(round(seconds / STEP)):
        memory, reference = autonomy.step(memory, told(start + k * STEP, out[-1] if out else None))
        out.append(reference)
    return memory, out


def follows(**always: bool) -> Callable[[float, Reference | None], Estimate]:
    """A vehicle that is where it is wanted."""

    def told(t: float, r: Reference | None) -> Estimate:
        if r is None:
            return seen(t, H=0.12, **always)
        velocity = {"vx": r.extra["vx"], "vy": r.extra["vy"], "vz": -r.climb_rate}
        return seen(t, x=r.extra["x"], y=r.y, H=r.height, **velocity, **always)

    return told


def phases(out: list[Reference]) -> list[str]:
    modes = [r.mode for r in out]
    return [m for k, m in enumerate(modes) if k == 0 or m != modes[k - 1]]


def test_a_landing_goes_through_all_phases_and_the_platform_counts_only_on_the_way() -> None:
    _, out = fly(Autonomy(), 60.0, follows(platform=True))
    assert phases(out) == ["wait", "take_off", "hover", "traverse", "hover_above", "descend", "cut"]
    end = out[-1]
    assert (end.extra["x"], end.y) == pytest.approx((1.2, 0.1))
    assert end.height == pytest.approx(0.14 + S.legs + S.clearance, abs=0.5 * S.clearance)
    assert (end.extra["lx"], end.extra["ly"], end.extra["lH"]) == pytest.approx((1.2, 0.1, 0.14))


def test_hovering_is_all_there_is_to_the_hover_task() -> None:
    _, out = fly(Autonomy(replace(S, task="hover")), 30.0, follows(platform=True))
    assert phases(out) == ["wait", "take_off", "hover"] and out[-1].height == S.height


def test_nothing_found_is_refused_at_the_end_of_the_way() -> None:
    _, out = fly(Autonomy(FAST), 30.0, follows())
    assert phases(out) == ["wait", "take_off", "hover", "traverse", "refuse"]
    assert out[-1].extra["x"] == FAST.goal[0] and out[-1].height == FAST.height


def test_what_is_not_localised_does_not_take_off() -> None:
    for told in (lambda t, r: seen(t, localised=False), lambda t, r: seen(t, valid=False)):
        assert phases(fly(Autonomy(), 5.0, told)[1]) == ["wait"]
    # localised for less than `settled` at a time
    assert phases(fly(Autonomy(), 5.0, lambda t, r: seen(t, localised=t % 0.8 < 0.59))[1]) == ["wait"]


def in_mode(mode: str, **changes: object) -> Memory:
    place = {"place": (1.2, 0.1, -0.14)} if mode in ("hover_above", "descend") else {}
    p = (0.5, 0.0, -1.0)
    return Memory(mode=mode, t=10.0, due=10.0, since=9.0, p=p, target=p)._replace(**place | changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("mode", FLYING)
def test_localisation_lost_holds_then_goes_on(mode: str) -> None:
    autonomy = Autonomy()
    lost = autonomy.decide(in_mode(mode), seen(10.0, localised=False, x=0.4, H=0.9))
    assert lost.mode == "hold" and lost.before == mode and lost.target == lost.p == (0.4, 0.0, -0.9)
    again = autonomy.decide(lost, seen(11.0, x=0.45, H=0.85))
    assert again.mode == mode and again.p == (0.45, 0.0, -0.85)
    wanted = {"traverse": (*S.goal, -1.0), "hover_above": (1.2, 0.1, -1.0), "descend": (1.2, 0.1, -0.14 - 0.12 - 0.03)}
    assert again.target == pytest.approx(wanted.get(mode, (0.45, 0.0, -1.0)))


@pytest.mark.parametrize("mode", FLYING)
def test_localisation_lost_for_good_lands_blind_and_cuts(mode: str) -> None:
    _, out = fly(Autonomy(), 20.0, lambda t, r: seen(t, localised=False, H=0.9), in_mode(mode))
    assert phases(out)[-3:] == ["hold", "land_blind", "cut"]
    held, blind = ([r.mode for r in out].count(m) * STEP for m in ("hold", "land_blind"))
    assert held == pytest.approx(S.patience, abs=0.21) and blind == pytest.approx(2.0 * S.height / S.blind, abs=0.21)
    assert {r.climb_rate for r in out if r.mode == "land_blind"} == {-S.blind}


@pytest.mark.parametrize(
    ("mode", "estimate", "then"),
    [
        ("take_off", {"x": 0.5, "H": 1.0}, "hover"),
        ("take_off", {"x": 0.5, "H": 0.74}, "take_off"),
        ("take_off", {"x": 0.5, "H": 1.0, "vz": 0.36}, "take_off"),
        ("hover", {"x": 0.5, "H": 1.0}, "hover"),  # steady, not for long enough
        ("traverse", {"x": 0.5, "H": 1.0}, "traverse"),
        ("traverse", {"x": 0.5, "H": 1.0, "platform": True}, "hover_above"),
        ("hover_above", {"x": 1.2, "y": 0.1, "H": 1.0, "platform": True}, "hover_above"),
        ("descend", {"x": 1.2, "y": 0.1, "H": 0.33}, "descend"),
        ("descend", {"x": 1.2, "y": 0.1, "H": 0.3199}, "cut"),
        ("descend", {"x": 1.2, "y": 0.23, "H": 0.3199}, "descend"),
        ("cut", {"x": 1.2, "H": 0.3}, "cut"),
        ("cut", {"x": 1.2, "H": 0.3, "localised": False}, "cut"),
        ("refuse", {"x": 0.5, "H": 1.0, "platform": True}, "refuse"),
        ("land_blind", {"x": 0.5, "H": 1.0}, "land_blind"),
    ],
)
def test_table_of_transitions(mode: str, estimate: dict[str, float], then: str) -> None:
    assert Autonomy().decide(in_mode(mode), seen(10.0, **estimate)).mode == then  # type: ignore[arg-type]


def test_every_mode_is_in_the_table() -> None:
    assert set(MODES) == {*FLYING, "wait", "cut", "hold", "land_blind"}


def test_a_gust_starts_the_hold_anew() -> None:
    def told(t: float, r: Reference | None) -> Estimate:
        return seen(t, x=0.8 if 2.0 <= t - 10.0 < 2.1 else 0.5, H=1.0)

    _, out = fly(Autonomy(), 8.0, told, in_mode("hover"))
    hovering = [r.mode for r in out].count("hover") * STEP
    assert hovering == pytest.approx(2.2 + S.hold, abs=0.21)


def test_steadiness_of_one_phase_does_not_count_in_the_next() -> None:
    m = Autonomy().decide(in_mode("take_off", steady=1.0), seen(10.0, x=0.5, H=1.0))
    assert m.mode == "hover" and math.isnan(m.steady)


def test_the_place_moves_with_new_way_points_until_the_descent() -> None:
    autonomy = Autonomy()
    m = autonomy.decide(in_mode("hover_above"), seen(10.0, platform=True, lx=1.3, ly=0.0, x=0.5, H=1.0))
    assert m.place == (1.3, 0.0, -0.14) and m.target == (1.3, 0.0, -1.0)
    m = autonomy.decide(in_mode("descend"), seen(10.0, platform=True, lx=9.0, x=1.2, H=0.8))
    assert m.place == (1.2, 0.1, -0.14)


def test_descent_waits_while_it_is_off_the_place() -> None:
    start = in_mode("descend", p=(1.2, 0.1, -1.0), target=(1.2, 0.1, -0.29))
    _, beside = fly(Autonomy(), 2.0, lambda t, r: seen(t, x=1.4, y=0.1, H=1.0), start)
    assert beside[-1].height == 1.0
    _, above = fly(Autonomy(), 2.0, lambda t, r: seen(t, x=1.2, y=0.1, H=1.0), start)
    assert above[-1].height == pytest.approx(1.0 - 2.0 * S.descent, abs=0.01)


def test_decisions_fall_at_five_hertz() -> None:
    told = lambda t, r: seen(t, x=0.5, H=1.0, platform=t >= 10.05)  # noqa: E731
    _, out = fly(Autonomy(), 1.0, told, in_mode("traverse", due=10.0))
    changed = [k for k in range(1, len(out)) if out[k].mode != out[k - 1].mode]
    assert [round(10.01 + 0.01 * k, 2) for k in changed] == [10.21]


@pytest.mark.parametrize("speed", [0.05, 0.5])
def test_the_wanted_point_keeps_its_limits_and_stops_at_its_end(speed: float) -> None:
    p, v, end = (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (1.0, -0.5, -1.0)
    fastest = hardest = 0.0
    taken = 0.0
    while taken < 40.0:
        before, taken = v, taken + 0.01
        p, v = moved(p, v, end, speed, 0.4, 0.01)
        fastest, hardest = max(fastest, math.hypot(*v)), max(hardest, math.dist(v, before) / 0.01)
        assert math.dist(p, end) <= math.hypot(1.0, 0.5) + 1e-9
        if p == end:
            break
    assert p == end and v == (0.0, 0.0, 0.0)
    way = math.hypot(1.0, 0.5)
    assert taken == pytest.approx(way / speed + speed / 0.4, rel=0.05)
    assert fastest == pytest.approx(speed, rel=1e-6) and hardest <= 0.4 * 2.01


def test_a_new_end_turns_the_point_without_a_jump() -> None:
    p, v = (0.0, 0.0, -1.0), (0.5, 0.0, 0.0)
    for _ in range(1000):
        before = v
        p, v = moved(p, v, (0.3, 0.4, -1.0), 0.5, 0.4, 0.01)
        assert math.dist(v, before) <= 0.4 * 0.01 * 2.01
    assert p == (0.3, 0.4, -1.0)


def test_profiles_are_those_of_the_trial() -> None:
    assert (SLOW.traverse, SLOW.descent, SLOW.hold) == (0.10, 0.05, 3.0)
    assert (FAST.traverse, FAST.descent, FAST.hold) == (0.50, 0.22, 0.7)
