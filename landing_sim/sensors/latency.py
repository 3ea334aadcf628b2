"""How late images are: a mean with jitter, and now and then a spike. They queue: none overtakes another."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

from landing_sim.noise import NoiseStream


@dataclass(frozen=True, slots=True)
class LatencyConfig:
    """mean [s], jitter [s] 1 sigma; a share of all images is late by spike_low ... spike_high [s] more, evenly.

    Raises ValueError for values that are not finite or below zero.
    """

    mean: float = 0.15
    jitter: float = 0.02
    spike_share: float = 0.02
    spike_low: float = 0.10
    spike_high: float = 0.25

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) and v >= 0.0 for v in astuple(self)):
            raise ValueError(f"latency: every value must be finite and >= 0, got {self}")
        if self.spike_share > 1.0:
            raise ValueError(f"latency: spike_share is a share of all images, not {self.spike_share}")
        if self.spike_low > self.spike_high:
            raise ValueError(f"latency: spike_low {self.spike_low} s is above spike_high {self.spike_high} s")


class Latency:
    """Arrival times, one call an image, in order."""

    def __init__(self, config: LatencyConfig, noise: NoiseStream) -> None:
        self._config, self._noise = config, noise
        self._last = -math.inf

    def arrival(self, t: float) -> float:
        """[s] when the image taken at t is there."""
        c = self._config
        jitter, chance, size = self._noise.normal(3).tolist()
        late = c.mean + c.jitter * jitter
        if _share(chance) < c.spike_share:
            late += c.spike_low + _share(size) * (c.spike_high - c.spike_low)
        self._last = max(t + max(late, 0.0), self._last)
        return self._last


def _share(normal: float) -> float:
    """A standard normal as a number that is uniform in 0 ... 1."""
    return 0.5 * math.erfc(-normal / math.sqrt(2.0))
