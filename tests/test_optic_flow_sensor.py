"""The visual motion sensor on rendered ground: bias, spread, outliers, and what it must not say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.noise import Noise
from landing_sim.sensors.optic_flow import MotionSensor, MotionSensorConfig
from landing_sim.sensors.optic_flow_edges import EdgeConfig, EdgeTracker
from landing_sim.signals import CameraTruth, Truth
from landing_sim.world.terrain import Terrain, TerrainConfig

PERIOD = 0.02
NOWHERE = CameraTruth(np.zeros(3), np.eye(3), 0.0, 0.0)


@pytest.fixture(scope="module")
def table() -> Terrain:
    """The Moon's light on a table: the true flow is known exactly."""
    return Terrain(TerrainConfig(flat=True), Noise(5, "terrain"))


def pose(t: float, x: float, height: float) -> Truth:
    nothing, zero = np.zeros(3), np.zeros(3)
    p = np.array([x, 0.0, -height])
    return Truth(
        0, t, p, np.eye(3), zero, zero, zero, zero, 0.0, 0.0, 0.0, np.zeros(4), 0.0, nothing, nothing > 1.0, 0.0
    )


def rig(terrain: Terrain, speed_dps: float, height: float, seconds: float, **changes: float) -> np.ndarray:
    """[deg/s] everything that a sensor straight down says while it passes at a constant angular speed."""
    sensor = MotionSensor("flow", MotionSensorConfig(PERIOD, 0.5 * math.pi, **changes), terrain, Noise(1, "flow"))
    speed, said = math.radians(speed_dps) * height, []
    for k in range(round(seconds / PERIOD)):
        sample = sensor.sense(pose(k * PERIOD, -1500.0 + speed * k * PERIOD, height), NOWHERE)
        said += list(sample.data.flows) if sample is not None else []
    return np.degrees(said)


@pytest.mark.parametrize(("speed", "height"), [(1.0, 1200.0), (2.0, 400.0), (5.0, 300.0), (-3.0, 150.0), (15.0, 40.0)])
def test_constant_speed(table, speed: float, height: float) -> None:
    """Bias <= 2 %, robust spread <= 5 %, outliers <= 5 %."""
    flows = rig(table, speed, height, 15.0)
    assert len(flows) > 12
    error = flows / speed - 1.0
    assert abs(np.median(error)) <= 0.02
    assert 1.4826 * np.median(np.abs(error - np.median(error))) <= 0.05
    assert np.mean(np.abs(error) > 0.3) <= 0.05


def test_too_slow_is_invalid(table) -> None:
    """Below 0.5 deg/s it says nothing rather than guess; in between it is never far off."""
    assert len(rig(table, 0.25, 800.0, 20.0)) == 0
    slow = rig(table, 0.45, 800.0, 15.0)
    assert (np.abs(slow) >= 0.5).all() and (np.abs(slow) < 0.6).all()


def test_standing_still_is_invalid(table) -> None:
    assert len(rig(table, 0.0, 100.0, 10.0, noise=1.0)) == 0


def test_noise_costs_readings_before_it_costs_truth(table) -> None:
    quiet, noisy = rig(table, 2.0, 400.0, 15.0), rig(table, 2.0, 400.0, 15.0, noise=2.0)
    assert len(noisy) < len(quiet)
    assert np.mean(np.abs(noisy / 2.0 - 1.0) > 0.3) <= 0.05


def edges(intervals: np.ndarray, dt: float = 0.002) -> np.ndarray:
    """(n, 6) a bright bar that passes receptor i at 1 s + sum of the first i intervals; and again every second."""
    at = 1.0 + np.concatenate([[0.0], np.cumsum(intervals)])
    t = dt * np.arange(round(8.0 / dt))
    phase = (t[:, None] - at[None, :]) % 1.0
    return 80.0 + 60.0 * np.exp(-0.5 * ((phase - 0.2) / 0.04) ** 2)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_even_steps_are_a_speed_with_its_sign(direction: float) -> None:
    signals = edges(np.full(5, 0.03))[:, :: int(direction)]
    found = EdgeTracker(EdgeConfig(), 6, 0.002).feed(signals)
    assert len(found) >= 4
    assert [w for _, w in found] == pytest.approx([direction * math.radians(0.1) / 0.03] * len(found), rel=0.02)
    assert len(found) <= 2 * 7  # one for each border of each bar


def test_uneven_steps_are_nothing() -> None:
    assert EdgeTracker(EdgeConfig(), 6, 0.002).feed(edges(np.array([0.03, 0.07, 0.02, 0.06, 0.03]))) == []


def test_pieces_give_what_the_whole_gives() -> None:
    signals = edges(np.full(5, 0.02))
    whole = EdgeTracker(EdgeConfig(), 6, 0.002).feed(signals)
    pieces = EdgeTracker(EdgeConfig(), 6, 0.002)
    found = [e for k in range(0, len(signals), 10) for e in pieces.feed(signals[k : k + 10])]
    assert len(whole) > 5
    assert np.array(found) == pytest.approx(np.array(whole))


def test_periods_that_do_not_fit(table) -> None:
    with pytest.raises(ValueError, match="whole number of samples"):
        MotionSensor("flow", MotionSensorConfig(0.0111, 1.5), table, Noise(1, "flow"))
