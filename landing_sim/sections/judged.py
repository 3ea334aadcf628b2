"""What is written down of a flight, and what it is judged by."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.sections.bounds import NotNegative


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
