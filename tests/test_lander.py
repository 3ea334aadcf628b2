"""The lunar lander on JSBSim: against the paper's planar equations, its mass flow, its legs, and what it refuses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from landing_sim import paths
from landing_sim.estimators.optic_flow.dynamics import Lander
from landing_sim.estimators.optic_flow.reference import MASS, reference
from landing_sim.plants.jsbsim import PlantError
from landing_sim.plants.lander import LanderPlant, Start
from landing_sim.signals import Command

FOLDER = paths.data_folder("aircraft") / "lander"
REF = reference()
THRUST, ATTITUDE = 3500.0, 60.0  # [N] full
STILL = (0.0, 0.0, 0.0)
IDLE = Command()


def start(t: float = 0.0, x: float = -847.7) -> Start:
    h, q, wx, wz, theta = REF.state(t)
    u, a = REF.inputs(t)
    return Start(x, h, wx * h, wz * h, theta, q, float(REF.at(t)[7]), u / THRUST, a / ATTITUDE)


def resting(height: float, v_z: float = 0.0, v_x: float = 0.0, theta: float = 0.0) -> Start:
    return Start(0.0, height, v_x, v_z, theta, 0.0, 700.0, 0.0, 0.0)


def fall(plant: LanderPlant, seconds: float, command: Command = IDLE) -> None:
    for _ in range(round(seconds / plant.dt)):
        plant.step(command, STILL)


@pytest.fixture(scope="module")
def flat_moon(tmp_path_factory) -> Path:
    """A thousand times as large with the same gravity: the paper's."""
    text = (FOLDER / "moon.xml").read_text()
    large = text.replace(">1737400<", ">1737400000<").replace(">4920178659880<", ">4920178659880000000<")
    assert large.count("1737400000<") == 2 and "4920178659880000000<" in large
    path = tmp_path_factory.mktemp("planet") / "flat.xml"
    path.write_text(large)
    return path


def test_planar_equations(flat_moon) -> None:
    """The whole reference descent, open loop, within 0.2 m, 0.02 m/s, 0.02 deg and 2 g of eq. (2) by scipy."""
    dt, lander = 0.005, Lander()
    plant = LanderPlant(FOLDER, start(), dt=dt, planet=flat_moon)
    n = round(46.0 / dt)
    for k in range(n):
        u, a = REF.inputs((k + 1.5) * dt)  # what is commanded acts a step later
        plant.step(Command(throttle=u / THRUST, elevator=a / ATTITUDE), STILL)
    s = start()
    state = solve_ivp(
        lambda t, y: lander.rates(y, *REF.inputs(t)),
        (0.0, n * dt),
        [s.x, s.height, s.v_x, s.v_z, s.theta, s.q, s.mass],
        rtol=1e-10,
        atol=1e-10,
        max_step=0.05,
    ).y[:, -1]
    truth = plant.truth()
    assert [truth.p_RB[0], -truth.p_RB[2]] == pytest.approx(state[:2], abs=0.2)
    assert [truth.v_RB_R[0], -truth.v_RB_R[2]] == pytest.approx(state[2:4], abs=0.02)
    assert [-truth.euler[1], -truth.w_RB_B[1]] == pytest.approx(state[4:6], abs=math.radians(0.02))
    assert plant.mass == pytest.approx(state[6], abs=0.002)
    assert np.abs([truth.p_RB[1], truth.v_RB_R[1], truth.euler[0], truth.euler[2]]).max() < 1e-9


def test_gravity_of_a_round_moon() -> None:
    """Free fall from 1 km: 1.63 m/s2 at the ground, less by (R/r)^2 above it, and no air."""
    plant = LanderPlant(FOLDER, resting(1000.0))
    fall(plant, 30.0)
    truth = plant.truth()
    y = solve_ivp(
        lambda t, y: [y[1], -1.63 * (1737400.0 / (1737400.0 + y[0])) ** 2],
        (0, 30),
        [1000.0, 0.0],
        rtol=1e-11,
        atol=1e-9,
    ).y[:, -1]
    assert -truth.p_RB[2] == pytest.approx(y[0], abs=0.02)
    assert truth.v_RB_R[2] == pytest.approx(-y[1], abs=1e-3)


def test_flying_level_round_the_moon() -> None:
    """At the speed of a circular orbit it falls as fast as the ground does: R's plane is left behind by x^2 / 2R."""
    speed = math.sqrt(1.63 * 1737400.0**2 / 1738400.0)
    plant = LanderPlant(FOLDER, resting(1000.0, v_x=speed))
    fall(plant, 20.0)
    p = plant.truth().p_RB
    assert p[0] == pytest.approx(1738400.0 * math.sin(20.0 * speed / 1738400.0), rel=1e-6)
    assert math.hypot(1737400.0 - p[2], p[0]) - 1737400.0 == pytest.approx(1000.0, abs=0.05)


def test_mass_flow() -> None:
    """2,000 N and 30 N for 10 s at 325 s and 287 s."""
    plant = LanderPlant(FOLDER, start())
    before = MASS
    fall(plant, 10.0, Command(throttle=2000.0 / THRUST, elevator=-30.0 / ATTITUDE))
    burnt = 10.0 * (2000.0 / (325.0 * 9.81) + 30.0 / (287.0 * 9.81))
    assert before - plant.mass == pytest.approx(burnt, abs=0.005)


def test_signs() -> None:
    """Attitude force > 0 turns the nose down (theta of the paper grows), thrust then pushes forward; both are limited."""
    plant = LanderPlant(FOLDER, resting(500.0))
    fall(plant, 2.0, Command(elevator=5.0, throttle=9.0))
    truth = plant.truth()
    assert truth.w_RB_B[1] == pytest.approx(-2.0 * ATTITUDE / 1000.0, rel=0.01)
    assert truth.euler[1] == pytest.approx(-0.12, rel=0.02)
    assert truth.v_RB_R[0] == pytest.approx(3500.0 / 700.0 * 0.06 * 2.0**3 / 6.0, rel=0.03)
    assert truth.thrust == THRUST and truth.surfaces[0] == ATTITUDE


def test_legs_carry_it() -> None:
    """A landing at 2 m/s down, 0.5 m/s along: touches once, uses its legs but not its hull, and stands."""
    plant = LanderPlant(FOLDER, resting(3.0, v_z=-1.0, v_x=0.5))
    lowest = 3.0
    for _ in range(2000):
        plant.step(Command(), STILL)
        lowest = min(lowest, -plant.truth().p_RB[2])
    truth, touchdown = plant.truth(), plant.touchdown
    assert touchdown is not None
    assert touchdown.sink_rate == pytest.approx(math.sqrt(1.0 + 2.0 * 1.63 * 1.4), abs=0.02)
    assert touchdown.groundspeed == pytest.approx(0.5, abs=1e-3)
    assert 1.2 < lowest < 1.55
    assert truth.on_ground.all() and np.abs(truth.v_RB_R).max() < 0.01 and abs(truth.euler[1]) < 0.02


def test_touches_the_terrain_where_it_is() -> None:
    plant = LanderPlant(FOLDER, resting(30.0, v_z=-2.0), ground=lambda x, y: 12.5 + 0.05 * x)
    fall(plant, 12.0)
    assert plant.touchdown is not None
    assert -plant.truth().p_RB[2] == pytest.approx(12.5 + 1.6, abs=0.15)
    front, aft = plant.truth().wheels_height[2], plant.truth().wheels_height[0]
    assert front < aft  # uphill ahead


def test_same_bits_again() -> None:
    plant = LanderPlant(FOLDER, start())
    fall(plant, 1.0, Command(throttle=0.6, elevator=0.1))
    first = plant.truth()
    plant.reset()
    fall(plant, 1.0, Command(throttle=0.6, elevator=0.1))
    assert (plant.truth().p_RB == first.p_RB).all() and (plant.truth().R_RB == first.R_RB).all()


def test_refusals(tmp_path) -> None:
    with pytest.raises(PlantError, match="no flight model"):
        LanderPlant(tmp_path, start(), planet=FOLDER / "moon.xml")
    with pytest.raises(PlantError, match="no propellant"):
        LanderPlant(FOLDER, Start(0.0, 100.0, 0.0, 0.0, 0.0, 0.0, 600.0, 0.0, 0.0))
    turning = tmp_path / "turning.xml"
    turning.write_text((FOLDER / "moon.xml").read_text().replace('"RAD/SEC">0<', '"RAD/SEC">1e-4<'))
    with pytest.raises(PlantError, match="does not turn"):
        LanderPlant(FOLDER, start(), planet=turning)
    with pytest.raises(PlantError, match="no planet"):
        LanderPlant(FOLDER, start(), planet=tmp_path / "none.xml")
    with pytest.raises(PlantError, match="not finite"):
        LanderPlant(FOLDER, start()).step(Command(throttle=math.nan), STILL)
