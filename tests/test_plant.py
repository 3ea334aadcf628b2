"""The plant adapter: what it must guarantee about JSBSim, the runway's surface, the wind and the wheels."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from landing_sim.geometry import so3
from landing_sim.geometry.earth import RunwayFrame
from landing_sim.plants.aircraft import InitialState, JsbsimPlant
from landing_sim.plants.jsbsim import FlightModel, PlantError
from landing_sim.plants.trim import trim
from landing_sim.plants.wheels import reactions, read_contacts
from landing_sim.sensors.platform import PanTilt
from landing_sim.signals import Command

DO128 = Path(__file__).resolve().parents[1] / "aircraft" / "do128"
FRAME = RunwayFrame(math.radians(52.3192), math.radians(10.5561), 89.0, math.radians(263.0))
STILL = np.zeros(3)
APPROACH = InitialState(y=-85.0, psi=math.radians(15.0), gamma=math.radians(-3.0))


def plant(initial: InitialState = APPROACH, **more: object) -> JsbsimPlant:
    return JsbsimPlant(DO128, FRAME, initial, **more)  # type: ignore[arg-type]


def fly(p: JsbsimPlant, steps: int) -> None:
    for _ in range(steps):
        p.step(p.trimmed, STILL)


# ---------------------------------------------------------------------------------------------- beginning


def test_begins_trimmed_where_it_was_told() -> None:
    p = plant()
    truth = p.truth()
    assert truth.p_RB == pytest.approx([-950.0, -85.0, -51.0], abs=2e-4)
    assert truth.euler == pytest.approx([0.0, p.trim_point.theta, math.radians(15.0)], abs=1e-9)
    assert truth.airspeed == pytest.approx(50.0, abs=1e-9)
    flight_path = math.atan2(-truth.v_RB_R[2], math.hypot(truth.v_RB_R[0], truth.v_RB_R[1]))
    assert math.degrees(flight_path) == pytest.approx(-3.0, abs=1e-6)
    for _ in range(200):
        p.step(p.trimmed, STILL)
    later = p.truth()
    assert later.t == pytest.approx(1.0)
    assert later.airspeed == pytest.approx(50.0, abs=0.02)
    assert np.abs(later.w_RB_B).max() < 2e-4
    assert later.thrust == pytest.approx(p.trim_point.thrust, rel=1e-3)
    assert later.load_factor == pytest.approx(math.cos(later.euler[1]), abs=2e-3)


def test_wind_at_the_start_is_added_and_survives() -> None:
    """Airspeed and heading stay, the ground moves with the wind; nothing jumps in the first steps."""
    wind = np.array([-6.0, 4.0, -1.0])
    p = plant(wind_R=wind)
    calm = plant().truth()
    truth = p.truth()
    assert truth.wind_R == pytest.approx(wind, abs=1e-9)
    assert truth.airspeed == pytest.approx(50.0, abs=1e-9)
    assert truth.v_RB_R - calm.v_RB_R == pytest.approx(wind, abs=1e-6)
    for _ in range(20):
        p.step(p.trimmed, wind)
    later = p.truth()
    assert later.wind_R == pytest.approx(wind, abs=1e-6)  # turned with the local frame of a step ago
    assert later.airspeed == pytest.approx(50.0, abs=0.01)
    assert later.v_RB_R == pytest.approx(truth.v_RB_R, abs=0.02)
    through_air = np.linalg.norm(later.v_RB_R - later.wind_R)
    assert through_air == pytest.approx(later.airspeed, abs=1e-9)


def test_position_is_the_integral_of_velocity_in_R() -> None:
    """The chain JSBSim - ECEF - R is one rigid frame: no drift between position and velocity, 2 km from the threshold."""
    p = plant(InitialState(x=-2000.0, y=500.0, height=150.0, psi=0.4, gamma=-0.03))
    before = p.truth()
    mean = np.zeros(3)
    for _ in range(400):
        a = p.truth().v_RB_R
        p.step(p.trimmed, STILL)
        mean += 0.5 * (a + p.truth().v_RB_R)
    assert p.truth().p_RB - before.p_RB == pytest.approx(mean * p.dt, abs=2e-3)


def test_same_bits_in_fresh_instances_and_after_reset() -> None:
    def bits(p: JsbsimPlant) -> bytes:
        rng = np.random.default_rng(7)
        for i in range(400):
            p.step(Command(0.01 * math.sin(i / 20), 0.02, -0.01, 0.4, 0.5), rng.normal(size=3))
        t = p.truth()
        return np.concatenate([t.p_RB, t.v_RB_R, t.w_RB_B, t.euler, t.surfaces, [t.thrust, t.airspeed]]).tobytes()

    p = plant()
    first = bits(p)
    assert bits(plant()) == first
    p.reset()
    assert bits(p) == first


def test_mass_and_cg_disperse_but_positions_stay_those_of_the_nominal_cg() -> None:
    initial = InitialState(mass=4200.0, cg_offset_B=(-0.08, 0.02, 0.05), psi=0.2)
    p = plant(initial)
    assert p.truth().p_RB == pytest.approx([-950.0, 0.0, -51.0], abs=2e-4)
    model = FlightModel(DO128, 0.005, 4200.0, np.array([-0.08, 0.02, 0.05]))
    assert model.mass == pytest.approx(4200.0, rel=1e-9)
    cg = np.array([model.get(f"inertia/cg-{a}-in") for a in "xyz"]) * 0.0254
    assert (cg - model.nominal_cg) * [-1.0, 1.0, -1.0] == pytest.approx([-0.08, 0.02, 0.05], abs=1e-9)
    # 8 cm aft is less nose-down moment to hold, so more elevator-down trim
    assert p.trim_point.elevator > plant(InitialState(mass=4200.0)).trim_point.elevator + 0.005


def test_platform_rides_on_the_body() -> None:
    p = plant(platform=PanTilt(pan=0.1, tilt=-0.05), p_BC=np.array([3.0, 0.0, -0.3]))
    truth, camera = p.truth(), p.camera()
    assert camera.p_RC == pytest.approx(truth.p_RB + truth.R_RB @ [3.0, 0.0, -0.3])
    np.testing.assert_allclose(camera.R_CR, so3.camera_from_body(0.1, -0.05) @ truth.R_RB.T, atol=1e-12)
    for _ in range(200):
        p.step(Command(p.trimmed.elevator, throttle=p.trimmed.throttle, flap=0.5, pan=0.2, tilt=0.0), STILL)
    assert (p.camera().pan, p.camera().tilt) == pytest.approx((0.2, 0.0), abs=2e-3)
    p.reset()
    assert (p.camera().pan, p.camera().tilt) == (0.1, -0.05)


# ---------------------------------------------------------------------------------------------- actuators and engines


def test_actuators_keep_their_time_constants_at_this_step() -> None:
    """A lag loaded with another step would be another lag: 63 % after 0.08 s, and 0.6 rad/s at most."""
    p = plant()
    start = p.truth().surfaces[0]
    small = Command(start + 0.02, throttle=p.trimmed.throttle, flap=0.5)
    for _ in range(16):
        p.step(small, STILL)
    assert (p.truth().surfaces[0] - start) / 0.02 == pytest.approx(1.0 - math.exp(-1.0), abs=0.04)
    p.reset()
    large = Command(-0.3, throttle=p.trimmed.throttle, flap=0.5)
    reached = []
    for _ in range(40):
        p.step(large, STILL)
        reached.append(p.truth().surfaces[0])
    assert -np.diff(reached).min() / p.dt == pytest.approx(0.6, rel=1e-6)
    p.reset()
    for _ in range(400):
        p.step(Command(-1.0, 1.0, -1.0, p.trimmed.throttle, 0.5), STILL)
    assert p.truth().surfaces[:3] == pytest.approx([-0.30, 0.35, -0.44], abs=1e-3)


def test_engines_lag_from_the_very_first_step() -> None:
    p = plant()
    start = p.truth().thrust
    wanted = Command(p.trimmed.elevator, throttle=p.trimmed.throttle + 0.03, flap=0.5)
    p.step(wanted, STILL)
    assert p.truth().thrust == pytest.approx(start, rel=0.01)
    for _ in range(139):
        p.step(wanted, STILL)
    gain = p.trim_point.max_thrust * 0.03
    assert (p.truth().thrust - start) / gain == pytest.approx(1.0 - math.exp(-1.0), abs=0.05)
    for _ in range(600):
        p.step(wanted, STILL)
    # the slow speed change moves thrust too: compare with the map's own slope
    assert (p.truth().thrust - start) / gain == pytest.approx(1.0, abs=0.25)


def test_nothing_is_burnt() -> None:
    p = plant()
    before = p._model.mass
    for _ in range(400):
        p.step(Command(throttle=1.0), STILL)
    assert p._model.mass == before


# ---------------------------------------------------------------------------------------------- runway surface


@pytest.mark.parametrize("slope", [0.0, 0.02, -0.02])
@pytest.mark.parametrize("x", [0.0, 1500.0])
def test_wheels_stand_on_the_surface(slope: float, x: float) -> None:
    """At rest the springs carry the weight: wheel heights on the slope are the static compressions, to a millimetre."""
    p = plant(InitialState(x=x, y=-3.0, flap=0.0, on_ground=True), slope=slope)
    held = Command(brake_left=1.0, brake_right=1.0)
    for _ in range(600):
        p.step(held, STILL)
    truth = p.truth()
    weight = 4000.0 * 9.8125
    # about the tail's contact: weight along the slope acts at the cg's height, brakes at the mains'
    tail_x, main_x = -8.03, 0.60
    theta, height = truth.euler[1] - slope, 1.5956
    arm = -tail_x * math.cos(theta) - 0.50 * math.sin(theta) - height * math.tan(slope)
    base = (main_x - tail_x) * math.cos(theta) + (1.80 - 0.50) * math.sin(theta)
    main = 0.5 * weight * math.cos(slope) * arm / base
    tail = weight * math.cos(slope) - 2.0 * main
    assert truth.wheels_height == pytest.approx([-main / 180e3, -main / 180e3, -tail / 60e3], abs=1e-3)
    assert truth.on_ground.all()
    # and in R itself, without the plant's own notion of height
    bottom = truth.p_RB + truth.R_RB @ np.array([main_x, -1.76, 1.80])
    assert -bottom[2] == pytest.approx(bottom[0] * math.tan(slope) - main / 180e3, abs=1e-3)


def test_touchdown_is_on_the_sloping_surface_and_its_sink_rate_normal_to_it() -> None:
    slope, x0 = 0.02, 800.0
    path = slope - 1.2 / 43.0
    p = plant(InitialState(x=x0, height=2.6 + x0 * slope, airspeed=43.0, gamma=path), slope=slope)
    while p.touchdown is None:
        before = p.truth()
        p.step(p.trimmed, STILL)
    t = p.touchdown
    assert t.t == pytest.approx(before.t + p.dt)
    assert before.wheels_height[:2].min() > 0.0 > p.truth().wheels_height[:2].min()
    wheel = np.array([0.60, math.copysign(1.76, t.y), 1.80])
    v = before.v_RB_R + before.R_RB @ np.cross(before.w_RB_B, wheel)
    assert t.sink_rate == pytest.approx(v @ [math.sin(slope), 0.0, math.cos(slope)], abs=0.02)
    assert t.x == pytest.approx((before.p_RB + before.R_RB @ wheel)[0] + v[0] * p.dt, abs=1e-3)
    assert t.groundspeed == pytest.approx(43.0, abs=0.6)


def test_ground_effect_follows_the_surface_not_sea_level() -> None:
    low = plant(InitialState(x=500.0, height=2.5 + 10.0, airspeed=43.0), slope=math.atan(0.02))
    assert low._model.get("position/h-agl-ft") * 0.3048 == pytest.approx(2.5, abs=5e-3)
    high = plant(InitialState(x=500.0, height=200.0, airspeed=43.0))
    assert low._model.get("aero/ground-downwash") == pytest.approx(16 * 2.5**2 / (16 * 2.5**2 + 154.75), rel=5e-3)
    assert high._model.get("aero/ground-downwash") > 0.999


def test_brakes_hold_on_a_slope_and_wheels_roll_without() -> None:
    def run(brake: float) -> float:
        """Distance rolled from the 1st to the 4th second."""
        p = plant(InitialState(x=500.0, flap=0.0, on_ground=True), slope=0.04)
        for i in range(800):
            if i == 200:
                x = p.truth().p_RB[0]
            p.step(Command(brake_left=brake, brake_right=brake), STILL)
        return float(p.truth().p_RB[0] - x)

    assert abs(run(1.0)) < 1e-3
    # downhill, gravity less rolling friction of 0.02 (tail 0.03): s = g (0.04 - 0.0207) (4^2 - 1^2) / 2
    assert run(0.0) == pytest.approx(-9.81 * (0.04 - 0.0207) * 7.5, rel=0.05)


def test_a_wheel_pushes_where_it_touches() -> None:
    """One main 0.1 m in, sliding right at 2 m/s, sinking at 0.5: 18 + 9 kN up, grip of 0.8 to the left, at the surface."""
    c = read_contacts(DO128 / "do128.xml", np.array([0.532, 0.0, 0.0]))
    R_RB, height, out = np.eye(3), np.array([1.0, -0.1, 1.0, 1.0, 1.0, 1.0]), np.empty((2, 3))
    reactions(
        R_RB, np.array([0.0, 2.0, 0.5]), np.zeros(3), 0.0, 0.0, 0.0, 0.005, c.p_B, c.values, height,
        np.zeros((6, 2)), out,
    )  # fmt: skip
    force = np.array([0.0, -0.8 * 27e3, -27e3])
    np.testing.assert_allclose(out[0], force, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(out[1], np.cross([0.60, 1.76, 1.70], force), rtol=1e-9)


@pytest.mark.parametrize("sideways", [0.5, 6.0])
def test_a_tyre_that_slips_keeps_pushing_the_same_way(sideways: float) -> None:
    """Rolling at 60 m/s: cornering stiffness k_t sigma while it grips, the limit of grip beyond; never to and fro."""
    c = read_contacts(DO128 / "do128.xml", np.array([0.532, 0.0, 0.0]))
    height, out, bristle = np.array([-0.1, 1.0, 1.0, 1.0, 1.0, 1.0]), np.empty((2, 3)), np.zeros((6, 2))
    pushes = []
    for _ in range(200):
        reactions(
            np.eye(3), np.array([60.0, sideways, 0.0]), np.zeros(3), 0.0, 0.0, 0.0, 0.005, c.p_B, c.values, height,
            bristle, out,
        )  # fmt: skip
        pushes.append(out[0, 1])
    grip = 18e3 * math.sqrt(0.8**2 - 0.02**2)
    assert max(pushes) < 0.0
    assert pushes[-1] == pytest.approx(-min(1.5 * 180e3 * 0.35 * sideways / 60.0, grip), rel=1e-3)


def test_contacts_are_read_in_their_order() -> None:
    contacts = read_contacts(DO128 / "do128.xml", np.array([0.532, 0.0, 0.0]))
    assert contacts.names[:3] == ("LEFT_MAIN", "RIGHT_MAIN", "TAIL")
    assert contacts.p_B[:3] == pytest.approx(np.array([[0.6, -1.76, 1.8], [0.6, 1.76, 1.8], [-8.03, 0.0, 0.5]]))


# ---------------------------------------------------------------------------------------------- guards


def test_missing_aircraft() -> None:
    with pytest.raises(PlantError, match="no flight model"):
        FlightModel(DO128.with_name("zeppelin"), 0.005)


def broken(tmp_path: Path, old: str, new: str) -> Path:
    folder = tmp_path / "do128"
    shutil.copytree(DO128, folder)
    file = folder / "do128.xml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    return folder


def test_malformed_model(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match="cannot load"):
        FlightModel(broken(tmp_path, "</fdm_config>", ""), 0.005)


def test_model_without_an_engine_file(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match=r"cannot load|no property"):
        FlightModel(broken(tmp_path, 'engine file="do128_turboprop"', 'engine file="nowhere"'), 0.005)


def test_property_that_nothing_provides(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match="no property 'fcs/rudder-range-rad'"):
        FlightModel(broken(tmp_path, '<property value="0.44">fcs/rudder-range-rad</property>', ""), 0.005)
    with pytest.raises(PlantError, match="no property 'aero/alhpa-rad'"):
        FlightModel(DO128, 0.005).get("aero/alhpa-rad")


def test_property_that_takes_no_value() -> None:
    with pytest.raises(PlantError, match="did not take"):
        FlightModel(DO128, 0.005).set("aero/qbar-psf", 1.0)


def test_contacts_without_a_main_wheel(tmp_path: Path) -> None:
    folder = broken(tmp_path, "<brake_group>LEFT</brake_group>", "<brake_group>NONE</brake_group>")
    with pytest.raises(PlantError, match="left and a right main wheel"):
        JsbsimPlant(folder, FRAME, APPROACH)


def test_contact_in_other_units(tmp_path: Path) -> None:
    folder = broken(tmp_path, '<spring_coeff unit="N/M">60000', '<spring_coeff unit="LBS/FT">4111')
    with pytest.raises(PlantError, match="TAIL needs spring_coeff in N/M"):
        JsbsimPlant(folder, FRAME, APPROACH)


def test_no_trim() -> None:
    with pytest.raises(PlantError, match="no trim at 20 m/s"):
        trim(DO128, 20.0, 0.0, 0.5)
    with pytest.raises(PlantError, match="no trim"):
        trim(DO128, 50.0, math.radians(25.0), 0.5)


def test_mass_below_empty() -> None:
    with pytest.raises(PlantError, match="no payload"):
        FlightModel(DO128, 0.005, 2000.0)


def test_numbers_that_are_not() -> None:
    p = plant()
    with pytest.raises(PlantError, match="state is not finite"):
        p.step(p.trimmed, np.array([math.nan, 0.0, 0.0]))
    p = plant()
    with pytest.raises(PlantError, match="command is not finite"):
        p.step(Command(elevator=math.nan), STILL)


def test_wind_lost_at_run_ic() -> None:
    p = plant(wind_R=np.array([-5.0, 2.0, 0.0]))
    p.truth()
    p._model._fdm.run_ic()
    with pytest.raises(PlantError, match="lost the wind"):
        p.truth()


@pytest.mark.parametrize("kind", [3.0, 4.0, 5.0])
def test_turbulence_of_jsbsims_own(kind: float) -> None:
    p = plant()
    p._model._fdm["atmosphere/turb-type"] = kind
    with pytest.raises(PlantError, match="turb-type"):
        p.truth()


def test_time_step_changed_behind_our_back() -> None:
    p = plant()
    p._model._fdm.set_dt(0.01)
    with pytest.raises(PlantError, match="time step"):
        p._model.release([0.0, 0.0, 0.0])


def test_beginning_under_ground() -> None:
    with pytest.raises(PlantError, match="below the runway's surface"):
        plant(InitialState(x=500.0, height=5.0), slope=0.02)


def test_leaving_the_tangent_plane() -> None:
    p = plant(InitialState(x=-49_400.0, height=500.0, psi=math.pi))
    with pytest.raises(PlantError, match="neighbourhood"):
        fly(p, 800)


def test_camera_without_platform() -> None:
    with pytest.raises(PlantError, match="without a camera platform"):
        plant().camera()


def test_loading_says_nothing() -> None:
    """In its own process: JSBSim's stream is flushed at the end."""
    code = f"from pathlib import Path; from landing_sim.plants.trim import trim; trim(Path({str(DO128)!r}), 50.0, 0.0, 0.5)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""
