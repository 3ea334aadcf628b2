"""Extended Kalman filter on the same state: the point in camera axes, and the size W seen there if it is measured.

    x- = R x + t,   z = (x1/x3, x2/x3[, W/x3])

It knows how sure it is, and settles as fast as its noise allows. What it is not told (a biased velocity, a camera askew) it
takes for range where little is to be seen: `flag` says when, and `limit` bounds what one step may do.

Source     textbook; ours as a rival to the observers. The state is not theirs: the first guess is spread along the ray.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.ranging.contract import Motion, State, arrive, on_ray
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class RangeEkf:
    """contract.RangeObserver on y (2,), or on y (3,) with the angular width s = W/x3 third. NaN in y: not measured.

    sigma : [-] noise of y1, y2 and s, as an angle
    first : one sigma of the first range, as a share of it
    drift : [m/sqrt(s)] random walk that the position is allowed
    floor : [m/s] flagged below |(d1, d2[, d_s])| = floor
    """

    sigma: tuple[float, float, float] = (3.3e-4, 3.3e-4, 4.7e-4)
    first: float = 0.5
    drift: float = 0.2
    floor: float = 0.05
    limit: float = math.inf

    def start(self, y: Array, range_guess: float) -> State:
        """Raises ValueError if the width is asked for and not measured."""
        y = np.asarray(y, dtype=float)
        x = on_ray(y, range_guess)
        if not np.isfinite(y).all():
            raise ValueError(f"a filter on {len(y)} outputs starts when all are measured, not from {y}")
        ray = np.array([y[0], y[1], 1.0, *y[2:]])
        spread = np.array([self.sigma[0], self.sigma[1], 0.0, *self.sigma[2 : len(y)]]) * range_guess
        P = (self.first * range_guess) ** 2 * np.outer(ray, ray) + np.diag(spread**2)
        return State(x, y, _pack(y[2:] * range_guess, P))

    def step(self, state: State, y: Array, motion: Motion, dt: float) -> State:
        y = np.asarray(y, dtype=float)
        n, m = len(y) + 1, len(y)
        W, P = _unpack(state.inner, n)
        x = np.concatenate([motion.R @ state.x + motion.t, W])
        F, Q = np.eye(n), np.zeros((n, n))
        F[:3, :3] = motion.R
        Q[:3, :3] = self.drift**2 * dt * np.eye(3)
        P = F @ P @ F.T + Q
        outputs = x[[0, 1, *range(3, n)]]
        d = motion.B[:2] - motion.B[2] * outputs[:2] / x[2]
        d_width = motion.B[2] * outputs[2] / x[2] if m == 3 else 0.0
        speed = math.sqrt(float(d @ d) + float(d_width) ** 2)
        if x[2] > 0.0:
            H = np.zeros((m, n))
            H[:, [0, 1, *range(3, n)]] = np.eye(m) / x[2]
            H[:, 2] = -outputs / x[2] ** 2
            use = np.isfinite(y)
            H, e, R = H[use], (y - outputs / x[2])[use], np.diag(np.square(self.sigma[:m]))[np.ix_(use, use)]
            K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            x = x + K @ e
            joseph = np.eye(n) - K @ H
            P = joseph @ P @ joseph.T + K @ R @ K.T
        seen = speed >= self.floor and bool(np.isfinite(y).any())
        return arrive(state, x[:3], y, motion, _pack(x[3:], P), (float(d[0]), float(d[1])), seen, self.limit)

    def estimate(self, state: State) -> Array:
        return state.x

    def sigmas(self, state: State) -> Array:
        """One sigma [m] of x1, x2, x3 and, if it is estimated, W."""
        n = len(state.y) + 1
        return np.sqrt(np.diag(_unpack(state.inner, n)[1]))


def _pack(W: Array, P: Array) -> Array:
    return np.concatenate([W, P.ravel()])


def _unpack(inner: Array, n: int) -> tuple[Array, Array]:
    return inner[: n - 3], inner[n - 3 :].reshape(n, n)
