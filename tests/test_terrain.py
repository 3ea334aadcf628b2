"""The lunar plain: light and shadow, craters, one seed one Moon, and what it looks like in a picture."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.geometry import so3
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.noise import Noise
from landing_sim.sensors.optic_flow_eye import FWHM, Eye
from landing_sim.sensors.optic_flow_picture import TerrainFrame, picture
from landing_sim.world.terrain import LEVELS, SITE, Layer, Terrain, TerrainConfig, pyramid
from landing_sim.world.terrain_relief import DARK, Scale, lit, relief

CONFIG = TerrainConfig()


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return Terrain(CONFIG, Noise(1, "terrain"))


def light_of(heights: np.ndarray, elevation: float, azimuth: float, cell: float = 1.0) -> np.ndarray:
    out = np.empty_like(heights)
    lit(heights, cell, math.radians(elevation), math.radians(azimuth), out)
    return out


def test_level_ground_is_lit_evenly_and_slopes_by_lamberts_law() -> None:
    flat = np.zeros((32, 64), np.float32)
    assert light_of(flat, 20.0, 10.0) == pytest.approx(np.ones_like(flat))
    ramp = np.zeros((32, 64), np.float32)
    ramp[:, 20:40] = 0.1 * np.arange(20)  # rises along +x, towards the sun: it turns away
    n = np.array([-0.1, 0.0, 1.0]) / math.sqrt(1.01)
    sun = np.array([math.cos(0.5), 0.0, math.sin(0.5)])
    got = light_of(ramp, math.degrees(0.5), 0.0)[16, 30]
    assert got == pytest.approx(DARK + (1 - DARK) * float(n @ sun) / math.sin(0.5), rel=1e-5)


@pytest.mark.parametrize(("azimuth", "side"), [(0.0, -1), (180.0, 1)])
def test_shadow_is_as_long_as_the_sun_is_low(azimuth: float, side: int) -> None:
    """A wall of 5 m under a sun at 20 deg: 13.7 m of shadow, away from the sun."""
    wall = np.zeros((16, 128), np.float32)
    wall[:, 64] = 5.0
    light = light_of(wall, 20.0, azimuth)[8]
    dark = np.flatnonzero(light < 0.5)
    dark = dark[np.abs(dark - 64) > 1]
    assert len(dark) == pytest.approx(5.0 / math.tan(math.radians(20.0)) - 1.0, abs=1.5)
    assert (np.sign(dark - 64) == side).all()


def test_slanting_shadow_falls_to_the_side() -> None:
    post = np.zeros((128, 128), np.float32)
    post[62:66, 62:66] = 6.0
    light = light_of(post, 20.0, 35.0)
    j, i = np.nonzero(light < 0.3)
    far = np.argmax(np.hypot(j - 63.5, i - 63.5))
    assert math.degrees(math.atan2(j[far] - 63.5, i[far] - 63.5)) == pytest.approx(35.0 - 180.0, abs=12.0)


def test_the_large_crater_and_the_spared_site() -> None:
    scale = Scale(512, 1024, 2.0, 1e-6, 1, 200.0, 200.1, 0, 1.0)
    heights = relief(scale, Noise(3, "crater"), None, 40.0)
    assert float(heights.max() - heights.min()) == pytest.approx(48.0, abs=1.0)  # depth and rim
    spared = relief(Scale(256, 256, 2.0, 1e-6, 50, 20.0, 60.0, 0, 1.0), Noise(3, "crater"), (0.0, 1e3))
    assert float(np.ptp(spared)) < 0.1


def test_heights(terrain) -> None:
    """Deep somewhere, level on average at the site, which has neither."""
    base = terrain.layers[0].heights
    assert 30.0 < -float(base.min()) < 60.0
    x = np.linspace(-SITE, SITE, 200)
    site = np.array([terrain.height(float(a), 0.0) for a in x])
    assert abs(site.mean()) < 3.0 and np.ptp(site) < 15.0
    step = np.abs(np.diff([terrain.height(float(a), 5.0) for a in np.arange(0.0, 100.0, 0.05)]))
    assert step.max() < 0.2  # continuous


def test_same_seed_same_moon(terrain) -> None:
    again = Terrain(CONFIG, Noise(1, "terrain"))
    for a, b in zip(terrain.layers, again.layers):
        assert (a.heights == b.heights).all() and (a.light[0] == b.light[0]).all()
    scale = Scale(64, 64, 1.0, 0.02, 5, 3.0, 9.0, 5, 1.0)
    assert not np.array_equal(relief(scale, Noise(1, "terrain")), relief(scale, Noise(2, "terrain")))


def test_brightness_blurs_with_the_footprint(terrain) -> None:
    x, y = np.linspace(-800, 800, 300), np.zeros(300)
    spreads = [float(terrain.brightness(x, y, footprint).std()) for footprint in (0.005, 0.5, 5.0, 50.0)]
    assert spreads == sorted(spreads, reverse=True) and spreads[0] > 3.0 * spreads[-1]
    assert terrain.brightness(x, y, 20.0).mean() == pytest.approx(0.95, abs=0.1)


def test_sun_out_of_the_question() -> None:
    with pytest.raises(ValueError, match="above the horizon"):
        Terrain(TerrainConfig(elevation=0.0), Noise(1, "terrain"))
    with pytest.raises(ValueError, match="45 deg"):
        Terrain(TerrainConfig(azimuth=math.radians(90.0)), Noise(1, "terrain"))


def test_acceptance_of_a_receptor() -> None:
    """Across a black-and-white border, the slope of what it sees is a Gaussian of the width asked for."""
    step = np.ones((256, 256), np.float32)
    step[:, :128] = 0.0
    plain = np.ones((256, 256), np.float32)
    made = Terrain.__new__(Terrain)
    made.config = CONFIG
    zero = np.zeros((256, 256), np.float32)
    made.layers = tuple(
        Layer(cell, zero, pyramid(light)) for cell, light in ((0.4, step), (0.04, plain), (0.004, plain))
    )
    assert all(len(layer.light) == LEVELS for layer in made.layers)
    acceptance, H = math.radians(0.1), 1000.0
    eye = Eye(made, np.array([0.5 * math.pi]), acceptance)
    width = H * acceptance / FWHM
    seen = eye.between(np.array([-4 * width, 0, -H]), np.eye(3), np.array([4 * width, 0, -H]), np.eye(3), 400)[:, 0]
    x = np.linspace(-4, 4, 400)[:-1]
    slope = np.diff(seen)
    centre = float(np.sum(x * slope) / slope.sum())
    assert abs(centre) < 0.4
    assert math.sqrt(np.sum((x - centre) ** 2 * slope) / slope.sum()) == pytest.approx(1.0, abs=0.12)


def test_picture(terrain) -> None:
    """Black sky above, grey plain with shadows and sunlit slopes below; the frame's windows are its pixels."""
    camera = Intrinsics.centred(96, 72, 70.0)
    R_CR = so3.camera_from_body(0.0, math.radians(-15.0))
    p = np.array([-400.0, 0.0, -300.0])
    image = picture(terrain, camera, p, R_CR)
    assert (image[0] == 0).all() and 60 < np.median(image[40:]) < 130
    assert image[40:].min() < 30 < 130 < image[40:].max()
    frame = TerrainFrame(terrain, camera, p, R_CR, 96, 72)
    assert (frame.window(10, 30, 20, 8) == image[30:38, 10:30]).all()
    assert (frame.windows(np.array([[10, 30]]), 20, 8)[0] == image[30:38, 10:30]).all()
