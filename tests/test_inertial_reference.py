"""Inertial reference unit, flow vanes, strapped-down camera: readings by hand, noise, and the Earth's curve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_sensors import CAMERA, truth

from landing_sim.geometry.earth import A as EARTH_RADIUS
from landing_sim.noise import Noise
from landing_sim.sensors.airdata import FlowAngles, FlowAnglesConfig
from landing_sim.sensors.inertial_reference import InertialReference, InertialReferenceConfig
from landing_sim.sensors.platform import Strapdown
from landing_sim.signals import InertialReading

QUIET = InertialReferenceConfig(
    attitude_bias_sigma=0.0, heading_bias_sigma=0.0, velocity_bias_sigma=0.0, attitude_noise=0.0, rate_noise=0.0,
    velocity_noise=0.0,
)  # fmt: skip


def read(unit: InertialReference, *args: object, **state: object) -> InertialReading:
    sample = unit.sense(truth(*args, **state), CAMERA)  # type: ignore[arg-type]
    assert sample is not None
    return sample.data  # type: ignore[no-any-return]


def test_over_the_threshold_levels_agree() -> None:
    """Runway due west: along it is west, right of it is north."""
    unit = InertialReference(QUIET, math.radians(270.0), Noise(1, "inertial"))
    got = read(unit, p_RB=(0.0, 0.0, -10.0), euler=(0.02, 0.05, 0.1))
    np.testing.assert_allclose(got.euler, [0.02, 0.05, math.radians(-90.0) + 0.1], atol=1e-12)
    np.testing.assert_allclose(got.v_N, [0.0, -50.0, 2.6], atol=1e-12)  # 50 m/s along the runway: west
    np.testing.assert_allclose(got.rates, [0.1, -0.02, 0.03])
    assert (got.moved_N == 0.0).all()  # the first reading has none before it


def test_five_kilometres_out_the_level_has_turned() -> None:
    """Level flight there climbs, seen from the runway, by 5000 m over the Earth's radius: 0.045 degrees."""
    unit = InertialReference(QUIET, 0.0, Noise(1, "inertial"))
    got = read(unit, p_RB=(-5000.0, 0.0, -260.0))
    assert got.euler[1] == pytest.approx(-5000.0 / EARTH_RADIUS, rel=1e-6)
    assert math.degrees(-got.euler[1]) == pytest.approx(0.0449, abs=1e-4)
    assert got.v_N[2] == pytest.approx(2.6 + 50.0 * 5000.0 / EARTH_RADIUS, rel=1e-6)


def test_ways_add_up_whatever_the_rate() -> None:
    """The sum of what it says it has moved is where it is, with a biased velocity: where the bias has carried it."""
    config = InertialReferenceConfig(
        attitude_bias_sigma=0.0, heading_bias_sigma=0.0, velocity_bias=(0.5, -0.2, 0.1), velocity_noise=0.3
    )
    unit = InertialReference(config, 0.0, Noise(1, "inertial"))
    path = [(-20.0 + 3.0 * k, 0.1 * k * k, -10.0) for k in range(8)]
    moved = sum(read(unit, 0.04 * k, p_RB=p).moved_N for k, p in enumerate(path))
    np.testing.assert_allclose(moved, np.subtract(path[-1], path[0]) + 0.28 * np.array([0.5, -0.2, 0.1]), atol=1e-4)


def test_inertial_errors_have_their_sigma() -> None:
    config = InertialReferenceConfig()
    biases = []
    for run in range(300):
        unit = InertialReference(config, 0.0, Noise(1, "inertial", run))
        biases.append([*unit.attitude_bias, *unit.velocity_bias])
    wanted = [config.attitude_bias_sigma] * 2 + [config.heading_bias_sigma] + [config.velocity_bias_sigma] * 3
    np.testing.assert_allclose(np.std(biases, axis=0), wanted, rtol=0.15)
    unit = InertialReference(config, 0.0, Noise(1, "inertial"))
    readings = [read(unit, 0.04 * k, p_RB=(0.0, 0.0, -10.0)) for k in range(600)]
    for name, sigma in (("euler", config.attitude_noise), ("rates", config.rate_noise), ("v_N", config.velocity_noise)):
        np.testing.assert_allclose(np.std([getattr(r, name) for r in readings], axis=0), sigma, rtol=0.12)


def test_vanes() -> None:
    vanes = FlowAngles(FlowAnglesConfig(noise=0.004, bias_sigma=0.0, latency=0.1), Noise(1, "flow_angles"))
    samples = [vanes.sense(truth(0.06 * k), CAMERA) for k in range(500)]
    assert samples[0] is not None and samples[0].t_arrival == pytest.approx(0.1)
    data = np.array([s.data for s in samples if s is not None])
    np.testing.assert_allclose(data.std(axis=0), 0.004, rtol=0.12)
    assert np.abs(data.mean(axis=0)).max() < 0.001


@pytest.mark.parametrize(
    "make",
    [
        lambda: InertialReferenceConfig(period=0.0),
        lambda: InertialReferenceConfig(attitude_noise=-1.0),
        lambda: FlowAnglesConfig(noise=math.nan),
        lambda: Strapdown(2.0),
        lambda: InertialReference(InertialReferenceConfig(velocity_bias=(1.0, 2.0)), 0.0, Noise(1, "i")),  # type: ignore
    ],
)
def test_bad_settings_are_refused(make) -> None:
    with pytest.raises(ValueError, match="must be|at most|finite number"):
        make()


def test_a_strapped_down_camera_stays_where_it_is() -> None:
    mount = Strapdown(-0.05)
    mount.reset(0.3, 0.3)
    mount.step(0.2, 0.2, np.array([0.1, 0.2, 0.3]), 0.005)
    assert (mount.pan, mount.tilt, mount.pan_rate, mount.tilt_rate) == (0.0, -0.05, 0.0, 0.0)
