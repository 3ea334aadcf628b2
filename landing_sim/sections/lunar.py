"""A descent to the Moon: everything about one, from a YAML file into frozen, checked values.

Angles of pitch here are the paper's, nose down positive, as are its published deviations.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from landing_sim.config import Section, inconsistent
from landing_sim.errors import Location
from landing_sim.sections.bounds import NotNegative, Positive
from landing_sim.sections.head import Head

METRICS = (
    *("touchdown_x_m", "sink_rate_mps", "touchdown_groundspeed_mps", "touchdown_tilt_deg"),
    *("H_rms", "q_rms", "theta_rms", "flow_x_rms", "flow_z_rms"),
)
"""Figures of a descent."""


class Clock(Section):
    """The clock. Every period must be a whole number of steps."""

    step_s: float = Field(0.005, gt=0, le=0.02, description="step of the flight model")
    cycle_s: Positive = Field(0.02, description="control cycle: sensors, estimator and controller run once in it")
    limit_s: float = Field(120.0, gt=0, le=600, description="end the run here if nothing else has")


class Deviation(Section):
    """From the reference at its start."""

    height_m: float = Field(0.0, ge=-800, le=800, description="higher by")
    pitch_rate_dps: float = Field(0.0, ge=-5, le=5, description="nose down positive")
    flow_x_dps: float = Field(0.0, ge=-3, le=3, description="ventral flow V_x/h")
    flow_z_dps: float = Field(0.0, ge=-3, le=3, description="expansion flow V_z/h, upwards positive")
    pitch_deg: float = Field(0.0, ge=-20, le=20, description="nose down positive")


class Ground(Section):
    """The plain that is flown over."""

    sun_elevation_deg: float = Field(22.0, gt=0, le=90, description="above the horizon")
    sun_azimuth_deg: float = Field(35.0, ge=-180, le=180, description="from straight ahead, to the right positive")
    slope_deg: float = Field(1.5, ge=0, le=10, description="rms of the fractal relief from cell to cell")
    crater_m: float = Field(40.0, ge=0, le=60, description="depth of the one large crater; 0 = none")
    flat: bool = Field(False, description="light and shadow of relief, but heights all zero")


class Eyes(Section):
    """The visual motion sensors, strapped down."""

    angles_deg: tuple[float, ...] = Field(
        (90.0, 120.0, 160.0), min_length=1, max_length=8, description="below the body's horizontal, forward"
    )
    spacing_deg: Positive = Field(0.1, description="between two of the six photoreceptors")
    acceptance_deg: Positive = Field(0.1, description="of one, at half height")
    noise_dn: NotNegative = Field(0.25, description="one sigma of a sample's grey level")
    mounting_error_deg: float = Field(0.0, ge=-5, le=5, description="all look this much further back than believed")


class Observer(Section):
    """What estimates flows and pitch."""

    kind: Literal["ekf", "ukf", "lpv"] = Field("ekf", description="lpv: the paper's, linear about the reference")
    floor_dps: Positive = Field(0.1, description="a flow's sigma is this")
    share: NotNegative = Field(0.05, description="and this share of it")


class Descent(Section):
    """Guidance and control."""

    loop: Literal["closed", "open"] = Field("closed", description="open: the reference's inputs, whatever is estimated")
    rate: Literal["position", "estimate", "combined"] = Field(
        "combined", description="what damps attitude: pitch's derivative, the estimated rate, or both"
    )
    flow_bandwidth_radps: Positive = Field(0.25, description="of both flows")
    attitude_bandwidth_radps: Positive = Field(0.9, description="of pitch")
    patience_s: NotNegative = Field(4.0, description="before the estimate is flown")


class Pictures(Section):
    """What is written down."""

    frames_hz: NotNegative = Field(0.5, description="camera images in the recording, per second; 0 = none")


class Limits(Section):
    """What makes it a landing: at the first foot's touch."""

    sink_rate_mps: Positive = Field(2.0, description="vertical speed")
    groundspeed_mps: Positive = Field(1.0, description="horizontal speed")
    tilt_deg: Positive = Field(10.0, description="off the vertical")


class LunarScenario(Head):
    """One descent."""

    mission: Literal["lunar_landing"] = Field(description="what is flown")
    time: Clock = Field(Clock(), description="clock")
    initial: Deviation = Field(Deviation(), description="the lander's true deviation")
    believed: Deviation = Field(Deviation(), description="what is believed of it")
    terrain: Ground = Field(Ground(), description="the Moon")
    sensors: Eyes = Field(Eyes(), description="the only ones")
    filter: Observer = Field(Observer(), description="estimator")
    control: Descent = Field(Descent(), description="guidance and control")
    record: Pictures = Field(Pictures(), description="outputs")
    criteria: Limits = Field(Limits(), description="what makes it pass")

    @model_validator(mode="after")
    def _consistent(self) -> LunarScenario:
        problems: list[tuple[Location, str]] = []
        count = self.time.cycle_s / self.time.step_s
        if abs(count - round(count)) > 1e-9:
            problems.append((("time", "cycle_s"), f"is not a whole multiple of time.step_s = {self.time.step_s:g}"))
        samples = self.time.cycle_s * 500.0
        if abs(samples - round(samples)) > 1e-9:
            problems.append((("time", "cycle_s"), "is not a whole number of the sensors' 2 ms"))
        inconsistent(problems)
        return self
