"""Results of campaigns that nobody flew: figures from simple laws of what is drawn, written as the campaign writes them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from landing_sim.campaign.dispersions import draw
from landing_sim.campaign.figures import NEES_BANDS
from landing_sim.campaign.landing import Landing
from landing_sim.campaign.plan import Plan
from landing_sim.campaign.store import Store


def fill(folder: Path, plan: Plan, runs: int, seed: int = 1, crashes: int = 0) -> None:
    """Landings whose touchdown follows the wind and the mass, the last `crashes` of which never touched down."""
    rng = np.random.default_rng(seed)
    with Store(folder, plan, plan.figures()) as store, store.session(workers=2, engine="forkserver"):
        for run in range(runs):
            values = draw(plan.campaign, run)
            head, cross = values.get("wind.headwind_mps", 0.0), values.get("wind.crosswind_mps", 0.0)
            figures = dict.fromkeys(plan.figures(), math.nan)
            n = rng.normal(size=12)
            figures |= {
                "touchdown_x_m": 400.0 - 8.0 * head + 35.0 * n[0],
                "touchdown_y_m": 0.25 * cross + 0.6 * n[1],
                "sink_rate_mps": abs(0.8 + 0.02 * abs(cross) + 0.15 * n[2]),
                "touchdown_bank_deg": 0.15 * cross + 0.6 * n[3],
                "touchdown_sideslip_deg": 0.3 * cross + 1.0 * n[4],
                "gear_height_60m_m": 9.0 + 0.1 * head + 0.6 * n[5],
                **{name: math.exp(0.3 * x) for name, x in zip(NEES_BANDS, n[6:])},
            }
            crashed = run >= runs - crashes
            landing = Landing(
                run,
                "crash" if crashed else "landed",
                figures=None if crashed else figures,
                values=values,
                wall_s=2.0 + 0.2 * abs(n[0]),
                cpu_s=1.9 + 0.2 * abs(n[0]),
                peak_mb=310.0,
                worker="synthetic:1",
            )
            store.add(landing)
