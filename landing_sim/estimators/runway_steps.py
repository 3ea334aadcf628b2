"""What the runway filter does with its arrays in one cycle, each step in one piece, compiled: numpy's calls cost more.

Nothing that is handed in is changed.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.estimators.aircraft_model import propagate
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.inertial_model import airspeed_model, gyro_model
from landing_sim.estimators.kalman import (
    expand,
    innovation_variance,
    integrated_noise,
    predict_dense,
    update_dense,
    update_ud,
)
from landing_sim.estimators.states import DRIVING, JPAN, JTILT, N
from landing_sim.geometry.runway_image import HORIZON, THRESHOLD
from landing_sim.jit import kernel
from landing_sim.types import Array

_REJECTED = 6  # of signals.Status


@kernel
def transition(
    x: Array, shadow: Array, u: Array, par: Array, on_ground: bool, dt: float, index: np.ndarray, starts: np.ndarray,
    keep: Array, q: Array, added: Array, integrated: bool,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """x (26,) and shadow (6,) after dt [s] under commands u (see `propagate`), Phi (n, n) and Qd (n, n) of the covariance.

    index, starts, keep: see `Blocks` and `kalman.expand`; q (n,) spectral densities, integrated by eq. (9) or taken as
    Qd = q dt (the constant Q of eqs. 13, 14); added (n,) variances of what comes in besides.
    """
    x, shadow = x.copy(), shadow.copy()
    driving = np.empty((DRIVING, DRIVING))
    propagate(x, shadow, u, par, on_ground, dt, driving)
    x[JPAN] = x[JTILT] = 0.0  # the next reading's noise is another
    Phi = expand(driving, index, keep)
    Qd = integrated_noise(Phi, q, dt, starts) if integrated else np.zeros(Phi.shape)
    for i in range(len(q)):
        Qd[i, i] += added[i] if integrated else q[i] * dt + added[i]
    return x, shadow, Phi, Qd


@kernel
def forward_dense(
    P: Array, x: Array, shadow: Array, u: Array, par: Array, on_ground: bool, dt: float, index: np.ndarray,
    starts: np.ndarray, keep: Array, q: Array, added: Array, integrated: bool,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """`transition` and `predict_dense` in one: x, shadow, P after dt."""
    x, shadow, Phi, Qd = transition(x, shadow, u, par, on_ground, dt, index, starts, keep, q, added, integrated)
    return x, shadow, predict_dense(P, Phi, Qd, starts)


@kernel
def weigh(
    x: Array, cov: Array, index: np.ndarray, z: Array, variance: Array, extra: float, gate: float, feature: np.ndarray,
    status: np.ndarray, centre: Array, direction: Array, pan: float, tilt: float, lever: Array, focal: Array,
    slope: float,
) -> tuple[Array, Array, Array, np.ndarray, Array, np.ndarray, int, int, bool, bool]:  # fmt: skip
    """What edges say against the state x (26,) with covariance cov (n, n): see `edge_model` for what describes them.

    z, variance (n,) as measured, NaN where not found; extra [px^2] is added to the variance; an innovation of a square
    beyond `gate` times its variance is not used.

    Returns nu (n,) and R (n,), 0 and 1 where not found; Hn (n, :) as `of_index` gives it; use (n,) bool; nu with NaN;
    status (n,) with the gate's; and how many were found, how many are used, whether one of these lies on the runway, and
    on its threshold.
    """
    n = len(z)
    h, Hx = np.empty(n), np.empty((n, N))
    edge_model(x, feature, centre, direction, pan, tilt, lever, focal, slope, h, Hx)
    Hn = of_index(Hx, index)
    nu, R, innovation = np.zeros(n), np.ones(n), np.full(n, np.nan)
    use = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        if math.isfinite(z[i]):
            nu[i] = innovation[i] = z[i] - h[i]
            R[i] = variance[i] + extra
            use[i] = math.isfinite(nu[i])
    status = status.copy()
    if gate < math.inf:
        s = innovation_variance(cov, Hn, R)
        for i in range(n):
            use[i] = use[i] and nu[i] * nu[i] <= gate * s[i]
            if math.isfinite(z[i]) and not use[i]:
                status[i] = _REJECTED
    found = used = 0
    runway = threshold = False
    for i in range(n):
        found += math.isfinite(z[i])
        used += use[i]
        runway |= use[i] and feature[i] != HORIZON
        threshold |= use[i] and feature[i] == THRESHOLD
    return nu, R, Hn, use, innovation, status, found, used, runway, threshold


@kernel
def of_index(Hx: Array, index: np.ndarray) -> Array:
    """(m, n) the columns of Hx (m, 26) that the covariance covers."""
    out = np.empty((len(Hx), len(index)))
    for i in range(len(Hx)):
        for j in range(len(index)):
            out[i, j] = Hx[i, index[j]]
    return out


@kernel
def correct_dense(
    x: Array, P: Array, index: np.ndarray, starts: np.ndarray, Hn: Array, R: Array, nu: Array, use: np.ndarray
) -> tuple[Array, Array, Array, float]:
    """x, P after an update with nu, R (m,), Hn (m, n); the step dx (n,) and the normalised innovation squared."""
    P, dx, nis = update_dense(P.copy(), Hn, R, nu, use, starts)
    return _moved(x, index, dx), P, dx, nis


@kernel
def correct_ud(
    x: Array, U: Array, D: Array, index: np.ndarray, starts: np.ndarray, Hn: Array, R: Array, nu: Array, use: np.ndarray
) -> tuple[Array, Array, Array, Array, float]:
    """The same on U-D factors: x, U, D, dx and the NIS."""
    U, D, dx, nis = update_ud(U.copy(), D.copy(), Hn, R, nu, use, starts)
    return _moved(x, index, dx), U, D, dx, nis


@kernel
def edges_dense(
    x: Array, P: Array, index: np.ndarray, starts: np.ndarray, z: Array, variance: Array, extra: float, gate: float,
    feature: np.ndarray, status: np.ndarray, centre: Array, direction: Array, pan: float, tilt: float, lever: Array,
    focal: Array, slope: float,
) -> tuple[Array, Array, Array, np.ndarray, float, int, int, bool, bool]:  # fmt: skip
    """`weigh` and `correct_dense` in one: an array that Python never sees is one that it need not be handed.

    Returns x, P; nu with NaN, status (n,), the NIS; found, used, runway, threshold as `weigh` counts them.
    """
    nu, R, Hn, use, innovation, verdict, found, used, runway, threshold = weigh(
        x, P, index, z, variance, extra, gate, feature, status, centre, direction, pan, tilt, lever, focal, slope
    )
    x_after, P_after, _, nis = correct_dense(x, P, index, starts, Hn, R, nu, use)
    return x_after, P_after, innovation, verdict, nis, found, used, runway, threshold


@kernel
def gyro_dense(
    x: Array, P: Array, index: np.ndarray, starts: np.ndarray, z: Array, R: Array, use: np.ndarray
) -> tuple[Array, Array]:
    """x, P after a reading z (3,) of the gyros."""
    nu, Hx = gyro_model(x, z)
    x_after, P_after, _, _ = correct_dense(x, P, index, starts, of_index(Hx, index), R, nu, use)
    return x_after, P_after


@kernel
def airspeed_dense(
    x: Array, P: Array, index: np.ndarray, starts: np.ndarray, z: float, R: Array, use: np.ndarray
) -> tuple[Array, Array]:
    """x, P after a reading z [m/s] of the airspeed."""
    nu, Hx = airspeed_model(x, z)
    x_after, P_after, _, _ = correct_dense(x, P, index, starts, of_index(Hx, index), R, nu, use)
    return x_after, P_after


@kernel
def _moved(x: Array, index: np.ndarray, dx: Array) -> Array:
    out = x.copy()
    for i in range(len(index)):
        out[index[i]] += dx[i]
    return out
