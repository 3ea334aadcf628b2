"""Poses along an approach, and their pictures, for the front end's tests."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics, project
from landing_sim.geometry.so3 import from_euler
from landing_sim.sensors.render import Optics, Renderer
from landing_sim.signals import CameraSample
from landing_sim.types import Array
from landing_sim.vision.believed import BelievedCamera, RunwayMap, ThresholdStripes
from landing_sim.vision.prediction import camera_pose
from landing_sim.world.markings import stripe_count
from landing_sim.world.runway import Greys, Runway

CAMERA = Intrinsics.centred(512, 512, 2000.0)
LEVER = (3.0, 0.0, -0.3)
NOSE_CAMERA, NOSE_LEVER = Intrinsics.centred(1280, 960, 1500.0), (24.0, 0.0, 0.5)  # of a transport, strapped down
RAD = math.radians(1.0)

# x, y, H of the cg [m], phi, theta, psi [deg]: the paper's approach, over the threshold, flare, and on the runway
APPROACH = (
    (-950.0, -85.0, 51.0, 0.0, -1.0, 15.0),
    (-800.0, -50.0, 44.0, -7.0, -1.0, 11.0),
    (-600.0, -20.0, 33.0, -7.0, 0.0, 4.0),
    (-450.0, -5.0, 26.0, -2.0, 0.0, 2.0),
    (-300.0, 3.0, 18.0, 1.0, 1.0, -1.0),
    (-180.0, 2.0, 11.0, 0.0, 1.0, 1.5),
    (-120.0, 1.0, 9.0, 0.0, 1.0, 1.5),
    (-60.0, 1.0, 7.0, 0.0, 2.0, 2.0),
    (0.0, 0.5, 5.5, 1.0, 2.0, 2.0),
    (60.0, 0.0, 4.5, 0.0, 3.0, 1.0),
    (300.0, -1.0, 2.6, 0.5, 4.0, 1.0),
    (550.0, 0.5, 2.0, 0.0, 2.0, 0.0),
)


def pose_of(row: tuple[float, ...]) -> Array:
    return np.array([*row[:3], *(RAD * angle for angle in row[3:])])


def fixate(pose: Array, target_R: Array | None = None) -> tuple[float, float]:
    """pan, tilt that look along R's x axis (the borderlines' vanishing point), or at a point (3,) of R."""
    d_R = np.array([1.0, 0.0, 0.0]) if target_R is None else target_R - np.array([pose[0], pose[1], -pose[2]])
    d = from_euler(*pose[3:]).T @ d_R
    return math.atan2(d[1], d[0]), math.atan2(-d[2], math.hypot(d[0], d[1]))


def sight(pose: Array, pan: float, tilt: float, width: float = 29.0) -> Array:
    return np.concatenate([pose, [pan, tilt, width]])


@dataclass(frozen=True)
class Bench:
    """A true runway and camera, and what is believed of them (the same unless said)."""

    noise: float = 4.0
    contrast: float = 55.0  # paint scales with it: haze
    runway: Runway | None = None
    known: RunwayMap = field(default_factory=RunwayMap)
    key: int = 7
    lens: Intrinsics = CAMERA
    lever: tuple[float, float, float] = LEVER

    @property
    def camera(self) -> BelievedCamera:
        return BelievedCamera(self.lens, self.lever, noise=max(self.noise, 0.3))

    def renderer(self) -> Renderer:
        greys = Greys(surface=90.0 + self.contrast, paint=90.0 + self.contrast * 125.0 / 55.0)
        return Renderer(self.lens, self.runway or Runway(greys=greys), Optics(noise=self.noise), self.key)

    def sample(self, renderer: Renderer, pose: Array, pan: float, tilt: float, index: int = 0) -> CameraSample:
        p_RC, R_CR = camera_pose(sight(pose, pan, tilt), np.array(self.lever))
        return CameraSample(renderer.frame(p_RC, R_CR, index), index, pan, tilt, pan, tilt)


def threshold_in_view(pose: Array, pan: float, tilt: float, margin: float = 12.0) -> bool:
    p_RC, R_CR = camera_pose(sight(pose, pan, tilt), np.array(LEVER))
    uv = project((np.array([[0.0, -14.5, 0.0], [0.0, 14.5, 0.0]]) - p_RC) @ R_CR.T, CAMERA)
    return bool(np.all((uv >= margin) & (uv <= 511.0 - margin)))


def scattered_poses(n: int, seed: int) -> list[tuple[Array, float, float]]:
    """n poses with pan and tilt: on a glide of 2.2..3.8 deg, up to 100 m and 15 deg off, banked, the camera looking at
    some point of the runway with an error of 3 deg (1 deg in tilt), its threshold in view."""
    rng = np.random.default_rng(seed)
    out: list[tuple[Array, float, float]] = []
    while len(out) < n:
        x = rng.uniform(-1200.0, -300.0)
        H = 2.0 + max(10.0, -x * math.tan(rng.uniform(2.2, 3.8) * RAD))
        angles = rng.uniform(-1.0, 1.0, 3) * np.array([10.0, 5.0, 15.0]) * RAD
        pose = np.array([x, rng.uniform(-100.0, 100.0), H, *angles])
        pan, tilt = fixate(pose, np.array([rng.uniform(0.0, 900.0), 0.0, 0.0]))
        pan, tilt = pan + rng.uniform(-3.0, 3.0) * RAD, tilt + rng.uniform(-1.0, 1.0) * RAD
        if threshold_in_view(pose, pan, tilt):
            out.append((pose, pan, tilt))
    return out


def map_of(runway: Runway) -> RunwayMap:
    """All that there is to know about a runway."""
    blocks = [m for m in runway.markings if m.kind in ("aiming_point", "touchdown_zone")]
    paint = tuple((m.x0, m.x1, -m.y1, m.y1) for m in blocks if m.y0 > 0.0)
    stripes = ThresholdStripes(stripe_count(runway.width) if runway.painted else 0)
    return RunwayMap(runway.width, runway.length, runway.slope, stripes, paint=paint)


def transport(runway: Runway | None = None, known: RunwayMap | None = None, noise: float = 4.0) -> Bench:
    """1280 x 960 px strapped to the nose; by default 45 m x 3000 m, and all is known of it."""
    runway = runway or Runway(width=45.0, length=3000.0)
    return Bench(noise, runway=runway, known=known or map_of(runway), lens=NOSE_CAMERA, lever=NOSE_LEVER)


NOSE_TILT = -3.0 * RAD


def approach_pose(x: float, rng: np.random.Generator, aside: float = 0.0) -> Array:
    """Of a transport's cg `x` [m] from the threshold, on a glide of 3 deg, flared and on the ground; up to `aside` [m] per
    5 km and 1/6 of that too high or too low, banked and turned a little."""
    height = max(5.0, 15.0 - x * math.tan(3.0 * RAD)) if x < -150.0 else max(5.0, 5.0 + 0.0324 * (400.0 - x))
    far = max(0.0, -x / 5000.0) * aside
    pose = np.array(
        [x, rng.uniform(-1.0, 1.0) * (2.0 + far), height + rng.uniform(-1.0, 1.0) * far / 6.0, 0.0, 0.0, 0.0]
    )
    if height > 5.0:
        pose[3:] = rng.normal(size=3) * np.array([3.0, 1.0, 2.0]) * RAD + np.array([0.0, 4.0 * RAD, 0.0])
    return pose
