"""The gains of the transport, planned for its nominal cg, over its envelope; what keeps a slow elevator from cycling."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from landing_sim import paths, vehicle
from landing_sim.campaign import file, landing
from landing_sim.control.design import Design, LinearModel, design, lateral_model, longitudinal_model
from landing_sim.control.eigenstructure import margins
from landing_sim.control.landing_lq import LandingController
from landing_sim.control.settings import ControlSettings
from landing_sim.missions.onboard import linear_models
from landing_sim.plants.jsbsim import FlightModel
from landing_sim.plants.trim import linearise, trim
from landing_sim.signals import Estimate, Reference

NAMES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H")
TRANSPORT = paths.aircraft_folder("transport")
CYCLE, STEP, DELAY = 0.04, 0.01, 0.06
FASTEST = math.radians(20.0)


@cache
def planned(mass: float, headwind: float = 0.0, recovery: bool = True) -> tuple[ControlSettings, Design]:
    """As the crew of an aircraft of this mass has it, whatever its cg."""
    c = vehicle.load("transport").prepared(mass, headwind, 1.225).control
    c = c if recovery else replace(c, elevator=replace(c.elevator, recovery_s=0.0))
    return c, design(c, linear_models(TRANSPORT, c, mass))


def true_model(mass: float, cg_percent: float, airspeed: float) -> LinearModel:
    """Of the aircraft as it is loaded, trimmed on the glide path by its own stabiliser."""
    m = FlightModel(TRANSPORT, 0.005, mass, np.array([(28.0 - cg_percent) * 0.075, 0.0, 0.0]))
    t = trim(TRANSPORT, airspeed, math.radians(-3.0), 1.0, model=m)
    linear = linearise(TRANSPORT, t, m)
    return LinearModel.straight(t.airspeed, t.gamma, t.mass, t.alpha, t.elevator, t.thrust, linear.A, linear.B)


@pytest.mark.parametrize(("mass", "headwind"), [(120e3, 0.0), (120e3, 15.0), (150e3, 0.0), (180e3, 0.0), (180e3, 15.0)])
def test_margins_hold_over_mass_cg_and_speed(mass: float, headwind: float) -> None:
    """120 ... 180 t, cg 15 ... 41 %, 63 ... 77 m/s (a headwind of 30 kt adds 10 kt), gains of the nominal cg."""
    c, result = planned(mass, headwind)
    lags = tuple(a.lag_s + a.smoothing_s for a in (c.elevator, c.aileron, c.rudder))
    point = result.points[0]
    for cg in (15.0, 28.0, 41.0):
        model = true_model(mass, cg, point.model.airspeed)
        for axis, (A, B), names, lag in (
            (point.longitudinal, longitudinal_model(model), ("elevator", "thrust"), (lags[0], c.thrust.lag_s)),
            (point.lateral, lateral_model(model), ("aileron", "rudder"), lags[1:]),
        ):
            found = margins(A, B, axis.solution.K, c.loop_delay_s, lag, names, np.ones(2))
            assert found.stable, (cg, names)
            for loop in found.loops:
                assert loop.gain_up > 3.0, (cg, loop)
                assert loop.gain_down < 0.4, (cg, loop)
                assert loop.phase > math.radians(30.0), (cg, loop)
                assert loop.delay > 0.2, (cg, loop)  # beside the 80 ms already in the loop


def pitch_after_an_upset(controller: LandingController, model: LinearModel, rate: float) -> np.ndarray:
    """(n,) [deg] pitch from trim for 60 s from pitching up at `rate` [deg/s], 15 m below the path.

    The elevator moves within 25 deg at 20 deg/s, 60 ms after it is told to.
    """
    d = np.zeros(12)
    d[NAMES.index("q")], d[NAMES.index("H")] = math.radians(rate), -15.0
    climb = model.airspeed * math.sin(model.flight_path)
    memory, elevator, thrust = controller.init(), 0.0, 0.0
    late = deque([0.0] * round(DELAY / STEP))
    pitch = []
    for k in range(round(60.0 / CYCLE)):
        state = model.state + d
        state[NAMES.index("H")] += 1000.0
        off = min(max(1000.0 - state[NAMES.index("H")], -5.0), 5.0)
        reference = Reference("glide", model.airspeed, float(state[NAMES.index("H")]) + off, climb, 0.0, 0.0, 0.0,
                              extra={"on_path": float(abs(off) < 5.0)})  # fmt: skip
        memory, command = controller.step(memory, Estimate(k * CYCLE, NAMES, state, None, True), reference)
        for _ in range(round(CYCLE / STEP)):
            late.append(command.elevator)
            elevator += STEP * min(max((late.popleft() - elevator) / 0.07, -FASTEST), FASTEST)
            wanted = 12e3 + 400e3 * command.throttle - model.inputs[1]
            thrust += STEP / 2.0 * (wanted - thrust)
            d = d + STEP * (model.A @ d + model.B @ [elevator, thrust, 0.0, 0.0])
        pitch.append(math.degrees(d[NAMES.index("theta")]))
    return np.array(pitch)


@pytest.mark.parametrize("rate", [9.0, -12.0])
@pytest.mark.parametrize("cg", [15.0, 28.0, 41.0])
@pytest.mark.parametrize("mass", [120e3, 160e3, 180e3])
def test_an_upset_dies_out_with_the_elevator_at_its_rate_limit(mass: float, cg: float, rate: float) -> None:
    result = planned(mass)[1]
    pitch = pitch_after_an_upset(LandingController(result), true_model(mass, cg, result.points[0].model.airspeed), rate)
    assert np.abs(pitch).max() < 12.0
    assert np.abs(pitch[-250:]).max() < 0.5


def test_a_limiter_that_catches_up_at_the_full_rate_cycles_for_ever() -> None:
    """The airframe is stable and every margin holds: it is the limiter's lag."""
    result = planned(160e3, recovery=False)[1]
    model = true_model(160e3, 41.0, result.points[0].model.airspeed)
    pitch = pitch_after_an_upset(LandingController(result), model, 9.0)
    assert np.abs(pitch[-250:]).max() > 5.0


@pytest.mark.slow
@pytest.mark.parametrize("run", [15, 16])
def test_aft_cg_off_the_path_lands(run: int) -> None:
    """Of the challenge's limit campaign: 160 t, cg 36 and 40 %, 72 m/s; they cycled within +-25 deg of elevator."""
    wanted, flight = landing.fly(file.load("transport/campaign_limit"), run)
    assert wanted.aircraft.cg_offset_m < -0.5
    assert flight.verdict.outcome == "landed"
    airborne = (flight.log["t_s"] > 10.0) & (flight.log["true_x_m"] < -300.0)
    assert np.degrees(flight.log["true_theta_rad"][airborne]).std() < 2.0
