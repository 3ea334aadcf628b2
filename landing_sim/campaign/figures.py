"""What a campaign keeps of every flight, by its mission, and what counts as a good end."""

from __future__ import annotations

import math
from typing import get_args

from landing_sim.sections import lunar, quadrotor
from landing_sim.sections.judged import Metric

EXTRA_METRICS = ("touchdown_sideslip_deg", "gear_height_60m_m")
"""What a campaign judges of a runway landing beyond `record.judge.measure`."""
METRICS: dict[str, tuple[str, ...]] = {
    "runway_landing": (*get_args(Metric), *EXTRA_METRICS),
    "lunar_landing": lunar.METRICS,
    "quadrotor_landing": quadrotor.METRICS,
}
"""What risks can be about."""
NEES_BANDS: dict[str, tuple[float, float]] = {
    "nees_beyond_3000m": (-math.inf, -3000.0),
    "nees_3000_1000m": (-3000.0, -1000.0),
    "nees_1000_300m": (-1000.0, -300.0),
    "nees_300_0m": (-300.0, 0.0),
    "nees_over_runway": (0.0, math.inf),
}
"""Figures of the estimate's consistency over a stretch of x [m] each: mean squared error over variance, per state."""
SCATTER: dict[str, tuple[str, ...]] = {
    "runway_landing": ("touchdown_x_m", "touchdown_y_m", "sink_rate_mps", "touchdown_bank_deg"),
    "lunar_landing": ("touchdown_x_m", "sink_rate_mps", "touchdown_groundspeed_mps", "touchdown_tilt_deg"),
    "quadrotor_landing": ("hover_rms_m", "miss_m", "sink_rate_mps", "position_error_rms_m"),
}
"""Whose scatter a report explains."""
FOLDERS = {"lunar_landing": "lander", "quadrotor_landing": "pelican"}
"""Vehicles of missions that know only one."""
GOOD = ("landed", "hovered")
"""Ends that need no looking into."""


def figures(mission: str) -> tuple[str, ...]:
    """Columns that every flight of a mission has; NaN where it gives none."""
    return (*METRICS[mission], *(NEES_BANDS if mission == "runway_landing" else ()))
