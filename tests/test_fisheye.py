"""The fisheye's geometry, and its pictures of textured planes: edges where geometry puts them, noise as asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.geometry.fisheye import NEAR, Fisheye

FULL = Fisheye(640, 480, 261.9)
HALF = Fisheye(320, 240, 130.95)


def directions(n: int = 400, widest: float = 2.5) -> np.ndarray:
    rng = np.random.default_rng(4)
    theta, turn, length = widest * rng.random(n), 2.0 * np.pi * rng.random(n), 0.3 + 3.0 * rng.random(n)
    sides = np.sin(theta) * np.array([np.cos(turn), np.sin(turn)])
    return np.column_stack([*sides, np.cos(theta)]) * length[:, None]


def test_by_hand() -> None:
    """45 deg to the right is f pi / 4 right of the middle; straight to the side, f pi / 2."""
    uv = FULL.project(np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 1.0], [0.0, -3.0, 0.0]]))
    assert uv == pytest.approx(
        np.array([[319.5, 239.5], [319.5 + 261.9 * math.pi / 4, 239.5], [319.5, 239.5 - 261.9 * math.pi / 2]])
    )
    assert FULL.rays(np.array([319.5 + 261.9 * math.radians(30.0), 239.5])) == pytest.approx(
        [0.5, 0.0, math.cos(math.radians(30.0))]
    )


def test_half_the_width_is_seventy_degrees() -> None:
    x, _, z = FULL.rays(np.array([639.5, 239.5]))  # the edge of the outermost pixel
    assert math.degrees(math.atan2(x, z)) == pytest.approx(70.0, abs=0.05)


def test_there_and_back() -> None:
    p = directions()
    unit = p / np.linalg.norm(p, axis=1)[:, None]
    assert FULL.rays(FULL.project(p)) == pytest.approx(unit, abs=1e-12)
    assert FULL.rays(FULL.project(p.reshape(20, 20, 3))).shape == (20, 20, 3)


def test_jacobian_is_the_derivative() -> None:
    p = np.vstack([directions(), [[0.0, 0.0, 1.3], [1e-6, -2e-6, 0.7], [2e-5, 1e-5, 1.0]]])
    J = FULL.jacobian(p)
    h = 1e-6
    for k in range(3):
        step = np.zeros(3)
        step[k] = h
        slope = (FULL.project(p + step) - FULL.project(p - step)) / (2.0 * h)
        assert J[..., k] == pytest.approx(slope, abs=2e-5 * FULL.focal)


def test_no_step_where_the_series_ends() -> None:
    p = np.array([[NEAR * (1.0 - 1e-9), 0.0, 1.0], [NEAR * (1.0 + 1e-9), 0.0, 1.0]])
    assert np.ptp(FULL.project(p)[:, 0]) < 1e-9
    assert np.ptp(FULL.jacobian(p), axis=0) == pytest.approx(np.zeros((2, 3)), abs=1e-3)


def test_nothing_straight_behind() -> None:
    assert np.isnan(FULL.project(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))).all()


def test_inside() -> None:
    uv = np.array([[0.0, 0.0], [639.0, 479.0], [639.1, 5.0], [5.0, -0.1], [7.9, 100.0]])
    assert FULL.inside(uv).tolist() == [True, True, False, False, True]
    assert FULL.inside(uv, 8.0).tolist() == [False] * 5


def test_half_size_sees_the_same() -> None:
    assert FULL.resized(0.5) == HALF


@pytest.mark.parametrize("size", [(0, 480, 200.0), (640, 480, -1.0), (640, 480, math.nan), (640, 480, 100.0)])
def test_refused(size: tuple[int, int, float]) -> None:
    with pytest.raises(ValueError, match="fisheye"):
        Fisheye(*size)
