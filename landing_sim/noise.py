"""Randomness: one stream of standard normals per named component and run.

Every random number of a simulation comes from a `Noise` handle. Streams are keyed by (root seed, run, name), so
adding a sensor changes no other component's draws, and run k alone equals run k of a campaign.
A rare-event method may hand in another object with the same two methods.
"""

from __future__ import annotations

import zlib
from typing import Protocol

import numpy as np

from landing_sim.types import Array


class NoiseStream(Protocol):
    """Standard normals for one named component."""

    def normal(self, size: int) -> Array:
        """The next `size` independent standard normals, shape (size,)."""

    def key(self) -> int:
        """A 64-bit key for counter-based noise (pixels), constant over the run."""


class Noise:
    """Seeded stream of one component.

    Parameters
    ----------
    seed : root seed of the scenario or campaign, >= 0
    name : the component, e.g. "gyro"
    run : index of the run within a campaign
    """

    __slots__ = ("_generator", "_key")

    def __init__(self, seed: int, name: str, run: int = 0) -> None:
        sequence = np.random.SeedSequence(seed, spawn_key=(run, zlib.crc32(name.encode())))
        self._key = int(sequence.generate_state(1, np.uint64)[0])
        self._generator = np.random.Generator(np.random.Philox(sequence))

    def normal(self, size: int) -> Array:
        return self._generator.standard_normal(size)

    def key(self) -> int:
        return self._key
