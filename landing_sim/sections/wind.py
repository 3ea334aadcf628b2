"""The moving air."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.errors import Location
from landing_sim.sections.bounds import NotNegative, Positive


class Profile(Section):
    """How the steady wind grows with height above the runway."""

    law: Literal["logarithmic", "certification"] = Field(
        description="ln(h/z0) of MIL-F-8785C, or 0.43 log10(h in ft) + 0.35 of CS-AWO and AC 120-28D, where headwind and "
        "crosswind are those at 33 ft"
    )
    reference_height_m: Positive | None = Field(
        None, description="where headwind and crosswind are measured, logarithmic only; null = 10.06 (33 ft)"
    )
    roughness_m: Positive | None = Field(
        None, description="z0, logarithmic only; null = 0.0457 (0.15 ft, near runways)"
    )


class Gust(Section):
    """The paper's gust: added from a place on, decaying with time (section 7.1)."""

    at_x_m: float = Field(-650.0, description="where it strikes")
    lateral_mps: float = Field(-2.0, ge=-30, le=30, description="towards +y (right)")
    vertical_mps: float = Field(1.0, ge=-30, le=30, description="updraught positive")
    time_constant_s: Positive = Field(6.0, description="it decays as exp(-t/this)")


class DiscreteGust(Section):
    """A one-minus-cosine gust, flown through from a place on."""

    at_x_m: float = Field(description="where it begins")
    headwind_mps: float = Field(0.0, ge=-30, le=30, description="full strength, positive on the nose")
    lateral_mps: float = Field(0.0, ge=-30, le=30, description="full strength, towards +y (right)")
    vertical_mps: float = Field(0.0, ge=-30, le=30, description="full strength, updraught positive")
    gradient_m: float = Field(100.0, gt=0, le=5000, description="distance through the air to full strength")
    shape: Literal["pulse", "ramp"] = Field(
        "pulse", description="falls again as it rose (14 CFR 25.341), or stays (MIL-F-8785C)"
    )


class Microburst(Section):
    """Air that falls in a shaft and flows out over the ground, Oseguera and Bowles 1988."""

    x_m: float = Field(description="its axis, along the runway from the threshold")
    y_m: float = Field(0.0, description="its axis, right of the centreline")
    radius_m: float = Field(1000.0, ge=50, le=10000, description="of the falling shaft")
    outflow_mps: float = Field(15.0, ge=0, le=60, description="strongest level wind, at 1.12 times the radius")
    outflow_height_m: float = Field(40.0, ge=5, le=500, description="height of the strongest level wind")


class Turbulence(Section):
    """Continuous turbulence. Dryden wants a severity or a wind at 20 ft, not both."""

    model: Literal["dryden", "dryden_1797", "first_order"] = Field(
        "dryden",
        description="MIL-F-8785C at low altitude; MIL-HDBK-1797, which is the same air with lengths counted otherwise; or "
        "the certification's first-order filters: 0.15 times the wind at 33 ft level, 0.77 m/s vertically",
    )
    severity: Literal["light", "moderate", "severe"] | None = Field(None, description="Dryden: 15, 30, 45 kt at 20 ft")
    wind_at_20ft_mps: NotNegative | None = Field(None, description="Dryden: sets the intensity directly")
    wind_at_33ft_mps: NotNegative | None = Field(None, description="first_order: null = that of the steady wind")


class Wind(Section):
    """The moving air."""

    headwind_mps: float = Field(0.0, ge=-30, le=30, description="steady, positive on the nose")
    crosswind_mps: float = Field(0.0, ge=-30, le=30, description="steady, positive blowing towards +y (right)")
    crosswind_from_x_m: float | None = Field(None, description="crosswind blows only beyond this x; null = everywhere")
    profile: Profile | None = Field(None, description="null = the same at every height")
    gust: Gust | None = Field(None, description="null = none")
    discrete_gust: DiscreteGust | None = Field(None, description="null = none")
    microburst: Microburst | None = Field(None, description="null = none")
    turbulence: Turbulence | None = Field(None, description="null = none")


def problems(wind: Wind) -> list[tuple[Location, str]]:
    """Values that are each fine but do not fit together, by their place in the scenario."""
    found: list[tuple[Location, str]] = []
    turbulence, profile = wind.turbulence, wind.profile
    if turbulence and turbulence.model == "first_order":
        found += [
            (("wind", "turbulence", key), "belongs to model dryden: first_order takes wind_at_33ft_mps")
            for key in ("severity", "wind_at_20ft_mps")
            if getattr(turbulence, key) is not None
        ]
    elif turbulence:
        if (turbulence.severity is None) == (turbulence.wind_at_20ft_mps is None):
            found.append((("wind", "turbulence"), "give one of severity and wind_at_20ft_mps"))
        if turbulence.wind_at_33ft_mps is not None:
            found.append((("wind", "turbulence", "wind_at_33ft_mps"), "belongs to model first_order"))
    if profile and profile.law == "certification":
        found += [
            (("wind", "profile", key), "belongs to the logarithmic law")
            for key in ("reference_height_m", "roughness_m")
            if getattr(profile, key) is not None
        ]
    elif profile and (profile.roughness_m or 0.0457) >= (profile.reference_height_m or 10.06):
        found.append((("wind", "profile", "roughness_m"), "must be below the reference height: no wind blows there"))
    if profile and wind.crosswind_from_x_m is not None:
        found.append((("wind", "crosswind_from_x_m"), "has no profile: leave one of the two out"))
    return found
