"""The quadrotor on JSBSim: thrust, drag, rotors' lag, signs, the attitude loop, legs on edges, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from landing_sim import paths
from landing_sim.noise import Noise
from landing_sim.plants.attitude_loop import AttitudeConfig
from landing_sim.plants.jsbsim import PlantError
from landing_sim.plants.jsbsim_quadrotor import GRAVITY, QuadrotorModel
from landing_sim.plants.quadrotor import QuadrotorPlant, Start
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.sensors.position_fix import PositionFix, PositionFixConfig
from landing_sim.sensors.sonar import Sonar, SonarConfig
from landing_sim.sensors.strapdown import Strapdown, StrapdownConfig
from landing_sim.signals import Command
from landing_sim.world.drift import Drift, DriftConfig
from landing_sim.world.planes import Box

FOLDER = paths.data_folder("aircraft") / "pelican"
STILL = (0.0, 0.0, 0.0)
CUT = Command()
EXACT = AttitudeConfig(bias=0.0, wander=0.0, gyro_bias=0.0)
BOX = Box(0.0, 0.0)


def flat(x: float, y: float) -> float:
    return 0.0


def box(x: float, y: float) -> float:
    return max(0.0, BOX.top(x, y))


def plant(
    start: Start | None = None,
    height: Callable[[float, float], float] = flat,
    config: AttitudeConfig = EXACT,
    dt: float = 0.001,
    **more,
) -> QuadrotorPlant:
    return QuadrotorPlant(FOLDER, start or Start(height=1.0), height, dt, Noise(3, "firmware"), config, **more)


def fly(p: QuadrotorPlant, seconds: float, command: Command | None = None, wind=STILL) -> None:
    for _ in range(round(seconds / p.dt)):
        p.step(command or p.trimmed, wind)


def test_hover_balances() -> None:
    """The trimmed thrust is the weight, and it stays where it is: 1 kg, four rotors of k w^2."""
    p = plant()
    assert p.mass == pytest.approx(1.0, abs=1e-9) and p.full_thrust == pytest.approx(4 * 9.9865e-6 * 838**2)
    fly(p, 2.0)
    now = p.truth()
    assert now.thrust == pytest.approx(1.0 * GRAVITY, rel=1e-6)
    assert 4 * 9.9865e-6 * now.surfaces[0] ** 2 == pytest.approx(now.thrust)
    assert now.p_RB == pytest.approx([0, 0, -1], abs=1e-3) and np.abs(now.v_RB_R).max() < 1e-3
    assert p.specific_force() == pytest.approx([0, 0, -GRAVITY], abs=1e-3)
    assert now.load_factor == pytest.approx(1.0, abs=2e-3)


def test_payload_and_thrust_as_they_are() -> None:
    heavy = plant(payload=0.5)
    assert heavy.mass == pytest.approx(1.25) and heavy.trimmed.throttle == pytest.approx(
        1.25 * plant().trimmed.throttle
    )
    weak = plant(thrust_share=0.9)
    fly(weak, 0.5)
    assert weak.truth().thrust == pytest.approx(0.9 * GRAVITY, rel=1e-6) and weak.truth().v_RB_R[2] > 0.4


def test_free_fall_through_air() -> None:
    """Motors cut at 20 m: v = g / c (1 - exp(-c t)) with c = 0.16 N/(m/s) on 1 kg, once the rotors have stopped."""
    p = plant(Start(height=20.0))
    fly(p, 0.3, CUT)  # e^-16 of the speed is left
    assert p.truth().thrust < 1e-5
    v = p.truth().v_RB_R[2]
    fly(p, 1.0, CUT)
    c = 0.16
    assert p.truth().v_RB_R[2] == pytest.approx(v * math.exp(-c) + GRAVITY / c * -math.expm1(-c), abs=2e-3)
    assert p.touchdown is None


def test_wind_is_felt_as_force() -> None:
    """Level thrust in a wind of 1 m/s: it drifts off as a body of 1 kg with 0.16 N/(m/s) does."""
    p = plant()
    fly(p, 2.0, wind=(1.0, -0.5, 0.0))
    v = p.truth().v_RB_R
    assert v[:2] == pytest.approx(np.array([1.0, -0.5]) * -math.expm1(-0.32), abs=2e-3)
    assert p.truth().wind_R == pytest.approx([1.0, -0.5, 0.0])
    assert p.truth().airspeed == pytest.approx(math.hypot(1.0, 0.5) * math.exp(-0.32), abs=5e-3)


def test_rotors_lag_by_18_ms() -> None:
    p = plant()
    w0, w1 = p.truth().surfaces[0], 838.0
    fly(p, 0.018, Command(throttle=1.0))
    assert (p.truth().surfaces[0] - w0) / (w1 - w0) == pytest.approx(-math.expm1(-1.0), abs=0.03)
    fly(p, 0.2, Command(throttle=5.0))
    assert p.truth().surfaces[0] == pytest.approx(838.0, rel=1e-4)
    assert p.truth().thrust == pytest.approx(p.full_thrust, rel=1e-4)


def test_signs() -> None:
    """Elevator > 0 noses down and so flies ahead, aileron > 0 rolls right and flies right, rudder > 0 turns left."""
    up = plant().trimmed.throttle
    ahead = plant()
    fly(ahead, 0.6, Command(throttle=up, elevator=0.1))
    assert ahead.truth().euler[1] == pytest.approx(-0.1, abs=0.01) and ahead.truth().v_RB_R[0] > 0.3
    right = plant()
    fly(right, 0.6, Command(throttle=up, aileron=0.1))
    assert right.truth().euler[0] == pytest.approx(0.1, abs=0.01) and right.truth().v_RB_R[1] > 0.3
    left = plant()
    fly(left, 2.0, Command(throttle=up, rudder=0.5))
    assert left.truth().w_RB_B[2] == pytest.approx(-0.5, abs=0.01) and left.truth().euler[2] < -0.7
    camera = ahead.camera()
    R_CB = camera.R_CR @ ahead.truth().R_RB
    assert np.abs(R_CB - [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]).max() < 1e-12
    assert camera.p_RC - ahead.truth().p_RB == pytest.approx(0.05 * ahead.truth().R_RB[:, 2])


def test_yaw_moment_is_the_rotors_drag() -> None:
    """To turn right the right and left rotors, which turn left, speed up: the reaction; 0.05 N m at most."""
    p = plant()
    fly(p, 0.15, Command(throttle=p.trimmed.throttle, rudder=-1.5))
    front, right, rear, left = 9.9865e-6 * p.truth().surfaces ** 2
    assert right + left > front + rear
    assert 0.016 * (right + left - front - rear) == pytest.approx(0.05, rel=0.01)
    before = p.truth().w_RB_B[2]
    fly(p, 0.1, Command(throttle=p.trimmed.throttle, rudder=-1.5))
    assert (p.truth().w_RB_B[2] - before) / 0.1 == pytest.approx(0.05 / 0.02, rel=0.05)


def test_attitude_step() -> None:
    """wn 16 rad/s, zeta 0.8 and the rotors' lag: 90 % within 0.2 s, little overshoot; leans no further than 30 deg."""
    p = plant()
    lean = []
    for _ in range(1000):
        p.step(Command(throttle=p.trimmed.throttle, aileron=0.2), STILL)
        lean.append(p.truth().euler[0])
    rise = 0.001 * int(np.argmax(np.array(lean) > 0.18))
    assert 0.12 < rise < 0.22 and 0.2 <= max(lean) < 0.2 * 1.15
    assert lean[-1] == pytest.approx(0.2, abs=0.002)
    fly(p, 1.0, Command(throttle=0.5, aileron=2.0))
    assert p.truth().euler[0] == pytest.approx(math.radians(30.0), abs=0.01)


def test_firmware_flies_its_own_attitude() -> None:
    """Its error is a bias of 0.6 deg (1 sigma) that wanders by 0.12 deg: the true lean is that, mirrored."""
    biases = np.degrees(
        [QuadrotorPlant(FOLDER, Start(height=1.0), flat, 0.002, Noise(k, "f"))._loop.bias for k in range(40)]
    )
    assert biases.std() == pytest.approx(0.6, rel=0.2)
    p = plant(config=AttitudeConfig())
    fly(p, 1.0)
    said, true = p.believed_euler(), p.truth().euler
    assert np.abs(said[:2]).max() < math.radians(0.1) and np.abs(true[:2]).max() > math.radians(0.3)
    before = said - true
    fly(p, 2.0)
    change = np.degrees((p.believed_euler() - p.truth().euler) - before)
    assert 1e-3 < np.abs(change).max() < 0.7


def test_stands_until_it_takes_off() -> None:
    p = plant(Start(x=0.3, y=-0.2, height=None, psi=0.5))
    fly(p, 0.5, CUT, wind=(1.4, 0.0, 0.0))  # 0.23 N against 7 N of friction
    now = p.truth()
    assert now.on_ground.all() and p.touchdown is None and np.abs(now.euler[:2]).max() < 1e-3
    assert now.p_RB[:2] == pytest.approx([0.3, -0.2], abs=2e-3) and -now.p_RB[2] == pytest.approx(0.1184, abs=1e-3)
    assert p.specific_force()[2] == pytest.approx(-GRAVITY, abs=0.02)
    fly(p, 0.5, Command(throttle=0.5))
    assert p.touchdown is None and -p.truth().p_RB[2] > 0.4
    fly(p, 1.0, CUT)
    touch = p.touchdown
    assert touch is not None and touch.sink_rate > 1.0


@pytest.mark.parametrize(("offset", "stands"), [(0.0, True), (0.10, True), (0.15, True), (0.20, False), (0.26, False)])
def test_on_a_box_it_stands_or_tips_over_the_edge(offset: float, stands: bool) -> None:
    """Set down with its centre `offset` from the middle of a 57 cm box: feet reach 12 cm, the edge is at 28.5 cm."""
    p = plant(Start(x=offset, height=0.14 + 0.12 + 0.06), box)
    fly(p, 2.0, CUT)
    now, touch = p.truth(), p.touchdown
    assert touch is not None and touch.sink_rate == pytest.approx(math.sqrt(2 * GRAVITY * 0.06), rel=0.2)
    lean = math.degrees(np.abs(now.euler[:2]).max())
    if stands:
        assert lean < 1.0 and -now.p_RB[2] == pytest.approx(0.14 + 0.1184, abs=2e-3)
        assert np.abs(now.v_RB_R).max() < 0.02 and now.on_ground.all()
    else:
        assert lean > 10.0 or -now.p_RB[2] < 0.2


def test_a_box_is_no_ramp() -> None:
    """What comes into a box from beside it, close to the ground, is not thrown up."""
    p = plant(Start(x=-0.43, height=0.125), box)
    highest = 0.0
    for k in range(1000):
        p.step(Command(throttle=0.33, elevator=0.2) if k < 700 else CUT, STILL)
        highest = max(highest, -p.truth().p_RB[2])
    assert p.truth().p_RB[0] > -0.285 and highest < 0.25


def test_a_fall_takes_up_its_energy() -> None:
    """From 30 cm: the legs give less than a quarter of the height back, and never more energy than came in."""
    p = plant(Start(height=0.42))
    highest = 0.0
    for _ in range(2000):
        p.step(CUT, STILL)
        if p.touchdown is not None and p.truth().t > p.touchdown.t + 0.05:
            highest = max(highest, -p.truth().p_RB[2])
    assert highest < 0.12 + 0.075
    assert -p.truth().p_RB[2] == pytest.approx(0.1184, abs=1e-3)


def test_same_bits_again() -> None:
    p = plant(Start(height=None), config=AttitudeConfig())
    turns = Command(throttle=0.5, aileron=0.1, rudder=0.2)
    fly(p, 1.0, turns, wind=(0.5, 0.2, 0.1))
    first, said = p.truth(), p.believed_euler()
    p.reset()
    fly(p, 1.0, turns, wind=(0.5, 0.2, 0.1))
    again = p.truth()
    assert (again.p_RB == first.p_RB).all() and (again.R_RB == first.R_RB).all()
    assert (p.believed_euler() == said).all()


def test_a_step_of_2_ms_flies_the_same() -> None:
    ends = []
    for dt in (0.001, 0.002):
        p = plant(Start(height=None), dt=dt)
        fly(p, 1.0, Command(throttle=0.4, elevator=0.1, aileron=0.05))
        ends.append(p.truth().p_RB)
    assert ends[0] == pytest.approx(ends[1], abs=0.01)


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match="no flight model"):
        QuadrotorModel(tmp_path, 0.001)
    with pytest.raises(PlantError, match="not finite"):
        plant().step(Command(throttle=math.nan), STILL)
    odd = tmp_path / "pelican"
    odd.mkdir()
    text = (FOLDER / "pelican.xml").read_text()
    place, rest = "<x>-0.21</x>", "<y>0</y><z>0</z></location>\n      <direction>"
    (odd / "pelican.xml").write_text(text.replace(place + rest, "<x>-0.3</x>" + rest))
    with pytest.raises(PlantError, match="at one distance"):
        QuadrotorModel(odd, 0.001)


# -------------------------------------------------------------------------------------------------- sensors and air


def test_accelerometers_integrate_what_was_flown() -> None:
    """Its readings add up to the velocity that there was, within 2 mm/s after half a second of leaning."""
    p = plant()
    unit = Strapdown(StrapdownConfig(noise=0.0, bias=(0.0, 0.0, 0.0)), p, Noise(1, "imu"))
    assert unit.sense(p.truth(), p.camera()) is None
    v = np.zeros(3)
    for _ in range(50):
        R = p.truth().R_RB
        fly(p, 0.01, Command(throttle=0.4, elevator=0.2, aileron=-0.1))
        sample = unit.sense(p.truth(), p.camera())
        assert sample is not None and sample.data.euler == pytest.approx(p.truth().euler)
        v += 0.01 * (0.5 * (R + p.truth().R_RB) @ sample.data.a_B + [0.0, 0.0, GRAVITY])
    assert v == pytest.approx(p.truth().v_RB_R, abs=2e-3) and np.abs(v).min() > 0.1
    assert Strapdown(StrapdownConfig(bias=(1.0, 2.0, 3.0)), p, Noise(1, "imu")).bias.tolist() == [1.0, 2.0, 3.0]


def test_sonar() -> None:
    """2.5 cm steps, 0.12 to 6.45 m, over the box what is nearest in its cone."""

    def heard(height: float, x: float = 5.0, **config) -> float | None:
        p = plant(Start(x=x, height=height), box)
        sample = Sonar(SonarConfig(noise=0.0, **config), box, Noise(1, "sonar")).sense(p.truth(), p.camera())
        return None if sample is None else sample.data

    assert heard(1.06) == pytest.approx(1.0) and heard(1.08) == pytest.approx(1.025)
    assert heard(0.13) == 0.12 and heard(7.0) is None and heard(1.06, loss=1.0) is None
    assert heard(1.2, x=0.0) == pytest.approx(1.0)  # 1.15 m above ground, 1.01 above the box
    assert heard(1.2, x=0.285 + 0.1) == pytest.approx(1.025)  # the box, within 10 degrees
    assert heard(1.2, x=0.285 + 0.19, quantum=0.0) == pytest.approx(
        0.19 / math.sin(math.radians(10)), abs=1e-3
    )  # its side
    assert heard(1.2, x=0.285 + 0.3) == pytest.approx(1.15)


def test_position_fixes_are_late_and_a_little_wrong() -> None:
    p = plant(Start(x=2.0, y=-1.0, height=1.5))
    fix = PositionFix(
        PositionFixConfig(latency=LatencyConfig(jitter=0.0, spike_share=0.0)), Noise(2, "a"), Noise(2, "b")
    )
    truth, camera = p.truth(), p.camera()
    samples = [fix.sense(truth, camera) for _ in range(3000)]
    error = np.array([s.data for s in samples if s is not None]) - fix.scale * truth.p_RB
    assert len(error) == 3000 and samples[0].t_arrival == pytest.approx(0.15)
    assert np.diff(error, axis=0).std() / math.sqrt(2.0) == pytest.approx(0.004, rel=0.1)
    assert error.std() == pytest.approx(math.hypot(0.004, 0.004), rel=0.25)
    assert 0.0 < abs(fix.scale - 1.0) < 0.01


def test_latency_queues() -> None:
    queue = Latency(LatencyConfig(0.15, 0.02, 0.05, 0.3, 0.3), Noise(1, "l"))
    late = np.array([queue.arrival(0.07 * k) - 0.07 * k for k in range(5000)])
    assert (np.diff(late + 0.07 * np.arange(5000)) >= -1e-9).all()
    assert np.percentile(late, 30) == pytest.approx(0.14, abs=0.01) and late.max() < 0.56
    apart = Latency(LatencyConfig(0.15, 0.02, 0.05, 0.3, 0.3), Noise(1, "l"))
    late = np.array([apart.arrival(k) - k for k in range(5000)])
    assert np.median(late) == pytest.approx(0.15, abs=0.002)
    assert (late > 0.35).mean() == pytest.approx(0.05, abs=0.01)


def test_gusts_push_with_the_force_asked_for() -> None:
    """0.23 N rms through 0.16 N/(m/s), less along z, forgotten in a second."""
    air = Drift(DriftConfig(mean=(1.0, 0.0, 0.0)), Noise(4, "gust"))
    wind = np.array([air.wind(0.1 * k, 0.0, 0.0, 1.0, 0.0) for k in range(20000)])
    force = 0.16 * (wind - [1.0, 0.0, 0.0])
    assert force.std(axis=0) == pytest.approx([0.23, 0.23, 0.161], rel=0.08)
    assert np.corrcoef(force[10:, 0], force[:-10, 0])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.05)
