"""The quadrotor's eye joined to what looks through it: the fisheye, the map made beforehand, localisation, landing place.

A map is made as in the paper, before the flight: somebody who sees the vehicle flies it by hand, and the SLAM
looks on. The same scene, camera and path give the same map, whatever the seed of the flight.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from landing_sim import loop
from landing_sim.control import autonomy
from landing_sim.control.autonomy import moved
from landing_sim.control.position import PositionController
from landing_sim.estimators.readings import Reading, StrapdownFrontEnd
from landing_sim.estimators.strapdown_ekf import StrapdownEkf
from landing_sim.geometry.fisheye import Fisheye
from landing_sim.interfaces import FrontEnd, NoiseStream
from landing_sim.noise import Noise
from landing_sim.plants.quadrotor import QuadrotorPlant
from landing_sim.sections.quadrotor import QuadrotorScenario
from landing_sim.sensors.fisheye import FisheyeCamera, FisheyeRenderer
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.sensors.position_fix import PositionFix, PositionFixConfig
from landing_sim.sensors.sonar import Sonar, SonarConfig
from landing_sim.sensors.strapdown import Strapdown, StrapdownConfig
from landing_sim.signals import CameraTruth, Command, Estimate, Measurement, Reference, Sample, Truth
from landing_sim.vision.landing_place import LandingPlaceDetector, Look
from landing_sim.vision.slam import map_file
from landing_sim.vision.slam.front_end import SlamFrontEnd, SonarToSlam
from landing_sim.vision.slam.map import Map
from landing_sim.vision.slam.settings import Rig, SlamSettings
from landing_sim.vision.slam.slam import Slam
from landing_sim.world.drift import Drift, DriftConfig
from landing_sim.world.planes import Box, Scene

FOCAL_640 = 261.9  # [px] at 640 px: 140 deg across
P_BC = (0.0, 0.0, 0.05)  # [m] camera, and sonar, from the cg
LEGS = 0.12  # [m] of the cg above the feet
STANDS, FLIES = 0.13, 0.20  # [m] sonar readings below, above
TOUCHED = 0.005  # [m] the lens's height above the ground it lies on
NOW = LatencyConfig(0.0, 0.0, 0.0)
Vector = tuple[float, float, float]


def lens(s: QuadrotorScenario, share: float = 1.0) -> Fisheye:
    """The camera's; `share` of its focal length."""
    width = s.camera.width_px
    return Fisheye(width, 3 * width // 4, share * FOCAL_640 * width / 640.0)


def rig(s: QuadrotorScenario) -> Rig:
    """The camera and sonar as they are believed to be."""
    return Rig(lens(s), p_BC=np.array(P_BC), p_BS=np.array(P_BC))


def renderer(s: QuadrotorScenario, scene: Scene, noise: NoiseStream) -> FisheyeRenderer:
    """The true eye before the true scene."""
    return FisheyeRenderer(lens(s, 1.0 + s.camera.focal_error), scene, s.camera.noise_dn, noise.key())


class Uncovered:
    """interfaces.Sensor: a camera that sends nothing while it lies on the ground, as it does under a toppled vehicle."""

    channels = 0

    def __init__(self, camera: FisheyeCamera) -> None:
        self.name, self.period, self._camera = camera.name, camera.period, camera

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        return self._camera.sense(truth, camera) if camera.p_RC[2] < -TOUCHED else None


# ------------------------------------------------------------------------------------------------- front ends


class Standing:
    """interfaces.FrontEnd for the sonar: standing where R begins, and until the camera can tell, it knows where it is.

    What `inner` makes of the readings comes besides. The sonar cannot see the last few centimetres to the ground, so this
    says little about height, and nothing once `placed`.
    """

    sensor = "sonar"

    def __init__(self, inner: FrontEnd, placed: Callable[[], bool]) -> None:
        self._inner, self._placed, self._stands = inner, placed, True
        self._variance = np.array([0.01, 0.01, 0.03]) ** 2

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        out = self._inner.process(sample, estimate)
        reading = float(sample.data)
        self._stands &= reading < FLIES and not self._placed()
        if not self._stands or reading > STANDS:
            return out
        z = np.array([0.0, 0.0, -LEGS])
        return (*out, Measurement("position", sample.t_valid, sample.t_arrival, z, self._variance))


class Looking:
    """interfaces.FrontEnd for the camera: the position, and the landing place once its pool of way points agrees.

    `look` is what the detector said of the latest image that could be placed.
    """

    sensor = "camera"

    def __init__(self, localiser: SlamFrontEnd, detector: LandingPlaceDetector | None) -> None:
        self.localiser, self.detector = localiser, detector
        self.look: Look | None = None

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        out = self.localiser.process(sample, estimate)
        at = self.localiser.located
        self.look = None
        if self.detector is None or at is None or not at.metric:
            return out
        self.look = self.detector.look(at.t, at.ids, at.rays, at.pose.p_RC, at.pose.R_CR)
        place = self.look.place
        if place is None:
            return out
        variance = np.full(3, self.detector.settings.limits.spread**2)
        return (*out, Measurement("way_point", sample.t_valid, sample.t_arrival, place.p_R, variance))


class While:
    """interfaces.FrontEnd: what `inner` makes of its samples is passed on only while `so` says."""

    def __init__(self, inner: FrontEnd, so: Callable[[], bool]) -> None:
        self.sensor, self.inner, self._so = inner.sensor, inner, so

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        out = self.inner.process(sample, estimate)
        return out if self._so() else ()


# ------------------------------------------------------------------------------------------------- the survey


class TourMemory(NamedTuple):
    """Where the wanted point is, and which of the tour's points it is on its way to."""

    t: float = math.nan
    at: int = 0
    p: Vector = (0.0, 0.0, 0.0)
    v: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Tour:
    """interfaces.Guidance: from point to point (x, y, z) [m] in R at `speed` [m/s]; then the mode is "done"."""

    points: tuple[Vector, ...]
    speed: float = 0.5
    acceleration: float = 0.5

    def init(self) -> TourMemory:
        return TourMemory(p=self.points[0])

    def step(self, m: TourMemory, estimate: Estimate) -> tuple[TourMemory, Reference]:
        dt = 0.0 if math.isnan(m.t) else estimate.t - m.t
        m = m._replace(t=estimate.t)
        if m.at < len(self.points) and dt > 0.0:
            p, v = moved(m.p, m.v, self.points[m.at], self.speed, self.acceleration, dt)
            m = m._replace(p=p, v=v, at=m.at + (p == self.points[m.at]))
        mode = "done" if m.at == len(self.points) else "survey"
        extra = {"x": m.p[0], "vx": m.v[0], "vy": m.v[1]}
        return m, Reference(mode, 0.0, -m.p[2], -m.v[2], m.p[1], 0.0, 0.0, extra=extra)


def tour(s: QuadrotorScenario, boxes: tuple[Box, ...]) -> tuple[Vector, ...]:
    """Three lanes along the way at its height, and low passes over the start and over the box that is to be landed on."""
    h, land = s.path.height_m, s.task == "land"
    goal = np.array([s.path.goal_x_m, s.path.goal_y_m]) if land else np.array([0.4, 0.0])
    way = float(np.hypot(*goal))
    along = goal / way if way > 0.0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])

    def point(forward: float, right: float, up: float) -> Vector:
        x, y = forward * along + right * across
        return float(x), float(y), -up

    lane = 0.5 * h
    points = [(0.0, 0.0, -h)]
    for k, right in enumerate((0.0, lane, -lane)):
        ends = (-0.4 * h, way + 0.4 * h) if k % 2 == 0 else (way + 0.4 * h, -0.4 * h)
        points += [point(end, right, h) for end in ends]
    if land:
        box = boxes[0]
        points += [(box.x, box.y, -h), (box.x, box.y, -(box.height + LEGS + 0.12)), (box.x, box.y, -h)]
    points += [(0.0, 0.0, -h), (0.0, 0.0, -0.24), (0.0, 0.0, -h)]
    return tuple(points)


class HandFlownMemory(NamedTuple):
    """The tour's memory until the vehicle is let go, then the autonomy's."""

    by_hand: TourMemory | None
    alone: autonomy.Memory


@dataclass(frozen=True, slots=True)
class HandFlown:
    """interfaces.Guidance: flown by hand along the tour until `ready` says so, then let go: from a hover on."""

    tour: Tour
    autonomy: autonomy.Autonomy
    ready: Callable[[], bool]

    def init(self) -> HandFlownMemory:
        return HandFlownMemory(self.tour.init(), self.autonomy.init())

    def step(self, m: HandFlownMemory, estimate: Estimate) -> tuple[HandFlownMemory, Reference]:
        if m.by_hand is not None and self.ready():
            over = (0.0, 0.0, -self.autonomy.settings.height)
            t, p, v = estimate.t, m.by_hand.p, m.by_hand.v
            m = HandFlownMemory(None, m.alone._replace(mode="hover", t=t, since=t, p=p, v=v, target=over))
        if m.by_hand is None:
            memory, reference = self.autonomy.step(m.alone, estimate)
            return m._replace(alone=memory), reference
        by_hand, reference = self.tour.step(m.by_hand, estimate)
        return m._replace(by_hand=by_hand), reference


def survey(s: QuadrotorScenario, plant: QuadrotorPlant, boxes: tuple[Box, ...], scene: Scene) -> Map:
    """The map that a flight by hand gives. `plant` hovers where the tour begins. Raises ValueError if it gives none."""

    def streams(name: str) -> NoiseStream:
        return Noise(s.scene.seed, f"survey {name}")

    points = tour(s, boxes)
    slam = Slam(rig(s), settings(s), "map")
    clock = loop.Clock.of(s.time.step_s, s.time.cycle_s, 0.0)
    sonar = SonarConfig(noise=s.sensors.sonar.noise_m)
    sensors = (
        Strapdown(
            StrapdownConfig(noise=s.sensors.imu.noise_mps2, bias_sigma=s.sensors.imu.bias_mps2), plant, streams("imu")
        ),
        Sonar(sonar, scene.height, streams("sonar")),
        PositionFix(PositionFixConfig(s.camera.period_s, NOW, wander=0.0, scale=0.0), streams("fix"), streams("late")),
        FisheyeCamera(renderer(s, scene, streams("pixels")), Latency(NOW, streams("late")), s.camera.period_s),
    )
    front_ends: dict[str, FrontEnd] = {
        "imu": StrapdownFrontEnd(),
        "sonar": SonarToSlam(slam),
        "position_fix": Reading("position_fix", "position", 0.01),
        "camera": While(SlamFrontEnd(slam), lambda: False),
    }
    air = Drift(DriftConfig(force=0.05), streams("gust"))
    controller = PositionController(replace(PositionController().settings, bandwidth=2.0, vertical=2.0))
    longest = 60.0 + 4.0 * sum(math.dist(a, b) for a, b in zip(points, points[1:]))
    for step in loop.simulate(
        clock, plant, air, sensors, front_ends, StrapdownEkf(), Tour(points), controller, Command()
    ):  # fmt: skip
        if step.reference.mode == "done":
            break
        if step.truth.t > longest or plant.touchdown is not None:
            raise ValueError(f"the survey flight failed at t = {step.truth.t:.1f} s: {slam.status}, {slam.reason}")
    if not slam.chart.metric:
        raise ValueError(f"the survey flight made no map: {slam.reason}")
    return slam.save_all()


_made: dict[str, Map] = {}
"""Maps of this process by what they were made from, so that a campaign makes each once."""
KEPT = 4


def chart(s: QuadrotorScenario, make: Callable[[], Map]) -> Map:
    """The map of the scenario: from its file if that is there, else made, and written there if one is named.

    Each caller gets a copy of its own. Raises ValueError for a file that is no map of this camera.
    """
    file = s.localisation.map
    if file is not None and Path(file).exists():
        return map_file.load(file)
    key = QuadrotorScenario.model_dump_json(
        s, include={"scene", "camera", "path", "task", "time", "sensors", "localisation"}
    )
    found = _made.pop(key, None) or make()
    _made[key] = found
    while len(_made) > KEPT:
        del _made[next(iter(_made))]
    if file is not None:
        map_file.save(file, found)
    return copy.deepcopy(found)


def settings(s: QuadrotorScenario) -> SlamSettings:
    """Of the SLAM."""
    l = s.localisation
    return SlamSettings(fast_threshold=l.fast_threshold, window=l.window)
