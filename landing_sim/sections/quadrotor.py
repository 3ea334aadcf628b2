"""A quadrotor that finds its own landing place: everything about one flight, from YAML into frozen, checked values.

R has its origin on the ground below the start, x ahead, y right; heights are above that ground.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from landing_sim.config import Section, inconsistent
from landing_sim.errors import Location
from landing_sim.sections import faults
from landing_sim.sections.bounds import NotNegative, Positive
from landing_sim.sections.faults import Fault
from landing_sim.sections.head import Head

Metre = Annotated[float, Field(ge=-20, le=20)]
Share = Annotated[float, Field(ge=0, le=1)]

METRICS = (
    *("hover_rms_m", "hover_x_rms_m", "hover_y_rms_m", "hover_z_rms_m", "hover_p99_m"),
    *("miss_m", "sink_rate_mps", "touchdown_tilt_deg", "flight_s", "cross_track_rms_m"),
    *("way_point_error_m", "platform_height_m", "platform_height_error_m"),
    *("position_error_rms_m", "fix_error_rms_m", "unlocalised_s"),
)
"""Figures of a flight; NaN where it gives none."""


class Clock(Section):
    """The clock. Every period must be a whole number of cycles, the cycle a whole number of steps."""

    step_s: float = Field(0.001, gt=0, le=0.004, description="step of the flight model and of its attitude loop")
    cycle_s: Positive = Field(
        0.01, description="cycle: sensors and estimator run once in it, controllers when they are due"
    )
    limit_s: float = Field(120.0, gt=0, le=600, description="end the run here if nothing else has")


class Airframe(Section):
    """The true vehicle, where it is not the one in aircraft/pelican."""

    payload_kg: float = Field(0.25, gt=0, le=0.5, description="carried at the centre of gravity of the bare 0.75 kg")
    thrust_sigma: float = Field(0.03, ge=0, le=0.2, description="1 sigma of the share by which thrust is off")
    attitude_bias_deg: float = Field(0.6, ge=0, le=5, description="1 sigma, each axis, of the firmware's attitude")
    attitude_wander_deg: float = Field(0.12, ge=0, le=5, description="and of what it wanders by within 2 s")


class Air(Section):
    """What pushes the vehicle about."""

    gust_n: float = Field(
        0.23, ge=0, le=3, description="rms force along each level axis on a vehicle at rest, by its drag"
    )
    gust_s: float = Field(1.0, gt=0, le=60, description="correlation time")
    vertical: float = Field(0.7, ge=0, le=2, description="vertical gusts are this share of level ones")
    wind_x_mps: float = Field(0.0, ge=-10, le=10, description="steady, velocity of the air along x")
    wind_y_mps: float = Field(0.0, ge=-10, le=10, description="and along y")


class Platform(Section):
    """A box on the ground."""

    x_m: Metre = Field(description="centre")
    y_m: Metre = Field(0.0, description="centre")
    yaw_deg: float = Field(0.0, ge=-180, le=180, description="its own x axis from R's, to the right positive")
    length_m: float = Field(0.57, gt=0, le=5, description="along its own x")
    width_m: float = Field(0.57, gt=0, le=5, description="along its own y")
    height_m: float = Field(0.14, gt=0, le=3, description="of the top's centre")
    slope_x_deg: float = Field(0.0, ge=-40, le=40, description="tilted roof: the top rises along its own x")
    slope_y_deg: float = Field(0.0, ge=-40, le=40, description="and along its own y")


class Place(Section):
    """What there is to see and to stand on: textured ground and boxes. The first box is the one to land on."""

    seed: int = Field(1, ge=0, lt=2**63, description="of textures and clutter: another seed, another place")
    boxes: tuple[Platform, ...] = Field((), max_length=20, description="none may overlap another")
    clutter: int = Field(0, ge=0, le=20, description="this many boxes that are no landing places, and as many patches")
    sun: bool = Field(False, description="boxes cast shadows; else the sky is overcast")
    contrast: float = Field(1.0, ge=0, le=2, description="of the textures")


class Latency(Section):
    """From an image's exposure until its position is in the computer's hands."""

    mean_s: NotNegative = Field(0.15, description="mean")
    jitter_s: NotNegative = Field(0.02, description="1 sigma")
    spike_share: Share = Field(0.02, description="of all images, which are later still")
    spike_low_s: NotNegative = Field(0.10, description="by between this")
    spike_high_s: NotNegative = Field(0.25, description="and this")


class Eye(Section):
    """The fisheye that looks straight down."""

    width_px: Literal[320, 640] = Field(640, description="pixels across 140 deg; three quarters as many down")
    noise_dn: NotNegative = Field(2.0, description="one sigma of a pixel's grey level")
    focal_error: float = Field(0.0, ge=-0.1, le=0.1, description="the true focal length is longer by this share")
    period_s: Positive = Field(0.07, description="between images")
    latency: Latency = Field(Latency(), description="how late they are")


class Inertial(Section):
    """Accelerometers of the inertial unit, 100 Hz; its attitude is the firmware's."""

    noise_mps2: NotNegative = Field(0.05, description="one sigma of a reading")
    bias_mps2: NotNegative = Field(0.08, description="1 sigma of each axis, constant over a flight")


class SonarEar(Section):
    """Looks down: 20 Hz, 2.5 cm resolution, 0.12 to 6.45 m."""

    noise_m: NotNegative = Field(0.005, description="one sigma, before it is rounded")
    loss: Share = Field(0.0, description="share of readings without an echo")


class Sensors(Section):
    """Other than the camera."""

    imu: Inertial = Field(Inertial(), description="inertial unit")
    sonar: SonarEar = Field(SonarEar(), description="sonar")


class Localisation(Section):
    """Where positions come from."""

    kind: Literal["slam", "emulated"] = Field(
        "slam",
        description="from rendered images; or the truth made as wrong and as late as those are, a hundred times faster",
    )
    noise_m: NotNegative = Field(
        0.004, description="1 sigma of each axis, white; slam: added, for its images are too good"
    )
    map: str | None = Field(
        None,
        max_length=500,
        description="slam: file of its map, made and written if it is not there; null = made each time",
    )
    survey: bool = Field(
        True, description="slam: a flight by hand made the map before; else this one is, until its own map has a scale"
    )
    mapping: bool = Field(False, description="slam: the map of the survey grows in flight")
    fast_threshold: int = Field(8, ge=4, le=100, description="slam: grey levels that a corner must stand out by")
    window: int = Field(0, ge=0, le=1000, description="slam: keyframes kept; 0 = all")
    wander_m: NotNegative = Field(0.004, description="emulated: 1 sigma of what wanders within 10 s")
    scale_sigma: NotNegative = Field(0.003, description="emulated: 1 sigma of the map's scale")


class Filter(Section):
    """Estimator."""

    kind: Literal["fused", "last_fix"] = Field(
        "fused", description="inertial readings fused with fixes, or the last fix carried on"
    )
    compensated: bool = Field(
        True, description="fused: late fixes applied when they were valid, readings since replayed"
    )
    horizon_s: Positive = Field(0.8, description="fixes later than this are of no use")


class Position(Section):
    """Position controller."""

    period_s: Positive = Field(0.02, description="between two commands")
    bandwidth_radps: Positive = Field(3.6, description="level axes")
    damping: Positive = Field(1.0, description="level axes")
    vertical_radps: Positive = Field(3.6, description="height")
    vertical_damping: Positive = Field(1.0, description="height")
    integral: NotNegative = Field(0.15, description="share of the bandwidth cubed")


class Path(Section):
    """What is flown."""

    height_m: float = Field(1.0, ge=0.3, le=10, description="of the cg in hover and traverse")
    goal_x_m: Metre = Field(2.0, description="where the traverse ends")
    goal_y_m: Metre = Field(0.0, description="where the traverse ends")
    climb_mps: Positive = Field(0.2, description="take-off")
    traverse_mps: Positive = Field(0.10, description="traverse, and to above the landing place")
    descent_mps: Positive = Field(0.05, description="descent")
    hold_s: NotNegative = Field(3.0, description="steady hover before the next leg")
    cut_m: Positive = Field(0.06, description="motors are cut with the feet this high above the landing place")
    search_s: NotNegative = Field(5.0, description="at the traverse's end, before no landing place is reported")


class Pictures(Section):
    """What is written down."""

    frames_hz: NotNegative = Field(4.0, description="camera images in the recording, per second; 0 = none")


class Limits(Section):
    """What makes it pass."""

    hover_rms_m: Positive = Field(0.045, description="hover: rms distance from where it is wanted")
    miss_m: Positive = Field(0.08, description="land: touchdown from the middle of the landing place")
    sink_rate_mps: Positive = Field(1.5, description="land: at touchdown")
    tilt_deg: Positive = Field(10.0, description="land: off the vertical at touchdown")


class QuadrotorScenario(Head):
    """One flight."""

    mission: Literal["quadrotor_landing"] = Field(description="what is flown")
    task: Literal["hover", "land"] = Field("land", description="stay over the start, or find a place and land on it")
    time: Clock = Field(Clock(), description="clock")
    vehicle: Airframe = Field(Airframe(), description="the true vehicle")
    air: Air = Field(Air(), description="moving air")
    scene: Place = Field(Place(), description="the true surroundings")
    camera: Eye = Field(Eye(), description="the true camera")
    sensors: Sensors = Field(Sensors(), description="other sensors")
    localisation: Localisation = Field(Localisation(), description="where positions come from")
    filter: Filter = Field(Filter(), description="estimator")
    control: Position = Field(Position(), description="position controller")
    path: Path = Field(Path(), description="what is flown")
    record: Pictures = Field(Pictures(), description="outputs")
    faults: tuple[Fault, ...] = Field((), max_length=20, description="what fails, how and when")
    criteria: Limits = Field(Limits(), description="what makes it pass")

    @model_validator(mode="after")
    def _consistent(self) -> QuadrotorScenario:
        problems: list[tuple[Location, str]] = []
        cycle, late = self.time.cycle_s, self.camera.latency
        periods: tuple[tuple[Location, float, float, str], ...] = (
            (("time", "cycle_s"), cycle, self.time.step_s, "time.step_s"),
            (("camera", "period_s"), self.camera.period_s, cycle, "time.cycle_s"),
            (("control", "period_s"), self.control.period_s, cycle, "time.cycle_s"),
            (("time", "cycle_s"), 0.05, cycle, "cycles, the sonar's period of"),
            (("time", "cycle_s"), 0.01, cycle, "cycles, the inertial unit's period of"),
        )
        for where, period, unit, name in periods:
            if abs(period / unit - round(period / unit)) > 1e-9 or round(period / unit) < 1:
                if name.startswith("cycles"):
                    problems.append((where, f"is not a whole part of {name[8:]} {period:g} s"))
                else:
                    problems.append((where, f"{period:g} is not a whole multiple of {name} = {unit:g}"))
        if late.spike_low_s > late.spike_high_s:
            problems.append((("camera", "latency", "spike_low_s"), f"is above spike_high_s = {late.spike_high_s:g}"))
        if not self.localisation.survey:
            if self.localisation.kind != "slam":
                problems.append((("localisation", "survey"), "only slam makes a map"))
            if self.localisation.map is not None:
                problems.append((("localisation", "map"), "without a survey the map is made in flight: leave it out"))
        if self.task == "land" and not self.scene.boxes:
            problems.append((("scene", "boxes"), "task land needs a box to land on"))
        for i, box in enumerate(self.scene.boxes):
            rise = [
                math.tan(math.radians(s)) * e
                for s, e in ((box.slope_x_deg, box.length_m), (box.slope_y_deg, box.width_m))
            ]
            if 0.5 * (abs(rise[0]) + abs(rise[1])) > box.height_m:
                problems.append((("scene", "boxes", i, "height_m"), "at this slope its top dips below the ground"))
            if _covers_start(box):
                problems.append(
                    (("scene", "boxes", i, "x_m"), "the flight starts on the ground at 0, 0: keep clear of it")
                )
        fixes = "position_fix" if self.localisation.kind == "emulated" else "camera"
        places = ["place_fix"] if self.localisation.kind == "emulated" else []
        problems += faults.problems(self.faults, ["imu", "sonar", fixes, *places], ["imu"], ["camera"])
        inconsistent(problems)
        return self


def _covers_start(box: Platform) -> bool:
    """Whether feet could stand on it at the start."""
    c, s = math.cos(math.radians(box.yaw_deg)), math.sin(math.radians(box.yaw_deg))
    along, across = c * box.x_m + s * box.y_m, c * box.y_m - s * box.x_m
    return abs(along) < 0.5 * box.length_m + 0.2 and abs(across) < 0.5 * box.width_m + 0.2
