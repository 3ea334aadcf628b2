"""The camera as a sensor: stamps, encoders, and frames that outlive the moment."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.geometry import so3
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.noise import Noise
from landing_sim.sensors.camera import Camera, Encoders, camera_motion
from landing_sim.sensors.platform import PanTilt
from landing_sim.sensors.render import Optics, render_frame
from landing_sim.signals import CameraSample, CameraTruth, Sample, Truth
from landing_sim.types import Array
from landing_sim.world.runway import Runway

INTRINSICS = Intrinsics.centred(160, 120, 500.0)
LEVER = np.array([3.0, 0.0, -0.3])


def truth(t: float, p_RB: Array, euler: Array, v: Array | None = None, w: Array | None = None) -> Truth:
    zero = np.zeros(3)
    v, w = zero if v is None else v, zero if w is None else w
    wheels = np.zeros(3, bool)
    R_RB = so3.from_euler(*euler)
    return Truth(0, t, p_RB, R_RB, v, w, euler, zero, 50.0, 0.0, 0.0, np.zeros(4), 0.0, zero, wheels, 1.0)


def seen_from(state: Truth, mount: PanTilt) -> CameraTruth:
    R_CR = so3.camera_from_body(mount.pan, mount.tilt) @ state.R_RB.T
    return CameraTruth(state.p_RB + state.R_RB @ LEVER, R_CR, mount.pan, mount.tilt)


def make(mount: PanTilt, seed: int = 1, **options: object) -> Camera:
    streams = Noise(seed, "pixels"), Noise(seed, "encoders")
    return Camera(INTRINSICS, Runway(), mount, *streams, **options)  # type: ignore[arg-type]


APPROACH = truth(1.23, np.array([-300.0, 3.0, -17.0]), np.array([0.05, 0.01, -0.01]))


def sample_of(sample: Sample) -> CameraSample:
    assert isinstance(sample.data, CameraSample)
    return sample.data


def test_stamps_index_and_commanded_angles() -> None:
    mount = PanTilt()
    mount.step(0.1, -0.05, np.zeros(3), 0.005)
    camera = make(mount, latency=0.045, period=0.06)
    first, second = (camera.sense(APPROACH, seen_from(APPROACH, mount)) for _ in range(2))
    assert (first.sensor, camera.name, camera.period) == ("camera", "camera", 0.06)
    assert (first.t_valid, first.t_arrival) == (1.23, 1.23 + 0.045)
    assert (sample_of(first).index, sample_of(second).index) == (0, 1)
    assert (sample_of(first).pan_cmd, sample_of(first).tilt_cmd) == (0.1, -0.05)
    assert sample_of(first).pan == mount.pan  # no bias, no noise
    assert (sample_of(first).frame.width, sample_of(first).frame.height) == (160, 120)


def test_frames_outlive_the_moment_and_render_again_from_their_pose() -> None:
    mount = PanTilt()
    view = seen_from(APPROACH, mount)
    p, R = view.p_RC.copy(), view.R_CR.copy()
    frame = sample_of(make(mount, seed=8).sense(APPROACH, view)).frame
    view.p_RC[:] = 1e3  # whoever owns the arrays may go on
    view.R_CR[:] = np.eye(3)
    again = render_frame(CameraTruth(p, R, 0.0, 0.0), INTRINSICS, key=Noise(8, "pixels").key(), index=0)
    assert np.array_equal(frame.window(20, 30, 41, 17), again.full()[30:47, 20:61])
    assert np.array_equal(frame.full(), again.full())


def test_encoders_have_bias_and_noise_of_their_own() -> None:
    mount = PanTilt(pan=0.2, tilt=-0.1)
    encoders = Encoders(pan_bias=0.01, tilt_bias=-0.02, noise=0.003)
    camera = make(mount, encoders=encoders)
    samples = [sample_of(camera.sense(APPROACH, seen_from(APPROACH, mount))) for _ in range(2000)]
    errors = np.array([[s.pan - 0.2, s.tilt + 0.1] for s in samples])
    assert errors.mean(axis=0) == pytest.approx([0.01, -0.02], abs=5 * 0.003 / math.sqrt(2000))
    assert errors.std(axis=0) == pytest.approx([0.003, 0.003], rel=0.08)
    assert abs(np.corrcoef(errors.T)[0, 1]) < 5 / math.sqrt(2000)


def test_encoder_noise_leaves_the_pixels_alone() -> None:
    mount = PanTilt()
    view = seen_from(APPROACH, mount)
    quiet, noisy = make(mount), make(mount, encoders=Encoders(noise=0.01))
    for _ in range(2):
        a, b = sample_of(quiet.sense(APPROACH, view)), sample_of(noisy.sense(APPROACH, view))
    assert np.array_equal(a.frame.full(), b.frame.full())
    assert a.pan != b.pan


def test_skewed_encoders_read_the_past() -> None:
    """A platform moving at constant rate: the reading is the angle of `skew` seconds ago."""
    mount = PanTilt()
    camera = make(mount, encoders=Encoders(skew=0.15))
    for k in range(10):
        t = 0.06 * k
        state = truth(t, APPROACH.p_RB, APPROACH.euler)
        view = CameraTruth(APPROACH.p_RB, np.eye(3), pan=0.5 * t, tilt=-0.25 * t)
        reading = sample_of(camera.sense(state, view))
        expected = max(t - 0.15, 0.0)  # nothing older than the first frame is known
        assert (reading.pan, reading.tilt) == pytest.approx((0.5 * expected, -0.25 * expected), abs=1e-12)


def test_camera_motion_is_the_derivative_of_its_pose() -> None:
    mount = PanTilt(pan=0.3, tilt=-0.2, stabilisation=0.5)
    euler, w = np.array([0.2, -0.1, 0.4]), np.array([0.3, -0.2, 0.5])
    state = truth(0.0, np.array([-100.0, 5.0, -20.0]), euler, np.array([48.0, 2.0, 3.0]), w)
    before = seen_from(state, mount)
    dt = 1e-6
    angle = np.linalg.norm(w)
    K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    turned = state.R_RB @ (np.eye(3) + np.sin(angle * dt) / angle * K)
    mount.step(0.5, 0.1, w, dt)
    later = truth(dt, state.p_RB + state.v_RB_R * dt, so3.to_euler(turned))
    after = seen_from(later, mount)
    v_RC_R, w_RC_C = camera_motion(state, before, mount)
    assert (after.p_RC - before.p_RC) / dt == pytest.approx(v_RC_R, abs=1e-4)
    skew = (after.R_CR @ before.R_CR.T - np.eye(3)) / dt  # -[w]x
    assert [skew[1, 2], skew[2, 0], skew[0, 1]] == pytest.approx(w_RC_C, abs=1e-4)


def test_motion_blur_comes_from_the_motion() -> None:
    mount = PanTilt(stabilisation=0.0)
    optics = Optics(noise=0.0, exposure=0.02)
    spinning = truth(0.0, APPROACH.p_RB, APPROACH.euler, w=np.array([0.0, 0.0, 0.5]))

    def sharpness(state: Truth) -> float:
        image = sample_of(make(mount, optics=optics).sense(state, seen_from(state, mount))).frame.full().astype(float)
        return float(np.abs(np.diff(image, axis=1)).max())

    assert sharpness(spinning) < 0.6 * sharpness(APPROACH)


def test_bad_cameras_are_refused() -> None:
    with pytest.raises(ValueError, match="latency"):
        make(PanTilt(), latency=-0.1)
    with pytest.raises(ValueError, match="period"):
        make(PanTilt(), period=0.0)
    with pytest.raises(ValueError, match="skew"):
        Encoders(skew=-0.1)
    with pytest.raises(ValueError, match="finite"):
        Encoders(pan_bias=math.inf)
