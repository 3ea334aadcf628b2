"""No fusion: the last position fix, carried on with the velocity between fixes. What the fused filter is compared with.

    p(t) = p_k + v (t - t_k),   v = (p_k - p_k-1) / (tau_k - tau_k-1)

tau is when a fix's image was taken, t_k when the fix arrived: velocities are right, positions as old as the latency was.
The extrapolation bridges the wait for the next fix, no more. Whoever asks for an earlier time, as the localisation does for
its next image's, is answered with p_k + v (t - tau_k) and the attitude of that time.

Source     Brockers et al. 2012, section 5.1 ("PTAM-only").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from landing_sim.estimators.strapdown_ekf import EPS, NAMES
from landing_sim.signals import Command, Estimate, Measurement
from landing_sim.types import Array

_NOTHING = np.zeros(3)
_NO_PLACE = np.full(3, np.nan)


@dataclass(frozen=True, slots=True)
class LastFixConfig:
    """smoothing : [s] time constant of a low pass on the velocity; 0 = the last difference as it is
    longest : [s] that a fix is carried on; then it stands still
    lost_after : [s] without a fix, and the vehicle is not localised
    horizon : [s] of attitudes kept
    """

    smoothing: float = 0.0
    longest: float = 0.4
    lost_after: float = 1.0
    horizon: float = 0.8


class Memory(NamedTuple):
    """The last fix, and what the autopilot said last."""

    t: float
    p: Array = _NOTHING  # (3,) in R
    v: Array = _NOTHING
    taken: float = -math.inf  # [s] when its image was taken
    arrived: float = -math.inf
    euler: Array = _NOTHING
    said: tuple[tuple[float, Array], ...] = ()  # when, and phi, theta, psi: oldest first
    place: Array = _NO_PLACE


class LastFix:
    """interfaces.Estimator. Takes the measurements that `StrapdownEkf` takes, of "strapdown" only the attitude."""

    def __init__(self, config: LastFixConfig | None = None) -> None:
        self.config = config or LastFixConfig()

    def init(self, t: float) -> Memory:
        return Memory(t)

    def predict(self, memory: Memory, command: Command, t: float) -> Memory:
        return memory._replace(t=t) if t > memory.t + EPS else memory

    def update(self, memory: Memory, measurement: Measurement) -> Memory:
        """A fix from before the last one is of no use any more."""
        kind, z = measurement.kind, measurement.z
        if kind == "strapdown":
            oldest = memory.t - self.config.horizon
            kept = [then for then in memory.said if then[0] >= oldest]
            return memory._replace(euler=z[3:], said=(*kept, (measurement.t_valid, z[3:])))
        if kind == "way_point":
            return memory._replace(place=z)
        if kind != "position":
            raise ValueError(f"an estimator of fixes knows no measurement {kind!r}")
        dt = measurement.t_valid - memory.taken
        if dt <= EPS:
            return memory
        share = 1.0 if self.config.smoothing == 0.0 else -math.expm1(-dt / self.config.smoothing)
        v = memory.v + share * ((z - memory.p) / dt - memory.v)  # 0 at the first fix: dt is infinite
        return memory._replace(p=z, v=v, taken=measurement.t_valid, arrived=measurement.t_arrival)

    def read(self, memory: Memory, t: float | None = None) -> Estimate:
        """The estimate now, or of an earlier time. No covariance, no bias (NaN)."""
        wait, valid = max(0.0, memory.t - memory.arrived), math.isfinite(memory.taken)
        p = memory.p + memory.v * min(wait, self.config.longest)
        v = memory.v if wait <= self.config.longest else _NOTHING
        euler, now = memory.euler, memory.t
        if t is not None and t < memory.t - EPS:
            now = t
            if valid:
                p = memory.p + memory.v * min(t - memory.taken, self.config.longest)
            euler = next((then for at, then in reversed(memory.said) if at <= t + EPS), euler)
        mean = np.concatenate([p, v, _NO_PLACE, euler, memory.place])
        mean[2], mean[14] = -mean[2], -mean[14]
        flags = {
            "localised": valid and memory.t - memory.taken <= self.config.lost_after,
            "platform": bool(memory.place[0] == memory.place[0]),
        }
        return Estimate(now, NAMES, mean, None, valid, flags)
