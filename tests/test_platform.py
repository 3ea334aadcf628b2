"""The pan/tilt platform: lag, limits, and what its rate feedback cancels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.geometry import so3
from landing_sim.sensors.platform import PanTilt

STILL = np.zeros(3)


def test_step_response_is_first_order_whatever_the_step() -> None:
    for dt in (0.001, 0.005, 0.02):
        mount = PanTilt(lag=0.08, rate_limit=10.0)
        for _ in range(round(0.08 / dt)):
            mount.step(0.1, -0.05, STILL, dt)
        assert mount.pan == pytest.approx(0.1 * (1.0 - math.exp(-1.0)), rel=1e-9)
        assert mount.tilt == pytest.approx(-0.05 * (1.0 - math.exp(-1.0)), rel=1e-9)
        assert (mount.pan_cmd, mount.tilt_cmd) == (0.1, -0.05)


def test_rate_limit() -> None:
    mount = PanTilt(rate_limit=math.radians(60.0))
    for _ in range(40):
        mount.step(1.0, -0.7, STILL, 0.005)
        assert mount.pan_rate == pytest.approx(math.radians(60.0))
        assert mount.tilt_rate == pytest.approx(-math.radians(60.0))
    assert mount.pan == pytest.approx(math.radians(12.0))
    assert mount.tilt == pytest.approx(-math.radians(12.0))


def test_angles_stop_at_the_limits() -> None:
    mount = PanTilt(lag=0.01, pan_limit=0.3, tilt_limit=0.2)
    for _ in range(400):
        mount.step(5.0, -5.0, np.array([0.0, 3.0, -3.0]), 0.005)
    assert (mount.pan, mount.tilt) == (0.3, -0.2)
    assert (mount.pan_cmd, mount.tilt_cmd) == (5.0, -5.0)  # what was asked for, not what was possible
    assert mount.pan_rate == 0.0


def test_without_lag_the_command_is_reached_at_once() -> None:
    mount = PanTilt(lag=0.0)
    mount.step(0.001, -0.002, STILL, 0.005)
    assert (mount.pan, mount.tilt) == pytest.approx((0.001, -0.002))


def fixation_error(stabilisation: float, period: float = 0.06) -> float:
    """Largest angle [rad] between the optical axis and R's x axis, fixated from exact attitude every `period`.

    The aircraft turns, pitches and rolls; 3-2-1 pointing: pan = -psi etc. only to first order, so solve it exactly.
    """
    mount, dt, worst = PanTilt(lag=0.08, stabilisation=stabilisation), 0.005, 0.0
    pan = tilt = 0.0
    R_RB = np.eye(3)
    for k in range(800):
        t = k * dt
        w = np.array([0.15 * math.sin(2.0 * t), 0.10 * math.sin(3.0 * t + 1.0), 0.20 * math.cos(1.5 * t)])
        if k % round(period / dt) == 0:
            x_B = R_RB.T @ [1.0, 0.0, 0.0]
            pan, tilt = math.atan2(x_B[1], x_B[0]), math.asin(-x_B[2])
        mount.step(pan, tilt, w, dt)
        angle = float(np.linalg.norm(w)) * dt
        axis = w / np.linalg.norm(w)
        K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        R_RB = R_RB @ (np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K)
        axis_R = R_RB @ so3.camera_from_body(mount.pan, mount.tilt)[2]
        if t > 1.0:
            worst = max(worst, math.acos(min(1.0, axis_R[0])))
    return worst


def test_stabilisation_rejects_the_bodys_rotation() -> None:
    plain, default, perfect = (fixation_error(k) for k in (0.0, 0.95, 1.0))
    assert plain > math.radians(1.0)  # about rate times (lag + half a period)
    # What is left is the command's age, 60 ms of staircase through an 80 ms lag.
    assert default < 0.45 * plain
    assert perfect < default


@pytest.mark.parametrize("k", [0.0, 0.95, 1.0])
def test_stabilisation_shrinks_the_lag_by_its_gain(k: float) -> None:
    """Commands that follow a turning body: none leaves rate x lag, perfect feedback leaves nothing."""
    rate, dt, lag = 0.1, 0.001, 0.08
    mount = PanTilt(lag=lag, stabilisation=k)
    for i in range(2000):
        mount.step(-rate * i * dt, 0.0, np.array([0.0, 0.0, rate]), dt)
    assert mount.pan + rate * 2000 * dt == pytest.approx((1.0 - k) * rate * lag, rel=0.01, abs=1e-9)


@pytest.mark.parametrize(("pan", "tilt"), [(0.4, 0.0), (0.0, 0.5), (-0.5, -0.3)])
def test_rates_cancel_exactly_about_both_axes(pan: float, tilt: float) -> None:
    """The camera's own rate about its x and y axes is zero under perfect feedback; only its roll remains."""
    mount, w, dt = PanTilt(stabilisation=1.0, pan=pan, tilt=tilt), np.array([0.2, -0.1, 0.3]), 1e-6
    mount.step(pan, tilt, w, dt)
    R_CB = so3.camera_from_body(pan, tilt)
    w_C = R_CB @ (w + [0.0, 0.0, mount.pan_rate]) + [mount.tilt_rate, 0.0, 0.0]
    assert np.abs(w_C[:2]).max() < 1e-9
    assert abs(w_C[2]) > 0.05


@pytest.mark.parametrize(
    "bad",
    [{"lag": -0.1}, {"lag": math.nan}, {"rate_limit": 0.0}, {"stabilisation": 1.5}, {"tilt_limit": 1.6}, {"pan": 2.0}],
)
def test_bad_platforms_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="platform"):
        PanTilt(**bad)
