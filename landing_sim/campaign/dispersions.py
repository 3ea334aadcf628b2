"""What run k of a campaign is flown with.

Each drawn value takes one standard normal from a stream of its own, keyed by (seed, run, "dispersion NAME"): a value more
in the file changes no other draw, and run k alone is run k of the campaign. A Sobol sequence instead gives each its own
dimension, in the order of the file: there a new value goes last.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from landing_sim.campaign.plan import Campaign, assemble
from landing_sim.noise import Noise, NoiseStream
from landing_sim.types import Array


def draw(campaign: Campaign, run: int, noise: Callable[[str], NoiseStream] | None = None) -> dict[str, Any]:
    """Every drawn, derived and swept value of a run, by name or path, in the units of their names.

    noise : streams to draw from, instead of the campaign's own
    """
    return assemble(campaign, normals(campaign, run, noise), run)


def normals(campaign: Campaign, run: int, noise: Callable[[str], NoiseStream] | None = None) -> dict[str, float]:
    """The standard normal behind everything drawn, correlated as the campaign wants."""
    names = list(campaign.drawn())
    if noise is None and campaign.sampling == "sobol" and names:
        z = dict(zip(names, _sobol(len(names), campaign.seed, run).tolist()))
    else:

        def stream(name: str) -> NoiseStream:
            key = f"dispersion {name}"
            return Noise(campaign.seed, key, run) if noise is None else noise(key)

        z = {name: float(stream(name).normal(1)[0]) for name in names}
    for group in campaign.correlations:
        joined = group.factor() @ np.array([z[name] for name in group.of])
        z |= dict(zip(group.of, joined.tolist()))
    return z


def _sobol(dimensions: int, seed: int, run: int) -> Array:
    """(dimensions,) normals of point `run` of the scrambled sequence."""
    from scipy.special import ndtri

    engine = _engine(dimensions, seed)
    engine.reset()
    if run:
        engine.fast_forward(run)
    return np.asarray(ndtri(np.clip(engine.random(1)[0], 1e-15, 1.0 - 1e-15)))


@cache
def _engine(dimensions: int, seed: int) -> Any:
    from scipy.stats import qmc

    return qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(np.random.SeedSequence(seed)))
