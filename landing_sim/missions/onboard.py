"""The onboard side of one flight: what the crew and the designers believe, as concrete parts."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.control.design import Design, LinearModel, design
from landing_sim.control.go_around import DoubtfulGuidance, Limits
from landing_sim.control.guidance import LandingGuidance
from landing_sim.control.offset import OffsetGuidance
from landing_sim.control.settings import ControlSettings
from landing_sim.estimators.mismatch import offset_sigma
from landing_sim.estimators.observer.gibert import Gibert, GibertConfig
from landing_sim.estimators.observer.kinematic_ekf import EkfConfig, KinematicEkf
from landing_sim.estimators.observer.looking import Ranging
from landing_sim.estimators.observer.runway_observer import ObserverConfig, RunwayObserver
from landing_sim.estimators.optic_flow.aircraft import FieldFlowFrontEnd
from landing_sim.estimators.optic_flow.aircraft_backup import BackupEkf
from landing_sim.estimators.readings import Fresh, InertialFrontEnd, Reading
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.estimators.runway_filter import FilterConfig
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.interfaces import Estimator, FrontEnd, Guidance, NoiseStream
from landing_sim.missions import truth
from landing_sim.plants.trim import linearise, trim
from landing_sim.scenario import Scenario
from landing_sim.signals import Feature
from landing_sim.vehicle import Vehicle
from landing_sim.vision.believed import BelievedCamera, RunwayMap, TaxiwayMouth, ThresholdStripes
from landing_sim.vision.front_end import FrontEndConfig, RunwayFrontEnd
from landing_sim.vision.windows import EdgeConfig
from landing_sim.world.markings import stripe_count

STANDARD, LAPSE = 288.15, 0.0065  # [K] at sea level, [K/m]: the standard atmosphere
GYROS_SILENT = 3.5  # cycles without a reading until the gyros count as dead
ALONE = 1.5  # times the rates' process noise while they are: moments of gusts are then seen in images only
RECEPTORS = 6
NOMINAL_WIDTH = 45.0  # [m] what an unknown runway is drawn with until its own motion tells


def believed_camera(scenario: Scenario, vehicle: Vehicle) -> BelievedCamera:
    """The camera as calibrated."""
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


def front_ends(scenario: Scenario, camera: BelievedCamera) -> dict[str, FrontEnd]:
    """What turns each sensor's samples into measurements."""
    v, s = scenario.vision, scenario.sensors
    brighter = scenario.runway.grey.surface > scenario.runway.grey.grass
    unknown = scenario.filter.kind == "observer"
    known = RunwayMap.unknown(NOMINAL_WIDTH, brighter) if unknown else _map(scenario, brighter)
    config = FrontEndConfig(v.windows, v.platform_angle, edges=EdgeConfig(floor=v.edge_floor_px))
    front_end = RunwayFrontEnd(known, camera, config)
    found: dict[str, FrontEnd] = {
        "camera": front_end,
        "gyro": Reading("gyro", "gyro", math.radians(max(s.gyro.noise_dps, 0.01))),
        "airspeed": Reading("airspeed", "airspeed", _airspeed_sigma(scenario)),
        "squat": Reading("squat", "on_ground", 0.0),
        "inertial": InertialFrontEnd(),
        "flow_angles": Reading("flow_angles", "flow_angles", math.radians(s.flow_angles.noise_deg)),
        **_eyes(scenario),
    }
    reach = _horizon(scenario)
    if scenario.faults and reach > 0.0:  # a sensor that fails may send what is older than can be put where it belongs
        return {name: Fresh(one, reach) for name, one in found.items()}
    return found


def _eyes(scenario: Scenario) -> dict[str, FrontEnd]:
    """Front ends of the visual motion sensors, where they are believed to look."""
    s = scenario.sensors.optic_flow
    return {
        f"flow_{i + 1}": FieldFlowFrontEnd(
            f"flow_{i + 1}",
            math.radians(angle),
            math.radians(s.floor_dps),
            s.share,
            math.radians(s.slowest_dps),
            math.radians(s.fastest_dps),
            s.lowest_m,
            _passage(scenario),
            (RECEPTORS - 1) * math.radians(s.spacing_deg),
            math.radians(s.unsteady_dps3),
        )
        for i, angle in enumerate(s.angles_deg)
    }


def _passage(scenario: Scenario) -> float:
    """[s] the age of the slowest flow that is believed when its edge has crossed the row; of none without such sensors."""
    s = scenario.sensors.optic_flow
    return 0.5 * (RECEPTORS - 1) * s.spacing_deg / s.slowest_dps if s.angles_deg else 0.0


def _horizon(scenario: Scenario) -> float:
    """[s] how far back a measurement may reach: images are late, and flows are as old as half an edge's passage."""
    latency = scenario.camera.latency_s if scenario.filter.compensate_latency else 0.0
    oldest = max(latency, _passage(scenario))
    return oldest + 2.0 * scenario.time.cycle_s if oldest > 0.0 else 0.0


def _map(scenario: Scenario, brighter: bool) -> RunwayMap:
    """The runway as its chart has it."""
    runway, seen = scenario.runway, truth.runway(scenario)
    # marks come in pairs either side of the centreline: the map keeps how far out they reach
    blocks = [m for m in seen.markings if m.kind in ("aiming_point", "touchdown_zone")]
    paint = sorted({(m.x0, m.x1, -max(-m.y0, m.y1), max(-m.y0, m.y1)) for m in blocks if m.y1 > 0.0})
    return RunwayMap(
        width=_believed_width(scenario),
        length=runway.length_m,
        slope=seen.slope,
        stripes=ThresholdStripes(stripe_count(runway.width_m) if runway.markings else 0),
        paint=tuple(paint),
        brighter=brighter,
        mouths=tuple(
            TaxiwayMouth(*t.mouth, Feature.LEFT if t.side == "left" else Feature.RIGHT)
            for t, wanted in zip(seen.taxiways, runway.taxiways)
            if wanted.mapped
        ),
    )


def estimator(scenario: Scenario, vehicle: Vehicle, camera: BelievedCamera, noise: NoiseStream) -> Estimator:
    """The filter or observer that is asked for, with the aircraft believed to be a little different from what it is."""
    f, b = scenario.filter, scenario.believed
    if f.kind == "observer":
        return _late(scenario, range_observer(scenario, camera))
    believed = replace(vehicle.believed, rho=_air_density(scenario), mass=vehicle.mass_kg)
    flap = control_settings(scenario, vehicle).flap
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
        wind=truth.steady_wind(scenario, vehicle)[:2] if b.wind_reported else (0.0, 0.0),
        turbulence=_reported_turbulence(scenario),
        offset_sigma=offset_sigma(believed, vehicle.guidance.path.approach_mps, flap, b.aero_sigma, b.mass_sigma),
    )
    told = (
        believed.perturbed(noise, b.aero_sigma, b.mass_sigma),
        camera.intrinsics,
        np.array(camera.p_BC),
        _believed_width(scenario),
        math.atan(scenario.runway.slope_percent / 100.0),
    )
    ekf = RunwayEkf(config, *told)
    if not (scenario.faults or scenario.sensors.optic_flow.angles_deg):
        return _late(scenario, ekf)  # nothing can fail: what would watch for it changes no bit of a flight
    p, q, r = config.q_rates
    alone = RunwayEkf(replace(config, q_rates=(ALONE * p, ALONE * q, ALONE * r)), *told)
    return _late(scenario, BackupEkf(ekf, alone, GYROS_SILENT * scenario.time.cycle_s))


def range_observer(scenario: Scenario, camera: BelievedCamera) -> RunwayObserver:
    """The estimator for a runway that is not known."""
    o, lever = scenario.observer, np.array(camera.p_BC)
    ranging: Ranging
    if o.ranging == "gibert":
        config = GibertConfig(outputs=o.outputs, attitude=o.attitude, bandwidth=o.bandwidth_rps)
        ranging = Gibert(config, camera.intrinsics)
    else:
        ranging = KinematicEkf(
            EkfConfig(attitude=o.attitude, attitude_noise=_attitude_noise(scenario)), camera.intrinsics
        )
    return RunwayObserver(ObserverConfig(o.first_range_m, o.trust_percent / 100.0), ranging, NOMINAL_WIDTH, lever)


def _attitude_noise(scenario: Scenario) -> float:
    """[rad] of the camera's attitude in each image: inertial unit and encoders together."""
    unit, platform = scenario.sensors.inertial, scenario.camera.platform
    return math.radians(max(math.hypot(unit.attitude_noise_deg, platform.encoder_noise_deg), 1e-3))


def _late(scenario: Scenario, estimator: Estimator) -> Estimator:
    """Images and flows that are old when they arrive are applied when they were taken."""
    horizon = _horizon(scenario)
    return Rewind(estimator, horizon) if horizon > 0.0 else estimator


def _reported_turbulence(scenario: Scenario) -> float:
    """[m/s] wind at 20 ft: the report is right unless the scenario says otherwise."""
    reported = scenario.believed.turbulence_mps
    return truth.wind_20ft(scenario.wind) if reported is None else reported


def _airspeed_sigma(scenario: Scenario) -> float:
    return max(scenario.sensors.airspeed.noise_mps, 0.05)


def _gate(wanted: float | str | None, kind: str) -> float | None:
    """A filter that does not know of wind blames the edges for it: a gate would reject true ones."""
    if isinstance(wanted, str):
        return 4.0 if kind == "augmented" else None
    return wanted


def _air_density(scenario: Scenario) -> float:
    """[kg/m^3] half-way down the approach: what altimeter and thermometer tell the crew."""
    height = scenario.runway.elevation_m + 0.5 * scenario.initial.height_m
    return _density(height, scenario.atmosphere.temperature_offset_K)


def _density(height: float, warmer: float) -> float:
    """[kg/m^3] at `height` [m], below 11 km, in an atmosphere that is `warmer` [K] than the standard one at any height."""
    sea_level = STANDARD + warmer
    return 1.225 * (1.0 - LAPSE * height / sea_level) ** 4.2559 * (STANDARD / sea_level)


def prepared(scenario: Scenario, vehicle: Vehicle) -> Vehicle:
    """The vehicle for this approach: a crew knows its mass, the steady headwind and reported turbulence."""
    mass = vehicle.mass_kg if scenario.aircraft.mass_kg is None else scenario.aircraft.mass_kg
    wanted = {"glide_deg": scenario.guidance.glide_deg, "touchdown_x_m": scenario.guidance.touchdown_x_m}
    changes: dict[str, Any] = {name: value for name, value in wanted.items() if value is not None}
    if changes:
        path = replace(vehicle.guidance.path, **changes)
        vehicle = vehicle.model_copy(update={"guidance": replace(vehicle.guidance, path=path)})
    return vehicle.prepared(mass, scenario.wind.headwind_mps, _air_density(scenario), _reported_turbulence(scenario))


def reported_wind(scenario: Scenario) -> tuple[float, float] | None:
    """[m/s] the air's velocity along R's x and y at 33 ft, if the tower tells it.

    A wind without a profile is reported as it is everywhere, and on board expected to fall towards the ground all the same.
    """
    w = scenario.wind
    return (-w.headwind_mps, w.crosswind_mps) if scenario.believed.wind_reported else None


def control_settings(scenario: Scenario, vehicle: Vehicle) -> ControlSettings:
    c, rho, flap = vehicle.control, scenario.control.rho, scenario.aircraft.flap
    axes = {name: replace(getattr(c, name), rho=rho) for name in ("longitudinal", "lateral")}
    return replace(c, flap=c.flap if flap is None else flap, **axes)


def guidance(scenario: Scenario, vehicle: Vehicle) -> Guidance:
    """Glide, flare and rollout, on a line that may lie beside the centreline."""
    g: Guidance
    g = landing = LandingGuidance(vehicle.guidance, math.atan(scenario.runway.slope_percent / 100.0))
    doubt, offset = scenario.guidance.doubt, scenario.guidance.lateral_offset_m
    if doubt is not None:
        limits = Limits(
            lateral=doubt.lateral_m,
            height=doubt.height_m,
            angle=math.radians(doubt.pitch_deg),
            blind=doubt.blind_s,
            patience=doubt.patience_s,
        )
        g = DoubtfulGuidance(landing, limits)
    return g if offset == 0.0 else OffsetGuidance(g, offset)


def density_altitude(scenario: Scenario) -> float:
    """[m] where the standard atmosphere is as dense as the runway's air: what gains are planned for."""
    density = _density(scenario.runway.elevation_m, scenario.atmosphere.temperature_offset_K)
    return STANDARD / LAPSE * (1.0 - (density / 1.225) ** (1.0 / 4.2559))


_designs: dict[tuple[Path, str], Design] = {}
_DESIGNS = 8  # kept: a campaign needs another one each landing


def planned_design(folder: Path, settings: ControlSettings, mass: float, altitude: float = 0.0) -> Design:
    """Gains from the nominal aircraft, never from the dispersed one, kept for the next flight of this process.

    altitude : [m] of the runway in the standard atmosphere
    """
    key = (folder, f"{mass!r} {altitude!r} {settings!r}")
    if key not in _designs:
        while len(_designs) >= _DESIGNS:
            del _designs[next(iter(_designs))]
        _designs[key] = design(settings, linear_models(folder, settings, mass, altitude))
    return _designs[key]


def linear_models(folder: Path, settings: ControlSettings, mass: float, altitude: float = 0.0) -> list[LinearModel]:
    """The nominal aircraft linearised at the controller's trim points; a stabiliser stays where the first one has it."""
    models = []
    stabiliser: float | None = None
    for wanted in settings.trim_points:
        point = trim(
            folder,
            wanted.airspeed_mps,
            math.radians(wanted.flight_path_deg),
            settings.flap,
            mass,
            altitude + 50.0,
            stabiliser=stabiliser,
        )
        stabiliser = point.stabiliser
        linear = linearise(folder, point)
        V, alpha = point.airspeed, point.alpha
        state = np.zeros(12)
        state[[0, 2, 7, 11]] = V * math.cos(alpha), V * math.sin(alpha), point.theta, point.height
        inputs = np.array([point.elevator, point.thrust, 0.0, 0.0])
        models.append(LinearModel(V, point.gamma, point.mass, state, inputs, linear.A, linear.B))
    return models
