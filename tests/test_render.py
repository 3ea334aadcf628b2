"""Pictures: edges where geometry puts them, the same pixels whatever is asked for, noise that is noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landing_sim.geometry import runway_image, so3
from landing_sim.geometry.pinhole import Intrinsics, project
from landing_sim.noise import Noise
from landing_sim.sensors.render import RENDERERS, Optics, RenderedFrame, Renderer, render_frame
from landing_sim.signals import CameraTruth
from landing_sim.types import Array
from landing_sim.world.runway import GRASS, PAINT, SKY, SURFACE, Greys, Runway, Taxiway

CAMERA = Intrinsics.centred(512, 512, 2000.0)
SMALL = Intrinsics.centred(150, 100, 160.0)  # wide, and no multiple of any block
CLEAN = Optics(noise=0.0)
BARE = Runway(painted=False)
FEATURES = [runway_image.LEFT, runway_image.RIGHT, runway_image.THRESHOLD, runway_image.HORIZON]


def pose(
    x: float, y: float, height: float, phi: float = 0.0, theta: float = 0.0, psi: float = 0.0, tilt: float = 0.0
) -> CameraTruth:
    R_CR = so3.camera_from_body(0.0, tilt) @ so3.from_euler(phi, theta, psi).T
    return CameraTruth(np.array([x, y, -height]), np.ascontiguousarray(R_CR), 0.0, tilt)


def flight(n: int, seed: int) -> list[CameraTruth]:
    """Poses of a landing: from 950 m out, over the threshold, along the runway."""
    rng = np.random.default_rng(seed)
    out = []
    for x in np.linspace(-950.0, 600.0, n):
        height = max(2.0, 51.0 * -x / 950.0) + rng.uniform(0.0, 0.3)
        y = rng.uniform(-0.03, 0.03) * max(-x, 100.0)
        out.append(
            pose(x, y, height, rng.uniform(-0.2, 0.2), rng.uniform(-0.03, 0.02), -y / 2000 + rng.normal() * 0.02)
        )
    return out


# ------------------------------------------------------------------------------ edges against closed-form geometry


def edge_errors(frame: RenderedFrame, view: CameraTruth, runway: Runway, feature: int) -> Array:
    """Displacement of the drawn edge from geometry [px], along the edge's normal, > 0 outwards (upwards for the horizon).

    Straight numerical integration of grey levels along a row or column across the edge; nothing of the renderer.
    Places near a corner, or where the two sides are not clean, are skipped.
    """
    image, greys, half = frame.full().astype(float), runway.greys, 7
    bright, dark = (greys.sky if feature == runway_image.HORIZON else greys.surface), greys.grass
    out = []
    corners = project(runway.corners() @ view.R_CR.T - view.R_CR @ view.p_RC, CAMERA)
    azimuth0 = math.atan2(view.R_CR[2, 1], view.R_CR[2, 0])
    for k in np.linspace(20, 490, 60):
        azimuth = azimuth0 + math.atan((k - CAMERA.cx) / CAMERA.f)
        n = runway_image.plane_normal(feature, view.p_RC, runway.width, runway.slope, azimuth)
        l = runway_image.image_line(n, view.R_CR, CAMERA.f, CAMERA.cx, CAMERA.cy)
        steep = abs(l[0]) > abs(l[1])  # then look along rows, else along columns
        fixed = round(k)
        at = -((l[1] if steep else l[0]) * fixed + l[2]) / (l[0] if steep else l[1])
        middle = round(at) if abs(at) < 1e4 else -1
        place = np.array([at, fixed] if steep else [fixed, at])
        near_corner = np.nanmin(np.hypot(*(corners - place).T), initial=np.inf) < 16.0
        if not half < middle < 511 - half or near_corner:
            continue
        span = slice(middle - half, middle + half + 1)
        profile = image[fixed, span] if steep else image[span, fixed]
        if profile[0] > profile[-1]:
            outward = 1.0  # bright comes first: growing means larger coordinates
        else:
            profile, outward = profile[::-1], -1.0
        if not (np.ptp(profile[:3]) <= 1 and np.ptp(profile[-3:]) <= 1):
            continue
        if abs(profile[0] - bright) > 1 or abs(profile[-1] - dark) > 1 or profile.max() > bright + 1:
            continue
        size = float(np.sum((profile - dark) / (bright - dark)))
        found = middle + outward * (-half - 0.5 + size)
        cosine = abs(l[0] if steep else l[1]) / math.hypot(l[0], l[1])
        out.append(outward * (found - at) * cosine)
    return np.array(out)


def collect(optics: Optics, runway: Runway, feature: int, n: int = 40) -> Array:
    errors = []
    for view in flight(n, seed=1):
        errors.append(edge_errors(render_frame(view, CAMERA, runway, optics), view, runway, feature))
    return np.concatenate(errors)


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("runway", [BARE, Runway(painted=False, slope=0.01, width=45.0)], ids=["level", "sloping"])
def test_edges_lie_where_geometry_puts_them(feature: int, runway: Runway) -> None:
    if feature == runway_image.HORIZON and runway.slope > 0.0:
        pytest.skip("a runway that rises hides the horizon")
    errors = collect(CLEAN, runway, feature)
    assert len(errors) > 100
    assert abs(errors.mean()) < 0.01
    # One row of 15 rounded pixels: 0.29 * sqrt(15) / contrast 55 = 0.02 px of quantisation alone.
    assert np.sqrt(np.mean(errors**2)) < 0.03
    assert np.abs(errors).max() < 0.1


def test_border_of_a_painted_runway_is_as_good() -> None:
    for feature in (runway_image.LEFT, runway_image.RIGHT):
        errors = collect(CLEAN, Runway(), feature)
        assert len(errors) > 100
        assert abs(errors.mean()) < 0.01
        assert np.abs(errors).max() < 0.1


@pytest.mark.parametrize(("renderer", "least", "most"), [("line_aa", 0.6, 0.8), ("line_8", 0.4, 0.65)])
def test_opencv_edges_grow_outwards(renderer: str, least: float, most: float) -> None:
    """The control: OpenCV's own drawing is biased, measured by the very same ruler."""
    for feature in (runway_image.LEFT, runway_image.RIGHT, runway_image.THRESHOLD):
        errors = collect(Optics(noise=0.0, renderer=renderer), BARE, feature)
        assert len(errors) > 100
        assert least < errors.mean() < most


def test_edge_profile_is_the_blurred_step() -> None:
    """Straight down on the left border: grey levels against Phi by hand."""
    view = pose(100.0, -14.5, 40.0, theta=-math.pi / 2)
    camera = Intrinsics.centred(101, 101, 1000.0)
    row = render_frame(view, camera, BARE, Optics(noise=0.0, blur=1.3)).full()[50].astype(float)
    u = np.arange(101) - 50.0
    expected = 90.0 + 55.0 * np.array([0.5 * math.erfc(-x / 1.3 / math.sqrt(2.0)) for x in u])
    assert np.abs(row - expected).max() <= 0.51


# --------------------------------------------------------------------------------------- against a ray caster


def cast(view: CameraTruth, camera: Intrinsics, runway: Runway, over: int = 1) -> np.ndarray:
    """(height * over, width * over) materials seen through sub-pixel centres, by intersecting rays with the ground."""
    us = (np.arange(camera.width * over) + 0.5) / over - 0.5
    vs = (np.arange(camera.height * over) + 0.5) / over - 0.5
    u, v = np.meshgrid(us, vs)
    rays = np.stack([(u - camera.cx) / camera.f, (v - camera.cy) / camera.f, np.ones_like(u)], axis=-1) @ view.R_CR
    dip = runway_image.horizon_dip(-view.p_RC[2])
    seen = np.where(rays[..., 2] > math.sin(dip) * np.linalg.norm(rays, axis=-1), GRASS, SKY)
    normal = np.array([math.sin(runway.slope), 0.0, math.cos(runway.slope)])
    with np.errstate(all="ignore"):
        reach = -(view.p_RC @ normal) / (rays @ normal)
        hit = view.p_RC + reach[..., None] * rays
    x, y = hit[..., 0] / math.cos(runway.slope), hit[..., 1]
    ahead = reach > 0.0
    seen[ahead & (x >= 0.0) & (x <= runway.length) & (np.abs(y) <= runway.width / 2)] = SURFACE
    for m in runway.markings:
        seen[ahead & (x >= m.x0) & (x <= m.x1) & (y >= m.y0) & (y <= m.y1)] = PAINT
    return seen


poses = st.builds(
    pose,
    x=st.floats(-300.0, 1900.0),
    y=st.floats(-60.0, 60.0),
    height=st.floats(0.3, 120.0),
    phi=st.floats(-math.pi, math.pi),
    theta=st.floats(-1.5, 1.5),
    psi=st.floats(-math.pi, math.pi),
)


@settings(max_examples=150, deadline=None)
@given(view=poses, slope=st.sampled_from([0.0, 0.02, -0.02]))
def test_interiors_agree_with_a_ray_caster(view: CameraTruth, slope: float) -> None:
    """Any attitude and place, corners behind the camera included: pixels far from edges have the right material."""
    runway = Runway(slope=slope)
    if -view.p_RC[2] < 0.3 + max(0.0, view.p_RC[0]) * math.tan(slope):
        return  # the camera is under the hill
    seen = cast(view, SMALL, runway)
    windows = np.lib.stride_tricks.sliding_window_view(seen, (9, 9))
    pure = np.zeros(seen.shape, bool)
    pure[4:-4, 4:-4] = windows.min(axis=(2, 3)) == windows.max(axis=(2, 3))
    image = render_frame(view, SMALL, runway, CLEAN).full()
    expected = runway.greys.palette[seen]
    # A stripe thinner than a ray's spacing can hide between rays, but not with the contrast of an interior.
    wrong = np.abs(image[pure].astype(float) - expected[pure]) > 60.0 * 0.7
    assert not wrong.any()


@pytest.mark.parametrize(
    ("view", "most"),
    [(pose(-300.0, 2.0, 17.0, 0.05), 2.5), (pose(-60.0, 1.0, 5.0), 6.0), (pose(100.0, 0.5, 2.0, -0.03), 6.0),
     (pose(-950.0, -10.0, 51.0), 2.5), (pose(-3000.0, 5.0, 157.0, theta=-0.052), 2.0)],
    ids=["300 m", "60 m", "over the runway", "950 m", "3 km"],
)  # fmt: skip
def test_grey_levels_agree_with_a_supersampled_ray_caster(view: CameraTruth, most: float) -> None:
    """Thin stripes keep their contrast, and edges show through paint that is blurred over them.

    The exact picture against 256 rays a pixel, blurred by brute force.
    """
    import cv2

    runway, over = Runway(), 16
    middle = Intrinsics(80, 80, 2000.0, 40.0 - 0.3, 25.0)
    image = render_frame(view, middle, runway, CLEAN).full().astype(float)
    fine = runway.greys.palette[cast(view, middle, runway, over)]
    fine = cv2.GaussianBlur(fine, (0, 0), math.sqrt(0.7**2 - 1.0 / 12.0) * over)  # averaging over the pixel adds 1/12
    expected = fine.reshape(80, over, 80, over).mean(axis=(1, 3))
    error = (image - expected)[4:-4, 4:-4]
    assert np.ptp(expected) > 50.0
    assert abs(error.mean()) < 0.1
    assert np.sqrt(np.mean(error**2)) < 0.8
    assert np.abs(error).max() < most


# ------------------------------------------------------------------------------------ windows, frames, determinism


@settings(max_examples=60, deadline=None)
@given(
    view=poses,
    corner=st.tuples(st.integers(0, 150 - 31), st.integers(0, 100 - 23)),
    renderer=st.sampled_from(RENDERERS),
    moving=st.booleans(),
)
def test_windows_are_cut_from_the_frame(
    view: CameraTruth, corner: tuple[int, int], renderer: str, moving: bool
) -> None:
    moving = moving and renderer == "exact"
    optics = Optics(renderer=renderer, gain=0.9, offset=3.3, exposure=0.01 if moving else 0.0)
    runway = Runway(taxiways=(Taxiway(200.0), Taxiway(400.0, side="left", flare=0.0)), greys=Greys(surface=144.7))
    v, w = np.array([50.0, 0.3, 2.0]), np.array([0.1, 0.7, -0.3])
    frame = Renderer(SMALL, runway, optics, key=5).frame(view.p_RC, view.R_CR, 3, v, w)
    corners = np.array([corner, (0, 0), (150 - 31, 100 - 23)])
    windows = frame.windows(corners, 31, 23)
    full = frame.full()
    for (u0, v0), window in zip(corners, windows, strict=True):
        assert np.array_equal(window, full[v0 : v0 + 23, u0 : u0 + 31])
    looked = np.array([[0, 0, 31, 23], [30, 22, 31, 23], [3, 7, 20, 11]])
    for window, wanted, (u0, v0, u1, v1) in zip(windows, frame.windows(corners, 31, 23, looked), looked, strict=True):
        assert np.array_equal(window[v0:v1, u0:u1], wanted[v0:v1, u0:u1])
    assert np.array_equal(frame.window(0, 0, 150, 100), full)
    assert np.array_equal(frame.window(*corner, 1, 1)[0, 0], full[corner[1], corner[0]])


@settings(max_examples=60, deadline=None)
@given(view=poses, seed=st.integers(0, 2**32 - 1), crowded=st.floats(0.05, 1.0))
def test_what_windows_share_is_the_same_in_all_of_them(view: CameraTruth, seed: int, crowded: float) -> None:
    """Two dozen that overlap, at the frame's corners too: joined into few blocks, or not, the pixels are the frame's."""
    rng = np.random.default_rng(seed)
    frame = render_frame(view, SMALL, Runway(), Optics(), key=6, index=2)
    place = rng.random((24, 2)) * crowded + rng.choice([0.0, 1.0 - crowded])
    corners = np.floor(place * (150 - 31 + 1, 100 - 23 + 1)).astype(np.int64)
    low = rng.integers(0, (31, 23), (24, 2))
    looked = np.hstack([low, rng.integers(low + 1, (32, 24))])
    for (u, v), (u0, v0, u1, v1), window in zip(corners, looked, frame.windows(corners, 31, 23, looked), strict=True):
        assert np.array_equal(window[v0:v1, u0:u1], frame.full()[v + v0 : v + v1, u + u0 : u + u1])


def test_windows_are_cut_from_the_frame_of_the_main_case() -> None:
    for view in flight(25, seed=3):
        frame = render_frame(view, CAMERA, Runway(), Optics(), key=11, index=7)
        assert np.array_equal(frame.window(0, 0, 512, 512), frame.full())
        assert np.array_equal(frame.window(201, 250, 41, 9), frame.full()[250:259, 201:242])


def test_a_frame_depends_on_pose_index_and_key_only() -> None:
    view, other = flight(2, seed=4)
    renderer = Renderer(CAMERA, Runway(), Optics(), key=99)
    frame = renderer.frame(view.p_RC, view.R_CR, 5)
    p, R = view.p_RC.copy(), view.R_CR.copy()
    renderer.frame(other.p_RC, other.R_CR, 6).full()
    view.p_RC[:] = 0.0  # the plant moves on; the frame must not
    again = render_frame(CameraTruth(p, R, 0.0, 0.0), CAMERA, Runway(), Optics(), key=99, index=5)
    assert np.array_equal(frame.full(), again.full())
    assert not np.array_equal(again.full(), renderer.frame(p, R, 6).full())


@pytest.mark.parametrize("renderer", RENDERERS)
def test_windows_outside_the_frame_are_refused(renderer: str) -> None:
    frame = render_frame(pose(-300.0, 0.0, 17.0), SMALL, optics=Optics(renderer=renderer))
    assert frame.windows(np.empty((0, 2), np.int64), 31, 31).shape == (0, 31, 31)
    for corner in [(-1, 0), (0, -1), (150 - 30, 0), (0, 100 - 30)]:
        with pytest.raises(ValueError, match="do not all lie in the 150x100 frame"):
            frame.window(*corner, 31, 31)


def test_the_camera_may_fly_anywhere() -> None:
    """Corners at, on and behind the camera's plane; on the ground; below it; straight down; far beyond."""
    views = [
        pose(0.0, 0.0, 2.0),
        pose(0.0, -14.5, 0.01),
        pose(100.0, 0.0, 0.0),
        pose(100.0, 0.0, -1.0),
        pose(100.0, 0.0, 30.0, theta=-math.pi / 2),
        pose(5000.0, 0.0, 100.0),
        pose(500.0, 0.0, 30.0, psi=math.pi),
        pose(-3e5, 0.0, 10000.0),
    ]
    for view in views:
        full = render_frame(view, SMALL, Runway(), CLEAN).full()
        assert full.max() <= 215
        assert full.min() >= 90
    assert render_frame(views[0], SMALL, Runway(), CLEAN).full()[70, 75] == 145
    assert render_frame(views[3], SMALL, Runway(), CLEAN).full()[-1].max() == 90  # from below only grass


# ------------------------------------------------------------------------------------------------ lens and sensor


def grass(index: int, optics: Optics, key: int = 1) -> np.ndarray:
    view = pose(-500.0, 0.0, 30.0, theta=-math.pi / 2)
    return render_frame(view, Intrinsics.centred(512, 512, 2000.0), Runway(), optics, key, index).full().astype(float)


def test_noise_is_white_and_gaussian() -> None:
    optics = Optics(noise=8.0)
    noise = (np.stack([grass(k, optics, Noise(3, "pixels").key()) for k in range(6)]) - 90.0) / 8.0
    n = noise.size
    sd = math.sqrt(1.0 + 1.0 / 12.0 / 64.0)  # rounding to whole grey levels
    assert abs(noise.mean()) < 5.0 / math.sqrt(n)
    assert abs(noise.std() - sd) < 5.0 / math.sqrt(2 * n)
    assert abs(np.mean(noise**3)) < 5.0 * math.sqrt(15.0 / n)
    assert abs(np.mean((noise / sd) ** 4) - 3.0) < 5.0 * math.sqrt(96.0 / n)
    for lag in [(0, 0, 1), (0, 0, 2), (0, 0, 4), (0, 1, 0), (0, 1, 1), (1, 0, 0), (3, 0, 0), (1, 1, 1), (0, 16, 0)]:
        a = noise[: 6 - lag[0], : 512 - lag[1], : 512 - lag[2]]
        b = noise[lag[0] :, lag[1] :, lag[2] :]
        assert abs(np.mean(a * b)) < 5.0 / math.sqrt(a.size), lag
    pixel = noise.mean(axis=0)
    assert abs(pixel.std() * math.sqrt(6) - 1.0) < 0.01  # no pattern that stays from frame to frame


def test_noise_of_other_keys_is_other_noise() -> None:
    a, b = grass(0, Optics(), key=1) - 90.0, grass(0, Optics(), key=2) - 90.0
    assert abs(np.mean(a * b)) / 16.0 < 5.0 / math.sqrt(a.size)


def test_lens_gain_offset_and_saturation() -> None:
    assert np.all(grass(0, Optics(noise=0.0, gain=0.5, offset=7.0)) == 52.0)
    assert np.all(grass(0, Optics(noise=0.0, gain=4.0)) == 255.0)
    assert np.all(grass(0, Optics(noise=0.0, offset=-200.0)) == 0.0)


def test_motion_blur_widens_an_edge_about_its_middle() -> None:
    view = pose(100.0, -14.5, 40.0, theta=-math.pi / 2)
    camera, v = Intrinsics.centred(101, 101, 1000.0), np.array([0.0, 20.0, 0.0])

    def moments(exposure: float) -> tuple[float, float]:
        optics = Optics(noise=0.0, blur=1.0, exposure=exposure)
        renderer = Renderer(camera, BARE, optics, 0)
        row = renderer.frame(view.p_RC, view.R_CR, 0, v, np.zeros(3)).full()[50].astype(float)
        density = np.diff(row) / 55.0
        u = np.arange(100) + 0.5 - 50.0
        mean = float(np.sum(u * density))
        return mean, float(np.sum((u - mean) ** 2 * density))

    still, moving = moments(0.0), moments(0.008)  # 20 m/s over 40 m at f = 1000 px: 4 px
    assert abs(moving[0] - still[0]) < 0.02
    steps = np.array([-1.5, -0.5, 0.5, 1.5])  # four instants 1 px apart
    assert moving[1] - still[1] == pytest.approx(np.mean(steps**2), abs=0.1)


# --------------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    "bad",
    [
        {"blur": 0.0},
        {"blur": math.nan},
        {"noise": -1.0},
        {"gain": 0.0},
        {"exposure": -0.1},
        {"renderer": "opengl"},
        {"renderer": "line_aa", "exposure": 0.01},
    ],
)
def test_bad_optics_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"optic|renderer"):
        Optics(**bad)


def test_bad_cameras_and_poses_are_refused() -> None:
    with pytest.raises(ValueError, match="focal length"):
        Renderer(Intrinsics.centred(512, 512, -1.0), Runway(), Optics(), 0)
    with pytest.raises(ValueError, match="not finite"):
        render_frame(pose(math.nan, 0.0, 10.0), SMALL)
    with pytest.raises(ValueError, match="needs the camera's velocity"):
        render_frame(pose(0.0, 0.0, 10.0), SMALL, optics=Optics(exposure=0.01))
