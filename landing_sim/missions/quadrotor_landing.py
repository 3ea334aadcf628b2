"""The quadrotor that finds its landing place: names the concrete parts, joins both sides, decides when a flight is over."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

from landing_sim import loop, paths
from landing_sim.control.autonomy import Autonomy, AutonomySettings
from landing_sim.control.position import PositionController, PositionSettings
from landing_sim.estimators.last_fix import LastFix
from landing_sim.estimators.readings import Fresh, Reading, StrapdownFrontEnd
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.strapdown_ekf import StrapdownEkf
from landing_sim.interfaces import Estimator, FrontEnd, Guidance, NoiseStream, Sensor
from landing_sim.missions.failing import with_faults
from landing_sim.missions.flight import Outcome, Parts, flown
from landing_sim.noise import Noise
from landing_sim.plants.attitude_loop import AttitudeConfig
from landing_sim.plants.quadrotor import QuadrotorPlant, Start
from landing_sim.sections.quadrotor import Platform, QuadrotorScenario
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.sensors.place_fix import PlaceFix, PlaceFixConfig
from landing_sim.sensors.position_fix import PositionFix, PositionFixConfig
from landing_sim.sensors.sonar import Sonar, SonarConfig
from landing_sim.sensors.strapdown import Strapdown, StrapdownConfig
from landing_sim.signals import Command, Step
from landing_sim.world.drift import Drift, DriftConfig
from landing_sim.world.planes import Box, Scene, Shade, Sun, clutter

UPSET = math.radians(75.0)  # beyond this it is falling over, not flying
SETTLED = 1.5  # [s] after the first touch
RANGE = 15.0  # [m] from the start
DRAG = 0.16  # [N/(m/s)] of aircraft/pelican
CLUTTERED = (-1.0, 4.0, -2.0, 2.0)  # [m] x from, to, y from, to


class Mission:
    """One flight, ready to be flown once."""

    def __init__(
        self, scenario: QuadrotorScenario, parts: Parts[QuadrotorPlant, Drift], boxes: tuple[Box, ...]
    ) -> None:
        self.parts, self.scene_boxes = parts, boxes
        self._limit = scenario.time.limit_s
        self._outcome: Outcome | None = None
        self._refused_at = math.inf

    def steps(self) -> Iterator[Step]:
        """Fly to the end, a Step a cycle. The last Step is the one that ended it."""
        self._outcome = yield from flown(self.parts, Command(), self._ended)

    def outcome(self) -> Outcome:
        """Raises RuntimeError before the flight is over."""
        if self._outcome is None:
            raise RuntimeError("the flight is not over: exhaust steps() first")
        return self._outcome

    def _ended(self, step: Step) -> str:
        now, touchdown = step.truth, self.parts.plant.touchdown
        p = now.p_RB
        if abs(now.euler[0]) > UPSET or abs(now.euler[1]) > UPSET or math.hypot(p[0], p[1]) > RANGE or p[2] < -RANGE:
            return "crash"
        if touchdown is not None and now.t >= touchdown.t + SETTLED:
            return "stopped"
        if step.reference.mode == "refuse":
            self._refused_at = min(self._refused_at, now.t)
            if now.t >= self._refused_at + SETTLED:
                return "refused"
        return "time" if now.t >= self._limit else ""


def build(
    scenario: QuadrotorScenario, seed: int, run: int = 0, noise: Callable[[str], NoiseStream] | None = None
) -> Mission:
    """Everything one flight needs. `run` selects independent random streams under the same seed; `noise`, where given,
    hands out the streams instead. Raises PlantError or ValueError for what cannot be flown.
    """
    streams = noise or (lambda name: Noise(seed, name, run))
    s = scenario
    clock = loop.Clock.of(s.time.step_s, s.time.cycle_s, 0.0)
    boxes, _ = surroundings(s)
    plant = _plant(s, boxes, streams, airborne=not s.localisation.survey)
    eyes = _eyes(s, plant, boxes, streams)
    fused = s.filter.kind == "fused"
    estimator: Estimator = LastFix() if not fused else StrapdownEkf()
    if fused and s.filter.compensated:
        estimator = Rewind(estimator, s.filter.horizon_s)
    air = DriftConfig(s.air.gust_n, DRAG, s.air.vertical, s.air.gust_s, (s.air.wind_x_mps, s.air.wind_y_mps, 0.0))
    return Mission(
        s,
        Parts(
            clock,
            plant,
            Drift(air, streams("gust")),
            with_faults(eyes.sensors, s.faults, streams),
            eyes.front_ends,
            estimator,
            eyes.led(Autonomy(_path(s))),
            PositionController(_gains(s)),
        ),
        boxes,
    )


def _box(b: Platform) -> Box:
    slope = math.tan(math.radians(b.slope_x_deg)), math.tan(math.radians(b.slope_y_deg))
    return Box(b.x_m, b.y_m, math.radians(b.yaw_deg), b.length_m, b.width_m, b.height_m, slope)


def surroundings(s: QuadrotorScenario) -> tuple[tuple[Box, ...], tuple[Shade, ...]]:
    """Boxes, the one to land on first, and patches. They have a seed of their own: many flights are flown in one place."""
    boxes = tuple(_box(b) for b in s.scene.boxes)
    if not s.scene.clutter:
        return boxes, ()
    start = Box(0.0, 0.0, length=0.4, width=0.4)
    more, shades = clutter(Noise(s.scene.seed, "clutter"), s.scene.clutter, CLUTTERED, (*boxes, start))
    return (*boxes, *more), shades


def scene(s: QuadrotorScenario) -> Scene:
    """All that a camera sees of it: textures take half a second to make."""
    boxes, shades = surroundings(s)
    sun = Sun() if s.scene.sun else None
    return Scene(boxes, Noise(s.scene.seed, "scene"), shades, sun, s.scene.contrast)


def _above(boxes: tuple[Box, ...]) -> Callable[[float, float], float]:
    """height(x, y) [m] of ground and box tops."""

    def height(x: float, y: float) -> float:
        highest = 0.0
        for box in boxes:
            highest = max(highest, box.top(x, y))
        return highest

    return height


def _plant(
    s: QuadrotorScenario, boxes: tuple[Box, ...], streams: Callable[[str], NoiseStream], airborne: bool = False
) -> QuadrotorPlant:
    v = s.vehicle
    firmware = AttitudeConfig(bias=math.radians(v.attitude_bias_deg), wander=math.radians(v.attitude_wander_deg))
    return QuadrotorPlant(
        paths.data_folder("aircraft") / "pelican",
        Start(height=s.path.height_m if airborne else None),
        _above(boxes),
        s.time.step_s,
        streams("firmware"),
        firmware,
        v.payload_kg,
        1.0 + v.thrust_sigma * float(streams("thrust").normal(1)[0]),
        highest=max((-float(box.corners()[:, 2].min()) for box in boxes), default=0.0),
    )


def _eyes(
    s: QuadrotorScenario, plant: QuadrotorPlant, boxes: tuple[Box, ...], streams: Callable[[str], NoiseStream]
) -> Eyes:
    """The sensors, and their front ends."""
    late = s.camera.latency
    latency = LatencyConfig(late.mean_s, late.jitter_s, late.spike_share, late.spike_low_s, late.spike_high_s)
    imu = StrapdownConfig(noise=s.sensors.imu.noise_mps2, bias_sigma=s.sensors.imu.bias_mps2)
    sonar = SonarConfig(noise=s.sensors.sonar.noise_m, loss=s.sensors.sonar.loss)
    sensors: list[Sensor] = [Strapdown(imu, plant, streams("imu")), Sonar(sonar, _above(boxes), streams("sonar"))]
    front_ends: dict[str, FrontEnd] = {"imu": StrapdownFrontEnd()}
    more = (
        _emulated(s, latency, boxes, streams)
        if s.localisation.kind == "emulated"
        else _seeing(s, latency, boxes, streams)
    )
    return Eyes([*sensors, *more.sensors], {**front_ends, **more.front_ends}, more.led)


class Eyes(NamedTuple):
    """Sensors, front ends, and what the autonomy becomes where the flight begins by hand."""

    sensors: list[Sensor]
    front_ends: dict[str, FrontEnd]
    led: Callable[[Autonomy], Guidance] = lambda autonomy: autonomy


def _emulated(
    s: QuadrotorScenario, latency: LatencyConfig, boxes: tuple[Box, ...], streams: Callable[[str], NoiseStream]
) -> Eyes:
    """Positions and the landing place without images."""
    l = s.localisation
    fix = PositionFixConfig(s.camera.period_s, latency, l.noise_m, l.wander_m, scale=l.scale_sigma)
    sensors: list[Sensor] = [PositionFix(fix, streams("position_fix"), streams("latency"))]
    reading = Reading("position_fix", "position", max(math.hypot(l.noise_m, l.wander_m), 1e-3))
    front_ends: dict[str, FrontEnd] = {"position_fix": Fresh(reading, s.filter.horizon_s)}
    if s.task == "land":
        place = PlaceFixConfig(s.camera.period_s, latency)
        sensors.append(PlaceFix(place, boxes[0].corners(), streams("place_fix"), streams("place_latency")))
        front_ends["place_fix"] = Fresh(Reading("place_fix", "way_point", place.bias), s.filter.horizon_s)
    return Eyes(sensors, front_ends)


def _seeing(
    s: QuadrotorScenario, latency: LatencyConfig, boxes: tuple[Box, ...], streams: Callable[[str], NoiseStream]
) -> Eyes:
    """Positions and the landing place from rendered images, on a map that was made before."""
    from landing_sim.missions import quadrotor_eyes as eyes  # half a second of imports that campaigns can do without

    place = scene(s)

    def made() -> eyes.Map:
        plant = _plant(s, boxes, lambda name: Noise(s.scene.seed, f"survey {name}"), airborne=True)
        return eyes.survey(s, plant, boxes, place)

    survey = s.localisation.survey
    chart = eyes.chart(s, made) if survey else None
    mode: Literal["map", "localise", "both"] = (
        "map" if chart is None else "both" if s.localisation.mapping else "localise"
    )
    slam = eyes.Slam(eyes.rig(s), eyes.settings(s), mode, chart)
    detector = eyes.LandingPlaceDetector(eyes.lens(s), streams("detector")) if s.task == "land" else None
    localiser = eyes.SlamFrontEnd(slam, s.localisation.noise_m, streams("added"))
    looking: FrontEnd = eyes.Looking(localiser, detector)
    eye = eyes.renderer(s, place, streams("pixels"))
    camera = eyes.Uncovered(eyes.FisheyeCamera(eye, Latency(latency, streams("latency")), s.camera.period_s))
    heard = eyes.SonarToSlam(slam)
    if survey:
        standing = eyes.Standing(heard, lambda: localiser.located is not None)
        return Eyes([camera], {"sonar": standing, "camera": Fresh(looking, s.filter.horizon_s)})

    def found() -> bool:
        return slam.chart.metric

    by_eye = PositionFixConfig(s.camera.period_s, eyes.NOW, wander=0.0, scale=0.0)
    front_ends: dict[str, FrontEnd] = {
        "sonar": heard,
        "camera": Fresh(eyes.While(looking, found), s.filter.horizon_s),
        "position_fix": eyes.While(Reading("position_fix", "position", 0.01), lambda: not found()),
    }
    seen_by_hand = PositionFix(by_eye, streams("position_fix"), streams("by hand"))
    return Eyes([camera, seen_by_hand], front_ends, lambda g: eyes.HandFlown(eyes.Tour(eyes.tour(s, boxes)), g, found))


def _path(s: QuadrotorScenario) -> AutonomySettings:
    p = s.path
    return AutonomySettings(
        task=s.task,
        height=p.height_m,
        goal=(p.goal_x_m, p.goal_y_m),
        climb=p.climb_mps,
        traverse=p.traverse_mps,
        descent=p.descent_mps,
        hold=p.hold_s,
        search=p.search_s,
        clearance=p.cut_m,
    )


def _gains(s: QuadrotorScenario) -> PositionSettings:
    c = s.control
    return PositionSettings(
        period=c.period_s,
        bandwidth=c.bandwidth_radps,
        damping=c.damping,
        vertical=c.vertical_radps,
        vertical_damping=c.vertical_damping,
        integral=c.integral,
    )
