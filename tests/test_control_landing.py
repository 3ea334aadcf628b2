"""The controller on the Do 128's own linear models, and the closed loop with the true state on JSBSim."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from landing_sim import paths, vehicle
from landing_sim.control.believed import believed, motion
from landing_sim.control.design import Design, DesignError, LinearModel, design, design_dict, design_report
from landing_sim.control.guidance import LandingGuidance
from landing_sim.control.landing_lq import LandingController, ThrustMap, _followed, _limited
from landing_sim.control.rollout import Rollout, RolloutMemory
from landing_sim.control.settings import GustSettings, RolloutSettings
from landing_sim.control.shear import expected_share
from landing_sim.geometry.earth import RunwayFrame
from landing_sim.noise import Noise
from landing_sim.plants import trim
from landing_sim.plants.aircraft import InitialState, JsbsimPlant
from landing_sim.signals import Command, Estimate, Reference, Touchdown, Truth
from landing_sim.world.dryden import W20, Turbulence
from landing_sim.world.wind import CrosswindStep, ExponentialGust, SteadyWind, Wind, WindConfig

NAMES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz")
GUST = WindConfig(step=CrosswindStep(), gust=ExponentialGust())
DT, CYCLE, DELAY = 0.005, 12, 12


@lru_cache
def do128() -> tuple[vehicle.Vehicle, Design]:
    v = vehicle.load("do128")
    folder = paths.aircraft_folder("do128")
    models = []
    for point in v.control.trim_points:
        t = trim.trim(folder, point.airspeed_mps, math.radians(point.flight_path_deg), v.control.flap)
        linear = trim.linearise(folder, t)
        models.append(
            LinearModel.straight(t.airspeed, t.gamma, t.mass, t.alpha, t.elevator, t.thrust, linear.A, linear.B)
        )
    return v, design(v.control, models)


# ----------------------------------------------------------------------------------------------------- design


def test_do128_design_is_robust_and_near_what_was_asked_for() -> None:
    _, result = do128()
    for point in result.points:
        for axis in (point.longitudinal, point.lateral):
            assert axis.margins.stable
            assert axis.solution.residual < 1e-9
            assert axis.margins.max_sensitivity < 2.5
            for loop in axis.margins.loops:
                assert loop.gain_up > 2.0
                assert loop.gain_down < 0.5
                assert loop.phase > math.radians(35.0)
                assert loop.delay > 0.2  # beside the 90 ms already in the loop
            for mode in axis.modes:
                assert abs(mode.eigenvalue - mode.wanted) < 0.2 * abs(mode.wanted), mode.name


def test_without_the_lq_part_the_modes_are_exact() -> None:
    _, result = do128()
    for point in result.points:
        axis = point.lateral
        found = np.linalg.eigvals(axis.A - axis.B @ axis.K_d)
        assert all(np.abs(found - mode.wanted).min() < 1e-8 for mode in axis.modes)


def test_report_says_what_was_designed() -> None:
    _, result = do128()
    text, plain = design_report(result, "do128"), design_dict(result)
    assert "50.0 m/s, flight path -3.0 deg" in text
    assert "dutch roll" in text and "margins with 90 ms" in text
    assert plain["trim_points"][1]["longitudinal"]["K"] == result.points[1].longitudinal.solution.K.tolist()
    assert plain["trim_points"][0]["lateral"]["modes"][1]["name"] == "roll"


def test_design_refuses_models_that_are_not_its_trim_points() -> None:
    v, result = do128()
    models = [point.model for point in result.points]
    with pytest.raises(DesignError, match="2 trim points but 1"):
        design(v.control, models[:1])
    with pytest.raises(DesignError, match=r"43\.0 m/s, the trim point 50\.0"):
        design(v.control, models[::-1])


# ----------------------------------------------------------------------------------------------------- controller


def in_trim(**values: float) -> tuple[Estimate, Reference]:
    """Descending at 50 m/s and -3 deg in still air, and a reference that asks for just that."""
    _, result = do128()
    m = result.points[0].model
    state = {"u": m.state[0], "w": m.state[2], "theta": m.state[7], "x": -600.0, "H": 40.0}
    wind = {k: values.pop(k) for k in ("wx", "wy", "wz") if k in values}
    state |= values
    mean = np.array([state.get(name, wind.get(name, 0.0)) for name in NAMES])
    return Estimate(0.0, NAMES, mean, None, True), Reference("glide", 50.0, 40.0, -50.0 * math.sin(math.radians(3.0)),
                                                             0.0, 0.0, 0.0)  # fmt: skip


def command(estimate: Estimate, reference: Reference) -> Command:
    controller = LandingController(do128()[1])
    return controller.step(controller.init(), estimate, reference)[1]


def test_in_trim_the_command_is_the_trim() -> None:
    v, result = do128()
    m = result.points[0].model
    c = command(*in_trim())
    assert c.elevator == pytest.approx(m.inputs[0], abs=2e-4)  # sin and small angle
    assert c.aileron == c.rudder == 0.0
    assert c.throttle == pytest.approx(m.inputs[1] / 8960.0, abs=2e-3)
    assert (c.flap, c.tilt) == (v.control.flap, pytest.approx(-m.state[7]))


def test_deviations_are_answered_the_right_way() -> None:
    e, r = in_trim()
    t = command(e, r)
    low = command(*in_trim(H=38.0))
    assert low.elevator < t.elevator - 0.01  # pull
    slow = command(*in_trim(u=48.0))
    assert slow.throttle > t.throttle + 0.1
    right = command(*in_trim(y=5.0))
    assert right.aileron < -0.05  # left wing down
    banked = command(*in_trim(phi=0.1))
    assert banked.aileron < -0.05
    nose_right = command(*in_trim(psi=0.05))
    assert nose_right.aileron < -0.05
    assert nose_right.pan == pytest.approx(-0.05, abs=1e-3)


def test_crabbed_flight_in_a_steady_crosswind_needs_no_control() -> None:
    """Ground speed along the runway, nose into the wind: the same air flow as in still air, so the same command."""
    _, result = do128()
    m = result.points[0].model
    psi = math.asin(1.0 / m.state[0])
    ground = m.state[0] * math.cos(psi)
    e, r = in_trim(u=ground * math.cos(psi), v=-ground * math.sin(psi), psi=psi, wy=-1.0)
    c = command(e, replace(r, psi=psi, extra={"crosswind": -1.0}))
    assert abs(c.aileron) < 2e-3
    assert abs(c.rudder) < 1e-3


def test_a_gust_that_heading_is_not_corrected_for_is_not_taken_for_sideslip() -> None:
    e, r = in_trim(wy=3.0)
    assert abs(command(e, replace(r, extra={"crosswind": 0.0})).aileron) < 1e-3
    assert abs(command(e, r).aileron) > 0.2  # told nothing, it must believe that it slips by 3 m/s
    trim = command(*in_trim()).elevator
    e, r = in_trim(wz=-2.0)
    assert command(e, replace(r, extra={"downdraught": 0.0})).elevator == pytest.approx(trim, abs=1e-3)


def test_lift_lost_to_a_gust_is_answered_at_once_by_the_elevator_alone_and_what_lasts_is_wind() -> None:
    """5 m/s of sudden tailwind, three cycles on: 5 (6 / 6.06)^3 = 4.85 m/s of it still count as a gust.

    At 45 + 4.85 m/s without it, elevator -0.9 (43 / 49.85)^2 4.85 = -3.25 deg; the engines see 0.15 m/s.
    """
    v, result = do128()
    gust = v.control.gust
    assert gust is not None

    def answers(settings: GustSettings | None, dt: float, cycles: int) -> tuple[Command, Command]:
        one = LandingController(replace(result, settings=replace(result.settings, gust=settings)))
        memory, out = one.init(), []
        for k in range(cycles):
            e, r = in_trim(wx=5.0 if k else 0.0)
            memory, c = one.step(memory, replace(e, t=dt * k), replace(r, extra={"crosswind": 0.0}))
            out.append(c)
        return out[0], out[-1]

    before, after = answers(gust, 0.06, 4)
    unanswered = answers(replace(gust, elevator_deg_per_mps=0.0), 0.06, 4)[1]
    assert math.degrees(after.elevator - unanswered.elevator) == pytest.approx(-3.25, abs=0.02)
    assert 0.0 < after.throttle - before.throttle < 0.1
    assert answers(None, 0.06, 4)[1].throttle - before.throttle > 0.5
    lasting = answers(gust, 0.5, 120)[1]
    unanswered = answers(replace(gust, elevator_deg_per_mps=0.0), 0.5, 120)[1]
    assert lasting.elevator == pytest.approx(unanswered.elevator, abs=1e-5)
    assert lasting.throttle - before.throttle > 0.5


def test_a_reported_wind_is_expected_to_fall_with_the_logarithm_of_height() -> None:
    """ln(20 / 0.0457) / ln(10.06 / 0.0457) = 6.0814 / 5.3942 = 1.1274; derivative 1 / (5.3942 x 20 m)."""
    assert expected_share(10.06) == pytest.approx((1.0, 0.018428), rel=1e-4)
    assert expected_share(20.0) == pytest.approx((1.1274, 0.0092692), rel=1e-4)
    assert expected_share(0.2) == (expected_share(1.0)[0], 0.0)  # nearer to the ground there is no wing


def test_a_headwind_that_falls_as_reported_is_no_gust() -> None:
    """10 m/s at 33 ft, from 40 m down to 20 m at 2 m/s: 1.3 m/s less, of which an unwarned gust law answers most."""
    _, result = do128()
    gust = result.settings.gust
    assert gust is not None

    def last(reported: tuple[float, float] | None, per_gust: float) -> float:
        law = replace(gust, filter_s=30.0, elevator_deg_per_mps=per_gust)
        one = LandingController(replace(result, settings=replace(result.settings, gust=law)), reported=reported)
        memory, c = one.init(), None
        for k in range(101):
            height = 40.0 - 0.2 * k
            wx = -10.0 * expected_share(height)[0]
            e, r = in_trim(u=result.points[0].model.state[0] + wx, wx=wx, H=height)
            memory, c = one.step(memory, replace(e, t=0.1 * k), replace(r, height=height))
        assert c is not None
        return math.degrees(c.elevator)

    assert last((-10.0, 0.0), 0.9) == pytest.approx(last((-10.0, 0.0), 0.0), abs=1e-6)
    assert last(None, 0.9) < last(None, 0.0) - 0.5


def test_engines_make_up_for_a_headwind_as_it_falls() -> None:
    """40 m up, sinking at 2.62 m/s, 10 m/s at 33 ft fall by 10 x 2.62 / (5.3942 x 40) = 0.121 m/s², times the mass."""
    _, result = do128()
    m = result.points[0].model
    e, r = in_trim()
    told, untold = (
        LandingController(result, reported=reported).step(LandingController(result).init(), e, r)[1].throttle
        for reported in ((-10.0, 0.0), None)
    )
    thrust, V = ThrustMap(result.settings.thrust), float(np.hypot(m.state[0], m.state[2]))
    fall = 10.0 * m.state[0] * math.sin(-m.flight_path) / (5.3942 * 40.0)
    more = thrust.throttle(m.mass * fall, V) - thrust.throttle(0.0, V)
    assert told - untold == pytest.approx(more, rel=0.02)
    assert more > 0.05


def test_decrabbed_flight_is_a_steady_sideslip() -> None:
    """Wing low by just as much as the slip takes: neither roll, yaw nor side acceleration, on the aircraft's own model."""
    _, result = do128()
    m = result.points[0].model
    slip = 2.0
    phi = result.points[0].sideslip[0] * slip
    e, r = in_trim(v=slip, phi=phi)
    c = command(e, replace(r, extra={"sideslip": slip / math.hypot(*m.state[:3]), "crosswind": 0.0}))
    x = np.zeros(12)
    x[1], x[6] = slip, phi
    rates = m.A @ x + m.B @ [0.0, 0.0, c.aileron, c.rudder]
    assert 0.01 < phi < 0.1  # right wing down, into the air from the right
    np.testing.assert_allclose(rates[[1, 3, 5]], 0.0, atol=3e-3)


def test_steady_turn_and_pull_are_fed_forward() -> None:
    """At the rates and attitudes asked for, the command balances the linear model's moments without any feedback."""
    _, result = do128()
    point = result.points[0]
    m = point.model
    r = 0.02
    phi = -float(np.linalg.solve(np.hstack([m.A[np.ix_([1, 3, 5], [6])], m.B[np.ix_([1, 3, 5], [2, 3])]]),
                                 m.A[[1, 3, 5], 5])[0]) * r  # fmt: skip
    e, ref = in_trim(r=r, phi=phi)
    c = command(e, replace(ref, phi=phi, r_ff=r))
    x = np.zeros(12)
    x[5], x[6] = r, phi
    np.testing.assert_allclose((m.A @ x + m.B @ [0.0, 0.0, c.aileron, c.rudder])[[1, 3, 5]], 0.0, atol=1e-9)
    assert phi == pytest.approx(m.airspeed * r / 9.81, rel=0.05)

    q = 0.03
    w = point.pull[0] * q
    e, ref = in_trim(q=q, w=m.state[2] + w, theta=m.state[7] + w / m.airspeed)
    c = command(e, replace(ref, extra={"pull": q * math.hypot(m.airspeed, w)}))
    x = np.zeros(12)
    x[2], x[4] = w, q
    np.testing.assert_allclose((m.A @ x + m.B @ [c.elevator - m.inputs[0], 0.0, 0.0, 0.0])[[2, 4]], 0.0, atol=5e-3)
    assert w > 0.0 > c.elevator - m.inputs[0]


def test_on_the_wheels_everything_is_steered_back() -> None:
    v, _ = do128()
    rollout = Rollout(v.control.rollout)
    ref = Reference("rollout", 0.0, 1.8, 0.0, 0.0, 0.0, 0.0)

    def step(**values: float) -> tuple[float, float, float, float, float]:
        b = believed(Estimate(0.0, NAMES, np.array([{"u": 30.0, **values}.get(n, 0.0) for n in NAMES]), None, True))
        return rollout.step(RolloutMemory(), b, motion(b), ref, 0.06)[1]

    straight = step()
    assert straight[3] == straight[4]
    elevator, aileron, rudder, left, right = step(theta=0.1, phi=0.05, psi=0.05, y=1.0)
    assert elevator > straight[0]  # nose high: push
    assert aileron < 0.0  # right wing low: raise it
    assert rudder > 0.0  # to the right and pointing there: nose left
    assert left > right
    assert step(psi=0.05, u=15.0)[2] > rudder  # less air, more rudder
    assert step(r=0.05)[2] > 0.0


def test_updraught_lowers_the_nose() -> None:
    """In air rising at 1 m/s the same path needs 1/50 rad less pitch; flown so, the elevator stays in trim."""
    _, result = do128()
    m = result.points[0].model
    theta = m.state[7] - 1.0 / 50.0
    e, r = in_trim(theta=theta, wz=-1.0)
    e.mean[0] = m.state[0] + math.sin(theta)  # over the ground: the air carries the aircraft up
    e.mean[2] = m.state[2] - math.cos(theta)
    assert command(e, r).elevator == pytest.approx(m.inputs[0], abs=1e-3)
    e.mean[NAMES.index("theta")] = m.state[7]
    assert command(e, r).elevator > m.inputs[0] + 0.03  # push


def test_rates_and_deflections_stay_within_what_is_believed() -> None:
    controller = LandingController(do128()[1])
    memory = controller.init()
    e, r = in_trim()
    memory, first = controller.step(memory, e, r)
    hit = replace(in_trim(phi=1.0, H=20.0)[0], t=0.06)
    memory, second = controller.step(memory, hit, r)
    assert abs(second.aileron - first.aileron) == pytest.approx(math.radians(51.0) * 0.06)
    for i in range(2, 20):
        memory, last = controller.step(memory, replace(hit, t=0.06 * i), r)
    assert last.aileron == pytest.approx(-math.radians(20.0))
    assert last.elevator == pytest.approx(-math.radians(17.0))


def test_integrals_do_not_run_into_a_closed_throttle() -> None:
    controller = LandingController(do128()[1])
    memory = controller.init()
    for i in range(100):
        memory, c = controller.step(memory, replace(in_trim(u=60.0)[0], t=0.06 * i), in_trim()[1])
    assert c.throttle == 0.0
    assert memory.int_V == 0.0


def test_before_acquisition_the_trim_is_held_and_the_camera_searches() -> None:
    v, result = do128()
    controller = LandingController(result)
    guidance = LandingGuidance(v.guidance)
    blind = Estimate(0.0, NAMES, np.full(len(NAMES), np.nan), None, False)
    _, reference = guidance.step(guidance.init(), blind)
    _, c = controller.step(controller.init(), blind, reference)
    assert c.elevator == result.points[0].model.inputs[0]
    assert (c.aileron, c.rudder, c.pan, c.tilt) == (0.0, 0.0, 0.0, 0.0)
    assert c.throttle == pytest.approx(result.points[0].model.inputs[1] / 8960.0)


def test_thrust_map_is_linear_between_idle_and_full() -> None:
    v, _ = do128()
    throttle = ThrustMap(v.control.thrust).throttle
    assert throttle(8960.0, 50.0) == pytest.approx(1.0)
    assert throttle(0.5 * (8960.0 + 7680.0) / 2, 55.0) == pytest.approx(0.5)
    assert throttle(-100.0, 50.0) < 0.0


def test_settings_name_what_is_wrong() -> None:
    v, _ = do128()
    with pytest.raises(ValueError, match="equally long"):
        replace(v.control.rollout, brake=(0.1,))
    with pytest.raises(ValueError, match="increasing"):
        replace(v.control.thrust, airspeed_mps=(0.0, 30.0, 20.0, 40.0, 50.0, 60.0, 80.0))
    with pytest.raises(ValueError, match="full_n must exceed idle_n"):
        replace(v.control.thrust, idle_n=v.control.thrust.full_n)
    with pytest.raises(ValueError, match=r"flap must be 0 \.\.\. 1"):
        replace(v.control, flap=5.0)
    assert isinstance(v.control.rollout, RolloutSettings)


# ----------------------------------------------------------------------------------------------------- closed loop


@dataclass(frozen=True)
class Flight:
    touchdown: Touchdown
    truths: list[Truth]
    modes: list[str]

    @property
    def airborne(self) -> list[Truth]:
        return [s for s in self.truths if s.t < self.touchdown.t]

    @property
    def peak_roll(self) -> float:
        return math.degrees(max(abs(s.euler[0]) for s in self.airborne))

    def y_at(self, travelled: float) -> float:
        """y [m] of the cg after `travelled` metres over the ground."""
        p = np.array([s.p_RB[:2] for s in self.truths])
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(p, axis=0).T))])
        return float(np.interp(travelled, s, p[:, 1]))

    @property
    def y_touchdown(self) -> float:
        """y [m] of the cg when the first wheel touches."""
        return float(np.interp(self.touchdown.t, [s.t for s in self.truths], [s.p_RB[1] for s in self.truths]))


def fly(
    wind: WindConfig,
    seed: int = 0,
    until: float = 80.0,
    valid: Callable[[float], bool] = lambda t: True,
    noise: float = 0.0,
) -> tuple[Flight | None, list[Truth], list[str]]:
    """The paper's start, the state known (with `noise` times a filter's typical errors), 60 ms cycle and delay."""
    v, result = do128()
    guidance, controller = LandingGuidance(v.guidance), LandingController(result)
    plant = JsbsimPlant(
        paths.aircraft_folder("do128"), RunwayFrame(math.radians(52.3), math.radians(10.5), 0.0, 0.0),
        InitialState(x=-950.0, y=-85.0, height=51.0, psi=math.radians(15.0), airspeed=50.0, gamma=math.radians(-2.65)),
    )  # fmt: skip
    air, errors = Wind(wind, Noise(seed, "turbulence")), Noise(seed, "errors")
    sd = np.array([0.15, 0.15, 0.15, *np.radians([0.1] * 3), *np.radians([0.06] * 3), 2.5, 0.25, 0.12, 0.4, 0.3, 0.3])
    error, fade = np.zeros(15), math.exp(-CYCLE * DT / 0.5)
    guided, controlled = guidance.init(), controller.init()
    acting, pending = plant.trimmed, deque[tuple[int, Command]]()
    truths, modes, tick = [], [], 0
    while tick * DT < until:
        truth = plant.truth()
        down = bool(truth.on_ground[:2].any())
        error = fade * error + math.sqrt(1.0 - fade**2) * errors.normal(15) * sd * noise
        mean = np.concatenate(
            [truth.R_RB.T @ truth.v_RB_R, truth.w_RB_B, truth.euler, truth.p_RB * [1.0, 1.0, -1.0], truth.wind_R]
        )
        estimate = Estimate(truth.t, NAMES, mean + error, None, valid(truth.t), {"on_ground": down})
        guided, reference = guidance.step(guided, estimate)
        controlled, wanted = controller.step(controlled, estimate, reference)
        truths.append(truth)
        modes.append(reference.mode)
        if reference.mode == "stopped":
            break
        pending.append((tick + DELAY, wanted))
        for _ in range(CYCLE):
            if pending and pending[0][0] <= tick:
                acting = pending.popleft()[1]
            plant.step(acting, air.wind(tick * DT, *plant.fast_truth()))
            tick += 1
    return (Flight(plant.touchdown, truths, modes) if plant.touchdown else None), truths, modes


@lru_cache
def paper() -> Flight:
    flight, _, _ = fly(GUST)
    assert flight is not None
    return flight


def test_the_papers_landing_in_wind_and_gust() -> None:
    flight = paper()
    assert abs(flight.y_at(520.0)) < 5.0
    assert flight.peak_roll < 10.5
    assert flight.touchdown.x == pytest.approx(550.0, abs=60.0)
    assert abs(flight.y_touchdown) < 0.5
    assert 0.0 < flight.touchdown.sink_rate < 0.6
    assert flight.touchdown.airspeed == pytest.approx(43.0, abs=1.5)
    assert abs(math.degrees(flight.touchdown.heading_error)) < 0.5
    heading = np.interp(-200.0, [s.p_RB[0] for s in flight.truths], [s.euler[2] for s in flight.truths])
    assert math.degrees(heading) == pytest.approx(2.0, abs=0.5)


def test_it_rolls_out_straight_and_stops_on_the_runway() -> None:
    flight = paper()
    rolling = [s for s in flight.truths if s.t > flight.touchdown.t]
    assert flight.modes[-1] == "stopped"
    assert rolling[-1].p_RB[0] < 1680.0
    assert max(abs(s.p_RB[1]) for s in rolling) < 3.0
    assert max(abs(s.euler[2]) for s in rolling) < math.radians(5.0)
    assert max(s.wheels_height[:2].min() for s in rolling) < 0.05  # no bounce
    assert min(s.euler[1] for s in rolling) > 0.0  # the tail never rises beyond level


def test_phases_follow_each_other() -> None:
    modes = paper().modes
    assert list(dict.fromkeys(modes)) == ["capture", "glide", "flare", "decrab", "rollout", "stopped"]


def test_blackout_ends_in_a_climb() -> None:
    flight, truths, modes = fly(GUST, until=30.0, valid=lambda t: t < 8.0)
    assert flight is None
    assert modes[-1] == "go_around"
    assert truths[-1].p_RB[2] < -60.0
    assert truths[-1].airspeed == pytest.approx(50.0, abs=1.0)
    assert max(s.load_factor for s in truths) < 1.4
    assert -truths[-1].v_RB_R[2] == pytest.approx(50.0 * math.sin(math.radians(4.0)), abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("head", [5.0, -5.0])
def test_head_and_tailwind(head: float) -> None:
    flight, _, modes = fly(replace(GUST, steady=SteadyWind(headwind=head)))
    assert flight is not None and modes[-1] == "stopped"
    assert abs(flight.y_touchdown) < 0.5
    assert flight.touchdown.x == pytest.approx(550.0, abs=60.0)
    assert flight.touchdown.sink_rate < 0.6
    assert flight.truths[-1].p_RB[0] < 1680.0


@pytest.mark.slow
@pytest.mark.parametrize("intensity", ["light", "moderate"])
def test_turbulence(intensity: str) -> None:
    for seed in range(6):
        flight, _, modes = fly(replace(GUST, turbulence=Turbulence(W20[intensity])), seed, noise=0.4)
        assert flight is not None and modes[-1] == "stopped"
        assert abs(flight.y_touchdown) < 3.0
        assert flight.touchdown.sink_rate < 1.5
        assert 250.0 < flight.touchdown.x < 900.0


def test_commands_are_smoothed_before_their_rate_is_limited() -> None:
    """A step of 1: 0.04 / (0.04 + 0.06) of it in the first cycle, of the rest in the second; then rate, then range."""
    assert _limited(1.0, 0.0, 0.04, 9.0, 99.0, 0.06) == pytest.approx(0.4)
    assert _limited(1.0, 0.4, 0.04, 9.0, 99.0, 0.06) == pytest.approx(0.64)
    assert _limited(1.0, 0.0, 0.04, 9.0, 2.0, 0.06) == pytest.approx(0.08)
    assert _limited(1.0, 0.0, 0.04, 0.3, 99.0, 0.0) == pytest.approx(0.3)
    assert _limited(1.0, 0.0, 0.0, 9.0, 2.0, 0.06) == 1.0  # no cycle before it


def test_a_surface_turns_when_its_command_does() -> None:
    """Limited to 0.1 a cycle: 0.5 asked at once gives 0.1; 0.3 then turns it to 0.0, and what is owed comes slowly."""
    assert _followed(0.5, 0.0, 0.0, 0.1, 9.0, 1.0, 0.9) == pytest.approx(0.1)
    assert _followed(0.3, 0.5, 0.1, 0.1, 9.0, 1.0, 0.9) == pytest.approx(0.1 - 0.1)  # -0.2 + 0.1 (0.5 - 0.1), limited
    assert _followed(0.3, 0.3, 0.0, 0.1, 9.0, 1.0, 0.9) == pytest.approx(0.03)
    assert _followed(0.35, 0.3, 0.3, 0.1, 9.0, 1.0, 0.9) == pytest.approx(0.35)  # nothing owed: as asked
    assert _followed(0.35, 0.3, 0.3, 0.1, 0.32, 1.0, 0.9) == pytest.approx(0.32)
