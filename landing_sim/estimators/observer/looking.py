"""The contract of what ranges an unknown runway, and what it is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from landing_sim.estimators.observer.scene import Carriage, Scene
from landing_sim.signals import Measurement
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class Image:
    """Edges of one image (measurement "edges") and the inertial reading (12,) of its time."""

    t: float
    edges: Measurement
    inertial: Array


class Ranging(Protocol):
    """Keeps the scene: pure functions of values."""

    def start(self, s: Array, P: Array, t: float) -> Scene:
        """From an acquired pose `s` (N,), scaled to the first guess of the range; P (N, N) without the guess's error."""

    def move(self, scene: Scene, way_R: Array, dt: float) -> Scene:
        """The cg has moved by way_R (3,) [m] in dt [s], as the inertial unit says."""

    def look(self, scene: Scene, image: Image, carried: Carriage) -> Scene: ...
