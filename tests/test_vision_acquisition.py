"""Cold start: a pose from one picture, with a covariance that is true, or a reason why not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from vision_bench import APPROACH, CAMERA, RAD, Bench, fixate, pose_of, scattered_poses

from landing_sim.geometry.so3 import from_euler
from landing_sim.vision.acquisition import Acquired, Acquisition, AcquisitionConfig, level_from_horizon
from landing_sim.vision.believed import RunwayMap
from landing_sim.vision.hough import borders
from landing_sim.world.runway import Runway, Taxiway

LENS = np.array([CAMERA.f, CAMERA.cx, CAMERA.cy])
NO_PAIR = np.empty((0, 3))

# noise, contrast -> rms limits: range [%], height [%], y [m]. A trial implementation: 0.4-0.5 %, 0.3 %, 0.3 m.
SETTINGS = {
    (4.0, 55.0): (0.5, 0.3, 0.3),
    (10.0, 55.0): (0.5, 0.4, 0.3),
    (4.0, 16.0): (0.6, 0.5, 0.4),
    (10.0, 16.0): (1.3, 1.2, 0.9),
}


def acquire(bench: Bench, pose: np.ndarray, pan: float, tilt: float, index: int = 0) -> Acquired:
    sample = bench.sample(bench.renderer(), pose, pan, tilt, index)
    return Acquisition(bench.known, bench.camera).acquire(sample, pan, tilt)


def errors_of(bench: Bench, n: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Errors (m, 6), NEES / 6 (m,), true poses (m, 6), reasons of failures, over n scattered poses."""
    renderer, acquisition = bench.renderer(), Acquisition(bench.known, bench.camera)
    errors, nees, poses, failures = [], [], [], []
    for k, (pose, pan, tilt) in enumerate(scattered_poses(n, seed)):
        got = acquisition.acquire(bench.sample(renderer, pose, pan, tilt, k), pan, tilt)
        if got.z is None or got.R is None:
            failures.append(f"{k}: {got.reason} at {np.round(pose, 2)}")
            continue
        e = got.z - pose
        errors.append(e)
        nees.append(float(e @ np.linalg.solve(got.R, e)) / 6.0)
        poses.append(pose)
    return np.array(errors), np.array(nees), np.array(poses), failures


def check(n: int, seed: int, noise: float, contrast: float) -> None:
    e, nees, poses, failures = errors_of(Bench(noise, contrast), n, seed)
    in_range = 100.0 * math.sqrt(np.mean((e[:, 0] / poses[:, 0]) ** 2))
    in_height = 100.0 * math.sqrt(np.mean((e[:, 2] / poses[:, 2]) ** 2))
    in_y = math.sqrt(np.mean(e[:, 1] ** 2))
    print(
        f"noise {noise} contrast {contrast}: {len(e)}/{n}, range {in_range:.2f} %, height {in_height:.2f} %, y {in_y:.2f} m"
        f", angles {np.degrees(np.sqrt(np.mean(e[:, 3:] ** 2, axis=0))).round(4)} deg, NEES/6 {np.mean(nees):.2f}"
    )
    assert len(failures) <= n // 100, failures
    limits = SETTINGS[noise, contrast]
    assert (in_range < limits[0], in_height < limits[1], in_y < limits[2]) == (True, True, True)
    assert np.max(np.abs(np.degrees(e[:, 3:]))) < 0.15
    assert 0.25 < np.mean(nees) < 2.0


@pytest.mark.parametrize(("noise", "contrast"), SETTINGS)
def test_cold_start_over_scattered_poses(noise: float, contrast: float) -> None:
    check(26, 11, noise, contrast)


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "contrast"), SETTINGS)
def test_cold_start_over_many_poses(noise: float, contrast: float) -> None:
    check(150, 5, noise, contrast)


def test_taxiways_do_not_confuse_it() -> None:
    taxiways = (Taxiway(250.0, 12.0, "left", 12.0, 200.0), Taxiway(800.0, 30.0, "right", 20.0, 300.0))
    e, nees, poses, failures = errors_of(Bench(runway=Runway(taxiways=taxiways)), 12, 23)
    assert failures == []
    assert np.max(np.abs(e[:, 0] / poses[:, 0])) < 0.015
    assert np.mean(nees) < 3.0


def test_sloping_runway_is_acquired_with_its_slope_known_and_missed_by_height_without() -> None:
    pose = pose_of(APPROACH[3])
    pan, tilt = fixate(pose)
    slope = 0.008
    bench = Bench(runway=Runway(slope=slope), known=RunwayMap(slope=slope))
    got = acquire(bench, pose, pan, tilt)
    assert got.z is not None
    assert np.abs(got.z - pose)[:3] == pytest.approx(0.0, abs=2.0)
    wrong = acquire(Bench(runway=Runway(slope=slope)), pose, pan, tilt)
    assert wrong.z is None or abs(wrong.z[2] - pose[2]) > 3.0 * abs(got.z[2] - pose[2])


def test_believed_width_sets_the_scale() -> None:
    """1 m of width is 1 / 29 of all distances: nothing in one picture can tell."""
    pose = pose_of(APPROACH[3])
    pan, tilt = fixate(pose)
    got = acquire(Bench(noise=0.0, known=RunwayMap(width=27.0)), pose, pan, tilt)
    assert got.z is not None
    p_RC = np.array([pose[0], pose[1], -pose[2]]) + from_euler(*pose[3:]) @ np.array([3.0, 0.0, -0.3])
    p_hat = np.array([got.z[0], got.z[1], -got.z[2]]) + from_euler(*got.z[3:]) @ np.array([3.0, 0.0, -0.3])
    assert p_hat / p_RC == pytest.approx(27.0 / 29.0, rel=0.01)


def test_platform_error_is_in_the_covariance() -> None:
    pose = pose_of(APPROACH[3])
    pan, tilt = fixate(pose)
    bench = Bench()
    sample = bench.sample(bench.renderer(), pose, pan, tilt)
    got = Acquisition(bench.known, bench.camera).acquire(sample, pan + 0.03 * RAD, tilt - 0.03 * RAD)
    assert got.z is not None
    assert got.R is not None
    e = got.z - pose
    assert abs(e[5] + 0.03 * RAD) < 0.015 * RAD  # the body is thought to be turned by what the platform was not
    assert np.all(np.abs(e) < 4.0 * np.sqrt(np.diag(got.R)))
    assert np.all(np.linalg.eigvalsh(got.R) > 0.0)


def test_failures_are_named() -> None:
    pose, bench = pose_of(APPROACH[3]), Bench()
    pan, tilt = fixate(pose)
    assert acquire(bench, pose, pan, tilt + 15.0 * RAD).reason == "no horizon in view"  # sky only
    assert acquire(bench, pose, pan, tilt - 15.0 * RAD).reason == "no horizon in view"  # ground only
    assert "no pair of borderlines" in acquire(bench, pose, pan + 25.0 * RAD, tilt).reason
    over = pose_of(APPROACH[-2])  # borderlines in view, and no threshold
    assert acquire(bench, over, *fixate(over)).reason == "too few windows found on the left edge"


def test_lines_across_the_runway_are_no_borders() -> None:
    """The two edges of something level and straight across, 20 px below the horizon and as wide as the picture."""
    u = np.arange(6.0, 506.0)
    above = np.column_stack([u, np.full_like(u, 270.0), np.zeros_like(u), np.full_like(u, 8.0)])
    below = np.column_stack([u, np.full_like(u, 276.0), np.zeros_like(u), np.full_like(u, -8.0)])
    R_LC = level_from_horizon(250.0, 0.0, LENS, 0.0)
    headings = np.arange(-0.49, 0.49, 0.001)
    scores = [
        borders(
            np.vstack([above, below]), R_LC, LENS, 0.0, 1.0, headings, np.array([0.1, 20.0, 50.0, spread]), NO_PAIR
        )[0]
        for spread in (0.0, AcquisitionConfig().min_depth_spread)
    ]
    assert scores[0] > 50.0
    assert scores[1] < AcquisitionConfig().min_points


def test_same_picture_same_bits() -> None:
    pose = pose_of(APPROACH[1])
    pan, tilt = fixate(pose)
    a, b = acquire(Bench(), pose, pan, tilt), acquire(Bench(), pose, pan, tilt)
    assert a.z is not None
    assert b.z is not None
    assert a.R is not None
    assert b.R is not None
    assert a.z.tobytes() == b.z.tobytes()
    assert a.R.tobytes() == b.R.tobytes()


def test_level_frame_from_a_tilted_and_dipped_horizon() -> None:
    """Roll 5 deg, looking 3 deg down from where the horizon dips 4 mrad: down in C comes out as computed by hand."""
    roll, down, dip = 5.0 * RAD, 3.0 * RAD, 0.004
    down_C = np.array([math.sin(roll) * math.cos(down), math.cos(roll) * math.cos(down), math.sin(down)])
    # rays of the horizon at two azimuths
    e1 = np.array([0.0, 0.0, 1.0]) - down_C[2] * down_C
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(down_C, e1)
    u, v = [], []
    for azimuth in (-1e-4, 1e-4):
        ray = math.cos(dip) * (math.cos(azimuth) * e1 + math.sin(azimuth) * e2) + math.sin(dip) * down_C
        u.append(CAMERA.cx + CAMERA.f * ray[0] / ray[2])
        v.append(CAMERA.cy + CAMERA.f * ray[1] / ray[2])
    b = (v[1] - v[0]) / (u[1] - u[0])
    R_LC = level_from_horizon(v[0] - b * u[0], b, LENS, dip)
    assert R_LC[2] == pytest.approx(down_C, abs=1e-6)
    assert pytest.approx(np.eye(3), abs=1e-12) == R_LC @ R_LC.T
