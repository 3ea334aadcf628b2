"""The contracts between the parts of the loop. Memory is a value; whoever holds it can rewind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from landing_sim.noise import NoiseStream
from landing_sim.signals import (
    CameraTruth,
    Command,
    Estimate,
    Measurement,
    Reference,
    Sample,
    Touchdown,
    Truth,
)


class Plant(Protocol):
    """A vehicle in its world of forces: JSBSim and what is bolted to the airframe (camera platform)."""

    dt: float

    def reset(self) -> Truth: ...

    def step(self, command: Command, wind_R: Sequence[float]) -> None:
        """Advance one dt in air moving at wind_R: x, y, z in R [m/s]."""

    def truth(self) -> Truth: ...

    def camera(self) -> CameraTruth: ...

    @property
    def touchdown(self) -> Touchdown | None: ...

    def fast_truth(self) -> tuple[float, float, float, float]:
        """x, y, H [m] of the cg in R and true airspeed [m/s]: all that the wind needs each dt."""


class World(Protocol):
    """The moving air. Called once every plant step."""

    def wind(self, t: float, x: float, y: float, height: float, airspeed: float) -> tuple[float, float, float]:
        """Velocity of the air in R at the aircraft [m/s]; `height` above the runway's threshold plane."""


class Sensor(Protocol):
    """Turns truth into samples; holds its own noise stream."""

    name: str
    period: float

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None: ...


class FrontEnd(Protocol):
    """Pixels (or raw readings) into measurements; where to look, the estimate at the sample's time tells."""

    sensor: str

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        """`estimate` answers with what is believed at the sample's time: it costs something, and few need to ask."""


class Estimator(Protocol):
    """Memory in, memory out: nothing is hidden in the object but constants."""

    def init(self, t: float) -> Any: ...

    def predict(self, memory: Any, command: Command, t: float) -> Any:
        """Propagate to time t under `command`, the one acting on the aircraft meanwhile."""

    def update(self, memory: Any, measurement: Measurement) -> Any: ...

    def read(self, memory: Any, t: float | None = None) -> Estimate:
        """The estimate now, or as it was at an earlier time t if the estimator keeps its past."""


class Guidance(Protocol):
    """Flight phase and references."""

    def init(self) -> Any: ...

    def step(self, memory: Any, estimate: Estimate) -> tuple[Any, Reference]: ...


class Controller(Protocol):
    """References into commands, camera pointing included."""

    def init(self) -> Any: ...

    def step(self, memory: Any, estimate: Estimate, reference: Reference) -> tuple[Any, Command]: ...


__all__ = ["Controller", "Estimator", "FrontEnd", "Guidance", "NoiseStream", "Plant", "Sensor", "World"]
