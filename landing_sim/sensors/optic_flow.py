"""Visual motion sensors: six photoreceptors each, strapped down, looking at the terrain of the Moon or at a field."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings
from landing_sim.sensors.optic_flow_edges import EdgeConfig, EdgeTracker
from landing_sim.sensors.optic_flow_eye import Eye
from landing_sim.sensors.optic_flow_field import FieldEye
from landing_sim.signals import CameraTruth, Sample, Truth
from landing_sim.types import Array
from landing_sim.world.field import Field
from landing_sim.world.terrain import Terrain

LEVEL = 80.0  # [DN] of bare level ground


@dataclass(frozen=True, slots=True)
class FlowReading:
    """Angular speeds [rad/s] of the edges that crossed the row since the reading before, and when in the middle of it [s].

    Empty where nothing was found, or nothing faster than the sensor can tell: invalid, not zero. `hit` (3,) [m] is where
    the middle of the row looks: of no use on board, for the recording.
    """

    alpha: float
    flows: tuple[float, ...]
    times: tuple[float, ...]
    hit: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MotionSensorConfig:
    """period [s] of readings; alpha [rad] below the body's horizontal; rate [Hz] of sampling; noise [DN] of a sample."""

    period: float
    alpha: float
    receptors: int = 6
    acceptance: float = math.radians(0.1)  # full width at half height
    rate: float = 500.0
    noise: float = 0.25
    level: float = LEVEL  # [DN] of brightness 1
    blind: float = 0.0  # [m] over a field: lower than this it is dark
    edges: EdgeConfig = field(default_factory=EdgeConfig)


class MotionSensor:
    """interfaces.Sensor named `name`; between two readings the vehicle is taken to move evenly.

    Raises ValueError where a period is not a whole number of samples.
    """

    channels = 0  # a record, not numbers that a fault could scale or shift

    def __init__(self, name: str, config: MotionSensorConfig, terrain: Terrain | Field, noise: NoiseStream) -> None:
        check_settings(name, config.period, 0.0, noise=config.noise)
        self._count = round(config.period * config.rate)
        if abs(self._count - config.period * config.rate) > 1e-9 or self._count < 1:
            raise ValueError(
                f"{name}: a period of {config.period} s is not a whole number of samples at {config.rate} Hz"
            )
        self.name, self.period, self._config, self._terrain, self._noise = name, config.period, config, terrain, noise
        rows = np.arange(config.receptors) - 0.5 * (config.receptors - 1)
        angles = np.asarray(config.alpha + rows * config.edges.spacing, dtype=float)
        self._eye: Eye | FieldEye = (
            FieldEye(terrain, angles, config.acceptance, config.blind)
            if isinstance(terrain, Field)
            else Eye(terrain, angles, config.acceptance)
        )
        self._tracker = EdgeTracker(config.edges, config.receptors, 1.0 / config.rate)
        self._before: tuple[Array, Array, float] | None = None

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        """None at the first call: there was no way to look along yet."""
        now = (np.array(truth.p_RB), np.ascontiguousarray(truth.R_RB), truth.t)
        before, self._before = self._before, now
        if before is None:
            self._start = truth.t
            return None
        light = self._eye.between(before[0], before[1], now[0], now[1], self._count)
        grey = self._config.level * light + self._config.noise * self._noise.normal(light.size).reshape(light.shape)
        found = self._tracker.feed(np.clip(np.rint(grey), 0.0, 255.0))
        x, y = self._eye.hit[len(self._eye.hit) // 2]
        reading = FlowReading(
            self._config.alpha,
            tuple(w for _, w in found),
            tuple(self._start + t for t, _ in found),
            (float(x), float(y), -self._terrain.height(float(x), float(y)) if math.isfinite(x) else math.nan),
        )
        return Sample(self.name, truth.t, truth.t, reading)


class FootSwitch:
    """interfaces.Sensor: 1.0 while any foot touches the ground, else 0.0."""

    name = "squat"

    def __init__(self, period: float) -> None:
        self.period = period

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample:
        return Sample(self.name, truth.t, truth.t, float(truth.on_ground.any()))
