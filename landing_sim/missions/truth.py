"""The true side of one flight: the scenario's world, vehicle and sensors as concrete parts."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from landing_sim import paths
from landing_sim.geometry.earth import RunwayFrame
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.interfaces import Sensor
from landing_sim.missions.failing import with_faults
from landing_sim.noise import NoiseStream
from landing_sim.plants.aircraft import InitialState, JsbsimPlant
from landing_sim.scenario import Scenario
from landing_sim.sections.wind import Wind as WantedWind
from landing_sim.sensors.airdata import Airspeed, AirspeedConfig, FlowAngles, FlowAnglesConfig
from landing_sim.sensors.camera import Camera, Encoders
from landing_sim.sensors.inertial import Gyro, GyroConfig
from landing_sim.sensors.inertial_reference import InertialReference, InertialReferenceConfig
from landing_sim.sensors.optic_flow import MotionSensor, MotionSensorConfig
from landing_sim.sensors.optic_flow_edges import EdgeConfig
from landing_sim.sensors.platform import PanTilt, Strapdown
from landing_sim.sensors.render import Optics
from landing_sim.sensors.squat import SquatSwitch
from landing_sim.vehicle import Vehicle
from landing_sim.world.dryden import FOOT, W20, Turbulence, low_altitude
from landing_sim.world.field import Field, FieldConfig
from landing_sim.world.first_order import FirstOrder
from landing_sim.world.gusts import DiscreteGust
from landing_sim.world.microburst import Microburst
from landing_sim.world.runway import Greys, Runway, Taxiway
from landing_sim.world.shear import AT_33FT, CATEGORY_C_ROUGHNESS, CertificationWind, LogWind
from landing_sim.world.wind import CrosswindStep, ExponentialGust, SteadyWind, Wind, WindConfig


def runway(scenario: Scenario) -> Runway:
    """The runway as it is."""
    r = scenario.runway
    return Runway(
        width=r.width_m,
        length=r.length_m,
        slope=math.atan(r.slope_percent / 100.0),
        painted=r.markings,
        taxiways=tuple(Taxiway(t.x_m, t.width_m, t.side, t.flare_m) for t in r.taxiways),
        greys=Greys(sky=r.grey.sky, grass=r.grey.grass, surface=r.grey.surface, paint=r.grey.marking),
    )


def turbulence(wanted: WantedWind) -> Turbulence | FirstOrder | None:
    """The continuous turbulence. Where it goes with the wind at 33 ft, that of the steady wind unless it is named."""
    t = wanted.turbulence
    if t is None:
        return None
    if t.model == "first_order":
        return FirstOrder(0.15 * (_wind_33ft(wanted) if t.wind_at_33ft_mps is None else t.wind_at_33ft_mps))
    return Turbulence((t.wind_at_20ft_mps or 0.0) if t.severity is None else W20[t.severity])


def wind_20ft(wanted: WantedWind) -> float:
    """[m/s] the wind at 20 ft whose Dryden turbulence is, at 100 ft, as strong as what blows, in the stronger axis."""
    air = turbulence(wanted)
    if air is None:
        return 0.0
    if isinstance(air, Turbulence):
        return air.w20
    sigma_uv, sigma_w, _, _ = low_altitude(100.0 * FOOT, 1.0)
    return max(air.sigma_level / sigma_uv, air.sigma_vertical / sigma_w)


def _wind_33ft(wanted: WantedWind) -> float:
    if wanted.profile is None:  # a crosswind that blows only on a part of the way counts, too
        return math.hypot(wanted.headwind_mps, wanted.crosswind_mps)
    return math.hypot(*_steady(wanted).velocity(0.0, 0.0, 0.0, AT_33FT, 0.0))


def _steady(w: WantedWind) -> SteadyWind | LogWind | CertificationWind:
    if w.profile is None:
        return SteadyWind(w.headwind_mps, w.crosswind_mps if w.crosswind_from_x_m is None else 0.0)
    if w.profile.law == "certification":
        return CertificationWind(w.headwind_mps, w.crosswind_mps)
    return LogWind(
        w.headwind_mps,
        w.crosswind_mps,
        w.profile.reference_height_m or AT_33FT,
        w.profile.roughness_m or CATEGORY_C_ROUGHNESS,
    )


def wind(scenario: Scenario, noise: NoiseStream) -> Wind:
    """All that moves the air."""
    w = scenario.wind
    config = WindConfig(
        steady=_steady(w),
        step=None if w.crosswind_from_x_m is None else CrosswindStep(w.crosswind_from_x_m, w.crosswind_mps),
        gust=None
        if w.gust is None
        else ExponentialGust(w.gust.at_x_m, w.gust.lateral_mps, w.gust.vertical_mps, w.gust.time_constant_s),
        turbulence=turbulence(w),
        discrete=None
        if (g := w.discrete_gust) is None
        else DiscreteGust(g.at_x_m, g.headwind_mps, g.lateral_mps, g.vertical_mps, g.gradient_m, g.shape),
        microburst=None
        if (b := w.microburst) is None
        else Microburst(b.x_m, b.y_m, b.radius_m, b.outflow_mps, b.outflow_height_m),
    )
    return Wind(config, noise, scenario.runway.slope_percent / 100.0)


def heading(scenario: Scenario, vehicle: Vehicle) -> float:
    """[rad] at the start: as wanted, or crabbed so that the steady wind does not blow it off the landing direction."""
    start = scenario.initial
    if start.heading_deg is not None:
        return math.radians(start.heading_deg)
    across = steady_wind(scenario, vehicle)[1] / _airspeed(scenario, vehicle)
    return -math.asin(min(max(across, -1.0), 1.0))


def steady_wind(scenario: Scenario, vehicle: Vehicle) -> tuple[float, float, float]:
    """[m/s] the air's mean velocity in R where the flight begins."""
    s = scenario.initial
    return _steady(scenario.wind).velocity(0.0, s.x_m, s.y_m, s.height_m, _airspeed(scenario, vehicle))


def _airspeed(scenario: Scenario, vehicle: Vehicle) -> float:
    """[m/s] true, at the start."""
    wanted = scenario.initial.airspeed_mps
    return vehicle.guidance.path.approach_mps if wanted is None else wanted


def platform(scenario: Scenario, vehicle: Vehicle, noise: NoiseStream) -> PanTilt | Strapdown:
    """The camera mount: bolted down, or turned by an operator to where the runway is thought to be."""
    if vehicle.camera.fixed_tilt_deg is not None:
        return Strapdown(math.radians(vehicle.camera.fixed_tilt_deg))
    p, start = scenario.camera.platform, scenario.initial
    off = math.radians(scenario.believed.pointing_sigma_deg) * np.clip(noise.normal(2), -2.0, 2.0)
    return PanTilt(
        lag=p.lag_s,
        rate_limit=math.radians(p.rate_limit_dps),
        pan_limit=math.radians(vehicle.camera.pan_limit_deg),
        tilt_limit=math.radians(vehicle.camera.tilt_limit_deg),
        stabilisation=p.stabilisation,
        pan=-heading(scenario, vehicle) + float(off[0]),
        tilt=-math.radians(start.flight_path_deg) + float(off[1]),
    )


def plant(scenario: Scenario, vehicle: Vehicle, platform: PanTilt | Strapdown, wind: Wind) -> JsbsimPlant:
    """The aircraft in trim at its start."""
    a, s, r = scenario.aircraft, scenario.initial, scenario.runway
    frame = RunwayFrame(
        math.radians(r.latitude_deg), math.radians(r.longitude_deg), r.elevation_m, math.radians(r.heading_deg)
    )
    initial = InitialState(
        x=s.x_m,
        y=s.y_m,
        height=s.height_m,
        psi=heading(scenario, vehicle),
        airspeed=_airspeed(scenario, vehicle),
        gamma=math.radians(s.flight_path_deg),
        flap=vehicle.control.flap if a.flap is None else a.flap,
        mass=a.mass_kg,
        cg_offset_B=(a.cg_offset_m, 0.0, 0.0),
        temperature_offset=scenario.atmosphere.temperature_offset_K,
    )
    return JsbsimPlant(
        paths.aircraft_folder(a.model),
        frame,
        initial,
        math.atan(r.slope_percent / 100.0),
        scenario.time.step_s,
        wind.wind(0.0, s.x_m, s.y_m, s.height_m, _airspeed(scenario, vehicle)),
        platform,
        np.array(vehicle.camera.p_BC_m),
    )


def sensors(
    scenario: Scenario, platform: PanTilt | Strapdown, noise: Callable[[str], NoiseStream]
) -> tuple[Sensor, ...]:
    """Inertial first: what the camera's front end is told rests on them. Those that the scenario has fail do.

    A fault of "inertial" is one of the whole unit: of the rate gyros on an aircraft that flies on the runway filter, of
    those and the reference's attitude and velocity on one that flies on the range observer. The camera platform has gyros
    of its own (see PanTilt) and goes on.
    """
    cycle, c, p, s = scenario.time.cycle_s, scenario.camera, scenario.camera.platform, scenario.sensors
    bias = math.radians(p.encoder_bias_deg)
    camera = Camera(
        Intrinsics.centred(c.width_px, c.height_px, c.focal_px),
        runway(scenario),
        platform,
        noise("pixels"),
        noise("encoder"),
        Optics(c.blur_px, c.noise_dn, c.gain, 0.0, c.exposure_s, c.renderer),
        Encoders(bias, bias, math.radians(p.encoder_noise_deg), p.encoder_skew_s),
        c.period_s,
        c.latency_s,
    )
    unit, vanes = s.inertial, s.flow_angles
    reference = InertialReference(
        InertialReferenceConfig(
            cycle,
            math.radians(unit.attitude_bias_deg),
            math.radians(unit.heading_bias_deg),
            unit.velocity_bias_sigma_mps,
            None if unit.velocity_bias_mps is None else unit.velocity_bias_mps,
            math.radians(unit.attitude_noise_deg),
            math.radians(unit.rate_noise_dps),
            unit.velocity_noise_mps,
        ),
        math.radians(scenario.runway.heading_deg),
        noise("inertial"),
    )
    flow = FlowAnglesConfig(cycle, math.radians(vanes.noise_deg), math.radians(vanes.bias_deg))
    air = () if scenario.filter.kind != "observer" else (reference, FlowAngles(flow, noise("flow_angles")))
    gyro = GyroConfig(cycle, math.radians(s.gyro.noise_dps), math.radians(s.gyro.bias_dps))
    healthy = (
        Gyro(gyro, noise("gyro")),
        Airspeed(AirspeedConfig(cycle, s.airspeed.noise_mps), noise("airspeed")),
        *air,
        SquatSwitch(cycle),
        *_eyes(scenario, noise),
        camera,
    )
    unit_names = tuple(sensor.name for sensor in healthy if sensor.name in ("gyro", "inertial"))
    return with_faults(healthy, scenario.faults, noise, {"inertial": unit_names})


def _eyes(scenario: Scenario, noise: Callable[[str], NoiseStream]) -> tuple[MotionSensor, ...]:
    """The visual motion sensors, where they really look."""
    s = scenario.sensors.optic_flow
    if not s.angles_deg:
        return ()
    field = Field(FieldConfig(s.contrast), noise("field"))
    edges = EdgeConfig(spacing=math.radians(s.spacing_deg), slowest=math.radians(s.slowest_dps))
    names = {f"flow_{i + 1}": angle for i, angle in enumerate(s.angles_deg)}
    return tuple(
        MotionSensor(
            name,
            MotionSensorConfig(
                scenario.time.cycle_s,
                math.radians(angle + s.mounting_error_deg),
                acceptance=math.radians(s.acceptance_deg),
                rate=s.rate_hz,
                noise=s.noise_dn,
                level=scenario.runway.grey.grass,
                blind=0.8 * s.lowest_m,
                edges=edges,
            ),
            field,
            noise(name),
        )
        for name, angle in names.items()
    )
