"""The fisheye's geometry, and its pictures of textured planes: edges where geometry puts them, noise as asked for."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from landing_sim.geometry import so3
from landing_sim.geometry.fisheye import NEAR, Fisheye
from landing_sim.noise import Noise
from landing_sim.sensors.faults import Faulty, Garbage
from landing_sim.sensors.fisheye import FisheyeCamera, FisheyeRenderer
from landing_sim.sensors.fisheye_render import SKY
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.signals import CameraTruth, Truth
from landing_sim.world.planes import Box, Scene, Shade, Sun, clutter
from landing_sim.world.planes_texture import texture

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


@pytest.mark.parametrize("size", [(0, 480, 200.0), (640, 480, -1.0), (640, 480, math.nan), (640, 480, 100.0)])
def test_refused(size: tuple[int, int, float]) -> None:
    with pytest.raises(ValueError, match="fisheye"):
        Fisheye(*size)


# ------------------------------------------------------------------------------------------------ the pictures

DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # R_CR of a level camera heading along x
BOX = Box(2.0, 0.3, yaw=0.3)


def attitude(phi: float, theta: float, psi: float) -> np.ndarray:
    """R_CR of a camera strapped below a body at these Euler angles [rad]."""
    return DOWN @ so3.from_euler(phi, theta, psi).T


@pytest.fixture(scope="module")
def textured() -> Scene:
    return Scene((BOX,), Noise(1, "scene"))


def plain(*boxes: Box, **settings: object) -> Scene:
    return Scene(boxes, Noise(1, "scene"), contrast=0.0, **settings)  # type: ignore[arg-type]


def light(scene: Scene, lens: Fisheye, p_RC: object, R_CR: np.ndarray = DOWN) -> np.ndarray:
    return FisheyeRenderer(lens, scene, 0.0, 1).light(np.asarray(p_RC, dtype=float), R_CR)


def rows_crossed(box: Box, lens: Fisheye, p: np.ndarray, R: np.ndarray) -> list[tuple[int, float]]:
    """Rows and the columns at which the box's upper edges cross their middles, where they cross steeply."""
    out = []
    corners = box.corners()
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        s = np.linspace(0.02, 0.98, 4001)[:, None]
        uv = lens.project((a + s * (b - a) - p) @ R.T)
        if abs(uv[-1, 1] - uv[0, 1]) < abs(uv[-1, 0] - uv[0, 0]):
            continue
        up = uv if uv[-1, 1] > uv[0, 1] else uv[::-1]
        rows = np.arange(math.ceil(up[0, 1]), math.floor(up[-1, 1]) + 1)
        out += [(int(r), float(u)) for r, u in zip(rows, np.interp(rows, up[:, 1], up[:, 0]))]
    return [(r, u) for r, u in out if 8 <= r < lens.height - 8 and 8.0 < u < lens.width - 9.0]


@pytest.mark.parametrize("lens", [FULL, HALF], ids=["640", "320"])
def test_edges_lie_where_geometry_puts_them(lens: Fisheye) -> None:
    """The grey along a row across an edge, summed, says where the edge is; from above a box no sides are seen."""
    scene = plain(BOX, tone=60.0)
    rng = np.random.default_rng(8)
    off = []
    for _ in range(12):
        p = np.array([2.0, 0.3, -0.14]) + [*(0.3 * rng.random(2) - 0.15), -0.3 - 0.7 * rng.random()]
        R = attitude(*(0.3 * rng.random(2) - 0.15), 2.0 * np.pi * rng.random())
        picture = light(scene, lens, p, R)
        for row, u in rows_crossed(BOX, lens, p, R):
            first = round(u) - 4
            part = picture[row, first : first + 9].astype(float)
            left, right = part[0], part[-1]
            if {round(float(left)), round(float(right))} != {60, 150}:
                continue  # another edge is near
            found = first - 0.5 + float(np.sum(part - right) / (left - right))
            off.append(found - u)
    assert len(off) > 500
    assert abs(np.mean(off)) < 0.01
    assert np.std(off) < 0.06


def test_what_hides_what() -> None:
    """Every pixel shows the surface that one comes to first, going along its ray in steps of a millimetre."""
    boxes = (
        Box(0.6, 0.2, 0.4, 0.5, 0.4, 0.5, tone=200.0),
        Box(0.7, -0.5, -0.7, 0.3, 0.6, 0.2, tone=160.0),
        Box(-0.3, 0.5, 1.0, 0.5, 0.5, 0.25, slope=(0.4, 0.1), tone=240.0),
    )
    scene = plain(*boxes, tone=20.0)
    lens = Fisheye(64, 48, 26.19)
    p, R = np.array([0.3, 0.0, -0.9]), attitude(0.1, -0.1, 0.4)
    picture = light(scene, lens, p, R)
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    d = lens.rays(np.stack([u, v], axis=-1)) @ R
    tone = np.where(d[..., 2] > 0.0, scene.tone, SKY)
    going = d[..., 2] > -0.5
    for t in np.arange(0.001, 4.0, 0.001):
        at = p + t * d
        for box in boxes:
            c, s = math.cos(box.yaw), math.sin(box.yaw)
            x, y = at[..., 0] - box.x, at[..., 1] - box.y
            a, b = c * x + s * y, c * y - s * x
            top = box.height + box.slope[0] * a + box.slope[1] * b
            inside = (abs(a) < 0.5 * box.length) & (abs(b) < 0.5 * box.width) & (-at[..., 2] < top) & (at[..., 2] < 0)
            by_top = top + at[..., 2] < 0.0025
            tone[inside & going] = np.where(by_top, box.tone, -box.tone)[inside & going]
            going &= ~inside
        going &= at[..., 2] < 0.0
    sides = np.outer([b.tone for b in boxes], [0.62, 0.74, 0.56, 0.68]).ravel()
    right = np.where(tone >= 0.0, abs(picture - tone) < 0.5, np.min(abs(picture[..., None] - sides), axis=-1) < 0.5)
    inner = np.ones_like(right)  # where nothing else is next to it
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(tone, step, axis) == tone
    assert right[inner].mean() > 0.995
    for box in boxes:  # tops and sides are all there
        assert (tone[inner] == box.tone).sum() > 20
        assert (tone[inner] == -box.tone).sum() > 3


def test_a_near_pixel_is_its_texel(textured: Scene) -> None:
    """By hand: from 0.2 m the pixel right of the middle by 30 deg shows y = 0.2 tan 30 deg, for the image's right is +y."""
    picture = light(textured, FULL, [-3.0, 1.0, -0.2])
    grid = textured.textures[0]
    for u, v in [(319, 239), (400, 240), (320, 160), (250, 300)]:
        x, y, z = FULL.rays(np.array([u, v], dtype=float))
        east, north = 1.0 + 0.2 * x / z, -3.0 - 0.2 * y / z
        j, i = east / grid.cell, north / grid.cell
        j0, i0 = math.floor(j), math.floor(i)
        s, r = i - i0, j - j0
        near = [float(grid.levels[0][(j0 + b) % 4096, (i0 + a) % 4096]) for b in (0, 1) for a in (0, 1)]
        value = (1 - r) * ((1 - s) * near[0] + s * near[1]) + r * ((1 - s) * near[2] + s * near[3])
        assert picture[v, u] == pytest.approx(textured.tone + value - 128.0, abs=0.05)


def test_far_texture_is_averaged(textured: Scene) -> None:
    """Against a camera of four times the pixels, averaged: what is left is less than the mottling, and has no bias."""
    p, R = [-1.0, 0.2, -2.0], attitude(0.05, 0.1, 0.7)
    fine = light(textured, Fisheye(1280, 960, 523.8), p, R).reshape(240, 4, 320, 4).mean(axis=(1, 3))
    off = light(textured, HALF, p, R) - fine
    assert abs(off.mean()) < 0.2
    assert off.std() < 0.35 * fine.std()


def test_contrast_scales_the_texture_only(textured: Scene) -> None:
    half = Scene((BOX,), Noise(1, "scene"), contrast=0.5)
    whole, faint = (light(s, HALF, [1.5, 0.0, -1.0]) for s in (textured, half))
    bare = light(plain(BOX), HALF, [1.5, 0.0, -1.0])
    assert faint - bare == pytest.approx(0.5 * (whole - bare), abs=0.01)
    assert (whole - bare).std() == pytest.approx(30.0, abs=6.0)


def test_noise_is_as_asked_and_the_same_again(textured: Scene) -> None:
    p = np.array([1.5, 0.0, -1.0])
    eye = FisheyeRenderer(HALF, textured, 4.0, Noise(3, "pixels").key())
    one, two = (eye.frame(p, DOWN, i).full() for i in (5, 6))
    off = one.astype(float) - eye.light(p, DOWN)
    assert off.std() == pytest.approx(math.hypot(4.0, math.sqrt(1.0 / 12.0)), rel=0.02)
    assert off.mean() == pytest.approx(0.0, abs=0.05)
    assert np.corrcoef(off.ravel(), (two - eye.light(p, DOWN)).ravel())[0, 1] == pytest.approx(0.0, abs=0.02)
    again = FisheyeRenderer(HALF, Scene((BOX,), Noise(1, "scene")), 4.0, Noise(3, "pixels").key())
    frame = again.frame(p, DOWN, 5)
    assert np.array_equal(frame.full(), one)
    assert np.array_equal(frame.window(40, 30, 16, 12), one[30:42, 40:56])
    assert np.array_equal(frame.windows(np.array([[40, 30], [0, 0]]), 16, 12)[0], one[30:42, 40:56])
    with pytest.raises(ValueError, match="does not lie inside"):
        frame.window(310, 0, 16, 12)
    assert not np.array_equal(FisheyeRenderer(HALF, textured, 4.0, 7).frame(p, DOWN, 5).full(), one)


def test_a_shadow_by_hand() -> None:
    """Under a sun of 45 deg standing behind the start, a box of half a metre shades half a metre of ground beyond it."""
    scene = plain(Box(1.0, 0.0, length=0.4, width=0.4, height=0.5), sun=Sun(math.radians(45.0), math.pi), tone=100.0)
    lens = Fisheye(321, 241, 130.95)
    picture = light(scene, lens, [1.5, 0.0, -2.0])
    for x, tone in [(1.25, 45.0), (1.65, 45.0), (1.75, 100.0)]:
        u, v = np.rint(lens.project(DOWN @ [x - 1.5, 0.0, 2.0])).astype(int)
        assert picture[v, u] == pytest.approx(tone, abs=0.5)


def test_heights() -> None:
    """By hand: a metre box turned by 90 deg whose top rises 0.2 per metre along its own x, R's y."""
    scene = plain(Box(1.0, 2.0, math.pi / 2, 1.0, 0.6, 0.3, slope=(0.2, 0.0)), Box(3.0, 0.0))
    found = [scene.height(*at) for at in [(1.0, 2.0), (1.0, 2.4), (1.29, 2.0), (1.31, 2.0), (3.0, 0.28), (0.0, 0.0)]]
    assert found == pytest.approx([0.3, 0.38, 0.3, 0.0, 0.14, 0.0])


def test_clutter_is_apart_and_the_same_again() -> None:
    boxes, shades = clutter(Noise(5, "clutter"), 8, (0.0, 4.0, -2.0, 2.0), (BOX,))
    assert len(boxes) == len(shades) == 8
    assert (boxes, shades) == clutter(Noise(5, "clutter"), 8, (0.0, 4.0, -2.0, 2.0), (BOX,))
    for i, a in enumerate(boxes):
        for b in (*boxes[:i], BOX):
            assert math.hypot(a.x - b.x, a.y - b.y) > 0.5 * (
                math.hypot(a.length, a.width) + math.hypot(b.length, b.width)
            )
    with pytest.raises(ValueError, match="do not fit"):
        clutter(Noise(5, "clutter"), 40, (0.0, 1.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Box(0.0, 0.0, height=0.0), "height > 0"),
        (lambda: Box(0.0, 0.0, height=0.1, slope=(0.5, 0.0)), "below the ground"),
        (lambda: Shade(((0.0, 0.0), (1.0, 0.0))), "three corners"),
        (lambda: Shade(((0.0, 0.0), (1.0, 0.0), (0.2, 0.2), (0.0, 1.0))), "convex"),
        (lambda: Sun(0.0), "horizon"),
        (lambda: plain(tone=math.nan), "finite tone"),
        (lambda: texture(Noise(1, "t"), 100, 0.01), "power of two"),
        (lambda: texture(Noise(1, "t"), 64, 0.0), "cell must be"),
        (lambda: FisheyeRenderer(HALF, plain(), -1.0, 1), "noise must be"),
        (lambda: FisheyeRenderer(HALF, plain(), 1.0, 1).frame(np.array([0.0, 0.0, 0.1]), DOWN, 0), "below the ground"),
        (lambda: FisheyeRenderer(HALF, plain(), 1.0, 1).frame(np.array([0.0, 0.0, np.nan]), DOWN, 0), "not finite"),
    ],
)
def test_mistakes_are_told(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


# -------------------------------------------------------------------------------------------------- the sensor


def test_the_sensor_counts_its_frames_and_can_fail() -> None:
    eye = FisheyeRenderer(HALF, plain(BOX), 2.0, 1)
    pose = CameraTruth(np.array([0.0, 0.0, -1.0]), DOWN, 0.0, 0.0)
    camera = FisheyeCamera(eye, prompt())
    samples = [camera.sense(truth_at(t), pose) for t in (0.0, 0.07)]
    assert [s.data.index for s in samples] == [0, 1]
    assert [s.t_arrival for s in samples] == pytest.approx([0.15, 0.22])
    assert samples[0].data.frame.full().shape == (240, 320)
    broken = Faulty(FisheyeCamera(eye, prompt()), Garbage(), Noise(1, "fault"))
    sample = broken.sense(truth_at(0.0), pose)
    assert sample is not None and sample.data.frame.full().std() > 60.0
    with pytest.raises(ValueError, match="period"):
        FisheyeCamera(eye, prompt(), period=0.0)


def prompt() -> Latency:
    return Latency(LatencyConfig(0.15, 0.0, 0.0), Noise(1, "camera latency"))


def truth_at(t: float) -> Truth:
    three = np.zeros(3)
    flags = np.zeros(3, bool)
    return Truth(0, t, three, np.eye(3), three, three, three, three, 0.0, 0.0, 0.0, np.zeros(4), 0.0, three, flags, 1.0)
