"""The landing-place detector: planes of two views by hand, what is accepted over which scene, and what is refused why.

Features are drawn from the scenes' geometry, hidden where boxes hide them, with noise, mismatches and dropped frames.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from landing_sim.geometry import so3
from landing_sim.geometry.fisheye import Fisheye
from landing_sim.noise import Noise
from landing_sim.vision.landing_place import DetectorSettings, LandingPlaceDetector, Look
from landing_sim.vision.landing_place_planes import (
    Plane,
    aligned,
    aligned_along,
    homography,
    misalignment,
    plane_of,
)
from landing_sim.vision.landing_place_pool import Limits, Pool, Refusal, WayPoint
from landing_sim.vision.landing_place_top import (
    Rectangle,
    foreign,
    gaps,
    halfway,
    in_view,
    on_level,
    patches,
    rectangle,
    uncertainty,
)
from landing_sim.vision.landing_place_views import Pair, View, Views
from landing_sim.world.planes import Box, clutter

DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
FULL, HALF = Fisheye(640, 480, 261.9), Fisheye(320, 240, 130.95)
BOX = Box(1.4, 0.1, 0.3)
DENSITY = 110.0  # [1/m^2] features below the way flown: as many on the box as the localisation finds, 25 to 40


# ------------------------------------------------------------------------------------------------ what is seen


def features(rng: np.random.Generator, boxes: Sequence[Box], x: tuple[float, float], y: float = 1.6) -> np.ndarray:
    """(n, 3) [m] on the ground, the boxes' tops and their sides; fewer far from the way."""
    n = rng.poisson(DENSITY * (x[1] - x[0]) * 2.0 * y)
    ground = np.column_stack([rng.uniform(*x, n), rng.uniform(-y, y, n), np.zeros(n)])
    ground = ground[rng.random(n) < (1.0 + ground[:, 1] ** 2) ** -1.5]
    out = [np.array([q for q in ground if all(b.top(q[0], q[1]) == -math.inf for b in boxes)])]
    for b in boxes:
        n, around = (
            rng.poisson(DENSITY * b.length * b.width),
            rng.poisson(DENSITY * b.height * 2.0 * (b.length + b.width)),
        )
        u, v = (rng.uniform(-0.5, 0.5, n + around) * side for side in (b.length, b.width))
        k = rng.integers(0, 4, n + around)
        side = np.arange(n + around) >= n
        u = np.where(side & (k < 2), np.where(k == 0, -0.5, 0.5) * b.length, u)
        v = np.where(side & (k > 1), np.where(k == 2, -0.5, 0.5) * b.width, v)
        top = b.height + b.slope[0] * u + b.slope[1] * v
        c, s = math.cos(b.yaw), math.sin(b.yaw)
        z = -np.where(side, rng.random(n + around), 1.0) * top
        out.append(np.column_stack([b.x + c * u - s * v, b.y + s * u + c * v, z]))
    return np.vstack(out)


def hidden(P: np.ndarray, p: np.ndarray, boxes: Sequence[Box]) -> np.ndarray:
    """(n,) bool: a box is between the points P (n, 3) and p (3,)."""
    out = np.zeros(len(P), bool)
    at = P + np.linspace(0.01, 0.995, 50)[:, None, None] * (p - P)
    for b in boxes:
        c, s = math.cos(b.yaw), math.sin(b.yaw)
        x, y = at[..., 0] - b.x, at[..., 1] - b.y
        u, v = c * x + s * y, c * y - s * x
        below = -at[..., 2] < b.height + b.slope[0] * u + b.slope[1] * v - 2e-3
        out |= ((abs(u) < 0.5 * b.length - 1e-3) & (abs(v) < 0.5 * b.width - 1e-3) & below).any(axis=0)
    return out


def spread_out(lens: Fisheye, uv: np.ndarray, ids: np.ndarray, most: int) -> np.ndarray:
    """At most so many of the features, evenly over the image, the same ones from frame to frame as far as may be."""
    side = lens.width / 12
    cell = (uv[:, 1] // side) * 100 + uv[:, 0] // side
    order = np.lexsort((ids * 2654435761 % 2**32, cell))
    rank = np.empty(len(ids), int)
    rank[order] = np.arange(len(ids)) - np.searchsorted(cell[order], cell[order])
    return np.sort(np.lexsort((ids * 2654435761 % 2**32, rank))[:most])


def flown(
    seed: int, boxes: Sequence[Box], lens: Fisheye = FULL, speed: float = 0.4, height: float = 1.0,
    px: float = 0.25, place: float = 0.0, turn: float = 0.0, settings: DetectorSettings | None = None,
) -> tuple[list[Look], LandingPlaceDetector]:  # fmt: skip
    """Looks of one flight along x over the boxes: px [px] noise of features; place [m], turn [rad] errors of poses."""
    rng = np.random.default_rng(seed)
    P = features(rng, boxes, (-1.5, 4.0))
    detector = LandingPlaceDetector(lens, Noise(seed, "landing place"), settings)
    looks = []
    for k in range(int(2.2 / (0.07 * speed))):
        t = 0.07 * k
        p = np.array([0.2 + speed * t, 0.05 * math.sin(t), -height + 0.03 * math.sin(0.7 * t)])
        R = DOWN @ so3.from_euler(*(0.03 * rng.standard_normal(2)), 0.03 * math.sin(t)).T
        uv = lens.project((P - p) @ R.T)
        ids = np.flatnonzero(lens.inside(uv, 8.0) & ((P - p) @ R[2] > 0.05))
        ids = ids[~hidden(P[ids], p, boxes)]
        ids = ids[spread_out(lens, uv[ids], ids, 320)]
        ids = ids[rng.random(len(ids)) < 0.85]
        seen = uv[ids] + px * rng.standard_normal((len(ids), 2))
        wrong = rng.random(len(ids)) < 0.02
        seen[wrong] += rng.uniform(-6.0, 6.0, (int(wrong.sum()), 2))
        said = R @ so3.from_euler(*(turn * rng.standard_normal(3)))
        looks.append(detector.look(t, ids, lens.rays(seen), p + place * rng.standard_normal(3), said))
    return looks, detector


def reasons(looks: list[Look]) -> Counter[Refusal | None]:
    """How often each was said of a candidate or a pool."""
    last = [why for _, why in looks[-1].pools]
    return Counter([c.refusal for look in looks for c in look.candidates] + last)


def places(looks: list[Look]) -> list[WayPoint]:
    return [look.place for look in looks if look.place is not None]


# -------------------------------------------------------------------------------------------------- two views


def two_views(
    n: int = 60, v: Sequence[float] = (0.05, -0.1, 1.1), noise: float = 0.0, seed: int = 3, wide: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """v, t and directions a, b (n, 3) to points of the plane v . X = 1 from cameras t apart."""
    rng = np.random.default_rng(seed)
    plane, t = np.array(v), np.array([-0.3, 0.05, 0.02])
    a = np.column_stack([wide * rng.uniform(-1.0, 1.0, (n, 2)), np.ones(n)])
    X = a / (a @ plane)[:, None]
    b = X + t
    a, b = (q / np.linalg.norm(q, axis=1)[:, None] for q in (X, b))
    b += noise * rng.standard_normal((n, 3))
    return plane, t, a, b / np.linalg.norm(b, axis=1)[:, None]


def test_a_plane_by_hand() -> None:
    """A level plane 2 m down, the second camera 0.5 m ahead: what was straight down is seen 0.25 behind."""
    t = np.array([-0.5, 0.0, 0.0])
    down, there = np.array([[0.0, 0.0, 1.0]]), np.array([[-0.25, 0.0, 1.0]]) / math.hypot(1.0, 0.25)
    assert misalignment(np.array([0.0, 0.0, 0.5]), down, there, t) == pytest.approx([0.0], abs=1e-12)
    H = np.eye(3) + np.outer(t, [0.0, 0.0, 0.5])
    assert plane_of(-3.0 * np.sign(np.linalg.det(H)) * -H, t) == pytest.approx([0.0, 0.0, 0.5])
    plane = Plane(np.array([0.0, 0.3, 0.4]), np.zeros(0, bool), 0.0)
    assert (plane.distance, plane.tilt) == pytest.approx((2.0, math.acos(0.8)))


def test_homography_and_alignment_find_the_plane_among_strays() -> None:
    """Aligned with a movement that is known, the plane is half as good again as out of the homography alone."""
    rough, fine, along = [], [], []
    for seed in range(20):
        v, t, a, b = two_views(noise=5e-4, seed=seed, wide=0.4)
        stray = np.random.default_rng(seed).choice(60, 25, replace=False)
        b[stray] = np.roll(b[stray], 1, axis=0)
        found = homography(a, b, 0.004, 128, Noise(seed, "h"), local=False)
        assert found is not None
        assert found[1][stray].sum() <= 1
        assert found[1].sum() >= 34
        first = plane_of(found[0], t)
        rough.append(first - v)
        fine.append(aligned(first, a, b, t, 0.004) - v)
        length = float(np.linalg.norm(v))
        along.append(aligned_along(v / length, 0.97 * length, a, b, t, 0.02) / length - 1.0)
    assert 1.5 * np.std(fine) < np.std(rough)
    assert np.abs(fine).max() < 0.01
    assert np.abs(along).max() < 0.003


def test_a_small_plane_among_many_is_found_by_local_samples() -> None:
    _, t, a, b = two_views(200, noise=3e-4)
    small = np.linalg.norm(a[:, :2] - [0.3, 0.2], axis=1).argsort()[:14]
    X = a[small] / (1.3 * a[small, 2])[:, None]
    moved = X + t
    b = np.roll(b, 1, axis=0)  # all else is strays
    b[small] = moved / np.linalg.norm(moved, axis=1)[:, None]
    hits = [
        sum(h is not None and h[1][small].sum() >= 12 for h in found)
        for found in (
            [homography(a, b, 0.003, 128, Noise(k, "h"), local) for k in range(20)] for local in (True, False)
        )
    ]
    assert hits[0] >= 15
    assert hits[1] <= 5


def test_too_little_for_a_homography() -> None:
    _, _, a, b = two_views(4)
    assert homography(a[:3], b[:3], 0.004, 16, Noise(1, "h"), local=False) is None
    assert homography(a[[0] * 9], b[[0] * 9], 0.004, 16, Noise(1, "h"), local=True) is None  # all in one place


# --------------------------------------------------------------------------------------------- rectangle, pairs


def test_rectangle_by_hand() -> None:
    """Corners of 0.6 x 0.4 m turned by 30 deg about (1, 2) and a point inside."""
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    own = np.array([[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2], [0.1, 0.0]])
    xy = own @ np.array([[c, s], [-s, c]]) + [1.0, 2.0]
    top = rectangle(np.column_stack([xy, np.full(5, -0.14)]))
    assert top.centre == pytest.approx([1.0, 2.0], abs=1e-6)
    assert sorted(2.0 * top.half) == pytest.approx([0.4, 0.6], abs=1e-6)
    assert top.z == pytest.approx(-0.14)
    assert {tuple(q) for q in np.round(top.corners()[:, :2], 4)} == {tuple(q) for q in np.round(xy[:4], 4)}


def test_sides_move_halfway_to_the_ground_beside_them() -> None:
    top = Rectangle(np.array([1.0, 0.0]), np.array([0.2, 0.1]), np.eye(2), -0.14)
    ground = np.array(
        [
            [1.3, 0.0],
            [1.32, 0.0],
            [0.7, 0.05],
            [0.76, 0.0],
            [1.0, 0.16],
            [1.1, 0.3],
            [1.0, -0.2],
            [0.9, -0.4],
            [1.5, 1.0],
        ]
    )
    gap = gaps(top, ground, 1)
    assert gap == pytest.approx(np.array([[0.04, 0.1], [0.1, 0.06]]))
    assert gaps(top, ground, 2) == pytest.approx(np.array([[0.1, 0.12], [0.3, 0.2]]))
    assert np.isinf(gaps(top, ground[:4], 1)[1]).all()
    wide = halfway(top, gap)
    assert wide.centre == pytest.approx([1.015, -0.01])
    assert wide.half == pytest.approx([0.235, 0.14])
    assert uncertainty(gap) == pytest.approx(math.hypot(0.1, 0.06) / math.sqrt(48.0))


def test_patches_are_split_at_gaps() -> None:
    xy = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.5, 0.0], [0.6, 0.0]])
    assert [list(p) for p in patches(xy, 0.15)] == [[0, 1, 2], [3, 4]]


def test_foreign_features_are_those_seen_on_it_that_are_not_of_its_plane() -> None:
    top = Rectangle(np.zeros(2), np.array([0.3, 0.3]), np.eye(2), -0.2)
    p = np.array([0.0, 0.0, -1.2])
    P = np.array([[0.0, 0.0, -0.2], [0.1, 0.1, 0.0], [0.29, 0.0, -0.2], [0.35, 0.0, 0.0], [0.5, 0.5, 0.0]])
    rays = (P - p) / np.linalg.norm(P - p, axis=1)[:, None]
    view = View(0.0, np.arange(5), rays, p, DOWN)
    pair = Pair(view, view, np.arange(5), rays, rays)
    assert on_level(rays[3:4], p, -0.2) == pytest.approx(np.array([[0.35 / 1.2, 0.0]]))
    members = np.array([True, False, False, False, False])
    assert foreign(top, pair, members, 0.05).tolist() == [1]  # the third and fourth are at the edge
    assert foreign(top, pair, members, 0.0).tolist() == [1, 2, 3]
    assert in_view(top, view, FULL, 8.0)
    assert not in_view(replace(top, centre=np.array([1.0, 0.0])), view, FULL, 8.0)


def test_pairs_have_the_baseline_asked_for_and_share_features() -> None:
    views = Views(age=5.0)
    for k in range(10):
        ids = np.arange(10 * k, 10 * k + 60)
        view = View(0.1 * k, ids, np.tile([0.0, 0.0, 1.0], (60, 1)), np.array([0.1 * k, 0.0, -1.0]), DOWN)
        pair = views.pair(view, 0.15, 0.6, 20)
        views.keep(view, 0.05)
    assert pair is not None
    assert pair.first.p[0] == pytest.approx(0.6)  # 30 shared at 0.3 m: more than 0.2 x 40 or 0.4 x 20
    assert len(pair.ids) == 30
    assert pair.t == pytest.approx([-0.3, 0.0, 0.0])
    further = views.pair(view, 0.35, 0.6, 20)
    assert further is not None
    assert further.first.p[0] == pytest.approx(0.5)  # 20 shared at 0.4 m
    assert views.pair(view, 0.45, 0.6, 20) is None
    assert views.pair(replace(view, t=9.0), 0.15, 0.6, 20) is None  # all too old


def waypoint(
    x: float = 0.0, height: float = 0.14, size: tuple[float, float] = (0.57, 0.57), tilt: float = 0.0
) -> WayPoint:
    return WayPoint(0.0, np.array([x, 0.0, -height]), height, size, np.array([math.sin(tilt), 0.0, math.cos(tilt)]), 20)


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([waypoint()] * 8, None),
        ([waypoint()] * 7, Refusal.TOO_NEW),
        ([waypoint(-0.04), waypoint(0.04)] * 5, Refusal.UNSTEADY),
        ([waypoint(height=0.06), waypoint(height=0.078)] * 5, Refusal.TOO_LOW),
        ([waypoint(height=0.7)] * 9, Refusal.TOO_HIGH),
        ([waypoint(size=(0.57, 0.2))] * 9, Refusal.TOO_SMALL),
        ([waypoint(size=(1.0, 0.5))] * 9, Refusal.TOO_LARGE),
        ([waypoint(tilt=0.12)] * 9, Refusal.TILTED),
        ([waypoint(tilt=0.12), waypoint(tilt=-0.12)] * 5, None),  # noise
    ],
)
def test_a_pool_is_judged_by_its_mean(points: list[WayPoint], expected: Refusal | None) -> None:
    pool = Pool(0.14)
    for point in points:
        pool.add(point)
    assert pool.refusal(Limits()) is expected


# ------------------------------------------------------------------------------------------------- whole flights


@pytest.mark.parametrize("height", [0.08, 0.14, 0.20])
def test_platform_is_found(height: float) -> None:
    """Height within 1 cm, way point within 5 cm."""
    box = replace(BOX, height=height)
    for seed in (1, 2):
        found = places(flown(seed, [box])[0])
        assert len(found) > 10
        for place in (found[0], found[-1]):
            assert place.height == pytest.approx(height, abs=0.01)
            assert np.hypot(*(place.p_R[:2] - [box.x, box.y])) < 0.05
            assert place.p_R[2] == pytest.approx(-height, abs=0.01)


def test_it_is_found_with_half_the_pixels_and_errors_of_pose() -> None:
    looks, _ = flown(3, [BOX], lens=HALF, speed=0.3, place=0.002, turn=math.radians(0.1))
    place = places(looks)[-1]
    assert place.height == pytest.approx(0.14, abs=0.01)
    assert np.hypot(*(place.p_R[:2] - [BOX.x, BOX.y])) < 0.05


def test_same_flight_same_bits() -> None:
    one, two = (places(flown(4, [BOX], speed=0.6)[0]) for _ in range(2))
    assert [w.p_R.tobytes() for w in one] == [w.p_R.tobytes() for w in two]


@pytest.mark.parametrize(
    ("boxes", "expected"),
    [
        ([], None),
        ([replace(BOX, height=0.06)], Refusal.TOO_LOW),
        ([Box(2.4, 0.0, 0.1, 2.0, 3.0, 0.14)], Refusal.TOO_LARGE),
        ([replace(BOX, length=0.85, width=0.2)], Refusal.TOO_FEW),
        ([replace(BOX, slope=(0.2, 0.0))], Refusal.TILTED),
        ([replace(BOX, height=1.0)], Refusal.TOO_HIGH),
        ([replace(BOX, length=0.8, width=0.8), Box(1.4, 0.1, 0.2, 0.3, 0.3, 0.24)], Refusal.CLUTTER),
    ],
    ids=["flat", "step", "large", "narrow", "tilted", "high", "laden"],
)
def test_refused_and_why(boxes: list[Box], expected: Refusal | None) -> None:
    height = 2.0 if boxes and boxes[0].height > 0.5 else 1.0
    looks, _ = flown(5, boxes, height=height)
    assert not places(looks)
    if expected is None:
        assert {look.refusal for look in looks} <= {Refusal.NO_PAIR, Refusal.NOTHING_ELSE}
    else:
        assert reasons(looks)[expected] > 0


def test_half_a_platform_in_the_map_is_not_a_smaller_one() -> None:
    """No features are known beyond the middle of the box, nor on the ground there."""
    rng = np.random.default_rng(7)
    box = replace(BOX, x=1.0, y=0.0, yaw=0.0, length=0.8, width=0.8)
    P = features(rng, [box], (-1.0, 3.0))
    P = P[P[:, 0] < 1.0]
    detector = LandingPlaceDetector(FULL, Noise(7, "landing place"))
    whys: Counter[Refusal | None] = Counter()
    for k in range(40):
        p = np.array([0.3 + 0.02 * k, 0.0, -1.0])
        uv = FULL.project((P - p) @ DOWN.T)
        ids = np.flatnonzero(FULL.inside(uv, 8.0) & ~hidden(P, p, [box]))
        look = detector.look(0.07 * k, ids, FULL.rays(uv[ids]), p, DOWN)
        whys.update(c.refusal for c in look.candidates)
        assert look.place is None
    assert whys[Refusal.NOT_SURROUNDED] > 10


def test_boxes_parked_about_are_left_alone_and_do_not_hide_the_platform() -> None:
    others, _ = clutter(Noise(9, "clutter"), 5, (0.2, 2.6, -0.9, 0.9), (BOX,))
    place = places(flown(6, [BOX, *others])[0])[-1]
    assert np.hypot(*(place.p_R[:2] - [BOX.x, BOX.y])) < 0.05
    assert not places(flown(6, others)[0])


def test_a_view_must_be_consistent() -> None:
    with pytest.raises(ValueError, match="need as many rays"):
        LandingPlaceDetector(FULL, Noise(1, "x")).look(0.0, np.arange(3), np.zeros((2, 3)), np.zeros(3), DOWN)


@pytest.mark.slow
def test_nothing_is_accepted_on_flat_ground_or_a_low_step_in_fifty_flights_each() -> None:
    for seed in range(50):
        rng = np.random.default_rng(seed)
        wrong = {"place": 0.003, "turn": math.radians(0.1)} if seed % 2 else {}
        step = replace(BOX, height=0.06, yaw=rng.uniform(0.0, 1.5), y=rng.uniform(-0.3, 0.3))
        for boxes in ([], [step]):
            assert not places(flown(100 + seed, boxes, speed=0.6, **wrong)[0]), (seed, boxes)
