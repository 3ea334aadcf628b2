"""Range from several outputs at once: smooth, without a division by zero, and dead reckoning where nothing is to be seen.

Each output z_i drifts with nearness rho = 1/x3: z_i' = p_i + d_i rho. After an exact prediction, e_i = z_i - z_hat_i and

    z_hat_i += l1 e_i,    rho_hat += l2 sum_i(w_i d_i e_i) / (sum_i w_i d_i^2 + eps^2)

With one output and |d| >> eps this is the observer of Gibert et al.; with two it passes from the one that moves to the
other without a switch, since d1 and d2 rarely vanish together; with |d| << eps only the bearings are corrected. On the
glide path to the point d1 = d2 = 0: there range comes from an angular width s = W/x3 of unknown size, d_s = -b3 s.

Source     ours, after Gibert et al. 2015 (remark 1 names the choice of output); see gibert.py for theirs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from landing_sim.estimators.ranging.contract import Flag, Motion, State, arrive, on_ray
from landing_sim.estimators.ranging.gains import pole_pair
from landing_sim.estimators.ranging.perspective import drift
from landing_sim.jit import kernel
from landing_sim.types import Array


class Corrected(NamedTuple):
    """What an update came to."""

    z: Array  # (m,) outputs
    rho: float  # [1/m]
    observed: float  # [m/s] sqrt(sum w d^2): what range was measured with; compare with eps
    limited: bool  # the correction was larger than allowed and was cut


@kernel
def correct(
    z: Array,
    rho: float,
    e: Array,
    d: Array,
    weights: Array,
    gains: tuple[float, float],
    eps: float,
    limit: float = math.inf,
) -> Corrected:
    """One correction of outputs z (m,) and nearness rho [1/m] by innovations e (m,).

    d : (m,) [m/s] how fast rho drives each output; b_i - b3 y_i for bearings, -b3 s (forward speed times s) for a width
    weights : (m,) >= 0, e.g. 1/sigma_i^2 normalised to the largest; 0 leaves an output's share of the range out
    gains : l1 (-), l2 [1/s] of `gains.pole_pair`
    eps : [m/s] below which range is not corrected; the share that remains at sqrt(sum w d^2) = q is q^2 / (q^2 + eps^2)
    limit : largest share of the range that one correction may move it by

    An innovation that is NaN was not measured: its output stays as predicted.
    """
    measured = np.isfinite(e)
    e = np.where(measured, e, 0.0)
    w = np.where(measured, weights, 0.0)
    power = float(np.sum(w * d * d))
    below = power + eps * eps
    change = gains[1] * float(np.sum(w * d * e)) / below if below > 0.0 else 0.0
    lowest, highest = -rho * limit / (1.0 + limit) if math.isfinite(limit) else -0.5 * rho, limit * rho
    allowed = min(max(change, lowest), highest)
    return Corrected(z + gains[0] * e, rho + allowed, math.sqrt(power), allowed != change)


@kernel
def faded(weights: Array, d: Array, floors: Array) -> Array:
    """Weights (m,) times d^2 / (d^2 + floor^2): an output whose d [m/s] is small against its floor loses its say.

    A bearing's d is wrong by the error of the lateral velocity, and range by that over d; a width's is not. With a floor of
    a few m/s on bearings and none on the width, the width takes over on the glide path. eps still keeps from dividing by 0.
    """
    square = d * d
    return np.where(square > 0.0, weights * square / (square + floors * floors + 1e-300), 0.0)


@dataclass(frozen=True, slots=True)
class Fused:
    """contract.RangeObserver on y (2,), or on y (3,) with the angular width s = W/x3 third. NaN in y: not measured.

    weights, floors [m/s] : of y1, y2 and s; see `faded`
    limit : largest share of the range that one step may correct
    """

    xi: float = 1.0
    omega: float = 0.5  # [rad/s]
    eps: float = 3.0  # [m/s]
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    floors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    limit: float = 0.02

    def start(self, y: Array, range_guess: float) -> State:
        y = np.asarray(y, dtype=float)
        return State(on_ray(y, range_guess), y, y[2:].copy())

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        x = motion.R @ state.x + motion.t
        if not x[2] > 0.0:
            return arrive(state, x, y, motion, state.inner, (state.d1, state.d2), False, self.limit)
        z = x / x[2]
        if len(y) == 3:
            width = state.inner[0] if len(state.inner) and math.isfinite(state.inner[0]) else math.nan
            z[2] = width * state.x[2] / x[2] if math.isfinite(width) else y[2]
        z = z[: len(y)]
        _, _, _, d1, d2 = drift(z[0], z[1], motion.A, motion.B)
        d = np.array([d1, d2, -motion.B[2] * z[2]] if len(y) == 3 else [d1, d2])
        d = np.where(np.isfinite(d), d, 0.0)
        n = len(y)
        weights = faded(np.array(self.weights[:n]), d, np.array(self.floors[:n]))
        found = correct(z, 1.0 / x[2], y - z, d, weights, pole_pair(self.xi, self.omega, dt), self.eps, self.limit)
        out = np.array([found.z[0], found.z[1], 1.0]) / found.rho
        after = arrive(state, out, y, motion, found.z[2:], (d1, d2), found.observed >= self.eps, math.inf)
        return replace(after, flag=Flag.LIMITED) if found.limited else after

    def estimate(self, state: State) -> Array:
        return state.x
