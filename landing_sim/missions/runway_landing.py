"""The 1992 landing: names the concrete parts, joins the true and the onboard side, and decides when the flight is over."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from landing_sim import loop, paths
from landing_sim.control.design import Design, LinearModel, design
from landing_sim.control.guidance import LandingGuidance
from landing_sim.control.landing_lq import LandingController
from landing_sim.control.settings import ControlSettings
from landing_sim.estimators.readings import Reading
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.estimators.runway_filter import FilterConfig
from landing_sim.geometry.earth import RunwayFrame
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.interfaces import Estimator, FrontEnd, Sensor
from landing_sim.noise import Noise
from landing_sim.plants.aircraft import InitialState, JsbsimPlant
from landing_sim.plants.jsbsim import PlantError
from landing_sim.plants.trim import linearise, trim
from landing_sim.record.judge import CRASH_SINK
from landing_sim.scenario import Scenario
from landing_sim.sensors.airdata import Airspeed, AirspeedConfig
from landing_sim.sensors.camera import Camera, Encoders
from landing_sim.sensors.inertial import Gyro, GyroConfig
from landing_sim.sensors.platform import PanTilt
from landing_sim.sensors.render import Optics
from landing_sim.sensors.squat import SquatSwitch
from landing_sim.signals import Feature, Step, Touchdown
from landing_sim.vehicle import Vehicle
from landing_sim.vision.believed import BelievedCamera, RunwayMap, TaxiwayMouth, ThresholdStripes
from landing_sim.vision.front_end import FrontEndConfig, RunwayFrontEnd
from landing_sim.vision.windows import EdgeConfig
from landing_sim.world.dryden import W20, Turbulence
from landing_sim.world.markings import stripe_count
from landing_sim.world.runway import Greys, Runway, Taxiway
from landing_sim.world.wind import CrosswindStep, ExponentialGust, SteadyWind, Wind, WindConfig

STOPPED = 0.5  # [m/s] over the ground
GO_AROUND_ENDS = 300.0  # [m] beyond the threshold
UPSET_ROLL, UPSET_PITCH = 1.0, 0.8  # [rad] beyond these it is falling, not flying
UNDERGROUND = 30.0  # [m] below the threshold: where there is no ground


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the flight ended: "stopped", "crash", "off_runway", "go_around", "time" or "numeric_error"."""

    end: str
    touchdown: Touchdown | None
    reason: str = ""  # what the flight model said when it could not go on


@dataclass(frozen=True, slots=True)
class Parts:
    """The concrete parts of one flight, in the order of the loop's arguments."""

    clock: loop.Clock
    plant: JsbsimPlant
    world: Wind
    sensors: tuple[Sensor, ...]
    front_ends: dict[str, FrontEnd]
    estimator: Estimator
    guidance: LandingGuidance
    controller: LandingController


class Mission:
    """One flight, ready to be flown once."""

    def __init__(self, scenario: Scenario, parts: Parts) -> None:
        self.parts = parts
        self._limit = scenario.time.limit_s
        self._half_width, self._length = 0.5 * scenario.runway.width_m, scenario.runway.length_m
        self._rise = scenario.runway.slope_percent / 100.0
        self._outcome: Outcome | None = None

    def steps(self) -> Iterator[Step]:
        """Fly to the end, a Step a control cycle. The last Step is the one that ended it."""
        p = self.parts
        end, reason = "time", ""
        try:
            for step in loop.simulate(
                p.clock,
                p.plant,
                p.world,
                p.sensors,
                p.front_ends,
                p.estimator,
                p.guidance,
                p.controller,
                p.plant.trimmed,
            ):
                yield step
                ended = self._ended(step)
                if ended:
                    end = ended
                    break
        except (PlantError, FloatingPointError) as error:
            end, reason = "numeric_error", str(error)
        self._outcome = Outcome(end, p.plant.touchdown, reason)

    def outcome(self) -> Outcome:
        """Raises RuntimeError before the flight is over."""
        if self._outcome is None:
            raise RuntimeError("the flight is not over: exhaust steps() first")
        return self._outcome

    def _ended(self, step: Step) -> str:
        truth = step.truth
        x, y = float(truth.p_RB[0]), float(truth.p_RB[1])
        ground_speed = math.hypot(truth.v_RB_R[0], truth.v_RB_R[1])
        on_ground = bool(truth.on_ground[0] or truth.on_ground[1])
        touchdown = self.parts.plant.touchdown
        if touchdown is not None and touchdown.sink_rate > CRASH_SINK:
            return "crash"
        upset = abs(truth.euler[0]) > UPSET_ROLL or abs(truth.euler[1]) > UPSET_PITCH
        if upset or float(truth.p_RB[2]) > UNDERGROUND + max(0.0, -self._rise * x):
            return "crash"
        if on_ground and (abs(y) > self._half_width or not 0.0 <= x <= self._length):
            return "off_runway"
        if on_ground and ground_speed < STOPPED:
            return "stopped"
        if step.reference.mode == "go_around" and x > GO_AROUND_ENDS and not on_ground:
            return "go_around"
        if truth.t >= self._limit:
            return "time"
        return ""


def build(scenario: Scenario, vehicle: Vehicle, seed: int, run: int = 0) -> Mission:
    """Everything one flight needs. `run` selects independent random streams under the same seed."""

    def noise(name: str) -> Noise:
        return Noise(seed, name, run)

    clock = loop.Clock.of(scenario.time.step_s, scenario.time.cycle_s, scenario.control.delay_s)
    wind = _wind(scenario, noise("turbulence"))
    platform = _platform(scenario, vehicle, noise("operator"))
    plant = _plant(scenario, vehicle, platform, wind)
    sensors = _sensors(scenario, platform, noise)
    camera = _believed_camera(scenario, vehicle)
    settings = _control_settings(scenario, vehicle)
    planned = _design(paths.aircraft_folder(scenario.aircraft.model), settings, vehicle.mass_kg)
    return Mission(
        scenario,
        Parts(
            clock,
            plant,
            wind,
            sensors,
            _front_ends(scenario, camera),
            _estimator(scenario, vehicle, camera, noise("believed")),
            LandingGuidance(vehicle.guidance, math.atan(scenario.runway.slope_percent / 100.0)),
            LandingController(planned, (platform.pan, platform.tilt)),
        ),
    )


# ------------------------------------------------------------------------------------------------- the true side


def _runway(scenario: Scenario) -> Runway:
    r = scenario.runway
    return Runway(
        width=r.width_m,
        length=r.length_m,
        slope=math.atan(r.slope_percent / 100.0),
        painted=r.markings,
        taxiways=tuple(Taxiway(t.x_m, t.width_m, t.side, t.flare_m) for t in r.taxiways),
        greys=Greys(sky=r.grey.sky, grass=r.grey.grass, surface=r.grey.surface, paint=r.grey.marking),
    )


def _wind(scenario: Scenario, noise: Noise) -> Wind:
    w = scenario.wind
    everywhere = w.crosswind_from_x_m is None
    turbulence = None
    if w.turbulence is not None:
        t = w.turbulence
        turbulence = Turbulence((t.wind_at_20ft_mps or 0.0) if t.severity is None else W20[t.severity])
    config = WindConfig(
        steady=SteadyWind(w.headwind_mps, w.crosswind_mps if everywhere else 0.0),
        step=None if w.crosswind_from_x_m is None else CrosswindStep(w.crosswind_from_x_m, w.crosswind_mps),
        gust=None
        if w.gust is None
        else ExponentialGust(w.gust.at_x_m, w.gust.lateral_mps, w.gust.vertical_mps, w.gust.time_constant_s),
        turbulence=turbulence,
    )
    return Wind(config, noise)


def _platform(scenario: Scenario, vehicle: Vehicle, noise: Noise) -> PanTilt:
    """The camera mount, turned by an operator to where the runway is thought to be."""
    p, start = scenario.camera.platform, scenario.initial
    off = math.radians(scenario.believed.pointing_sigma_deg) * np.clip(noise.normal(2), -2.0, 2.0)
    return PanTilt(
        lag=p.lag_s,
        rate_limit=math.radians(p.rate_limit_dps),
        pan_limit=math.radians(vehicle.camera.pan_limit_deg),
        tilt_limit=math.radians(vehicle.camera.tilt_limit_deg),
        stabilisation=p.stabilisation,
        pan=-math.radians(start.heading_deg) + float(off[0]),
        tilt=-math.radians(start.flight_path_deg) + float(off[1]),
    )


def _plant(scenario: Scenario, vehicle: Vehicle, platform: PanTilt, wind: Wind) -> JsbsimPlant:
    a, s, r = scenario.aircraft, scenario.initial, scenario.runway
    frame = RunwayFrame(
        math.radians(r.latitude_deg), math.radians(r.longitude_deg), r.elevation_m, math.radians(r.heading_deg)
    )
    initial = InitialState(
        x=s.x_m,
        y=s.y_m,
        height=s.height_m,
        psi=math.radians(s.heading_deg),
        airspeed=s.airspeed_mps,
        gamma=math.radians(s.flight_path_deg),
        flap=vehicle.control.flap if a.flap is None else a.flap,
        mass=a.mass_kg,
        cg_offset_B=(a.cg_offset_m, 0.0, 0.0),
    )
    return JsbsimPlant(
        paths.aircraft_folder(a.model),
        frame,
        initial,
        math.atan(r.slope_percent / 100.0),
        scenario.time.step_s,
        wind.wind(0.0, s.x_m, s.height_m, s.airspeed_mps),
        platform,
        np.array(vehicle.camera.p_BC_m),
    )


def _sensors(scenario: Scenario, platform: PanTilt, noise: Callable[[str], Noise]) -> tuple[Sensor, ...]:
    """Inertial first: what the camera's front end is told rests on them."""
    cycle, c, p, s = scenario.time.cycle_s, scenario.camera, scenario.camera.platform, scenario.sensors
    bias = math.radians(p.encoder_bias_deg)
    camera = Camera(
        Intrinsics.centred(c.width_px, c.height_px, c.focal_px),
        _runway(scenario),
        platform,
        noise("pixels"),
        noise("encoder"),
        Optics(c.blur_px, c.noise_dn, c.gain, 0.0, c.exposure_s, c.renderer),
        Encoders(bias, bias, math.radians(p.encoder_noise_deg), p.encoder_skew_s),
        c.period_s,
        c.latency_s,
    )
    gyro = GyroConfig(cycle, math.radians(s.gyro.noise_dps), math.radians(s.gyro.bias_dps))
    return (
        Gyro(gyro, noise("gyro")),
        Airspeed(AirspeedConfig(cycle, s.airspeed.noise_mps), noise("airspeed")),
        SquatSwitch(cycle),
        camera,
    )


# ------------------------------------------------------------------------------------------------- the onboard side


def _believed_camera(scenario: Scenario, vehicle: Vehicle) -> BelievedCamera:
    c = scenario.camera
    return BelievedCamera(
        Intrinsics.centred(c.width_px, c.height_px, c.focal_px * scenario.believed.focal_scale),
        vehicle.camera.p_BC_m,
        c.blur_px,
        max(c.noise_dn, 0.3),  # grey levels are whole numbers: never less than their rounding
        # a filter that estimates the encoders' error adds it to an acquired attitude itself
        0.0 if scenario.filter.kind == "augmented" else math.radians(scenario.believed.encoder_sigma_deg),
    )


def _believed_width(scenario: Scenario) -> float:
    believed = scenario.filter.believed_width_m
    return scenario.runway.width_m if believed is None else believed


def _front_ends(scenario: Scenario, camera: BelievedCamera) -> dict[str, FrontEnd]:
    runway, v, s = scenario.runway, scenario.vision, scenario.sensors
    seen = _runway(scenario)
    # marks come in pairs either side of the centreline: the map keeps how far out they reach
    blocks = [m for m in seen.markings if m.kind in ("aiming_point", "touchdown_zone")]
    paint = sorted({(m.x0, m.x1, -max(-m.y0, m.y1), max(-m.y0, m.y1)) for m in blocks if m.y1 > 0.0})
    known = RunwayMap(
        width=_believed_width(scenario),
        length=runway.length_m,
        slope=seen.slope,
        stripes=ThresholdStripes(stripe_count(runway.width_m) if runway.markings else 0),
        paint=tuple(paint),
        brighter=runway.grey.surface > runway.grey.grass,
        mouths=tuple(
            TaxiwayMouth(*t.mouth, Feature.LEFT if t.side == "left" else Feature.RIGHT)
            for t, wanted in zip(seen.taxiways, runway.taxiways)
            if wanted.mapped
        ),
    )
    config = FrontEndConfig(v.windows, v.platform_angle, edges=EdgeConfig(floor=v.edge_floor_px))
    front_end = RunwayFrontEnd(known, camera, config)
    return {
        "camera": front_end,
        "gyro": Reading("gyro", "gyro", math.radians(max(s.gyro.noise_dps, 0.01))),
        "airspeed": Reading("airspeed", "airspeed", _airspeed_sigma(scenario)),
        "squat": Reading("squat", "on_ground", 0.0),
    }


def _estimator(scenario: Scenario, vehicle: Vehicle, camera: BelievedCamera, noise: Noise) -> Estimator:
    f, b = scenario.filter, scenario.believed
    config = FilterConfig(
        kind=f.kind,
        factorisation=f.factorisation,
        width=f.width,
        process_noise=f.process_noise,
        gate_sigma=_gate(f.gate_sigma, f.kind),
        airspeed_sigma=_airspeed_sigma(scenario),
        encoder_sigma=math.radians(b.encoder_sigma_deg),
        encoder_noise=math.radians(scenario.camera.platform.encoder_noise_deg),
        gyro_bias_sigma=math.radians(scenario.sensors.gyro.bias_dps),
    )
    believed = replace(vehicle.believed, rho=_air_density(scenario), mass=vehicle.mass_kg)
    ekf = RunwayEkf(
        config,
        believed.perturbed(noise, b.aero_sigma, b.mass_sigma),
        camera.intrinsics,
        np.array(camera.p_BC),
        _believed_width(scenario),
        math.atan(scenario.runway.slope_percent / 100.0),
    )
    latency = scenario.camera.latency_s
    if latency > 0.0 and f.compensate_latency:
        return Rewind(ekf, latency + 2.0 * scenario.time.cycle_s)
    return ekf


def _airspeed_sigma(scenario: Scenario) -> float:
    return max(scenario.sensors.airspeed.noise_mps, 0.05)


def _gate(wanted: float | str | None, kind: str) -> float | None:
    """A filter that does not know of wind blames the edges for it: a gate would reject true ones."""
    if isinstance(wanted, str):
        return 4.0 if kind == "augmented" else None
    return wanted


def _air_density(scenario: Scenario) -> float:
    """[kg/m^3] of the standard atmosphere where the approach begins: what an altimeter tells the crew."""
    height = scenario.runway.elevation_m + 0.5 * scenario.initial.height_m
    return 1.225 * (1.0 - 0.0065 * height / 288.15) ** 4.2559


def _control_settings(scenario: Scenario, vehicle: Vehicle) -> ControlSettings:
    c, rho, flap = vehicle.control, scenario.control.rho, scenario.aircraft.flap
    axes = {name: replace(getattr(c, name), rho=rho) for name in ("longitudinal", "lateral")}
    return replace(c, flap=c.flap if flap is None else flap, **axes)


_designs: dict[tuple[Path, str], Design] = {}


def _design(folder: Path, settings: ControlSettings, mass: float) -> Design:
    """Gains from the nominal aircraft, never from the dispersed one; made once a process."""
    key = (folder, f"{mass!r} {settings!r}")
    if key not in _designs:
        _designs[key] = design(settings, linear_models(folder, settings, mass))
    return _designs[key]


def linear_models(folder: Path, settings: ControlSettings, mass: float) -> list[LinearModel]:
    """The nominal aircraft linearised at the controller's trim points."""
    models = []
    for wanted in settings.trim_points:
        point = trim(folder, wanted.airspeed_mps, math.radians(wanted.flight_path_deg), settings.flap, mass)
        linear = linearise(folder, point)
        V, alpha = point.airspeed, point.alpha
        state = np.zeros(12)
        state[[0, 2, 7, 11]] = V * math.cos(alpha), V * math.sin(alpha), point.theta, point.height
        inputs = np.array([point.elevator, point.thrust, 0.0, 0.0])
        models.append(LinearModel(V, point.gamma, point.mass, state, inputs, linear.A, linear.B))
    return models
