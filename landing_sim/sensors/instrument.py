"""What every instrument model shares: checked settings and a bias that is drawn once a run."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.types import Array

Bias = float | tuple[float, ...] | None


def check_settings(name: str, period: float, latency: float, **magnitudes: float) -> None:
    """Raise ValueError unless period > 0, latency >= 0 and all magnitudes (sigmas, time constants) are >= 0, finite."""
    if not (math.isfinite(period) and period > 0.0):
        raise ValueError(f"{name}: period must be > 0 s, not {period}")
    for key, value in {"latency": latency, **magnitudes}.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise ValueError(f"{name}: {key} must be finite and >= 0, not {value}")


def draw_bias(name: str, bias: Bias, sigma: float, size: int, noise: NoiseStream) -> Array:
    """(size,) the bias of this run: `bias` where it is given, else `size` normals of `sigma`.

    The normals are drawn either way, so that fixing a bias leaves every later draw as it was.
    Raises ValueError when the given bias has another size or is not finite.
    """
    drawn = sigma * noise.normal(size)
    if bias is None:
        return drawn
    given = np.atleast_1d(np.asarray(bias, dtype=np.float64))
    if given.shape != (size,) or not np.isfinite(given).all():
        raise ValueError(f"{name}: bias must be {size} finite number(s), not {bias}")
    return given
