"""Visual SLAM tried on its own: a camera led along a given path through a scene, real pixels, and how far off it is.

No flight is simulated, so that a minute of images costs seconds; sonar, lens and inertial attitude err as in flight.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.geometry.so3 import from_euler
from landing_sim.noise import Noise
from landing_sim.sensors.fisheye import FisheyeRenderer
from landing_sim.sensors.sonar import Sonar, SonarConfig
from landing_sim.signals import CameraTruth, Truth
from landing_sim.types import Array
from landing_sim.vision.slam.settings import Rig
from landing_sim.vision.slam.slam import Slam
from landing_sim.world.planes import Box, Scene, Sun, clutter


class PathError(NamedTuple):
    """All [m] but scale.

    absolute : (n,) distance as it is; aligned : (n,) after the best similarity; scale : of the path over the true one's
    """

    absolute: Array
    aligned: Array
    scale: float

    @property
    def median(self) -> float:
        return float(np.median(self.absolute))

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.aligned**2)))


def path_error(p_hat: Array, p: Array) -> PathError:
    """Compare positions p_hat (n, 3) with the true ones p (n, 3) of the same times. Raises ValueError below 3 positions.

    Source     Umeyama 1991, eqs. (38)-(43).
    """
    if len(p) < 3 or p.shape != p_hat.shape:
        raise ValueError(f"paths of {p_hat.shape} and {p.shape} cannot be compared")
    a, b = p_hat - p_hat.mean(0), p - p.mean(0)
    U, d, Vt = np.linalg.svd(b.T @ a / len(p))
    S = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = U @ S @ Vt
    scale = float((d * np.diag(S)).sum() / np.mean((a**2).sum(1)))
    aligned = np.linalg.norm(b - scale * a @ R.T, axis=1)
    return PathError(np.linalg.norm(p_hat - p, axis=1), aligned, 1.0 / scale)


Path = Callable[[float], Array]
"""Where the cg is at a time [s]: (3,) [m] in R."""

LENS = Fisheye(640, 480, 261.9)
CAMERA_DOWN, SONAR_DOWN = 0.06, 0.05  # [m] below the cg


@dataclass(frozen=True, slots=True)
class Erring:
    """1 sigma of what is not perfect: attitude [rad] bias and wander (2 s) of each axis, grey levels of a pixel."""

    bias: float = math.radians(0.6)
    wander: float = math.radians(0.12)
    grey: float = 2.0
    sonar: SonarConfig = field(default_factory=lambda: SonarConfig(down=SONAR_DOWN))


@dataclass(frozen=True, slots=True)
class Look:
    """One image: t [s], pixels, the attitude (3,) [rad] that the inertial unit tells, sonar readings (t, height [m]) since
    the image before, and the true place p (3,) [m] of the cg."""

    t: float
    image: np.ndarray
    euler: Array
    sonar: tuple[tuple[float, float], ...]
    p: Array


@dataclass(frozen=True, slots=True)
class Placed:
    """What a SLAM made of looks, arrays over the images.

    t (n,) [s]; p_hat (n, 3) [m], NaN where not placed; p (n, 3) the truth; metric (n,) bool; cost (n,) [s] processor time;
    grew (n,) bool: the image became a keyframe
    """

    t: Array
    p_hat: Array
    p: Array
    metric: np.ndarray
    cost: Array
    grew: np.ndarray

    @property
    def error(self) -> PathError:
        """Of the images placed in metres. Raises ValueError with fewer than three."""
        return path_error(self.p_hat[self.metric], self.p[self.metric])


def rig(lens: Fisheye) -> Rig:
    """The camera and sonar of these trials."""
    return Rig(lens, p_BC=np.array([0.0, 0.0, CAMERA_DOWN]), p_BS=np.array([0.0, 0.0, SONAR_DOWN]))


def scene(seed: int, contrast: float = 1.0, boxes: tuple[Box, ...] = (Box(1.6, 0.3, 0.3),), left: int = 3) -> Scene:
    """A box to land on, `left` parked boxes, patches and shadows."""
    parked, shades = clutter(Noise(seed, "clutter"), left, (-3.0, 4.0, -2.0, 2.0), boxes) if left else ((), ())
    return Scene((*boxes, *parked), Noise(seed, "scene"), shades, Sun(), contrast)


def _gently(t: float, over: float) -> float:
    s = min(1.0, max(0.0, t / over))
    return s * s * (3.0 - 2.0 * s)


def eight(t: float) -> Array:
    """Figures of eight, 2.4 m by 1.4 m, 0.9 to 1.1 m high, 0.3 m/s."""
    e = _gently(t, 3.0)
    return np.array([1.2 * e * math.sin(0.25 * t), 0.7 * e * math.sin(0.5 * t), -1.0 - 0.1 * e * math.sin(0.41 * t)])


def rows(t: float) -> Array:
    """To and fro over 3.2 m, drifting sideways by 3 cm/s, 0.88 to 1.12 m high, up to 0.4 m/s."""
    e = _gently(t, 3.0)
    return np.array([
        1.6 * (1.0 - math.cos(0.25 * t)),
        e * (0.03 * t + 0.1 * math.sin(0.6 * t)),
        -1.0 - 0.12 * e * math.sin(0.5 * t),
    ])  # fmt: skip


def low(t: float) -> Array:
    """Figures of eight, 1.8 m by 1 m, between 1 m and 0.4 m high."""
    e = _gently(t, 3.0)
    return np.array([0.9 * e * math.sin(0.3 * t), 0.5 * e * math.sin(0.6 * t), -0.7 - 0.3 * math.cos(0.2 * t)])


def descent(t: float) -> Array:
    """From the start to above the box at 1.6, 0.3 within 8 s, then down at 8 cm/s to 20 cm above its top of 14 cm."""
    a = _gently(t, 8.0)
    return np.array([1.6 * a, 0.3 * a, -1.0 + min(0.66, max(0.0, 0.08 * (t - 10.0)))])


PATHS: dict[str, Path] = {"eight": eight, "rows": rows, "low": low}


def wobble(t: float, seed: int) -> Array:
    """phi, theta, psi [rad]: tilts of up to 3.7 deg, headings of up to 3 deg."""
    a, b, c = 0.3 * seed, 1.1 * seed, 2.0 * seed
    return np.radians([
        2.5 * math.sin(1.7 * t + a) + 1.2 * math.sin(4.1 * t + b),
        2.5 * math.sin(1.4 * t + b) + 1.2 * math.sin(3.7 * t + c),
        3.0 * math.sin(0.3 * t),
    ])  # fmt: skip


def look_round(
    place: Scene,
    lens: Fisheye,
    path: Path,
    seconds: float,
    seed: int,
    erring: Erring | None = None,
    period: float = 0.07,
) -> Iterator[Look]:
    """Images along a path, with what the other sensors say. The same seed gives the same errors."""
    erring = erring or Erring()
    eye = FisheyeRenderer(lens, place, erring.grey, Noise(seed, "pixels").key())
    sonar = Sonar(erring.sonar, place.height, Noise(seed, "sonar"))
    drawn = Noise(seed, "attitude")
    bias, wander = erring.bias * drawn.normal(3), erring.wander * drawn.normal(3)
    keep = math.exp(-period / 2.0)
    mount, heard = rig(lens), 0
    for k in range(round(seconds / period)):
        t = k * period
        readings = []
        while heard * sonar.period <= t:
            at = heard * sonar.period
            said = sonar.sense(_truth(at, path(at), wobble(at, seed)), _NOWHERE)
            if said is not None:
                readings.append((at, float(said.data)))
            heard += 1
        p, euler = path(t), wobble(t, seed)
        R_RB = from_euler(*euler.tolist())
        image = eye.image(p + R_RB @ mount.p_BC, mount.R_CB @ R_RB.T, k)
        yield Look(t, image, euler + bias + wander, tuple(readings), p)
        wander = keep * wander + erring.wander * math.sqrt(1.0 - keep * keep) * drawn.normal(3)


_NOWHERE = CameraTruth(np.zeros(3), np.eye(3), 0.0, 0.0)


def _truth(t: float, p: Array, euler: Array) -> Truth:
    """A truth of which only place and attitude mean anything."""
    none = np.zeros(3)
    R = from_euler(*euler.tolist())
    return Truth(0, t, p, R, none, none, euler, none, 0.0, 0.0, 0.0, np.zeros(4), 0.0, none, np.zeros(3, bool), 1.0)


def locate(slam: Slam, looks: Iterable[Look]) -> Placed:
    """Hand the looks to a SLAM, one by one."""
    t, p_hat, p, metric, cost, grew = [], [], [], [], [], []
    for look in looks:
        for at, height in look.sonar:
            slam.sonar(at, height)
        frames, last = slam.chart.frames, slam.chart.t[-1:]
        began = time.thread_time()
        found = slam.image(look.t, look.image, look.euler)
        cost.append(time.thread_time() - began)
        grew.append(slam.chart.frames != frames or not np.array_equal(slam.chart.t[-1:], last))
        t.append(look.t)
        p.append(look.p)
        p_hat.append(np.full(3, np.nan) if found is None else found.p_RB)
        metric.append(found is not None and found.metric)
    return Placed(*map(np.array, (t, p_hat, p, metric, cost, grew)))
