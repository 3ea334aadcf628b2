"""Faults of any sensor, in PX4's words: a sensor wrapped in a `Faulty` is a sensor again; wrap twice for two faults.

    off            sends nothing
    stuck          repeats the last reading from before the fault, with fresh time stamps (a camera: the last image)
    garbage        numbers that have nothing to do with the truth: normal with sigma `spread` (a camera: random pixels)
    wrong          scale * reading + bias
    slow           sends every `factor`-th sample only
    delayed        arrives `delay` later; unless `honest_time`, it claims to be that much younger than it is
    intermittent   each sample is lost with probability `loss`

The wrapped sensor is read all the while, so that after the fault, or beside a flight without it, it draws the same
noise. Source: the words are MAVLink's FAILURE_TYPE, as used by PX4's failure injection; the meanings are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any, Literal

import numpy as np

from landing_sim.interfaces import Sensor
from landing_sim.noise import NoiseStream
from landing_sim.signals import CameraSample, CameraTruth, Sample, Truth

Kind = Literal["off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent"]

# what each kind must be given, beside its times; anything else given is a mistake
_NEEDS: dict[str, frozenset[str]] = {
    "off": frozenset(),
    "stuck": frozenset(),
    "garbage": frozenset({"spread"}),
    "wrong": frozenset({"bias", "scale"}),
    "slow": frozenset({"factor"}),
    "delayed": frozenset({"delay", "honest_time"}),
    "intermittent": frozenset({"loss"}),
}

_WANTED = {
    "wrong": "a finite bias, a finite scale, or both",
    "garbage": "a finite spread > 0 in the reading's unit",
    "slow": "a whole factor >= 2",
    "delayed": "a finite delay > 0 s",
    "intermittent": "a loss probability between 0 and 1; for 1 use 'off'",
}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault, acting on samples with start <= t_valid < end [s]. None: not given."""

    kind: Kind
    start: float = 0.0
    end: float = math.inf
    spread: float | None = None  # garbage: 1 sigma, in the reading's unit; a camera takes none
    bias: float | tuple[float, ...] | None = None  # wrong: in the reading's unit, one for all axes or one each
    scale: float | None = None  # wrong: factor
    factor: int | None = None  # slow: 1 sample in so many
    delay: float | None = None  # delayed: [s]
    honest_time: bool | None = None  # delayed: t_valid stays true (the default)
    loss: float | None = None  # intermittent: probability, 0..1

    def __post_init__(self) -> None:
        if self.kind not in _NEEDS:
            raise ValueError(f"fault: no kind {self.kind!r}; choose from {', '.join(_NEEDS)}")
        if not (math.isfinite(self.start) and self.end > self.start):
            raise ValueError(f"fault {self.kind}: needs start < end, got {self.start} and {self.end} s")
        for name in ("spread", "bias", "scale", "factor", "delay", "honest_time", "loss"):
            if getattr(self, name) is not None and name not in _NEEDS[self.kind]:
                raise ValueError(f"fault {self.kind}: {name!r} means nothing to it")
        problem = {
            "wrong": (self.bias is None and self.scale is None) or not _all_finite(self.bias, self.scale),
            "garbage": self.spread is not None and not (_all_finite(self.spread) and self.spread > 0.0),
            "slow": not (isinstance(self.factor, int) and self.factor >= 2),
            "delayed": not (_all_finite(self.delay) and (self.delay or 0.0) > 0.0),
            "intermittent": not (self.loss is not None and 0.0 < self.loss < 1.0),
        }.get(self.kind, False)
        if problem:
            raise ValueError(f"fault {self.kind}: needs {_WANTED[self.kind]}")


def _all_finite(*values: float | tuple[float, ...] | None) -> bool:
    return all(bool(np.isfinite(np.asarray(value)).all()) for value in values if value is not None)


class Faulty:
    """interfaces.Sensor: `sensor` with one fault.

    Parameters
    ----------
    sensor : what fails. Its `channels` says how many numbers its samples hold; one without it is taken for a camera
    fault : how it fails
    noise : stream of the fault's own randomness (garbage, intermittent)

    Raises ValueError for a fault that makes no sense for the sensor.
    """

    def __init__(self, sensor: Sensor, fault: Fault, noise: NoiseStream) -> None:
        self.name = sensor.name
        self.period = sensor.period
        self.channels = int(getattr(sensor, "channels", 0))
        self.sensor = sensor
        self.fault = fault
        self._noise = noise
        self._held: Any = None  # stuck: the reading repeated
        self._count = 0  # slow: samples since the fault began
        self._lost_below = NormalDist().inv_cdf(fault.loss) if fault.loss is not None else 0.0
        where = f"fault {fault.kind} on {sensor.name}"
        if fault.kind == "wrong" and self.channels == 0:
            raise ValueError(
                f"{where}: an image has no bias or scale; falsify the calibration, encoder bias or exposure instead"
            )
        if fault.kind == "garbage" and (fault.spread is None) != (self.channels == 0):
            raise ValueError(
                f"{where}: " + ("needs a spread" if self.channels else "random pixels have no spread; leave it out")
            )
        if isinstance(fault.bias, tuple) and len(fault.bias) != self.channels:
            raise ValueError(f"{where}: bias needs {self.channels} numbers, got {len(fault.bias)}")
        bias = fault.bias[0] if isinstance(fault.bias, tuple) and self.channels == 1 else fault.bias
        self._bias: Any = np.array(bias) if isinstance(bias, tuple) else bias or 0.0

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        sample = self.sensor.sense(truth, camera)
        fault = self.fault
        if sample is None:
            return None
        if not fault.start <= sample.t_valid < fault.end:
            if sample.t_valid < fault.start:
                self._held = sample.data
            return sample
        match fault.kind:
            case "off":
                return None
            case "stuck":
                if self._held is None:
                    self._held = sample.data
                return replace(sample, data=_repeat(self._held, sample.data))
            case "garbage":
                return replace(sample, data=self._garbage(sample.data))
            case "wrong":
                scale = 1.0 if fault.scale is None else fault.scale
                return replace(sample, data=scale * sample.data + self._bias)
            case "slow":
                self._count += 1
                return sample if (self._count - 1) % (fault.factor or 1) == 0 else None
            case "delayed":
                delay = fault.delay or 0.0
                t_valid = sample.t_valid + (delay if fault.honest_time is False else 0.0)
                return replace(sample, t_valid=t_valid, t_arrival=sample.t_arrival + delay)
            case "intermittent":
                return None if self._noise.normal(1)[0] < self._lost_below else sample

    def _garbage(self, data: Any) -> Any:
        if isinstance(data, CameraSample):
            frame = RandomFrame(data.frame.width, data.frame.height, self._noise.key(), data.index)
            return replace(data, frame=frame)
        drawn = (self.fault.spread or 0.0) * self._noise.normal(self.channels)
        return float(drawn[0]) if self.channels == 1 else drawn


def _repeat(held: Any, data: Any) -> Any:
    """The held reading; of a camera the held image only, for the platform's encoders go on."""
    return replace(data, frame=held.frame) if isinstance(data, CameraSample) else held


class RandomFrame:
    """signals.Frame of uniformly random grey levels, a function of key, frame index and pixel alone."""

    __slots__ = ("_offset", "height", "width")

    def __init__(self, width: int, height: int, key: int, index: int) -> None:
        self.width = width
        self.height = height
        self._offset = np.uint64((key + index * 0xD1342543DE82EF95) % 2**64)

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        if u0 < 0 or v0 < 0 or u0 + width > self.width or v0 + height > self.height:
            raise ValueError(
                f"window {width}x{height} at ({u0}, {v0}) does not lie inside the {self.width}x{self.height} frame"
            )
        u = np.arange(u0, u0 + width, dtype=np.uint64)
        v = np.arange(v0, v0 + height, dtype=np.uint64)
        return _mix(self._offset + v[:, None] * np.uint64(self.width) + u)

    def windows(self, corners: np.ndarray, width: int, height: int) -> np.ndarray:
        out = np.empty((len(corners), height, width), np.uint8)
        for i, (u0, v0) in enumerate(corners):
            out[i] = self.window(int(u0), int(v0), width, height)
        return out

    def full(self) -> np.ndarray:
        return self.window(0, 0, self.width, self.height)


def _mix(counter: np.ndarray) -> np.ndarray:
    """uint8 hash of uint64 counters.

    Source     the finaliser of SplitMix64: Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
               generators".
    """
    z = counter * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return ((z ^ (z >> np.uint64(31))) >> np.uint64(56)).astype(np.uint8)
