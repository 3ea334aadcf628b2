"""The Do 128 class aircraft: trims, modes, stall, gear, against the design figures in its provenance table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from landing_sim.geometry.earth import RunwayFrame
from landing_sim.plants.aircraft import InitialState, JsbsimPlant
from landing_sim.plants.trim import STATES, LinearModel, TrimPoint, linearise, trim
from landing_sim.signals import Command, Truth

DO128 = Path(__file__).resolve().parents[1] / "aircraft" / "do128"
FRAME = RunwayFrame(math.radians(52.3192), math.radians(10.5561), 89.0, math.radians(263.0))
STILL = np.zeros(3)


@cache
def at_50() -> tuple[TrimPoint, LinearModel]:
    point = trim(DO128, 50.0, math.radians(-3.0), 0.5, height=300.0)
    return point, linearise(DO128, point)


@cache
def at_43() -> tuple[TrimPoint, LinearModel]:
    point = trim(DO128, 43.0, math.radians(-0.7), 0.5, height=300.0)
    return point, linearise(DO128, point)


def sub(linear: LinearModel, names: str) -> np.ndarray:
    index = [STATES.index(n) for n in names.split()]
    return linear.A[np.ix_(index, index)]


def oscillations(A: np.ndarray) -> list[tuple[float, float]]:
    """Natural frequency [rad/s] and damping ratio of each complex pair, slowest first."""
    poles = [p for p in np.linalg.eigvals(A) if p.imag > 1e-9]
    return sorted((abs(p), -p.real / abs(p)) for p in poles)


# ---------------------------------------------------------------------------------------------- trim and modes


def test_trims_of_the_approach() -> None:
    """alpha 0.1 deg, 3.37 kN, elevator 0.3 deg; alpha 3.7 deg, 4.55 kN."""
    fast, slow = at_50()[0], at_43()[0]
    assert math.degrees(fast.alpha) == pytest.approx(0.1, abs=0.1)
    assert fast.thrust == pytest.approx(3370.0, rel=0.01)
    assert math.degrees(fast.elevator) == pytest.approx(0.3, abs=0.1)
    assert math.degrees(slow.alpha) == pytest.approx(3.7, abs=0.1)
    assert slow.thrust == pytest.approx(4550.0, rel=0.01)
    assert math.degrees(slow.theta) == pytest.approx(3.0, abs=0.1)
    assert fast.max_thrust == pytest.approx(2 * 8000.0 * 0.56, rel=1e-3)


def test_longitudinal_modes_at_50() -> None:
    """Short period 3.34 rad/s (5 %), damping 0.68 with the downwash late (0.06); phugoid 0.226 rad/s (5 %), 0.14 (0.03)."""
    point, linear = at_50()
    A = sub(linear, "u w q theta")
    faster, slower = (trim(DO128, V, point.gamma, 0.5, height=300.0).max_thrust for V in (51.0, 49.0))
    per_speed = point.throttle * (faster - slower) / 2.0  # the lever, not the thrust, stays put
    A = A + np.outer(linear.B[[0, 2, 4, 7], 1], [per_speed, 0.0, 0.0, 0.0])
    (w_ph, z_ph), (w_sp, z_sp) = oscillations(A)
    assert w_sp == pytest.approx(3.34, rel=0.05)
    assert z_sp == pytest.approx(0.68, abs=0.06)
    assert w_ph == pytest.approx(0.226, rel=0.05)
    assert z_ph == pytest.approx(0.14, abs=0.03)


def test_lateral_modes_at_50() -> None:
    """Roll 0.29 s (5 %), Dutch roll 1.62 rad/s (6 %) damped 0.22 (0.03), spiral doubling in 40 to 150 s."""
    A = sub(at_50()[1], "v p r phi")
    ((w_dr, z_dr),) = oscillations(A)
    real = sorted(p.real for p in np.linalg.eigvals(A) if abs(p.imag) < 1e-9)
    assert -1.0 / real[0] == pytest.approx(0.29, rel=0.05)
    assert w_dr == pytest.approx(1.62, rel=0.06)
    assert z_dr == pytest.approx(0.22, abs=0.03)
    assert 40.0 < math.log(2.0) / real[1] < 150.0


def test_full_aileron_roll_rate() -> None:
    """pb/2V of 0.071 at full aileron, from a fifth of it; without the sideslip it breeds it would be 0.105."""
    p = JsbsimPlant(DO128, FRAME, InitialState(height=400.0))
    rate = 0.0
    for _ in range(240):
        p.step(Command(p.trimmed.elevator, 0.07, 0.0, p.trimmed.throttle, 0.5), STILL)
        rate = max(rate, float(p.truth().w_RB_B[0]))
    assert 5.0 * rate * 15.55 / 100.0 == pytest.approx(0.075, abs=0.02)


def test_signs_of_the_controls() -> None:
    """Elevator > 0 nose down, aileron > 0 right wing down, rudder > 0 nose left, thrust forward."""
    B = at_50()[1].B
    rate = {n: B[STATES.index(n)] for n in "upqr"}
    assert rate["q"][0] < -1.0
    assert rate["p"][2] > 1.0
    assert rate["r"][3] < -1.0
    assert rate["u"][1] == pytest.approx(1.0 / 4000.0, rel=0.02)


def test_linear_model_predicts_the_aircraft() -> None:
    """Elevator and aileron pulses: linear w, q, p, v, phi stay within 5 % of the peak of the flight model's for 3 s.

    The linear model has no actuator: it is given the surfaces reached. Its downwash delay is an alpha-dot term.
    """
    point = trim(DO128, 50.0, 0.0, 0.5, height=400.0 + FRAME.elevation)
    linear = linearise(DO128, point)
    p = JsbsimPlant(DO128, FRAME, InitialState(height=400.0))
    x, flown, predicted = np.zeros(12), [], []
    F = expm(np.block([[linear.A, linear.B], [np.zeros((4, 16))]]) * p.dt)
    first = p.truth()
    for i in range(600):
        on = 0.01 if i < 100 else 0.0
        p.step(Command(p.trimmed.elevator + on, on, 0.0, p.trimmed.throttle, 0.5), STILL)
        truth = p.truth()
        u = np.array([truth.surfaces[0] - first.surfaces[0], 0.0, truth.surfaces[1], truth.surfaces[2]])
        x = F[:12, :12] @ x + F[:12, 12:] @ u
        predicted.append(x[[1, 2, 3, 4, 6]])
        flown.append(_lateral_and_pitch(truth, first))
    error = np.abs(np.array(flown) - np.array(predicted)).max(axis=0)
    assert (error < 0.05 * np.abs(flown).max(axis=0)).all(), error / np.abs(flown).max(axis=0)


def _lateral_and_pitch(truth: Truth, first: Truth) -> list[float]:
    v, v0 = truth.R_RB.T @ truth.v_RB_R, first.R_RB.T @ first.v_RB_R
    return [v[1] - v0[1], v[2] - v0[2], truth.w_RB_B[0], truth.w_RB_B[1], truth.euler[0]]


@pytest.mark.parametrize("gust", [(0.0, 0.5, 0.0), (0.0, 0.0, -0.4), (-0.5, 0.0, 0.0)])
def test_gusts_enter_the_linear_model_as_they_enter_the_aircraft(gust: tuple[float, float, float]) -> None:
    """A gust that comes up over 2 s: inertial velocity, rates and bank within 6 % of their peaks for 4 s."""
    point = trim(DO128, 50.0, 0.0, 0.5, height=400.0 + FRAME.elevation)
    linear = linearise(DO128, point)
    p = JsbsimPlant(DO128, FRAME, InitialState(height=400.0))
    first = p.truth()
    inputs = np.column_stack([linear.B[:, 1], linear.G, linear.G_dot])
    F = expm(np.block([[linear.A, inputs], [np.zeros((7, 19))]]) * p.dt)
    x, flown, predicted = np.zeros(12), [], []
    before = np.zeros(3)
    for i in range(800):
        wind = np.array(gust) * 0.5 * (1.0 - math.cos(math.pi * min(i * p.dt / 2.0, 1.0)))
        p.step(p.trimmed, wind)
        truth = p.truth()
        w, w_dot = first.R_RB.T @ wind, first.R_RB.T @ (wind - before) / p.dt
        before = wind
        x = F[:12, :12] @ x + F[:12, 12:] @ np.array([truth.thrust - first.thrust, *w, *w_dot])
        predicted.append(x[[0, 1, 2, 3, 4, 6]])
        v = truth.R_RB.T @ truth.v_RB_R - first.R_RB.T @ first.v_RB_R
        flown.append([v[0], *_lateral_and_pitch(truth, first)])
    error, peak = np.abs(np.array(flown) - np.array(predicted)).max(axis=0), np.abs(flown).max(axis=0)
    told = peak > [0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3]  # a gust from the side barely pitches
    assert told.sum() >= 3
    assert (error < 0.06 * peak)[told].all(), error / peak


# ---------------------------------------------------------------------------------------------- stall


def slow_down(flap: float, airspeed: float, gamma: float) -> list[Truth]:
    """Idle, alpha raised by 0.7 deg/s until the elevator or the lift runs out."""
    p = JsbsimPlant(DO128, FRAME, InitialState(height=400.0, airspeed=airspeed, gamma=gamma, flap=flap))
    flight, integral = [p.truth()], 0.0
    for i in range(5600):
        t = flight[-1]
        error = t.alpha - p.trim_point.alpha - math.radians(0.7) * i * p.dt
        integral += error * p.dt
        elevator = p.trim_point.elevator + error + 1.2 * integral + 0.6 * t.w_RB_B[1]
        aileron, rudder = -t.euler[0] - 0.3 * t.w_RB_B[0], 0.5 * t.w_RB_B[2]
        p.step(Command(elevator, aileron, rudder, 0.0, flap), STILL)
        flight.append(p.truth())
    return flight


@cache
def full_flap_stall() -> list[Truth]:
    return slow_down(1.0, 36.0, -0.1)


def stall_speed(flight: list[Truth]) -> float:
    """[m/s] at which the most lift the wing gave would just carry the weight."""
    return min(t.airspeed / math.sqrt(t.load_factor) for t in flight if t.load_factor > 0.5)


def test_full_flap_stall_speed() -> None:
    """29 to 30 m/s at 4,000 kg (29.1 m/s published for 3,842 kg)."""
    assert 29.0 < stall_speed(full_flap_stall()) < 30.0


def test_flap_lowers_the_stall_speed() -> None:
    clean = stall_speed(slow_down(0.0, 46.0, -0.05))
    assert clean == pytest.approx(29.6 * math.sqrt(2.5 / 1.6), rel=0.03)


def test_past_the_stall_lift_drops_and_the_aircraft_sinks() -> None:
    flight = full_flap_stall()
    peak = max(flight, key=lambda t: t.load_factor / t.airspeed**2)
    deep = flight[-1]
    per_lift = [t.load_factor / t.airspeed**2 for t in (peak, deep)]
    assert 0.65 < per_lift[1] / per_lift[0] < 0.9
    assert math.degrees(peak.alpha) == pytest.approx(16.9, abs=1.0)
    assert deep.v_RB_R[2] > peak.v_RB_R[2] + 2.0


# ---------------------------------------------------------------------------------------------- gear


def test_at_rest_it_sits_still() -> None:
    """10 s on its wheels: three-point attitude 8.34 deg, cg at 1.598 m, drift below a millimetre a second."""
    p = JsbsimPlant(DO128, FRAME, InitialState(x=100.0, y=2.0, flap=0.0, on_ground=True))
    for _ in range(200):
        p.step(Command(), STILL)
    before = p.truth()
    fastest = 0.0
    for _ in range(1800):
        p.step(Command(), STILL)
        fastest = max(fastest, float(np.linalg.norm(p.truth().v_RB_R)))
    after = p.truth()
    assert fastest < 1e-3
    assert after.p_RB == pytest.approx(before.p_RB, abs=1e-4)
    assert math.degrees(after.euler[1]) == pytest.approx(8.34, abs=0.05)
    assert -after.p_RB[2] == pytest.approx(1.598, abs=0.005)
    assert p.touchdown is None


@dataclass(slots=True)
class Rollout:
    plant: JsbsimPlant
    flight: list[Truth]


@cache
def land(sink: float) -> Rollout:
    """On the mains at 43 m/s with about this sink rate, then idle, tail lowered, brakes and rudder until it stands."""
    height = 2.25
    p = JsbsimPlant(DO128, FRAME, InitialState(x=500.0, height=height, airspeed=43.0, gamma=-math.asin(sink / 43.0)))
    flight = [p.truth()]
    while flight[-1].v_RB_R[0] > 0.3 and flight[-1].t < 60.0:
        t = flight[-1]
        fast = t.airspeed > 22.0
        if p.touchdown is None:
            c = Command(p.trimmed.elevator, throttle=p.trimmed.throttle, flap=0.5)
        else:
            hold = 0.02 + 0.6 * (t.euler[1] - 0.03) if fast else -0.2
            brake = 0.25 if t.airspeed < 28.0 else 0.0
            rudder = 1.5 * t.euler[2] + t.w_RB_B[2] + 0.02 * t.p_RB[1]
            aileron = -t.euler[0] - 0.3 * t.w_RB_B[0]
            c = Command(hold + 0.3 * t.w_RB_B[1], aileron, rudder, 0.0, 0.5, brake, brake)
        p.step(c, STILL)
        flight.append(p.truth())
    return Rollout(p, flight)


@pytest.mark.parametrize(("sink", "most_g"), [(0.6, 2.0), (1.5, 3.0)])
def test_wheel_landing_stays_down_and_rolls_out(sink: float, most_g: float) -> None:
    r = land(sink)
    touch = r.plant.touchdown
    assert touch is not None
    assert touch.sink_rate == pytest.approx(sink, abs=0.25)
    assert touch.airspeed == pytest.approx(43.0, abs=0.5)
    assert math.degrees(touch.pitch) < 4.5  # on the mains: three points would be 8.3
    rolling = [t for t in r.flight if t.t > touch.t]
    bounce = max(t.wheels_height[:2].min() for t in rolling)
    assert bounce < 0.03
    assert max(t.load_factor for t in rolling) < most_g
    last = rolling[-1]
    assert last.v_RB_R[0] < 0.3
    assert last.on_ground.all()
    assert last.p_RB[0] < 1680.0
    assert abs(last.p_RB[1]) < 2.0
    assert max(abs(t.euler[0]) for t in rolling) < math.radians(2.0)


def test_elevator_brings_the_tail_down_only_when_slow() -> None:
    flight = land(0.6).flight
    tail_down = next(t for t in flight if t.on_ground[2])
    assert 15.0 < tail_down.airspeed < 30.0


def test_ground_effect_pitches_the_nose_down_and_lifts() -> None:
    """Hands off over the runway: less downwash at the tail turns the nose down, as image vortices say."""
    high, low = (trim(DO128, 43.0, 0.0, 0.5, clearance=c) for c in (200.0, 2.0))
    assert low.elevator < high.elevator - 0.03
    assert low.thrust < high.thrust - 150.0
    assert low.alpha < high.alpha
