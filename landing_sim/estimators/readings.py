"""Front ends that need no processing: a reading becomes a measurement with a believed noise."""

from __future__ import annotations

import numpy as np

from landing_sim.signals import Estimate, InertialReading, Measurement, Sample


class Reading:
    """The samples of `sensor` as measurements of `kind` (interfaces.FrontEnd), `sigma` 1 sigma in the sample's unit."""

    def __init__(self, sensor: str, kind: str, sigma: float) -> None:
        self.sensor = sensor
        self.kind = kind
        self.variance = sigma * sigma

    def process(self, sample: Sample, estimate: Estimate) -> tuple[Measurement, ...]:
        z = np.atleast_1d(np.asarray(sample.data, dtype=float))
        return (Measurement(self.kind, sample.t_valid, sample.t_arrival, z, np.full(z.shape, self.variance)),)


class InertialFrontEnd:
    """An inertial unit's readings as measurements "inertial" (interfaces.FrontEnd)."""

    sensor = "inertial"

    def process(self, sample: Sample, estimate: Estimate) -> tuple[Measurement, ...]:
        r: InertialReading = sample.data
        z = np.concatenate([r.euler, r.rates, r.v_N, r.moved_N])
        return (Measurement("inertial", sample.t_valid, sample.t_arrival, z, np.zeros(12)),)
