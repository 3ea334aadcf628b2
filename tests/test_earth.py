"""The WGS84 Earth and the runway's frame on it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.geometry.earth import RunwayFrame, ecef_to_geodetic, geodetic_to_ecef, ned_from_ecef

FRAME = RunwayFrame(math.radians(52.3192), math.radians(10.5561), 89.0, math.radians(263.0))


def test_known_points() -> None:
    assert geodetic_to_ecef(0.0, 0.0, 0.0) == pytest.approx([6378137.0, 0.0, 0.0], abs=1e-9)
    assert geodetic_to_ecef(math.pi / 2, 0.0, 100.0) == pytest.approx([0.0, 0.0, 6356752.314245 + 100.0], abs=1e-5)
    # 45 N, 90 E by hand: N = a / sqrt(1 - e2 / 2) = 6388838.290; y = N cos 45, z = N (1 - e2) sin 45
    assert geodetic_to_ecef(math.pi / 4, math.pi / 2, 0.0) == pytest.approx([0.0, 4517590.879, 4487348.409], abs=2e-3)


def test_geodetic_round_trip() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        lat, lon, h = rng.uniform(-1.57, 1.57), rng.uniform(-3.14, 3.14), rng.uniform(-500.0, 20e3)
        back = ecef_to_geodetic(geodetic_to_ecef(lat, lon, h))
        assert back[:2] == pytest.approx((lat, lon), abs=1e-13)
        assert back[2] == pytest.approx(h, abs=5e-9)


def test_frame_is_level_at_the_threshold_and_points_along_the_heading() -> None:
    assert FRAME.geodetic_to_R(FRAME.latitude, FRAME.longitude, 99.0) == pytest.approx([0.0, 0.0, -10.0], abs=1e-8)
    R_RN = FRAME.R_RN(FRAME.latitude, FRAME.longitude)
    north, east = math.cos(FRAME.heading), math.sin(FRAME.heading)
    assert R_RN[0] == pytest.approx([north, east, 0.0], abs=1e-12)
    assert R_RN[2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert np.linalg.det(R_RN) == pytest.approx(1.0)


def test_the_earth_curves_away_below_the_tangent_plane() -> None:
    """2 m at 5 km, and the vertical turns 0.045 degrees."""
    lat, lon, h = FRAME.R_to_geodetic(np.array([5000.0, 0.0, 0.0]))
    assert h - FRAME.elevation == pytest.approx(5000.0**2 / (2 * 6.38e6), rel=0.01)
    tilt = math.acos(FRAME.R_RN(lat, lon)[2, 2])
    assert math.degrees(tilt) == pytest.approx(0.045, abs=0.001)


def test_runway_position_agrees_with_pymap3d() -> None:
    pymap3d = pytest.importorskip("pymap3d")
    rng = np.random.default_rng(2)
    c, s = math.cos(FRAME.heading), math.sin(FRAME.heading)
    place = (math.degrees(FRAME.latitude), math.degrees(FRAME.longitude), FRAME.elevation)
    for _ in range(50):
        p_R = rng.uniform(-1.0, 1.0, 3) * [9000.0, 5000.0, 800.0]
        lat, lon, h = FRAME.R_to_geodetic(p_R)
        n, e, d = pymap3d.geodetic2ned(math.degrees(lat), math.degrees(lon), h, *place)
        assert [c * n + s * e, -s * n + c * e, d] == pytest.approx(p_R.tolist(), abs=1e-6)
        assert FRAME.geodetic_to_R(lat, lon, h) == pytest.approx(p_R, abs=1e-7)


def test_local_frames_differ_by_the_convergence_of_meridians() -> None:
    lat, lon, _ = FRAME.R_to_geodetic(np.array([0.0, 3000.0, 0.0]))
    R_RN = FRAME.R_RN(lat, lon)
    turned = math.atan2(R_RN[1, 0], R_RN[0, 0]) + FRAME.heading
    expected = (lon - FRAME.longitude) * math.sin(FRAME.latitude)
    assert math.remainder(turned + expected, math.tau) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("latitude", "heading"), [(math.nan, 0.0), (1.7, 0.0), (0.5, math.inf)])
def test_bad_places_are_refused(latitude: float, heading: float) -> None:
    with pytest.raises(ValueError, match=r"finite|beyond the poles"):
        RunwayFrame(latitude, 0.0, 0.0, heading)


def test_ned_axes() -> None:
    R_NE = ned_from_ecef(0.0, 0.0)  # off Africa: north is z, east is y, down is -x
    np.testing.assert_allclose(R_NE, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], atol=1e-15)
