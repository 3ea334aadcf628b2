"""Front ends that need no processing: a reading becomes a measurement with a believed noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from landing_sim.interfaces import FrontEnd
from landing_sim.signals import Estimate, InertialReading, Measurement, Sample, StrapdownReading

_MOST = 3  # numbers in a reading


class Reading:
    """The samples of `sensor` as measurements of `kind` (interfaces.FrontEnd), `sigma` 1 sigma in the sample's unit."""

    def __init__(self, sensor: str, kind: str, sigma: float) -> None:
        self.sensor = sensor
        self.kind = kind
        self.variance = sigma * sigma
        self._variances = np.full(_MOST, self.variance)

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        z = np.array(sample.data, dtype=float, ndmin=1)
        return (Measurement(self.kind, sample.t_valid, sample.t_arrival, z, self._variances[: len(z)]),)


class InertialFrontEnd:
    """An inertial unit's readings as measurements "inertial" (interfaces.FrontEnd)."""

    sensor = "inertial"

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        r: InertialReading = sample.data
        z = np.concatenate([r.euler, r.rates, r.v_N, r.moved_N])
        return (Measurement("inertial", sample.t_valid, sample.t_arrival, z, np.zeros(12)),)


class StrapdownFrontEnd:
    """A strapped-down inertial unit's readings as measurements "strapdown" (interfaces.FrontEnd)."""

    sensor = "imu"

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        r: StrapdownReading = sample.data
        z = np.concatenate([r.a_B, r.euler])
        return (Measurement("strapdown", sample.t_valid, sample.t_arrival, z, np.zeros(6)),)


class Fresh:
    """A front end (interfaces.FrontEnd) that leaves samples older than `oldest` [s] alone: nothing can take them in."""

    def __init__(self, front_end: FrontEnd, oldest: float) -> None:
        self.sensor = front_end.sensor
        self.front_end, self.oldest = front_end, oldest

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        if sample.t_arrival - sample.t_valid > self.oldest + 1e-9:
            return ()
        return self.front_end.process(sample, estimate)
