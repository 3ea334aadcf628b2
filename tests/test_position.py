"""The position loop: signs and sizes by hand, limits, its clock, and a point mass that it brings to rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from landing_sim.control.position import FUSED, Memory, PositionController, PositionSettings
from landing_sim.estimators.strapdown_ekf import NAMES
from landing_sim.geometry.so3 import from_euler
from landing_sim.signals import Command, Estimate, Reference

S = PositionSettings(integral=0.0, bandwidth=3.0, damping=0.9, vertical=3.0, vertical_damping=0.9)
HOVER = S.mass * S.gravity / S.full_thrust


def at(t: float = 0.0, **values: float) -> Estimate:
    mean = np.array([values.get(name, 0.0) for name in NAMES])
    return Estimate(t, NAMES, mean, None, True, {"localised": True})


def want(
    mode: str = "hover", height: float = 0.0, climb: float = 0.0, y: float = 0.0, psi: float = 0.0, **extra: float
):
    return Reference(mode, 0.0, height, climb, y, psi, 0.0, extra={"x": 0.0, "vx": 0.0, "vy": 0.0} | extra)


def asked(estimate: Estimate, reference: Reference, settings: PositionSettings = S) -> Command:
    return PositionController(settings).step(Memory(), estimate, reference)[1]


def made(command: Command, psi: float, settings: PositionSettings = S) -> np.ndarray:
    """Acceleration (3,) in R of a body that has the attitude and thrust commanded: elevator is nose down."""
    R_RB = from_euler(command.aileron, -command.elevator, psi)
    return -command.throttle * settings.full_thrust / settings.mass * R_RB[:, 2] + [0.0, 0.0, settings.gravity]


def test_at_rest_where_it_is_wanted_it_carries_its_weight() -> None:
    command = asked(at(), want())
    assert command == Command(elevator=0.0, aileron=0.0, rudder=0.0, throttle=pytest.approx(HOVER))


def test_forward_is_nose_down_right_is_right_wing_down_up_is_more_thrust() -> None:
    """10 cm ahead at wn = 3: 0.9 m/s^2, atan(0.9 / 9.797) = 5.25 deg."""
    assert asked(at(), want(x=0.1)).elevator == pytest.approx(math.atan(0.9 / 9.797))
    assert asked(at(), want(y=0.1)).aileron == pytest.approx(math.atan(0.9 / 9.797))
    assert asked(at(), want(height=0.1)).throttle == pytest.approx(HOVER * (9.797 + 0.9) / 9.797)


def test_speed_is_damped() -> None:
    assert asked(at(vx=0.1), want()).elevator == pytest.approx(-math.atan(2 * 0.9 * 3.0 * 0.1 / 9.797))
    assert asked(at(vz=0.1), want()).throttle > HOVER
    assert asked(at(vz=-0.1), want(climb=0.1)).throttle == pytest.approx(HOVER)


@pytest.mark.parametrize("psi", [0.0, 0.7, -2.0, math.pi])
def test_tilt_and_thrust_make_the_acceleration_wanted_at_any_heading(psi: float) -> None:
    command = asked(at(psi=psi), want(psi=psi, ax=1.1, ay=-0.6, az=0.4))
    np.testing.assert_allclose(made(command, psi), [1.1, -0.6, 0.4], atol=1e-12)


def test_heading_error_turns_the_short_way() -> None:
    assert asked(at(psi=3.0), want(psi=-3.0)).rudder == pytest.approx(-S.heading * (math.tau - 6.0))
    assert asked(at(psi=-0.1), want()).rudder == pytest.approx(-S.heading * 0.1)  # nose right: rudder < 0
    assert asked(at(psi=-3.0), want()).rudder == -S.turn


def test_limits_hold_and_keep_the_direction() -> None:
    far = replace(S, bandwidth=6.0)
    acceleration = made(asked(at(), want(x=5.0, y=2.5), far), 0.0, far)
    assert math.atan(math.hypot(*acceleration[:2]) / S.gravity) == pytest.approx(S.tilt)
    assert acceleration[0] == pytest.approx(acceleration[1])  # both errors count as half a metre
    assert made(asked(at(), want(height=5.0), far), 0.0)[2] == pytest.approx(-S.climb)
    assert made(asked(at(), want(height=-5.0), far), 0.0)[2] == pytest.approx(S.climb)


def test_it_acts_every_period_and_holds_between() -> None:
    controller = PositionController(replace(S, period=0.05))
    memory, commands = controller.init(), []
    for k in range(12):
        memory, command = controller.step(memory, at(0.01 * k), want(x=0.001 * (k + 1)))
        commands.append(command.elevator)
    assert [k for k in range(1, 12) if commands[k] != commands[k - 1]] == [5, 10]


def test_motors_are_off_on_the_ground_and_after_the_cut() -> None:
    controller = PositionController()
    memory, _ = controller.step(controller.init(), at(), want(x=0.1))
    assert memory.integral[0] > 0.0
    for mode in ("wait", "cut"):
        off, command = controller.step(memory, at(0.001), want(mode, x=0.3))
        assert command == Command() and off.integral == (0.0, 0.0, 0.0)


def test_blind_it_flies_velocity_alone() -> None:
    assert asked(at(x=5.0, y=-3.0, vx=0.1), want("land_blind")) == asked(at(vx=0.1), want())


def test_integral_by_hand_and_where_it_stops() -> None:
    """k_i wn^3 e = 0.1 x 27 x 0.1 = 0.27 m/s^3: 0.54 after 2 s (100 commands); never more than `trim`."""
    settings = replace(S, integral=0.1, trim=0.8)
    controller = PositionController(settings)
    memory = controller.init()
    for k in range(100):
        memory, _ = controller.step(memory, at(0.02 * k), want(x=0.1))
    assert memory.integral[0] == pytest.approx(0.54, rel=1e-9)
    for k in range(100, 400):
        memory, _ = controller.step(memory, at(0.02 * k), want(x=0.1))
    assert memory.integral == (0.8, 0.0, 0.0)


def test_integral_does_not_wind_up_against_a_limit_but_comes_back() -> None:
    controller = PositionController(PositionSettings(tilt=math.radians(3.0)))
    memory = controller.init()
    for k in range(50):
        memory, _ = controller.step(memory, at(0.02 * k), want(x=2.0, height=5.0))
    assert memory.integral == (0.0, 0.0, 0.0)
    memory = memory._replace(integral=(0.5, 0.0, 0.0))
    memory, _ = controller.step(memory, at(1.0), want(x=-2.0))
    assert 0.0 < memory.integral[0] < 0.5


def test_a_point_mass_in_steady_wind_with_weak_rotors_comes_to_rest_where_it_is_wanted() -> None:
    """3 % less thrust than believed and 0.3 m/s^2 of wind: only the integral finds both."""
    settings = FUSED
    controller, memory = PositionController(settings), Memory()
    p, v = np.array([0.3, -0.2, 0.0]), np.zeros(3)
    for k in range(3000):
        believed = dict(zip(NAMES, [p[0], p[1], -p[2], *v]))
        memory, command = controller.step(memory, at(0.01 * k, **believed), want())
        a = made(replace(command, throttle=0.97 * command.throttle), 0.0) + [0.3, 0.0, 0.0]
        v = v + 0.01 * a
        p = p + 0.01 * v
    np.testing.assert_allclose(p, 0.0, atol=2e-3)
