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

BLOCK = 64  # normals drawn at once


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

    __slots__ = ("_at", "_drawn", "_generator", "_key")

    def __init__(self, seed: int, name: str, run: int = 0) -> None:
        sequence = np.random.SeedSequence(seed, spawn_key=(run, zlib.crc32(name.encode())))
        self._key = int(sequence.generate_state(1, np.uint64)[0])
        self._generator = np.random.Generator(np.random.Philox(sequence))
        self._drawn, self._at = np.empty(0), 0

    def normal(self, size: int) -> Array:
        at, end = self._at, self._at + size
        if end > len(self._drawn):  # the same numbers as drawn one by one, but a call to the generator for many
            more = self._generator.standard_normal(max(BLOCK, size))
            self._drawn, at, end = np.concatenate([self._drawn[at:], more]), 0, size
        self._at = end
        return self._drawn[at:end]

    def key(self) -> int:
        return self._key
