"""Guidance: geometry by hand, continuity, phases and the decision to go around; where the camera points."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landing_sim import vehicle
from landing_sim.control.believed import believed, motion
from landing_sim.control.guidance import Capture, GuidanceMemory, LandingGuidance, Path
from landing_sim.control.path_settings import (
    CaptureSettings,
    DecrabSettings,
    GearSettings,
    GoAroundSettings,
    GuidanceSettings,
    HoldOffSettings,
    PathSettings,
)
from landing_sim.control.pointing import look_along
from landing_sim.control.speeds import KNOT, in_turbulence
from landing_sim.geometry import so3
from landing_sim.signals import Estimate, Reference

SETTINGS = GuidanceSettings(
    gear=GearSettings(forward_m=0.6, side_m=1.76, down_m=1.8),
    path=PathSettings(
        glide_deg=2.7, flare_height_m=17.0, sink_height_m=3.0, touchdown_x_m=550.0, approach_mps=50.0,
        touchdown_mps=43.0, height_error_limit_m=2.5,
    ),
    capture=CaptureSettings(
        bank_deg=7.5, bank_limit_deg=9.0, intercept_limit_deg=30.0, join_m=5.5, end_m=2.0, heading_error_limit_deg=4.0
    ),
    decrab=DecrabSettings(start_height_m=2.0, end_height_m=0.5, wind_filter_s=1.5),
    go_around=GoAroundSettings(
        decision_height_m=10.0, stable_by_m=20.0, max_y_m=10.0, max_height_error_m=5.0, max_speed_error_mps=6.0,
        unstable_s=1.0, blackout_s=3.0, climb_deg=4.0,
    ),
    touchdown_height_m=0.1,
    touchdown_confirm_s=0.1,
)  # fmt: skip
NAMES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz")
CYCLE = 0.06


def estimate(t: float = 0.0, valid: bool = True, flags: dict[str, bool] | None = None, **values: float) -> Estimate:
    state = {"u": 50.0, "x": -600.0, "H": 35.0, **values}
    mean = np.array([state.get(name, 0.0) for name in NAMES])
    return Estimate(t, NAMES, mean, None, valid, flags or {})


def on_path(guidance: LandingGuidance, t: float, x: float, **values: float) -> Estimate:
    """Wheels on the path, level attitude: the cg is 1.8 m above them and 0.6 m behind."""
    height, _, _ = guidance.path.height(x + 0.6)
    return estimate(t, x=x, H=height + 1.8, **{"u": guidance.path.speed(x + 0.6)[0], **values})


def fly(guidance: LandingGuidance, memory: GuidanceMemory, *estimates: Estimate) -> tuple[GuidanceMemory, Reference]:
    for e in estimates:
        memory, reference = guidance.step(memory, e)
    return memory, reference


# --------------------------------------------------------------------------------------------------- geometry


def test_path_by_hand() -> None:
    """tan 2.7 deg = 0.047159; L = 20 / 0.047159 = 424.1 m; the exponential falls from 20 to 3 m in L ln(20/3) = 804.6 m."""
    path = Path.from_settings(SETTINGS.path)
    assert path.length == pytest.approx(424.10, abs=0.01)
    assert path.flare_x == pytest.approx(550.0 - 804.57, abs=0.02)
    assert path.height(path.flare_x)[0] == pytest.approx(17.0)
    assert path.height(550.0) == pytest.approx((0.0, -3.0 / 424.10, 3.0 / 424.10**2), abs=1e-6)
    assert path.height(path.flare_x - 100.0)[0] == pytest.approx(17.0 + 4.7159, abs=1e-3)
    assert path.height(700.0)[0] < 0.0


def test_path_and_speed_are_continuous_with_the_derivatives_they_claim() -> None:
    path = Path.from_settings(SETTINGS.path)
    h = 1e-3
    for x in (path.flare_x, path.touchdown_x):
        below, above = path.height(x - 1e-9), path.height(x + 1e-9)
        assert below[:2] == pytest.approx(above[:2], abs=1e-8)
        assert path.speed(x - 1e-9)[0] == pytest.approx(path.speed(x + 1e-9)[0], abs=1e-8)
    for x in (-700.0, -100.0, 200.0, 500.0):
        (a, sa, _), (_, s, c), (b, sb, _) = path.height(x - h), path.height(x), path.height(x + h)
        assert (b - a) / (2 * h) == pytest.approx(s, abs=1e-8)
        assert (sb - sa) / (2 * h) == pytest.approx(c, abs=1e-8)
        assert (path.speed(x + h)[0] - path.speed(x - h)[0]) / (2 * h) == pytest.approx(path.speed(x)[1], abs=1e-8)
    assert path.speed(-400.0) == (50.0, 0.0)
    assert path.speed(600.0) == (43.0, 0.0)
    V, slope = path.speed(100.0)
    assert V * slope == pytest.approx((43.0**2 - 50.0**2) / (2 * (550.0 - path.flare_x)))  # constant deceleration


@pytest.mark.parametrize(("height", "share"), [(9.0, 1.0), (8.0, 1.0), (5.5, 0.7), (3.0, 0.4), (1.0, 0.4)])
def test_near_the_ground_less_of_a_height_error_is_flown_back(height: float, share: float) -> None:
    """The wheels half a metre above the path: between 8 and 3 m the share falls from 1 to 0.4."""
    hold_off = HoldOffSettings(from_height_m=8.0, to_height_m=3.0, share=0.4)
    guidance = LandingGuidance(replace(SETTINGS, path=replace(SETTINGS.path, hold_off=hold_off)))
    path = guidance.path
    x = path.flare_x + path.length * math.log(path.top / (height - 0.5 + path.sink_height))
    H = height + 1.8
    _, reference = fly(guidance, GuidanceMemory("flare", 0.0, 0.0), estimate(0.06, x=x - 0.6, H=H))
    assert reference.height - H == pytest.approx(-0.5 * share, abs=1e-6)


def test_a_straight_end_keeps_its_slope_and_past_it_engines_idle() -> None:
    """From 1 m on, at the slope that the exponential has there: 4 / L; 0 at the touchdown point, below it beyond."""
    guidance = LandingGuidance(replace(SETTINGS, path=replace(SETTINGS.path, straight_from_m=1.0)))
    path = guidance.path
    straight = 4.0 / path.length
    x = 550.0 - 1.0 / straight
    assert path.height(x - 1e-6)[0] == pytest.approx(1.0, abs=1e-6)
    assert path.height(x - 1e-6)[1] == pytest.approx(-straight, abs=1e-8)
    assert path.height(550.0) == pytest.approx((0.0, -straight, 0.0), abs=1e-9)
    assert path.height(650.0) == pytest.approx((-100.0 * straight, -straight, 0.0), abs=1e-9)
    memory = GuidanceMemory("decrab", 0.0, 0.0)
    for at, idle in ((540.0, 0.0), (560.0, 1.0)):
        _, reference = fly(guidance, memory, estimate(0.06, x=at - 0.6, H=2.3))
        assert reference.extra["idle"] == idle
        assert fly(LandingGuidance(SETTINGS), memory, estimate(0.06, x=at - 0.6, H=2.3))[1].extra["idle"] == 0.0


def test_hold_off_that_cannot_be() -> None:
    with pytest.raises(ValueError, match="from_height_m must be above"):
        HoldOffSettings(from_height_m=3.0, to_height_m=3.0, share=0.4)
    with pytest.raises(ValueError, match="share must be above 0"):
        HoldOffSettings(from_height_m=8.0, to_height_m=3.0, share=0.0)
    with pytest.raises(ValueError, match="turbulence_share must be 0 or more"):
        replace(SETTINGS.path, turbulence_share=-0.1)


def test_some_speed_is_kept_in_turbulence() -> None:
    """A fifth of 30 kt is 3.09 m/s; never more than the approach's speed."""
    wanted = replace(SETTINGS, path=replace(SETTINGS.path, turbulence_share=0.2))
    assert in_turbulence(30.0 * KNOT, wanted).path.touchdown_mps == pytest.approx(43.0 + 3.0867, abs=1e-3)
    assert in_turbulence(45.0 * KNOT, wanted).path.approach_mps == 50.0
    assert in_turbulence(100.0 * KNOT, wanted).path.touchdown_mps == 50.0
    assert in_turbulence(30.0 * KNOT, SETTINGS) == SETTINGS
    do128 = vehicle.load("do128")
    at = do128.prepared(4000.0, 0.0, 1.2, 30.0 * KNOT).guidance.path
    assert at.touchdown_mps == pytest.approx(do128.guidance.path.touchdown_mps + 3.0867, abs=1e-3)
    assert do128.prepared(4000.0, 0.0, 1.2, 0.0) is do128


def test_capture_by_hand() -> None:
    """7.5 deg at 50 m/s turns on 50² / (9.80665 tan 7.5°) = 1936.4 m; from 85 m: sqrt((170 - 5.5) / 1936.4) = 16.70°."""
    guidance = LandingGuidance(SETTINGS)
    assert guidance.capture.radius == pytest.approx(1936.4, abs=0.1)
    assert math.degrees(guidance.capture.course(-85.0)[0]) == pytest.approx(16.70, abs=0.01)
    assert math.degrees(guidance.capture.course(85.0)[0]) == pytest.approx(-16.70, abs=0.01)
    assert guidance.capture.course(0.0)[0] == 0.0
    assert math.degrees(guidance.capture.course(-400.0)[0]) == pytest.approx(30.0)  # never steeper than that


@settings(deadline=None)
@given(st.floats(-300.0, 300.0))
def test_capture_is_smooth_and_its_turn_has_one_radius(y: float) -> None:
    capture = Capture(join=5.5, radius=1936.4, limit=math.radians(30.0))
    (a, _), (course, slope), (b, _) = capture.course(y - 1e-4), capture.course(y), capture.course(y + 1e-4)
    kink = min(abs(abs(y) - 5.5), abs(abs(y) - 0.5 * (5.5 + 1936.4 * capture.limit**2)))
    if kink > 1e-3:
        assert (b - a) / 2e-4 == pytest.approx(slope, abs=1e-7)
    assert abs(b - a) < 2e-4 * 0.0098  # no step, also at the join: the steepest slope is 1 / sqrt(join radius)
    if 5.5 < abs(y) < 260.0:
        assert abs(slope * course) == pytest.approx(1.0 / 1936.4)  # d course / ds = slope sin(course) ~ slope course


def test_flying_the_capture_law_turns_at_the_bank_asked_for() -> None:
    """Integrated exactly as the law says, the 85 m are gone at the distance the arc needs, without overshoot."""
    guidance = LandingGuidance(SETTINGS)
    x, y, banks = 0.0, -85.0, []
    for i in range(2000):
        course, _ = guidance.capture.course(y)
        e = estimate(i * 0.01, u=50.0 * math.cos(course), v=50.0 * math.sin(course), x=-950.0 + x, y=y)
        reference = guidance.step(GuidanceMemory("capture"), e)[1]
        if abs(y) > 6.0:
            banks.append(math.degrees(reference.phi))
        x, y = x + 0.5 * math.cos(course), y + 0.5 * math.sin(course)
        if abs(y) < 5.0:
            break
    assert np.allclose(banks, -7.5, atol=0.15)  # a left turn; small angles make the difference
    # arc of 1936.4 m from 16.70° to 3.05°, then from 5.5 to 5 m: 461 + 0.1 sqrt(5.5 1936.4) = 471 m
    assert x == pytest.approx(471.0, abs=6.0)


# --------------------------------------------------------------------------------------------------- references


def test_wind_becomes_crab_then_sideslip() -> None:
    guidance = LandingGuidance(SETTINGS)
    _, high = fly(guidance, GuidanceMemory("glide"), on_path(guidance, 0.0, -400.0, wy=-1.0))
    assert high.psi == pytest.approx(1.0 / 50.0, rel=1e-2)  # nose to the right, into the air that comes from there
    assert high.extra["sideslip"] == 0.0
    low = estimate(0.0, x=520.0, H=1.8 + 0.4, u=43.0, wy=-1.0)
    _, low_reference = fly(guidance, GuidanceMemory("decrab"), low)
    assert low_reference.psi == 0.0
    assert low_reference.extra["sideslip"] == pytest.approx(1.0 / 43.0, rel=1e-2)


def test_crosswind_is_smoothed() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory = GuidanceMemory("glide")
    memory, _ = guidance.step(memory, on_path(guidance, 0.0, -400.0))
    for i in range(1, 26):  # 1.5 s
        memory, _ = guidance.step(memory, on_path(guidance, i * CYCLE, -400.0, wy=2.0))
    assert memory.crosswind == pytest.approx(2.0 * (1.0 - math.exp(-1.0)), rel=0.03)


def test_height_reference_is_the_wheels_path_and_is_approached_at_a_limited_rate() -> None:
    guidance = LandingGuidance(SETTINGS)
    e = on_path(guidance, 0.0, -500.0)
    assert guidance.step(GuidanceMemory("glide"), e)[1].height == pytest.approx(e["H"])
    high = replace(e, mean=e.mean + np.where(np.array(NAMES) == "H", 20.0, 0.0))
    reference = guidance.step(GuidanceMemory("glide"), high)[1]
    assert reference.height == pytest.approx(high["H"] - 2.5)
    assert reference.extra["on_path"] == 0.0
    assert reference.climb_rate == pytest.approx(-50.0 * math.tan(math.radians(2.7)))


# --------------------------------------------------------------------------------------------------- phases


def test_phases_of_an_undisturbed_landing_come_in_order() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory, modes = guidance.init(), []
    y, x, t = -40.0, -950.0, 0.0
    while x < 1200.0:
        V = guidance.path.speed(x)[0] if x < 560.0 else max(43.0 - 0.1 * (x - 560.0), 0.4)
        flags = {"on_ground": x > 555.0}
        e = replace(on_path(guidance, t, x, y=y, u=V), valid=x > -930.0, flags=flags)
        memory, reference = guidance.step(memory, e)
        if not modes or modes[-1] != reference.mode:
            modes.append(reference.mode)
        y, x, t = y * 0.985, x + V * CYCLE, t + CYCLE
        if reference.mode == "stopped":
            break
    assert modes == ["acquire", "capture", "glide", "flare", "decrab", "rollout", "stopped"]


def test_touchdown_without_a_switch_needs_a_moment() -> None:
    guidance = LandingGuidance(SETTINGS)
    low = [estimate(i * CYCLE, x=550.0, H=1.85, u=43.0) for i in range(4)]
    memory = GuidanceMemory("decrab", t=-CYCLE, seen=0.0)
    modes = []
    for e in low:
        memory, reference = guidance.step(memory, e)
        modes.append(reference.mode)
    assert modes == ["decrab", "rollout", "rollout", "rollout"]


def test_a_bounce_is_flared_again_from_where_it_is() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory = GuidanceMemory("rollout", t=0.0, seen=0.0)
    memory, hop = guidance.step(memory, estimate(0.06, x=500.0, H=2.2, u=43.0, flags={"on_ground": False}))
    assert hop.mode == "rollout"  # 0.4 m under the wheels: leave it
    high = estimate(0.12, x=500.0, H=3.3, u=43.0, flags={"on_ground": False})
    memory, hop = guidance.step(memory, high)
    assert (hop.mode, hop.airspeed, hop.height) == ("decrab", 43.0, high["H"])
    assert hop.climb_rate == pytest.approx(-43.0 * (1.5 + 3.0) / guidance.path.length)
    memory, down = guidance.step(memory, estimate(0.18, x=560.0, H=1.8, u=43.0, flags={"on_ground": True}))
    assert down.mode == "rollout"


def test_a_bounce_that_does_not_come_down_is_seen_as_too_high() -> None:
    """2 s at 1.5 m under the wheels: the flare, from 4.5 m over its aim, is then at 4.5 exp(-86 / 424) - 3 m."""
    guidance = LandingGuidance(SETTINGS)
    memory = GuidanceMemory("rollout", t=0.0, seen=0.0)
    for i in range(3):
        floating = estimate(1.0 + i, x=500.0, H=3.3, u=43.0, flags={"on_ground": False})
        memory, reference = guidance.step(memory, floating)
    wanted = 4.5 * math.exp(-2.0 * 43.0 / guidance.path.length)
    assert reference.height - floating["H"] == pytest.approx(wanted - 3.0 - 1.5)
    assert reference.climb_rate == pytest.approx(-43.0 * wanted / guidance.path.length)
    assert reference.extra["on_path"] == 1.0


# --------------------------------------------------------------------------------------------------- range not known


def unranged(t: float, known: bool = False, **values: float) -> Estimate:
    state = {"x": -3000.0, "H": 150.0, "y": 60.0, "psi": 0.1, **values}
    return estimate(t, flags={"range_valid": known}, **state)


def test_without_a_range_it_flies_straight_on_down() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory, reference = fly(guidance, guidance.init(), unranged(0.0), unranged(0.06, psi=0.12, H=149.0, y=61.0))
    assert (reference.mode, reference.airspeed, reference.phi, reference.r_ff) == ("hold", 50.0, 0.0, 0.0)
    assert reference.psi == 0.1  # as it began
    assert (reference.height, reference.y) == (149.0, 61.0)  # no place to steer for
    assert reference.climb_rate == pytest.approx(-50.0 * math.tan(math.radians(2.7)))
    assert reference.extra["on_path"] == 0.0  # nothing is integrated
    memory, reference = guidance.step(memory, unranged(0.12, known=True))
    assert reference.mode == "capture"
    memory, reference = guidance.step(memory, unranged(0.18))
    assert reference.mode == "capture"  # never again


def test_a_known_range_is_not_waited_for() -> None:
    guidance = LandingGuidance(SETTINGS)
    assert guidance.step(guidance.init(), unranged(0.0, known=True))[1].mode == "capture"
    assert guidance.step(guidance.init(), estimate(0.0))[1].mode == "glide"


@pytest.mark.parametrize(("step", "values", "expected"), [(0.5, {}, 40.0), (0.5, {"H": 61.0}, 0.0)])
def test_a_range_that_never_comes_ends_in_a_climb(step: float, values: dict[str, float], expected: float) -> None:
    """After 40 s, or below 60 m."""
    guidance = LandingGuidance(SETTINGS)
    memory, t = guidance.init(), 0.0
    while t < 60.0:
        memory, reference = guidance.step(memory, unranged(t, **values))
        if reference.mode == "go_around":
            break
        t += step
    assert t == pytest.approx(expected, abs=1.0)
    memory, reference = guidance.step(memory, unranged(t + step, known=True))
    assert reference.mode == "go_around"


def test_holding_blind_goes_around() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory, _ = guidance.step(guidance.init(), unranged(0.0))
    memory, still = guidance.step(memory, replace(unranged(2.9), valid=False))
    memory, gone = guidance.step(memory, replace(unranged(3.1), valid=False))
    assert (still.mode, gone.mode) == ("hold", "go_around")


def test_a_height_below_ground_is_not_believed() -> None:
    """4 m below the surface with no wheel on it: up, below the decision height too; on its wheels it rolls out."""
    guidance = LandingGuidance(SETTINGS)
    memory, _ = fly(guidance, guidance.init(), *(on_path(guidance, k * CYCLE, 100.0) for k in range(5)))
    for flags, expected in (({"on_ground": False}, "go_around"), ({"on_ground": True}, "rollout")):
        assert fly(guidance, memory, estimate(0.3, x=100.0, H=1.8 - 4.0, flags=flags))[1].mode == expected
    assert fly(guidance, memory, estimate(0.3, x=100.0, H=1.8 - 2.0, flags={"on_ground": False}))[1].mode != "go_around"


def test_no_more_downdraught_is_corrected_for_than_there_can_be() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory = guidance.init()
    for k in range(100):
        memory, reference = guidance.step(memory, on_path(guidance, k * CYCLE, -400.0, wz=25.0))
    assert reference.extra["downdraught"] == pytest.approx(10.0, abs=0.01)


def test_long_blackout_goes_around_but_not_below_decision_height() -> None:
    guidance = LandingGuidance(SETTINGS)
    for x, expected in ((-400.0, "go_around"), (100.0, "flare")):
        memory = guidance.init()
        memory, _ = guidance.step(memory, on_path(guidance, 0.0, x))
        modes = []
        for i in range(1, 60):
            memory, reference = guidance.step(memory, replace(on_path(guidance, i * CYCLE, x), valid=False))
            modes.append(reference.mode)
        assert "go_around" not in modes[:49]  # 3 s of patience
        assert modes[-1] == expected


def test_unstable_approach_goes_around_and_climbs() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory = guidance.init()
    for i in range(18):
        memory, reference = guidance.step(memory, on_path(guidance, i * CYCLE, -250.0, y=12.0))
    assert reference.mode == "go_around"
    start = memory.start[0]
    rates = []
    for i in range(18, 120):
        memory, reference = guidance.step(memory, on_path(guidance, i * CYCLE, -250.0, y=12.0))
        rates.append(reference.climb_rate)
    assert np.all(np.diff(rates) >= -1e-9)
    assert np.max(np.diff(rates)) < 1.5 * CYCLE + 1e-9  # a gentle pull, no step
    assert rates[-1] == pytest.approx(50.0 * math.sin(math.radians(4.0)))
    assert reference.extra["pull"] == 0.0
    assert start > 1.0


@pytest.mark.parametrize("rise", [-0.02, 0.02])
def test_where_an_approach_must_be_stable_is_told_from_the_threshold_not_from_its_slope_drawn_on(rise: float) -> None:
    """500 m before it a plane of 2 % lies 10 m off: 28 m up the aircraft may still be 12 m aside, 17 m up no longer."""
    for height, expected in ((28.0, "capture"), (17.0, "go_around")):
        guidance = LandingGuidance(SETTINGS, math.atan(rise))
        memory = guidance.init()
        for i in range(30):
            memory, reference = guidance.step(memory, estimate(i * CYCLE, x=-500.0, y=12.0, H=height + 1.8))
        assert reference.mode == expected, height


def test_a_short_instability_is_flown_through() -> None:
    guidance = LandingGuidance(SETTINGS)
    memory = guidance.init()
    for i in range(60):
        y = 12.0 if 10 < i < 20 else 0.0
        memory, reference = guidance.step(memory, on_path(guidance, i * CYCLE, -250.0, y=y))
        assert reference.mode != "go_around"


def test_an_estimate_without_a_state_is_refused() -> None:
    guidance = LandingGuidance(SETTINGS)
    names = tuple(n for n in NAMES if n != "psi")
    with pytest.raises(ValueError, match="needs psi"):
        guidance.step(GuidanceMemory("glide"), Estimate(0.0, names, np.zeros(len(names)), None, True))


def test_wind_need_not_be_estimated() -> None:
    guidance = LandingGuidance(SETTINGS)
    e = on_path(guidance, 0.0, -400.0)
    plain = Estimate(0.0, NAMES[:12], e.mean[:12], None, True)
    assert guidance.step(GuidanceMemory("glide"), plain)[1] == guidance.step(GuidanceMemory("glide"), e)[1]


# --------------------------------------------------------------------------------------------------- kinematics


@settings(deadline=None)
@given(st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3), st.lists(st.floats(-9.0, 9.0), min_size=6, max_size=6))
def test_motion_is_rotation_and_wind(angles: list[float], values: list[float]) -> None:
    velocity, wind = np.array(values[:3]) + [50.0, 0.0, 0.0], np.array(values[3:])
    state = dict(zip(("phi", "theta", "psi", "u", "v", "w", "wx", "wy", "wz"), [*angles, *velocity, *wind]))
    m = motion(believed(estimate(**state)))
    R_RB = so3.from_euler(*angles)
    air = velocity - R_RB.T @ wind
    np.testing.assert_allclose([m.x_dot, m.y_dot, -m.H_dot], R_RB @ velocity, atol=1e-12)
    np.testing.assert_allclose([m.u_air, m.v_air, m.w_air, m.airspeed], [*air, np.linalg.norm(air)], atol=1e-12)


# --------------------------------------------------------------------------------------------------- pointing


@settings(deadline=None)
@given(
    phi=st.floats(-0.6, 0.6), theta=st.floats(-0.4, 0.4), psi=st.floats(-1.0, 1.0),
    azimuth=st.floats(-0.3, 0.3), elevation=st.floats(-0.3, 0.3),
)  # fmt: skip
def test_camera_looks_where_it_is_told(phi: float, theta: float, psi: float, azimuth: float, elevation: float) -> None:
    pan, tilt = look_along(phi, theta, psi, azimuth, elevation)
    R_RC = so3.from_euler(phi, theta, psi) @ so3.camera_from_body(pan, tilt).T
    wanted = [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), -math.sin(elevation)]
    np.testing.assert_allclose(R_RC[:, 2], wanted, atol=1e-12)


def test_pointing_signs() -> None:
    assert look_along(0.0, 0.0, 0.2) == pytest.approx((-0.2, 0.0))  # nose right of the runway: look left
    assert look_along(0.0, -0.05, 0.0) == pytest.approx((0.0, 0.05))  # nose down: look up
