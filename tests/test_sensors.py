"""Instruments and their faults: hand-computed readings, noise figures, and faults that do what their word says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from landing_sim.geometry.so3 import from_euler
from landing_sim.interfaces import Sensor
from landing_sim.noise import Noise
from landing_sim.sensors.airdata import Airspeed, AirspeedConfig
from landing_sim.sensors.faults import (
    FAULTS,
    Delayed,
    Fault,
    Faulty,
    Garbage,
    Intermittent,
    Off,
    RandomFrame,
    Slow,
    Stuck,
    Wrong,
)
from landing_sim.sensors.inertial import Gyro, GyroConfig
from landing_sim.sensors.reference import DifferentialGps, DifferentialGpsConfig, RadarAltimeter, RadarAltimeterConfig
from landing_sim.signals import CameraSample, CameraTruth, Sample, Truth

CAMERA = CameraTruth(np.zeros(3), np.eye(3), 0.0, 0.0)


def truth(
    t: float = 0.0, p_RB=(-950.0, -85.0, -51.0), euler=(0.0, 0.0, 0.0), rates=(0.1, -0.02, 0.03), airspeed: float = 50.0
) -> Truth:
    return Truth(
        tick=round(t / 0.005), t=t, p_RB=np.array(p_RB), R_RB=from_euler(*euler), v_RB_R=np.array([50.0, 0.0, 2.6]),
        w_RB_B=np.array(rates), euler=np.array(euler), wind_R=np.zeros(3), airspeed=airspeed, alpha=0.0, beta=0.0,
        surfaces=np.zeros(4), thrust=3000.0, wheels_height=np.full(3, 49.0), on_ground=np.zeros(3, bool),
        load_factor=1.0,
    )  # fmt: skip


def read(sensor: Sensor, n: int, period: float = 0.06, **state) -> list[Sample | None]:
    return [sensor.sense(truth(k * period, **state), CAMERA) for k in range(n)]


def values(samples: list[Sample | None]) -> np.ndarray:
    return np.array([sample.data for sample in samples if sample is not None])


# ------------------------------------------------------------------------------------------------------ instruments


def test_gyro_without_noise() -> None:
    gyro = Gyro(GyroConfig(noise=0.0, bias=(0.001, 0.002, -0.003), latency=0.02), Noise(1, "gyro"))
    sample = gyro.sense(truth(0.6), CAMERA)
    assert sample is not None
    assert (sample.sensor, sample.t_valid, sample.t_arrival) == ("gyro", 0.6, 0.62)
    np.testing.assert_allclose(sample.data, [0.101, -0.018, 0.027], atol=1e-15)


def test_gyro_noise_and_bias_have_their_sigma() -> None:
    """0.1 deg/s each: the noise within a run, the bias over runs."""
    gyro = Gyro(GyroConfig(), Noise(1, "gyro"))
    error = values(read(gyro, 4000)) - [0.1, -0.02, 0.03]
    sigma = math.radians(0.1)
    np.testing.assert_allclose(error.std(axis=0), sigma, rtol=4 / math.sqrt(2 * 4000))
    np.testing.assert_allclose(error.mean(axis=0), gyro.bias, atol=4 * sigma / math.sqrt(4000))
    biases = np.array([Gyro(GyroConfig(), Noise(1, "gyro", run)).bias for run in range(1000)])
    np.testing.assert_allclose(biases.std(axis=0), sigma, rtol=4 / math.sqrt(2 * 1000))


def test_a_fixed_bias_leaves_the_noise_as_it_was() -> None:
    drawn, fixed = Gyro(GyroConfig(), Noise(1, "gyro")), Gyro(GyroConfig(bias=(0.0, 0.0, 0.0)), Noise(1, "gyro"))
    np.testing.assert_allclose(values(read(drawn, 20)) - drawn.bias, values(read(fixed, 20)), atol=1e-15)


def test_gyro_quantum() -> None:
    gyro = Gyro(GyroConfig(noise=0.0, bias=(0.0, 0.0, 0.0), quantum=0.04), Noise(1, "gyro"))
    np.testing.assert_allclose(values(read(gyro, 1))[0], [0.08, -0.0, 0.04], atol=1e-15)  # 0.1 is 2.5 steps: to even


def test_airspeed_noise_and_bias() -> None:
    sensor = Airspeed(AirspeedConfig(bias=1.5), Noise(1, "airspeed"))
    error = values(read(sensor, 4000)) - 50.0
    assert error.std() == pytest.approx(0.5, rel=4 / math.sqrt(2 * 4000))
    assert error.mean() == pytest.approx(1.5, abs=4 * 0.5 / math.sqrt(4000))
    assert isinstance(read(sensor, 1)[0].data, float)  # type: ignore[union-attr]


def test_airspeed_is_never_negative() -> None:
    readings = values(read(Airspeed(AirspeedConfig(), Noise(1, "airspeed")), 200, airspeed=0.1))
    assert readings.min() == 0.0
    assert (readings > 0.0).any()


@given(lag=st.floats(0.05, 2.0), period=st.floats(0.005, 0.5), slope=st.floats(-0.3, 3.0))
def test_a_ramp_is_followed_by_the_lag(lag: float, period: float, slope: float) -> None:
    """After n samples the reading is behind by slope lag (1 - exp(-n period / lag)), at any period."""
    sensor = Airspeed(AirspeedConfig(noise=0.0, lag=lag), Noise(1, "airspeed"))
    n = 40
    for k in range(n + 1):
        sample = sensor.sense(truth(k * period, airspeed=50.0 + slope * k * period), CAMERA)
    behind = 50.0 + slope * n * period - sample.data  # type: ignore[union-attr]
    assert behind == pytest.approx(slope * lag * (1 - math.exp(-n * period / lag)), abs=1e-9)


def test_dgps_antenna() -> None:
    """Rolled 90 deg right, an antenna 2 m above the cg stands 2 m to the right of it."""
    config = DifferentialGpsConfig(
        noise=(0.0, 0.0), drift=(0.0, 0.0), bias=(0.5, 0.0, -4.0), p_BA=(1.0, 0.0, -2.0), latency=0.2
    )
    sample = DifferentialGps(config, Noise(1, "dgps")).sense(truth(3.0, euler=(math.pi / 2, 0.0, 0.0)), CAMERA)
    assert sample is not None
    np.testing.assert_allclose(sample.data, [-950.0 + 1.0 + 0.5, -85.0 + 2.0, -51.0 - 4.0], atol=1e-12)
    assert (sample.t_valid, sample.t_arrival) == (3.0, 3.2)


def test_dgps_errors() -> None:
    """White noise, and a drift whose correlation falls to 1/e in its correlation time."""
    quiet = DifferentialGpsConfig(noise=(0.0, 0.0), bias=(0.0, 0.0, 0.0))
    n = 40_000
    drift = values(read(DifferentialGps(quiet, Noise(2, "dgps")), n, period=20.0)) - [-950.0, -85.0, -51.0]
    # squares whose neighbours correlate by e^(-2/3) are worth n tanh(1/3) independent ones
    np.testing.assert_allclose(drift.std(axis=0), [1.0, 1.0, 2.0], rtol=4 / math.sqrt(2 * n * math.tanh(1 / 3)))
    kept = (drift[3:] * drift[:-3]).mean(axis=0) / drift.var(axis=0)
    np.testing.assert_allclose(kept, math.exp(-1.0), atol=4 / math.sqrt(n * math.tanh(1 / 3)))
    white = DifferentialGpsConfig(drift=(0.0, 0.0), bias=(0.0, 0.0, 0.0))
    error = values(read(DifferentialGps(white, Noise(2, "dgps")), 4000)) - [-950.0, -85.0, -51.0]
    np.testing.assert_allclose(error.std(axis=0), [0.5, 0.5, 1.0], rtol=4 / math.sqrt(2 * 4000))


def test_dgps_height_is_the_worst_axis() -> None:
    """Section 7.2 had to bring a radar altimeter, for the height of the GPS showed errors."""
    biases = np.array([DifferentialGps(DifferentialGpsConfig(), Noise(1, "dgps", run)).bias for run in range(1000)])
    np.testing.assert_allclose(biases.std(axis=0), [0.5, 0.5, 3.0], rtol=4 / math.sqrt(2 * 1000))


def test_radar_altimeter() -> None:
    """51 m above the threshold, ground 2 m higher, antenna 1.5 m below the cg: 47.5 m."""
    config = RadarAltimeterConfig(noise=0.0, bias=0.25, scale_sigma=0.0, below_cg=1.5, max_height=60.0)
    sensor = RadarAltimeter(config, Noise(1, "radar"), ground=lambda x, y: 2.0)
    assert read(sensor, 1)[0].data == pytest.approx(47.75)  # type: ignore[union-attr]
    assert sensor.sense(truth(p_RB=(0.0, 0.0, -63.6)), CAMERA) is None
    assert sensor.sense(truth(p_RB=(0.0, 0.0, -63.4)), CAMERA) is not None
    assert sensor.sense(truth(p_RB=(0.0, 0.0, -1.0)), CAMERA).data == 0.0  # type: ignore[union-attr]


def test_radar_altimeter_errors() -> None:
    sensor = RadarAltimeter(RadarAltimeterConfig(), Noise(1, "radar"))
    readings = values(read(sensor, 4000))
    assert readings.std() == pytest.approx(0.3, rel=4 / math.sqrt(2 * 4000))
    assert readings.mean() == pytest.approx(sensor.scale * 51.0 + sensor.bias, abs=4 * 0.3 / math.sqrt(4000))
    scales = [RadarAltimeter(RadarAltimeterConfig(), Noise(1, "radar", run)).scale - 1 for run in range(1000)]
    assert np.std(scales) == pytest.approx(0.01, rel=4 / math.sqrt(2 * 1000))


@pytest.mark.parametrize(
    "make",
    [
        lambda: GyroConfig(period=0.0),
        lambda: GyroConfig(noise=-1.0),
        lambda: GyroConfig(latency=math.nan),
        lambda: Gyro(GyroConfig(bias=(0.0, 0.0)), Noise(1, "gyro")),  # type: ignore[arg-type]
        lambda: Gyro(GyroConfig(bias=(0.0, math.nan, 0.0)), Noise(1, "gyro")),
        lambda: AirspeedConfig(lag=-0.1),
        lambda: AirspeedConfig(period=math.inf),
        lambda: DifferentialGpsConfig(drift_time=0.0),
        lambda: DifferentialGpsConfig(drift=(1.0, -1.0)),
        lambda: DifferentialGpsConfig(p_BA=(0.0, math.nan, 0.0)),
        lambda: RadarAltimeterConfig(max_height=math.inf),
        lambda: RadarAltimeterConfig(below_cg=math.nan),
    ],
)
def test_bad_settings_are_refused(make) -> None:
    with pytest.raises(ValueError, match=r"^(gyro|airspeed|dgps|radar_altimeter): "):
        make()


# ----------------------------------------------------------------------------------------------------------- faults


class Clock:
    """A sensor that reads the time, so that every sample can be told from every other."""

    name, period, channels = "clock", 0.06, 1

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        return Sample("clock", truth.t, truth.t + 0.01, truth.t)


class Flat:
    """A frame of one grey level."""

    width, height = 64, 48

    def __init__(self, grey: int) -> None:
        self.grey = grey

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        return np.full((height, width), self.grey, np.uint8)

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
        return np.full((len(corners), height, width), self.grey, np.uint8)

    def full(self) -> np.ndarray:
        return self.window(0, 0, self.width, self.height)


class Camera:
    """A camera whose k-th frame has the grey level k."""

    name, period, channels = "camera", 0.06, 0

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        k = round(truth.t / self.period)
        return Sample("camera", truth.t, truth.t, CameraSample(Flat(k), k, 0.1 * k, 0.2 * k, 0.0, 0.0))


class Mute:
    """A sensor that does not say what it sends."""

    name, period = "mute", 0.06

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        return None


def run(fault: Fault, sensor: Sensor | None = None, n: int = 10) -> list[Sample | None]:
    return read(Faulty(sensor or Clock(), fault, Noise(1, "fault")), n)


# samples 3, 4 and 5 lie in [0.18, 0.36)
WINDOW = {"start": 0.17, "end": 0.36 - 1e-9}
INSIDE = {3, 4, 5}


@pytest.mark.parametrize(
    "fault", [Off(**WINDOW), Stuck(**WINDOW), Garbage(1.0, **WINDOW), Wrong(1.0, **WINDOW), Slow(2, **WINDOW),
              Delayed(0.1, **WINDOW), Intermittent(0.999, **WINDOW)], ids=list(FAULTS)
)  # fmt: skip
def test_a_fault_acts_within_its_times_only(fault: Fault) -> None:
    healthy = read(Clock(), 10)
    changed = {k for k, sample in enumerate(run(fault)) if sample != healthy[k]}
    assert changed <= INSIDE
    assert changed == ({4} if isinstance(fault, Slow) else INSIDE)
    assert FAULTS[type(fault).__name__.lower()] is type(fault)


def test_off() -> None:
    assert [k for k, sample in enumerate(run(Off(**WINDOW))) if sample is None] == [3, 4, 5]


def test_stuck_repeats_the_last_good_reading_with_fresh_stamps() -> None:
    samples = run(Stuck(**WINDOW))
    np.testing.assert_allclose(values(samples), 0.06 * np.array([0, 1, 2, 2, 2, 2, 6, 7, 8, 9]))
    assert samples[5] is not None
    assert (samples[5].t_valid, samples[5].t_arrival) == (pytest.approx(0.30), pytest.approx(0.31))


def test_stuck_from_the_start_repeats_the_first() -> None:
    np.testing.assert_allclose(values(run(Stuck())), 0.0)


def test_stuck_camera_repeats_its_image_while_the_encoders_go_on() -> None:
    samples = run(Stuck(**WINDOW), Camera())
    greys = [int(sample.data.frame.full()[0, 0]) for sample in samples if sample]
    assert greys == [0, 1, 2, 2, 2, 2, 6, 7, 8, 9]
    assert [sample.data.index for sample in samples if sample] == list(range(10))
    assert samples[5] is not None
    assert (samples[5].data.pan, samples[5].data.tilt) == (0.5, 1.0)


def test_wrong() -> None:
    np.testing.assert_allclose(values(run(Wrong(bias=1.0, scale=2.0)))[:3], [1.0, 1.12, 1.24])
    gyro = Gyro(GyroConfig(noise=0.0, bias=(0.0, 0.0, 0.0)), Noise(1, "gyro"))
    faulty = Faulty(gyro, Wrong(bias=(0.0, 0.5, 0.0)), Noise(1, "fault"))
    np.testing.assert_allclose(values(read(faulty, 1))[0], [0.1, 0.48, 0.03])


def test_garbage_has_its_spread_and_no_truth_in_it() -> None:
    clock = values(run(Garbage(3.0), n=4000))
    assert clock.std() == pytest.approx(3.0, rel=4 / math.sqrt(2 * 4000))
    assert abs(np.corrcoef(clock, np.arange(4000))[0, 1]) < 4 / math.sqrt(4000)
    gyro = Gyro(GyroConfig(), Noise(1, "gyro"))
    assert values(run(Garbage(3.0), gyro, n=2)).shape == (2, 3)


def test_garbage_camera() -> None:
    samples = run(Garbage(), Camera())
    first, second = (sample.data.frame for sample in samples[:2] if sample)
    assert (first.width, first.height) == (64, 48)
    assert not np.array_equal(first.full(), second.full())
    np.testing.assert_array_equal(first.full(), run(Garbage(), Camera())[0].data.frame.full())  # type: ignore[union-attr]


@given(u0=st.integers(0, 56), v0=st.integers(0, 44), key=st.integers(0, 2**64 - 1), index=st.integers(0, 10_000))
def test_random_frame_is_the_same_through_any_window(u0: int, v0: int, key: int, index: int) -> None:
    frame = RandomFrame(64, 48, key, index)
    whole = frame.full()
    np.testing.assert_array_equal(frame.window(u0, v0, 8, 4), whole[v0 : v0 + 4, u0 : u0 + 8])
    np.testing.assert_array_equal(frame.windows(np.array([[u0, v0], [0, 0]]), 8, 4)[0], whole[v0 : v0 + 4, u0 : u0 + 8])


def test_random_frame_is_uniform_and_bounded() -> None:
    pixels = RandomFrame(512, 512, 12345, 7).full()
    counts = np.bincount(pixels.ravel(), minlength=256)
    assert abs(((counts - 1024.0) ** 2 / 1024.0).sum() - 255) < 4 * math.sqrt(2 * 255)
    assert abs(np.corrcoef(pixels[:, :-1].ravel(), pixels[:, 1:].ravel())[0, 1]) < 4 / 512
    with pytest.raises(ValueError, match="inside"):
        RandomFrame(64, 48, 1, 1).window(60, 0, 8, 4)


def test_slow_sends_one_in_so_many() -> None:
    samples = run(Slow(3, start=0.11), n=12)
    assert [k for k, sample in enumerate(samples) if sample is not None] == [0, 1, 2, 5, 8, 11]


def test_delayed() -> None:
    honest, posing = run(Delayed(0.12))[1], run(Delayed(0.12, honest_time=False))[1]
    assert honest is not None
    assert posing is not None
    assert (honest.t_valid, honest.t_arrival) == (pytest.approx(0.06), pytest.approx(0.19))
    assert (posing.t_valid, posing.t_arrival) == (pytest.approx(0.18), pytest.approx(0.19))
    assert honest.data == posing.data == pytest.approx(0.06)


def test_intermittent_loses_its_share() -> None:
    n = 4000
    lost = np.array([sample is None for sample in run(Intermittent(0.3), n=n)])
    assert lost.mean() == pytest.approx(0.3, abs=4 * math.sqrt(0.3 * 0.7 / n))
    assert abs(np.corrcoef(lost[1:], lost[:-1])[0, 1]) < 4 / math.sqrt(n)


def test_after_a_fault_the_sensor_draws_what_it_would_have() -> None:
    healthy = read(Gyro(GyroConfig(), Noise(1, "gyro")), 10)
    for fault in (Off(**WINDOW), Slow(4, **WINDOW), Intermittent(0.5, **WINDOW)):
        after = read(Faulty(Gyro(GyroConfig(), Noise(1, "gyro")), fault, Noise(1, "fault")), 10)
        np.testing.assert_array_equal(values(after[6:]), values(healthy[6:]))


def test_faults_nest() -> None:
    inner = Faulty(Clock(), Wrong(bias=1.0), Noise(1, "a"))
    samples = read(Faulty(inner, Slow(2), Noise(1, "b")), 4)
    assert [sample and sample.data for sample in samples] == [1.0, None, pytest.approx(1.12), None]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Off(start=2.0, end=1.0), "start before its end"),
        (lambda: Stuck(start=math.nan), "start"),
        (lambda: Garbage(0.0), "spread"),
        (lambda: Wrong(), "other than"),
        (lambda: Wrong(bias=math.inf), "finite"),
        (lambda: Slow(1), "factor"),
        (lambda: Slow(2.5), "factor"),  # type: ignore[arg-type]
        (lambda: Delayed(0.0), "delay"),
        (lambda: Delayed(math.nan), "delay"),
        (lambda: Intermittent(1.0), "'off'"),
        (lambda: Faulty(Camera(), Wrong(bias=1.0), Noise(1, "f")), "image has no bias"),
        (lambda: Faulty(Mute(), Off(), Noise(1, "f")), "how many channels"),
        (lambda: Faulty(Camera(), Garbage(1.0), Noise(1, "f")), "leave it out"),
        (lambda: Faulty(Clock(), Garbage(), Noise(1, "f")), "needs a spread"),
        (lambda: Faulty(Clock(), Wrong(bias=(1.0, 2.0)), Noise(1, "f")), r"needs 1 number"),
    ],
)
def test_faults_that_make_no_sense_are_refused(make, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        make()


def test_truth_is_left_as_it_was() -> None:
    """Sensors read; none writes into what it reads."""
    state = truth(euler=(0.1, 0.05, 0.2))
    before = replace(state, p_RB=state.p_RB.copy(), w_RB_B=state.w_RB_B.copy(), R_RB=state.R_RB.copy())
    for sensor in (
        Gyro(GyroConfig(), Noise(1, "g")),
        DifferentialGps(DifferentialGpsConfig(p_BA=(1.0, 0.0, 0.0)), Noise(1, "d")),
        RadarAltimeter(RadarAltimeterConfig(below_cg=1.0), Noise(1, "r")),
        Faulty(Gyro(GyroConfig(), Noise(1, "g")), Wrong(bias=1.0, scale=2.0), Noise(1, "f")),
    ):
        sensor.sense(state, CAMERA)
    for name in ("p_RB", "w_RB_B", "R_RB"):
        np.testing.assert_array_equal(getattr(state, name), getattr(before, name))


def test_the_real_camera_can_fail() -> None:
    """A stuck frame shows the old pose for ever; a random one has the camera's size; the encoders go on."""
    from landing_sim.geometry.pinhole import Intrinsics
    from landing_sim.geometry.so3 import camera_from_body
    from landing_sim.sensors.camera import Camera as RealCamera
    from landing_sim.sensors.platform import PanTilt
    from landing_sim.world.runway import Runway

    def sensed(fault: Fault) -> list[Sample]:
        camera = RealCamera(Intrinsics.centred(96, 64, 400.0), Runway(), PanTilt(), Noise(1, "px"), Noise(1, "enc"))
        faulty = Faulty(camera, fault, Noise(1, "fault"))
        out = []
        for k in range(3):
            pose = CameraTruth(np.array([-400.0 + 60.0 * k, 0.0, -20.0]), camera_from_body(0.0, -0.05), 0.01 * k, -0.05)
            sample = faulty.sense(truth(0.06 * k), pose)
            assert sample is not None
            out.append(sample)
        return out

    healthy, stuck, garbage = sensed(Off(start=99.0)), sensed(Stuck(start=0.05)), sensed(Garbage(start=0.05))
    first = healthy[0].data.frame.full()
    assert not np.array_equal(healthy[2].data.frame.full(), first)
    for k in (1, 2):
        np.testing.assert_array_equal(stuck[k].data.frame.full(), first)
        assert stuck[k].data.pan == healthy[k].data.pan != healthy[0].data.pan
        assert garbage[k].data.frame.full().shape == first.shape == (64, 96)
        assert garbage[k].data.frame.full().std() > 60.0  # uniform: 73.9


def test_normals_are_the_same_however_they_are_asked_for() -> None:
    """Drawn by the block inside; what is handed out is the stream, without gaps and without repeats."""
    sizes = [3, 1, 2, 60, 5, 200, 1, 64, 7]
    pieces = Noise(3, "gyro", 2)
    whole = Noise(3, "gyro", 2).normal(sum(sizes))
    np.testing.assert_array_equal(np.concatenate([pieces.normal(size) for size in sizes]), whole)
    assert len(np.unique(whole)) == len(whole)
