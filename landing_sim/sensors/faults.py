"""Faults of any sensor, in PX4's words: a sensor wrapped in a `Faulty` is a sensor again; wrap twice for two faults.

Every fault acts on the samples with start <= t_valid < end [s]. The wrapped sensor is read all the while, so that
after the fault, or in the same flight without it, it draws the same noise.

Source     the words are those of PX4's failure injection (MAVLink FAILURE_TYPE); their exact meanings here are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from landing_sim.interfaces import Sensor
from landing_sim.noise import NoiseStream
from landing_sim.signals import CameraSample, CameraTruth, Sample, Truth


@dataclass(frozen=True, slots=True)
class Off:
    """Sends nothing."""

    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)


@dataclass(frozen=True, slots=True)
class Stuck:
    """Repeats the last reading from before the fault under fresh time stamps; a camera repeats its last image."""

    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)


@dataclass(frozen=True, slots=True)
class Garbage:
    """Readings that have nothing to do with the truth: normal, sigma `spread`; random pixels of a camera."""

    spread: float | None = None  # in the reading's unit; None for a camera
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)
        if self.spread is not None and not (math.isfinite(self.spread) and self.spread > 0.0):
            raise ValueError(f"fault garbage: spread must be finite and > 0, not {self.spread}")


@dataclass(frozen=True, slots=True)
class Wrong:
    """scale * reading + bias."""

    bias: float | tuple[float, ...] = 0.0  # in the reading's unit: one number for all axes, or one each
    scale: float = 1.0
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)
        if not (np.isfinite(self.bias).all() and math.isfinite(self.scale)):
            raise ValueError(f"fault wrong: bias and scale must be finite, not {self.bias} and {self.scale}")
        if self.scale == 1.0 and not np.any(self.bias):
            raise ValueError("fault wrong: give a bias other than 0 or a scale other than 1")


@dataclass(frozen=True, slots=True)
class Slow:
    """Sends one sample in `factor`, the first of the fault among them."""

    factor: int
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)
        if not (isinstance(self.factor, int) and self.factor >= 2):
            raise ValueError(f"fault slow: factor must be a whole number >= 2, not {self.factor}")


@dataclass(frozen=True, slots=True)
class Delayed:
    """Samples arrive `delay` [s] later. Without `honest_time` they also claim to have been taken that much later."""

    delay: float
    honest_time: bool = True
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)
        if not (math.isfinite(self.delay) and self.delay > 0.0):
            raise ValueError(f"fault delayed: delay must be finite and > 0 s, not {self.delay}")


@dataclass(frozen=True, slots=True)
class Intermittent:
    """Every sample is lost with the probability `loss`, independently."""

    loss: float
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_times(self)
        if not 0.0 < self.loss < 1.0:
            raise ValueError(f"fault intermittent: loss must lie between 0 and 1, not {self.loss}; always is 'off'")


Fault = Off | Stuck | Garbage | Wrong | Slow | Delayed | Intermittent

FAULTS: dict[str, type[Fault]] = {
    "off": Off,
    "stuck": Stuck,
    "garbage": Garbage,
    "wrong": Wrong,
    "slow": Slow,
    "delayed": Delayed,
    "intermittent": Intermittent,
}  # by PX4's word


def _check_times(fault: Fault) -> None:
    if not (math.isfinite(fault.start) and fault.end > fault.start):
        word = type(fault).__name__.lower()
        raise ValueError(f"fault {word}: needs a finite start before its end, got {fault.start} and {fault.end} s")


class Faulty:
    """interfaces.Sensor: `sensor` with one fault.

    Parameters
    ----------
    sensor : what fails. Its `channels` says how many numbers its samples hold, 0 for a camera
    fault : how it fails
    noise : stream of the fault's own randomness (garbage, intermittent)

    Raises ValueError for a fault that makes no sense for the sensor, or a sensor without `channels`.
    """

    def __init__(self, sensor: Sensor, fault: Fault, noise: NoiseStream) -> None:
        self.name = sensor.name
        self.period = sensor.period
        channels = getattr(sensor, "channels", None)
        if channels is None:
            raise ValueError(f"sensor {sensor.name} cannot fail: it does not say how many channels it has (0: images)")
        self.channels = int(channels)
        self.sensor = sensor
        self.fault = fault
        self._noise = noise
        self._held: Any = None  # Stuck: what is repeated
        self._count = 0  # Slow: samples since the fault began
        self._lost_below = NormalDist().inv_cdf(fault.loss) if isinstance(fault, Intermittent) else -math.inf
        self._bias: Any = _fitting_bias(fault, self.channels, self.name) if isinstance(fault, Wrong) else 0.0
        if isinstance(fault, Garbage) and (fault.spread is None) != (self.channels == 0):
            advice = "random pixels have no spread; leave it out" if self.channels == 0 else "needs a spread"
            raise ValueError(f"fault garbage on {self.name}: {advice}")

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        sample = self.sensor.sense(truth, camera)
        fault = self.fault
        if sample is None or not fault.start <= sample.t_valid < fault.end:
            if sample is not None and sample.t_valid < fault.start:
                self._held = sample.data
            return sample
        match fault:
            case Off():
                return None
            case Stuck():
                if self._held is None:
                    self._held = sample.data
                return replace(sample, data=_repeat(self._held, sample.data))
            case Garbage():
                return replace(sample, data=self._garbage(sample.data, fault.spread))
            case Wrong():
                return replace(sample, data=fault.scale * sample.data + self._bias)
            case Slow():
                self._count += 1
                return sample if self._count % fault.factor == 1 else None
            case Delayed():
                t_valid = sample.t_valid if fault.honest_time else sample.t_valid + fault.delay
                return replace(sample, t_valid=t_valid, t_arrival=sample.t_arrival + fault.delay)
            case Intermittent():
                return None if self._noise.normal(1)[0] < self._lost_below else sample

    def _garbage(self, data: Any, spread: float | None) -> Any:
        if spread is None:
            frame = RandomFrame(data.frame.width, data.frame.height, self._noise.key(), data.index)
            return replace(data, frame=frame)
        drawn = spread * self._noise.normal(self.channels)
        return float(drawn[0]) if self.channels == 1 else drawn


def _fitting_bias(fault: Wrong, channels: int, name: str) -> Any:
    """The bias in the shape of the sensor's reading: a float, or an array of `channels`."""
    if channels == 0:
        raise ValueError(
            f"fault wrong on {name}: an image has no bias or scale; falsify calibration, encoders or exposure"
        )
    if not isinstance(fault.bias, tuple):
        return fault.bias
    if len(fault.bias) != channels:
        raise ValueError(f"fault wrong on {name}: bias needs {channels} number(s), got {len(fault.bias)}")
    return fault.bias[0] if channels == 1 else np.array(fault.bias)


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

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
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
