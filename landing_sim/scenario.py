"""A scenario: everything about one flight, from a YAML file into frozen, checked values.

Units stand in the keys (height_m, heading_deg). Defaults are the setting that the project's acceptance figures are
stated for, so a file says only what is its own. What is true of the world and what is believed on board are separate
sections; a key that nothing implements does not exist, so a wish can never be silently ignored.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from landing_sim import config, paths, yamlfile
from landing_sim.config import Section, inconsistent
from landing_sim.errors import ConfigError, Location, Problem, ScenarioError, did_you_mean

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Grey = Annotated[float, Field(ge=0, le=255)]


class Time(Section):
    """The clock. Every period must be a whole number of steps."""

    step_s: float = Field(0.005, gt=0, le=0.02, description="step of the flight model")
    cycle_s: Positive = Field(
        0.06, description="control cycle: gyros, airspeed, estimator and controller run once in it"
    )
    limit_s: float = Field(120.0, gt=0, le=3600, description="end the run here if nothing else has")


class Aircraft(Section):
    """Which vehicle flies, and how it is loaded. null leaves a value to the vehicle's own file."""

    model: str = Field("do128", min_length=1, description="folder under aircraft/")
    mass_kg: Positive | None = Field(None, description="true mass; null = the vehicle's nominal")
    cg_offset_m: float = Field(0.0, ge=-1, le=1, description="true cg ahead (+) of its nominal place")
    flap: float | None = Field(
        None, ge=0, le=1, description="flap setting, 0..1; null = the vehicle's approach setting"
    )


class Initial(Section):
    """Where and how the flight begins, in trim. Runway frame: x along the landing direction, y right."""

    x_m: float = Field(
        -950.0, ge=-20000, le=20000, description="cg along the runway from the threshold; before it is negative"
    )
    y_m: float = Field(-85.0, ge=-5000, le=5000, description="cg right of the centreline")
    height_m: float = Field(51.0, gt=0, le=3000, description="cg above the threshold")
    heading_deg: float = Field(15.0, gt=-180, le=180, description="nose right (+) of the landing direction")
    airspeed_mps: Positive | None = Field(50.0, description="true airspeed; null = the vehicle's approach speed")
    flight_path_deg: float = Field(-3.0, ge=-15, le=15, description="air-relative flight path angle, climb positive")


class Taxiway(Section):
    """An exit: the runway's edge is missing along its mouth."""

    x_m: float = Field(description="middle of the mouth, from the threshold")
    width_m: Positive = Field(12.0, description="width of the taxiway")
    side: Literal["left", "right"] = Field(description="side of the runway it leaves to")
    flare_m: float = Field(12.0, ge=0, lt=100, description="its mouth widens by this to each side, at 45 degrees")
    mapped: bool = Field(True, description="known on board, so that windows on the mouth are dropped")


class GreyLevels(Section):
    """Brightness of what the camera sees, in grey levels (DN)."""

    grass: Grey = Field(90.0, description="ground beside the runway")
    surface: Grey = Field(145.0, description="the runway's surface")
    marking: Grey = Field(215.0, description="painted markings")
    sky: Grey = Field(180.0, description="above the horizon")


class Runway(Section):
    """The true runway."""

    width_m: float = Field(29.0, gt=0, le=200, description="between the borderlines")
    length_m: float = Field(1680.0, gt=0, le=8000, description="threshold to far end")
    slope_percent: float = Field(0.0, ge=-2, le=2, description="rise along the landing direction")
    elevation_m: float = Field(0.0, ge=-450, le=5000, description="threshold above the ellipsoid")
    heading_deg: float = Field(262.0, ge=0, le=360, description="true course of the landing direction")
    latitude_deg: float = Field(52.32, ge=-85, le=85, description="threshold, WGS 84")
    longitude_deg: float = Field(10.55, ge=-180, le=180, description="threshold, WGS 84")
    markings: bool = Field(True, description="paint ICAO markings")
    taxiways: tuple[Taxiway, ...] = Field((), max_length=20, description="exits that break the borderlines")
    grey: GreyLevels = Field(GreyLevels(), description="brightness of the scene")


class Gust(Section):
    """The paper's gust: added from a place on, decaying with time (section 7.1)."""

    at_x_m: float = Field(-650.0, description="where it strikes")
    lateral_mps: float = Field(-2.0, ge=-30, le=30, description="towards +y (right)")
    vertical_mps: float = Field(1.0, ge=-30, le=30, description="updraught positive")
    time_constant_s: Positive = Field(6.0, description="it decays as exp(-t/this)")


class Turbulence(Section):
    """Dryden turbulence, MIL-F-8785C low-altitude model. Give a severity or a wind at 20 ft, not both."""

    model: Literal["dryden"] = Field("dryden", description="spectral model")
    severity: Literal["light", "moderate", "severe"] | None = Field(None, description="15, 30, 45 kt at 20 ft")
    wind_at_20ft_mps: NotNegative | None = Field(None, description="sets the intensity directly")


class Wind(Section):
    """The moving air."""

    headwind_mps: float = Field(0.0, ge=-30, le=30, description="steady, positive on the nose")
    crosswind_mps: float = Field(0.0, ge=-30, le=30, description="steady, positive blowing towards +y (right)")
    crosswind_from_x_m: float | None = Field(None, description="crosswind blows only beyond this x; null = everywhere")
    gust: Gust | None = Field(None, description="null = none")
    turbulence: Turbulence | None = Field(None, description="null = none")


class Platform(Section):
    """The two-axis camera mount."""

    lag_s: NotNegative = Field(0.08, description="time constant of its servo")
    rate_limit_dps: Positive = Field(60.0, description="fastest it turns")
    stabilisation: float = Field(0.95, ge=0, le=1, description="inertial rate feedback: 0 none, 1 perfect")
    encoder_bias_deg: float = Field(0.03, ge=-5, le=5, description="constant error of both angle readings")
    encoder_noise_deg: NotNegative = Field(0.005, description="1 sigma, each reading")
    encoder_skew_s: float = Field(0.0, ge=0, le=1, description="angle readings are older than the image by this")


class Camera(Section):
    """The true camera."""

    width_px: int = Field(512, ge=64, le=4096, description="image width")
    height_px: int = Field(512, ge=64, le=4096, description="image height")
    focal_px: float = Field(2000.0, ge=50, le=50000, description="focal length in pixels")
    blur_px: float = Field(0.7, ge=0.3, le=20, description="optical blur, 1 sigma, the pixel's own aperture included")
    noise_dn: float = Field(4.0, ge=0, le=100, description="noise of a pixel, 1 sigma in grey levels")
    gain: float = Field(1.0, gt=0, le=20, description="factor on all grey levels before they clip at 255")
    exposure_s: float = Field(0.0, ge=0, le=0.1, description="shutter time, centred on the time stamp: motion blur")
    period_s: Positive = Field(0.06, description="time between frames")
    latency_s: float = Field(0.0, ge=0, le=2, description="age of an image when the computer gets it")
    renderer: Literal["exact", "line_aa", "line_8"] = Field(
        "exact", description="edges where they belong, or OpenCV's own fill, which grows them (a negative control)"
    )
    platform: Platform = Field(Platform(), description="pan and tilt")


class Gyro(Section):
    """Rate gyros, three axes."""

    bias_dps: float = Field(0.1, ge=0, le=20, description="1 sigma of the constant bias of an axis, drawn per run")
    noise_dps: float = Field(0.1, ge=0, le=20, description="1 sigma of a sample")


class Airspeed(Section):
    """True airspeed from the air data computer."""

    noise_mps: float = Field(0.5, ge=0, le=20, description="1 sigma of a sample")


class InertialUnit(Section):
    """Inertial reference unit: attitude, rates and velocity over the ground. Biases are drawn per run."""

    attitude_bias_deg: float = Field(0.05, ge=0, le=5, description="1 sigma of the constant error of roll and of pitch")
    heading_bias_deg: float = Field(0.3, ge=0, le=10, description="1 sigma of the constant error of true heading")
    velocity_bias_sigma_mps: float = Field(0.1, ge=0, le=10, description="1 sigma of the constant error of each axis")
    velocity_bias_mps: tuple[float, float, float] | None = Field(
        None, description="this error instead of a drawn one: along the runway, right, down"
    )
    attitude_noise_deg: float = Field(0.01, ge=0, le=5, description="1 sigma of a sample")
    rate_noise_dps: float = Field(0.02, ge=0, le=5, description="1 sigma of a sample")
    velocity_noise_mps: float = Field(0.02, ge=0, le=5, description="1 sigma of a sample")


class FlowAngles(Section):
    """Vanes for angle of attack and sideslip."""

    noise_deg: float = Field(0.2, ge=0, le=10, description="1 sigma of a sample")
    bias_deg: float = Field(0.1, ge=0, le=10, description="1 sigma of the constant bias of a vane, drawn per run")


class Sensors(Section):
    """Sensors other than the camera."""

    gyro: Gyro = Field(Gyro(), description="rate gyros")
    airspeed: Airspeed = Field(Airspeed(), description="airspeed")
    inertial: InertialUnit = Field(InertialUnit(), description="inertial reference unit, used by filter.kind observer")
    flow_angles: FlowAngles = Field(FlowAngles(), description="vanes, used by filter.kind observer")


class Vision(Section):
    """The front end."""

    windows: str = Field(
        "3L3R2T2H",
        pattern=r"^[0-9]{1,2}L[0-9]{1,2}R([0-9]{1,2}T)?[0-9]{1,2}H$",
        description="windows on left, right borderline, threshold, horizon; a lost threshold's move to the borderlines",
    )
    platform_angle: Literal["encoder", "commanded"] = Field("encoder", description="which platform angles are believed")
    edge_floor_px: float = Field(
        0.01, ge=0, le=5, description="1 sigma added to what noise makes an edge uncertain by: 0.5 is the trust of 1992"
    )


class Filter(Section):
    """The estimator."""

    kind: Literal["augmented", "plain", "split", "observer"] = Field(
        "augmented",
        description="12 states with wind and gyro bias; the paper's 12; the paper's two halves of 6; or a range observer "
        "on an unknown runway (section observer)",
    )
    factorisation: Literal["dense", "ud"] = Field(
        "dense", description="full covariance, or Bierman's sequential U-D update"
    )
    process_noise: Literal["integrated", "constant"] = Field(
        "integrated", description="eq. (9), or the constant matrix of eqs. (13), (14)"
    )
    width: Literal["known", "state", "separate"] = Field(
        "known", description="runway width: believed, estimated, or by a second filter"
    )
    believed_width_m: float | None = Field(None, gt=0, le=200, description="null = the true width")
    compensate_latency: bool = Field(True, description="apply an image at the time it was exposed")
    gate_sigma: Annotated[float, Field(gt=0, le=100)] | Literal["auto"] | None = Field(
        "auto", description="reject a window beyond this; null = no gate; auto = 4 if wind is estimated, else no gate"
    )


class Observer(Section):
    """The runway's size is not known: its change with the aircraft's own motion tells the range (filter.kind observer)."""

    ranging: Literal["gibert", "ekf"] = Field("gibert", description="high-gain observer, or extended Kalman filter")
    outputs: Literal["both", "width", "point"] = Field(
        "both",
        description="what gibert ranges with: the runway's angular width, the threshold's bearing (unobservable on the "
        "glide path), or both",
    )
    first_range_m: Positive | None = Field(
        None, description="first guess of the range to the threshold; null = what a runway 45 m wide would be at"
    )
    bandwidth_rps: float = Field(0.5, gt=0, le=5, description="of the range at first, gibert; it falls to half")
    attitude: Literal["inertial", "horizon"] = Field("inertial", description="where roll and pitch come from")
    trust_percent: float = Field(
        10.0, gt=0, le=100, description="the range steers nothing before its error bound has come below this"
    )


class Believed(Section):
    """How far the onboard models are from the truth."""

    aero_sigma: float = Field(
        0.08, ge=0, le=0.5, description="1 sigma of the relative error of each aerodynamic parameter"
    )
    mass_sigma: float = Field(0.03, ge=0, le=0.5, description="1 sigma of the relative error of mass and inertia")
    turbulence_mps: NotNegative | None = Field(
        None, description="reported turbulence, as the wind at 20 ft that goes with it; null = as it is"
    )
    focal_scale: float = Field(1.0, ge=0.5, le=2, description="believed over true focal length")
    encoder_sigma_deg: float = Field(
        0.03, ge=0, le=5, description="what the data sheet says of the platform's constant angle error, 1 sigma"
    )
    pointing_sigma_deg: float = Field(
        0.7, ge=0, le=5, description="how well the camera is turned to the runway at the start, 1 sigma, cut at 2"
    )


class Control(Section):
    """The controller."""

    delay_s: float = Field(0.06, ge=0, le=1, description="from a command's computation to the actuators")
    rho: float = Field(
        0.1, ge=0, le=100, description="weight of plain LQ against the prescribed eigenstructure (0 = exact)"
    )


class Record(Section):
    """What is written down."""

    frames_hz: NotNegative = Field(5.0, description="camera images in the recording, per second; 0 = none")


Metric = Literal[
    "range_m",
    "range_far_percent",
    "height_approach_m",
    "height_runway_m",
    "lateral_m",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "airspeed_mps",
    "speed_forward_mps",
    "wind_along_mps",
    "wind_across_mps",
    "wind_down_mps",
    "width_m",
    "captured_after_m",
    "peak_roll_deg",
    "touchdown_x_m",
    "touchdown_y_m",
    "sink_rate_mps",
    "touchdown_airspeed_mps",
    "touchdown_bank_deg",
    "rollout_y_m",
    "final_groundspeed_mps",
    "threshold_lost_m",
    "range_1km_percent",
    "threshold_lateral_error_m",
    "threshold_height_error_m",
    "threshold_y_m",
    "threshold_above_m",
    "nees",
    "nis",
]


class Criterion(Section):
    """Bounds of one figure of the flight. Errors are the largest |estimate - truth| from 1.5 s after acquisition."""

    metric: Metric = Field(description="what is judged; range is judged in metres within 500 m and in percent beyond")
    low: float | None = Field(None, description="lowest value that passes")
    high: float | None = Field(None, description="highest value that passes")
    source: str = Field("", max_length=200, description="where the limit comes from")


LANDING = (
    Criterion(metric="touchdown_x_m", low=250.0, high=900.0, source="a safe landing"),
    Criterion(metric="touchdown_y_m", low=-3.0, high=3.0, source="a safe landing"),
    Criterion(metric="sink_rate_mps", high=1.5, source="a safe landing"),
    Criterion(metric="final_groundspeed_mps", high=10.0, source="a safe landing"),
)
"""What a landing in any weather must meet."""


class Scenario(Section):
    """One flight."""

    schema_version: Literal[1] = Field(description="version of this format")
    mission: Literal["runway_landing"] = Field(description="what is flown")
    name: str = Field(
        "", max_length=100, pattern=r"^[^/\\\x00-\x1f\x7f]*$", description="short name; the file's own if left out"
    )
    description: str = Field("", max_length=2000, description="what it is for")
    seed: int = Field(1, ge=0, lt=2**63, description="root of all random numbers")
    time: Time = Field(Time(), description="clock")
    aircraft: Aircraft = Field(Aircraft(), description="vehicle")
    initial: Initial = Field(Initial(), description="start of the flight")
    runway: Runway = Field(Runway(), description="the true runway")
    wind: Wind = Field(Wind(), description="moving air")
    camera: Camera = Field(Camera(), description="the true camera")
    sensors: Sensors = Field(Sensors(), description="other sensors")
    vision: Vision = Field(Vision(), description="front end")
    filter: Filter = Field(Filter(), description="estimator")
    observer: Observer = Field(Observer(), description="range observer, where filter.kind says so")
    believed: Believed = Field(Believed(), description="onboard models against the truth")
    control: Control = Field(Control(), description="controller")
    record: Record = Field(Record(), description="outputs")
    criteria: tuple[Criterion, ...] = Field(
        LANDING, max_length=100, description="what makes it pass; a safe landing if left out"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        problems: list[tuple[Location, str]] = []
        step, cycle = self.time.step_s, self.time.cycle_s
        periods: tuple[tuple[Location, float, float, str], ...] = (
            (("time", "cycle_s"), cycle, step, "time.step_s"),
            (("camera", "period_s"), self.camera.period_s, cycle, "time.cycle_s"),
            (("control", "delay_s"), self.control.delay_s, step, "time.step_s"),
        )
        for where, period, unit, name in periods:
            if not _whole(period, unit):
                problems.append((where, f"{period:g} is not a whole multiple of {name} = {unit:g}"))
        turbulence = self.wind.turbulence
        if turbulence and (turbulence.severity is None) == (turbulence.wind_at_20ft_mps is None):
            problems.append((("wind", "turbulence"), "give one of severity and wind_at_20ft_mps"))
        length = self.runway.length_m
        for i, taxiway in enumerate(self.runway.taxiways):
            half = 0.5 * taxiway.width_m + taxiway.flare_m
            if not half <= taxiway.x_m <= length - half:
                problems.append(
                    (("runway", "taxiways", i, "x_m"), f"its mouth reaches past the runway (0 ... {length:g})")
                )
        if self.camera.exposure_s > 0 and self.camera.renderer != "exact":
            problems.append(
                (("camera", "exposure_s"), f"renderer {self.camera.renderer!r} has no motion blur: must be 0")
            )
        for i, limit in enumerate(self.criteria):
            if limit.low is None and limit.high is None:
                problems.append((("criteria", i), "needs low, high or both"))
            elif limit.low is not None and limit.high is not None and limit.low > limit.high:
                problems.append((("criteria", i, "low"), f"is above high = {limit.high:g}"))
        inconsistent(problems)
        return self


def _whole(period: float, unit: float) -> bool:
    count = round(period / unit)
    return abs(period - count * unit) <= 1e-9 * max(period, unit) and (count > 0 or period == 0)


def load(name: str | Path, overrides: Iterable[str] = ()) -> Scenario:
    """Read, override and check a scenario.

    Parameters
    ----------
    name : a path, or the name of a shipped scenario such as ``do128/gust``
    overrides : ``path.to.key=value`` strings, as given with ``--set``

    Raises ScenarioError holding every problem with its place.
    """
    try:
        path = paths.scenario_file(str(name))
        document = yamlfile.load(path)
        config.override(document, overrides)
        if document.data.get("name") in (None, ""):
            document.data["name"] = path.stem
        scenario = config.validate(document, Scenario)
        if scenario.aircraft.model not in paths.aircraft_names():
            where: Location = ("aircraft", "model")
            near = did_you_mean(scenario.aircraft.model, paths.aircraft_names())
            message = f"no aircraft {scenario.aircraft.model!r}{near}"
            raise ConfigError([Problem(document.mark(where), where, message)])
    except ConfigError as error:
        raise ScenarioError(error.problems) from None
    return scenario


def schema() -> dict[str, Any]:
    """The JSON Schema of scenario files, for editors."""
    out = Scenario.model_json_schema()
    out["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    out["title"] = "landing-sim scenario"
    return out


def schema_text() -> str:
    """`schema()` as it is shipped in scenarios/schema.json."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def dump(scenario: Scenario) -> dict[str, Any]:
    """Every value, resolved, as plain data that loads again."""
    return scenario.model_dump(mode="json")
