"""The true world without its air: clock, vehicle, start, runway."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.sections.bounds import Grey, Positive


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
    heading_deg: float | None = Field(
        15.0,
        gt=-180,
        le=180,
        description="nose right (+) of the landing direction; null = into the steady wind as far as it takes to track it",
    )
    airspeed_mps: Positive | None = Field(50.0, description="true airspeed; null = the vehicle's approach speed")
    flight_path_deg: float = Field(-3.0, ge=-15, le=15, description="air-relative flight path angle, climb positive")


class Atmosphere(Section):
    """The still air: the standard atmosphere, shifted."""

    temperature_offset_K: float = Field(0.0, ge=-100, le=60, description="warmer (+) than the standard by this")


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
