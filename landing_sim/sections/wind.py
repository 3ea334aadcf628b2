"""The moving air."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.sections.bounds import NotNegative, Positive


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
