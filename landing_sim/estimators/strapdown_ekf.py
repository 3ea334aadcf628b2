"""Position fixes fused with a strapped-down inertial unit: nine states, the errors of position, velocity and bias.

    p' = v,   v' = C_RB (a_B - b) + g,   b' = 0                                            (1)-(3)
    dp' = dv,   dv' = -C_RB db + eta_a,   db' = eta_b                                      (4)-(6)
    z = y_fix - p,   H = [I 0 0]                                                           (7)

with a_B the specific force, g = (0, 0, g) in R (z down) and d = truth - belief, the sign in which (7) adds up. (5) is
printed with + C db: that holds only if the bias error alone counts the other way. A tilt error of the attitude that the
autopilot believes looks like an accelerometer bias, and is carried as one.

A reading integrates the interval that it was averaged over, so it must come before a fix of the same time. Time that no
reading covers yet is bridged with the last one, and integrated again when the reading arrives. The filter takes fixes as
valid at its own time: inside `Rewind` late ones are applied when their image was taken and the readings since replayed,
without `Rewind` nothing is compensated.

Source     Brockers et al. 2012, section 3.3. Departs: sign of (5); g is added, for with z down and a specific force (2)'s
           sign cannot be; a fix is gated, and after a run of refused ones believed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from landing_sim.estimators.kalman import predict_dense, update_dense
from landing_sim.geometry.so3 import from_euler
from landing_sim.jit import kernel
from landing_sim.signals import Command, Estimate, Measurement, Residuals, Status
from landing_sim.types import Array

NAMES = (
    *("x", "y", "H", "vx", "vy", "vz", "bax", "bay", "baz"),
    *("phi", "theta", "psi", "lx", "ly", "lH"),
)
"""[m] cg in R; [m/s] its velocity in R; [m/s^2] accelerometer bias in B; [rad]; [m] landing place in R, NaN while none."""
EPS = 1e-9  # [s]
_WHOLE = np.array([0, 9])
_H = np.eye(3, 9)
_NO_PLACE = np.full(3, np.nan)


@dataclass(frozen=True, slots=True)
class StrapdownConfig:
    """Noise densities and first spreads (1 sigma).

    gate : a fix whose normalised innovation squared exceeds it is refused; `patience` such in a row, and the next is
        believed: position and velocity are then as uncertain as at the start
    lost_after : [s] without a fix that was used, and the vehicle is not localised
    attitude : [rad] of the autopilot's angles: said in the covariance, not filtered
    """

    accel: float = 0.03  # [m/s^2/sqrt(Hz)] of the specific force; gusts do not count: they are felt
    bias: float = 0.02  # [m/s^2/sqrt(s)]: the attitude's wandering error, times g
    position: float = 0.003  # [m/sqrt(s)]
    gravity: float = 9.797  # [m/s^2]
    first_position: float = 0.05
    first_velocity: float = 0.5
    first_bias: float = 0.2
    gate: float = 25.0
    patience: int = 5
    lost_after: float = 1.0
    attitude: float = math.radians(0.6)


class Memory(NamedTuple):
    """At t; x, P are of `since`, where the last reading or fix was. Not valid before the first fix."""

    t: float
    since: float
    x: Array  # (9,) p, v [R], b [B]
    P: Array  # (9, 9)
    a_B: Array  # (3,) last reading
    euler: Array  # (3,)
    valid: bool = False
    t_fix: float = -math.inf  # of the last fix used
    refused: int = 0  # in a row
    place: Array = _NO_PLACE  # (3,) x, y, z in R
    place_variance: Array = _NO_PLACE
    seen: Residuals | None = None  # of the last fix


class StrapdownEkf:
    """interfaces.Estimator. Takes "strapdown", "position", "way_point"; other kinds raise ValueError."""

    def __init__(self, config: StrapdownConfig | None = None) -> None:
        self.config = c = config or StrapdownConfig()
        self._q = np.array([c.position**2, c.accel**2, c.bias**2])
        self._first = np.repeat([c.first_position**2, c.first_velocity**2, c.first_bias**2], 3)
        self._attitude = np.full(3, c.attitude**2)

    def init(self, t: float) -> Memory:
        return Memory(t, t, np.zeros(9), np.diag(self._first), np.array([0.0, 0.0, -self.config.gravity]), np.zeros(3))

    def predict(self, memory: Memory, command: Command, t: float) -> Memory:
        """Time passes; what moved meanwhile, the next reading tells."""
        return memory._replace(t=t) if t > memory.t + EPS else memory

    def update(self, memory: Memory, measurement: Measurement) -> Memory:
        kind, z = measurement.kind, measurement.z
        if kind == "strapdown":
            return self._integrate(memory, z[:3], z[3:])
        if kind == "position":
            return self._fix(memory, z, measurement.R)
        if kind == "way_point":
            return memory._replace(place=z, place_variance=measurement.R)
        raise ValueError(f"a strapdown filter knows no measurement {kind!r}")

    def read(self, memory: Memory, t: float | None = None) -> Estimate:
        """The estimate at the memory's time; an age `t` asked for is ignored (see Rewind)."""
        x, P = self._now(memory)
        flags = {
            "localised": memory.valid and memory.t - memory.t_fix <= self.config.lost_after,
            "platform": bool(memory.place[0] == memory.place[0]),
        }
        mean, cov = _told(x, P, memory.euler, self._attitude, memory.place, memory.place_variance)
        return Estimate(memory.t, NAMES, mean, cov, memory.valid, flags, memory.seen)

    def _integrate(self, memory: Memory, a_B: Array, euler: Array) -> Memory:
        x, P, dt = memory.x, memory.P, memory.t - memory.since
        if memory.valid and dt > EPS:
            x, P = propagate(x, P, a_B, memory.euler, euler, dt, self._q, self.config.gravity)
        return memory._replace(since=memory.t, x=x, P=P, a_B=a_B, euler=euler)

    def _now(self, memory: Memory) -> tuple[Array, Array]:
        dt = memory.t - memory.since
        if not memory.valid or dt <= EPS:
            return memory.x, memory.P
        euler = memory.euler
        return propagate(memory.x, memory.P, memory.a_B, euler, euler, dt, self._q, self.config.gravity)

    def _fix(self, memory: Memory, z: Array, R: Array) -> Memory:
        t = memory.t
        if not memory.valid:
            x, P = np.concatenate([z, np.zeros(6)]), np.diag(self._first)
            P[:3, :3] = np.diag(R)
            return memory._replace(since=t, x=x, P=P, valid=True, t_fix=t, refused=0)
        x, P = self._now(memory)
        innovation = z - x[:3]
        P_new, dx, nis = update_dense(P.copy(), _H, R, innovation, np.ones(3, np.bool_), _WHOLE)
        status, refused = Status.FOUND, 0
        if nis > self.config.gate:
            if memory.refused < self.config.patience:
                status, refused = Status.REJECTED, memory.refused + 1
                P_new, dx = P, np.zeros(9)
            else:
                P = widened(P, self._first[:6])
                P_new, dx, nis = update_dense(P, _H, R, innovation, np.ones(3, np.bool_), _WHOLE)
        return memory._replace(
            since=t,
            x=x + dx,
            P=P_new,
            t_fix=memory.t_fix if refused else t,
            refused=refused,
            seen=Residuals(innovation, np.full(3, int(status)), float(nis), 3),
        )


def widened(P: Array, variance: Array) -> Array:
    """P with the first states (as many as `variance`) forgotten: these variances, no correlation with anything."""
    out, n = P.copy(), len(variance)
    out[:n], out[:, :n] = 0.0, 0.0
    out[range(n), range(n)] = variance
    return out


@kernel
def propagate(
    x: Array, P: Array, a_B: Array, euler_0: Array, euler_1: Array, dt: float, q: Array, g: float
) -> tuple[Array, Array]:
    """x (9,), P (9, 9) after dt of the mean specific force a_B, the attitude turning from euler_0 to euler_1.

    q : (3,) densities of noise in position, velocity and bias
    """
    C_0, C_1 = from_euler(euler_0[0], euler_0[1], euler_0[2]), from_euler(euler_1[0], euler_1[1], euler_1[2])
    out, Phi, Q = x.copy(), np.eye(9), np.zeros((9, 9))
    for i in range(3):
        acceleration = g if i == 2 else 0.0
        for j in range(3):
            c = 0.5 * (C_0[i, j] + C_1[i, j])
            acceleration += c * (a_B[j] - x[6 + j])
            Phi[3 + i, 6 + j] = -c * dt
            Phi[i, 6 + j] = -0.5 * c * dt * dt
        out[i] += dt * (x[3 + i] + 0.5 * dt * acceleration)
        out[3 + i] += dt * acceleration
        Phi[i, 3 + i] = dt
        Q[i, i] = dt * (q[0] + q[1] * dt * dt / 3.0)
        Q[i, 3 + i] = Q[3 + i, i] = 0.5 * q[1] * dt * dt
        Q[3 + i, 3 + i] = q[1] * dt
        Q[6 + i, 6 + i] = q[2] * dt
    return out, predict_dense(P, Phi, Q, np.array([0, 9]))


@kernel
def _told(x: Array, P: Array, euler: Array, attitude: Array, place: Array, spread: Array) -> tuple[Array, Array]:
    """mean (15,) and covariance of NAMES: heights instead of z."""
    mean, cov = np.empty(15), np.zeros((15, 15))
    for i in range(9):
        up = -1.0 if i == 2 else 1.0
        mean[i] = up * x[i]
        for j in range(9):
            cov[i, j] = up * (-1.0 if j == 2 else 1.0) * P[i, j]
    for i in range(3):
        mean[9 + i], cov[9 + i, 9 + i] = euler[i], attitude[i]
        mean[12 + i], cov[12 + i, 12 + i] = (-place[i] if i == 2 else place[i]), spread[i]
    return mean, cov
