"""The descent on optic flow, closed: signs at the edges, guidance and control on their own, and whole landings."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from landing_sim.control.descent import AttitudeMemory, DescentController, DescentGuidance, DescentSettings
from landing_sim.estimators.optic_flow.dynamics import Lander
from landing_sim.estimators.optic_flow.estimator import NAMES, ContactFrontEnd, FlowEstimator, FlowFrontEnd
from landing_sim.estimators.optic_flow.geometry import flow
from landing_sim.estimators.optic_flow.kalman import FlowEkf
from landing_sim.estimators.optic_flow.reference import reference
from landing_sim.missions import lunar_flight
from landing_sim.missions.lunar_landing import build, deviation
from landing_sim.sections.lunar import Deviation, LunarScenario
from landing_sim.sensors.optic_flow import FlowReading
from landing_sim.signals import Command, Estimate, Measurement, Sample

REF = reference()
SETTINGS = DescentSettings()
GUIDANCE = DescentGuidance(REF.at, REF.duration, SETTINGS)
MASS = 758.0
CONTROLLER = DescentController(SETTINGS, MASS, Lander().burn)
PUBLISHED = {
    "initial": {"height_m": 100, "pitch_rate_dps": -0.2, "flow_x_dps": -0.115, "flow_z_dps": -0.08, "pitch_deg": -2},
    "believed": {"height_m": 60, "pitch_rate_dps": -0.2, "flow_x_dps": -0.126, "flow_z_dps": 0.23, "pitch_deg": 3.23},
}


def scenario(**changes) -> LunarScenario:
    return LunarScenario.model_validate_json(
        json.dumps({"schema_version": 1, "mission": "lunar_landing", **PUBLISHED, **changes})
    )


def estimate(t: float, X: np.ndarray, on_ground: bool = False) -> Estimate:
    """X (5,) in the paper's signs, as the estimator would say it."""
    return Estimate(t, NAMES, X * [1, -1, 1, 1, -1], np.eye(5), True, {"on_ground": on_ground})


def estimator() -> FlowEstimator:
    return FlowEstimator(FlowEkf(), Lander(), REF.state(0.0), MASS, 3500.0, 60.0)


def test_deviations_are_the_papers() -> None:
    X = deviation(Deviation(height_m=100, pitch_rate_dps=-0.2, flow_x_dps=-0.115, flow_z_dps=-0.08, pitch_deg=-2))
    assert pytest.approx([100.0, *np.radians([-0.2, -0.115, -0.08, -2.0])]) == X


def test_outside_pitch_is_nose_up() -> None:
    e = estimator()
    said = e.read(e.init(0.0))
    assert said["theta"] == pytest.approx(math.radians(53.43)) and said["q"] == pytest.approx(math.radians(0.92))
    assert said.cov is not None and said.cov[0, 0] == pytest.approx(100.0**2)
    memory = e.predict(e.init(0.0), Command(throttle=0.6, elevator=0.5), 2.0)  # nose down, 30 N
    assert e.read(memory)["q"] == pytest.approx(math.radians(0.92) - 2.0 * 0.03)
    assert MASS - memory.mass == pytest.approx(2.0 * Lander().burn(2100.0, 30.0))


def test_estimator_refuses_what_it_does_not_know() -> None:
    e = estimator()
    with pytest.raises(ValueError, match="knows no measurement"):
        e.update(e.init(0.0), Measurement("gyro", 0.0, 0.0, np.zeros(3), np.zeros(3)))


def test_a_flow_moves_the_estimate_towards_it_and_contact_stops_it() -> None:
    e = estimator()
    memory = e.init(0.0)
    z = np.array([2.0, flow(memory.state.X, 2.0) + 0.01])
    after = e.update(memory, Measurement("flow", 0.0, 0.0, z, np.array([0.0, 1e-6])))
    assert 0.0 < flow(after.state.X, 2.0) - flow(memory.state.X, 2.0) <= 0.0101
    landed = e.update(after, Measurement("on_ground", 0.0, 0.0, np.ones(1), np.zeros(1)))
    later = e.predict(landed, Command(throttle=1.0), 5.0)
    assert e.read(later).flags["on_ground"] and (later.state.X == landed.state.X).all() and later.state.t == 5.0


def test_an_old_flow_is_brought_up_to_date() -> None:
    """What was true 0.4 s ago teaches a filter that knows the truth nothing new; taken for today's, it would."""
    e = estimator()
    memory = e.predict(e.init(0.0), Command(throttle=0.55, elevator=0.1), 0.2)
    then = memory.state.X
    memory = e.predict(memory, Command(throttle=0.55, elevator=0.1), 0.6)
    z, R = np.array([1.8, flow(then, 1.8)]), np.array([0.0, 1e-8])
    old = e.update(memory, Measurement("flow", 0.2, 0.6, z, R))
    new = e.update(memory, Measurement("flow", 0.6, 0.6, z, R))
    change = [abs(flow(m.state.X, 1.8) - flow(memory.state.X, 1.8)) for m in (old, new)]
    assert change[0] < 1e-6 < 1e-3 < change[1]


def test_front_ends() -> None:
    reading = FlowReading(1.6, (math.radians(3.0), math.radians(0.4)), (9.9, 9.95), (0.0, 0.0, 0.0))
    (only,) = FlowFrontEnd("flow_1", 1.57).process(
        Sample("flow_1", 10.0, 10.0, reading), lambda: estimate(0.0, REF.state(0))
    )
    assert only.z == pytest.approx([1.57, math.radians(3.0)]) and only.t_valid == 9.9  # believed, not true, direction
    assert math.degrees(math.sqrt(only.R[1])) == pytest.approx(0.25)
    (contact,) = ContactFrontEnd().process(Sample("squat", 1.0, 1.0, 1.0), lambda: estimate(0.0, REF.state(0)))
    assert contact.kind == "on_ground" and contact.z[0] == 1.0


@pytest.mark.parametrize("t", [6.0, 20.0, 40.0])
def test_on_the_reference_guidance_asks_for_the_reference(t: float) -> None:
    row = REF.at(t)
    _, wanted = GUIDANCE.step(False, estimate(t, row[:5]))
    assert wanted.mode == "glide"
    assert math.degrees(wanted.theta_ff + row[4]) == pytest.approx(0.0, abs=0.15)
    assert wanted.extra["thrust_mps2"] == pytest.approx(row[5], rel=5e-3)
    _, command = CONTROLLER.step(CONTROLLER.init(), estimate(t, row[:5]), replace(wanted, theta_ff=-float(row[4])))
    assert command.elevator * 60.0 == pytest.approx(1000.0 * row[6], abs=0.02)
    assert command.throttle * 3500.0 == pytest.approx(MASS * row[5], rel=5e-3)


def test_too_fast_is_braked() -> None:
    """Sinking too fast asks for more thrust; too fast along, for more nose up (thrust backwards)."""
    t, X = 20.0, REF.state(20.0)
    _, on = GUIDANCE.step(False, estimate(t, X))
    _, sinking = GUIDANCE.step(False, estimate(t, X + [0, 0, 0, -0.01, 0]))
    _, along = GUIDANCE.step(False, estimate(t, X + [0, 0, 0.01, 0, 0]))
    assert sinking.extra["thrust_mps2"] > on.extra["thrust_mps2"] and along.theta_ff > on.theta_ff
    assert along.theta_ff - on.theta_ff <= SETTINGS.lean + 0.01


def test_the_first_seconds_are_flown_by_the_book() -> None:
    wild = REF.state(1.0) + [500.0, 0.1, 0.1, 0.1, 0.5]
    _, wanted = GUIDANCE.step(False, estimate(1.0, wild))
    assert -wanted.theta_ff == pytest.approx(REF.state(1.0)[4]) and wanted.extra["thrust_mps2"] == REF.at(1.0)[5]
    _, command = CONTROLLER.step(CONTROLLER.init(), estimate(1.0, wild), wanted)
    assert command.elevator * 60.0 == pytest.approx(1000.0 * REF.at(1.0)[6])


def test_flare_and_contact() -> None:
    t = REF.duration + 10.0
    X = np.array([3.7, 0.0, 0.0, -0.1, 0.0])
    _, flare = GUIDANCE.step(False, estimate(t, X))
    assert flare.mode == "flare" and abs(flare.theta_ff) < 1e-3
    assert flare.extra["thrust_mps2"] == pytest.approx(1.63 + 3.7 * 0.01, rel=0.02)
    landed, stopped = GUIDANCE.step(False, estimate(t, X, on_ground=True))
    assert landed and stopped.mode == "stopped"
    _, command = CONTROLLER.step(CONTROLLER.init(), estimate(t, X), stopped)
    assert command == Command()
    assert GUIDANCE.step(landed, estimate(t, X))[1].mode == "stopped"  # a bounce does not light the engine


@pytest.mark.parametrize("rate", ["position", "estimate", "combined"])
def test_attitude_loop_settles(rate) -> None:
    """On a double integrator, with a rate estimate that is 0.5 deg/s off: settles unless it trusts that estimate."""
    controller = replace(CONTROLLER, settings=replace(SETTINGS, rate=rate))
    _, wanted = GUIDANCE.step(False, estimate(45.0, REF.state(45.0)))
    wanted = replace(wanted, theta_ff=0.0, r_ff=0.0, extra={"thrust_mps2": 1.6, "spin": 0.0})
    memory, theta, q, dt = controller.init(), math.radians(5.0), 0.0, 0.02
    for k in range(1000):
        X = np.array([10.0, -q - math.radians(0.5), 0.0, -0.1, -theta])
        memory, command = controller.step(memory, estimate(5.0 + k * dt, X), wanted)
        q -= dt * command.elevator * 60.0 / 1000.0
        theta += dt * q
    off = math.degrees(theta)
    assert abs(math.degrees(q)) < 0.02
    if rate == "estimate":
        assert off == pytest.approx(-2.0 * 0.9 / 0.9 * 0.5, abs=0.05)  # 2 zeta/omega times the rate's error
    else:
        assert abs(off) < 0.1


def test_attitude_memory_starts_with_the_estimate() -> None:
    memory, _ = CONTROLLER.step(
        CONTROLLER.init(), estimate(6.0, REF.state(6.0)), GUIDANCE.step(False, estimate(6.0, REF.state(6.0)))[1]
    )
    assert isinstance(memory, AttitudeMemory) and memory.slow == pytest.approx(-REF.state(6.0)[1])


def test_periods_must_fit() -> None:
    with pytest.raises(ValidationError, match=r"time\.step_s"):
        scenario(time={"cycle_s": 0.013})


def test_open_loop_in_front_of_rendered_ground() -> None:
    """The first 9 s of the published descent on flat ground: what three sensors' edges alone teach the filter."""
    mission = build(scenario(terrain={"flat": True}, control={"loop": "open"}), 1)
    steps = list(itertools.takewhile(lambda step: step.truth.t < 9.0, mission.steps()))
    flows = [m for step in steps for m in step.measurements if m.kind == "flow"]
    assert len(flows) > 25 and {round(math.degrees(m.z[0])) for m in flows} == {90, 120, 160}
    truth, last = steps[-1].truth, steps[-1].estimate
    h = -float(truth.p_RB[2])
    assert abs(math.degrees(last["theta"] - truth.euler[1])) < 2.5
    assert abs(math.degrees(last["flow_x"] - truth.v_RB_R[0] / h)) < 0.35
    assert abs(math.degrees(last["flow_z"] + truth.v_RB_R[2] / h)) < 0.25
    again = build(scenario(terrain={"flat": True}, control={"loop": "open"}), 1)
    some = list(itertools.islice(again.steps(), 100))
    assert (some[99].estimate.mean == steps[99].estimate.mean).all()
    with pytest.raises(RuntimeError, match="not over"):
        again.outcome()


@pytest.mark.slow
def test_lands_softly() -> None:
    """Vertical <= 2 m/s, horizontal <= 1 m/s, tilt <= 10 deg, with the engine off at the end; the report flies more."""
    for seed in (21,):
        mission = build(scenario(), seed)
        *_, last = mission.steps()
        outcome = mission.outcome()
        touch = outcome.touchdown
        assert outcome.end == "stopped" and touch is not None
        assert touch.sink_rate <= 2.0 and touch.groundspeed <= 1.0
        assert math.hypot(touch.pitch, touch.bank) <= math.radians(10.0)
        assert last.truth.thrust == 0.0 and np.linalg.norm(last.truth.v_RB_R) < 0.1


def test_a_flight_becomes_a_log_a_verdict_and_a_recording(tmp_path) -> None:
    """Cut off after 0.6 s: not landed, nothing judged as met, but everything written down."""
    short = scenario(terrain={"flat": True}, time={"limit_s": 0.6}, record={"frames_hz": 2.0})
    flight = lunar_flight.fly(short, recording=tmp_path / "recording.rrd")
    assert flight.verdict.outcome == "timeout" and not flight.verdict.passed
    assert [c.passed for c in flight.verdict.criteria] == [False, False, False]
    log = flight.log
    assert log["true_flow_x"][0] == pytest.approx(math.radians(2.18 - 0.115), rel=1e-6)
    assert log.error("theta")[0] == pytest.approx(math.radians(-5.23), abs=1e-4)  # nose up outside
    sight = np.column_stack([log[f"sight_1_{axis}_m"] for axis in "xyz"])[5]
    p = np.array([log["true_x_m"][5], log["true_y_m"][5], log["true_z_m"][5]])
    below = math.atan2(sight[2] - p[2], sight[0] - p[0])  # the first sensor looks 90 deg below the body's horizontal
    assert math.degrees(below) == pytest.approx(90.0 - math.degrees(log["true_theta_rad"][5]), abs=0.1)
    assert (tmp_path / "recording.rrd").stat().st_size > 100_000
