"""The runway filter that goes on when the inertial unit dies: it notices, and takes optic flow beside the edges.

Without gyros p, q, r are what the aircraft's model makes of controls, attitude and air; edges correct it in each image,
flows where the ground ahead is in view. That the rates are then known from a model whose moments are gusty is told to the
filter as process noise: `alone` is the same filter with more of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from landing_sim.estimators import kalman
from landing_sim.estimators.inertial_model import gyro_model
from landing_sim.estimators.optic_flow.aircraft import flow_dense
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.estimators.runway_filter import Memory
from landing_sim.estimators.runway_steps import of_index
from landing_sim.signals import Command, Estimate, Measurement
from landing_sim.types import Array

FLOW_GATE = 3.5  # [sigma] beyond which a single flow is not believed


class BackupMemory(NamedTuple):
    """The filter's memory; when a gyro reading was last believed and an edge last used [s]; the gyros' latest reading."""

    inner: Memory
    heard: float
    seen: float
    reading: Array
    flow: float = 0.0  # last flow's innovation, in sigma


class BackupEkf:
    """interfaces.Estimator: `filter` while gyros speak, `alone` from `patience` [s] after their last believed reading.

    A reading is not believed that repeats the one before to the last bit, or is further off than `gate` sigma an axis.
    The gate closes on a filter that is wrong as well; alone it soon admits to so much doubt that the gate opens.

    Raises ValueError where the two filters do not cover the same states.
    """

    def __init__(self, filter: RunwayEkf, alone: RunwayEkf, patience: float, gate: float = 6.0) -> None:
        if filter.names != alone.names or filter.config.factorisation != alone.config.factorisation:
            raise ValueError("the filter with gyros and the one without must cover the same states in the same way")
        self.filter, self.alone, self.patience, self.gate = filter, alone, patience, gate

    def init(self, t: float) -> BackupMemory:
        return BackupMemory(self.filter.init(t), t, t, np.full(3, np.nan))

    def predict(self, memory: BackupMemory, command: Command, t: float) -> BackupMemory:
        ekf = self.filter if self._heard(memory) else self.alone
        return memory._replace(inner=ekf.predict(memory.inner, command, t))

    def update(self, memory: BackupMemory, measurement: Measurement) -> BackupMemory:
        inner = memory.inner
        match measurement.kind:
            case "flow":
                return self._flow(memory, measurement) if inner.valid else memory
            case "gyro":
                z = measurement.z
                repeated = bool((z == memory.reading).all())
                memory = memory._replace(reading=z)
                if repeated or (inner.valid and not self._plausible(inner, measurement)):
                    return memory
                return memory._replace(inner=self.filter.update(inner, measurement), heard=measurement.t_valid)
        inner = self.filter.update(inner, measurement)
        used = measurement.kind == "pose" or (measurement.kind == "edges" and inner.misses == 0)
        return memory._replace(inner=inner, seen=measurement.t_valid if used else memory.seen)

    def read(self, memory: BackupMemory, t: float | None = None) -> Estimate:
        """As the filter's; flags "inertial": whether gyros speak, "unseen": whether edges have been missing as long."""
        estimate = self.filter.read(memory.inner, t)
        unseen = memory.inner.valid and memory.inner.t - memory.seen > self.patience
        flags = {**estimate.flags, "inertial": self._heard(memory), "unseen": unseen}
        return Estimate(
            estimate.t, estimate.names, estimate.mean, estimate.cov, estimate.valid, flags, estimate.residuals
        )

    def _heard(self, memory: BackupMemory) -> bool:
        return memory.inner.t - memory.heard <= self.patience

    def _plausible(self, inner: Memory, m: Measurement) -> bool:
        nu, Hx = gyro_model(inner.x, m.z)
        h = of_index(Hx, self.filter.blocks.index)
        S = np.einsum("ij,jk,ik->i", h, self._covariance(inner), h) + m.R
        return bool((nu * nu <= self.gate**2 * S).all())

    def _flow(self, memory: BackupMemory, m: Measurement) -> BackupMemory:
        inner, blocks = memory.inner, self.filter.blocks
        told = blocks.index, blocks.starts, float(m.z[0]), float(m.z[1]), float(m.R[1]), FLOW_GATE
        x, P, ratio = flow_dense(inner.x, self._covariance(inner), *told)
        if abs(ratio) <= FLOW_GATE:
            U, D = (P, None) if inner.D is None else kalman.ud_factor(P)
            inner = inner._replace(x=x, P=U, D=D)
        return memory._replace(inner=inner, flow=ratio)

    def _covariance(self, inner: Memory) -> Array:
        return inner.P if inner.D is None else kalman.ud_product(inner.P, inner.D)
