"""Bundle adjustment: keyframe poses and points that agree best with where the points were found.

Levenberg-Marquardt on fisheye pixels with Huber's weights; the points are eliminated (Schur complement), and what is left,
six unknowns a free keyframe, is dense. Keyframes that are not free take part with their observations: without them, points
that they see would be dragged along with the free ones (the trial behind this design was 47 cm off at residuals of 0.3 px).

Source     Triggs et al. 2000, section 6 (Schur complement); Klein & Murray 2007, section 6.3 (local adjustment).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.slam.lens import seen, slopes, small_turn

HUBER = 1.5  # [px of the level that a point was found in] from here on residuals count linearly


def adjust(
    R: Array, p: Array, X: Array, free: np.ndarray, frame: np.ndarray, point: np.ndarray, uv: Array, size: Array,
    f: float, cx: float, cy: float, steps: int = 10,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """Adjusted R (m, 3, 3), p (m, 3), X (n, 3), and the residuals (k,) [px of the level] of the observations.

    Parameters
    ----------
    R_CR (m, 3, 3), p_RC (m, 3), X (n, 3) : where to start; every point needs an observation
    free (m,) bool : poses that may move
    frame (k,), point (k,) : who sees what, sorted by point; uv (k, 2) [px]; size (k,) [px] their standard deviation's scale
    steps : at most so many Levenberg-Marquardt steps
    """
    R, p, X = R.copy(), p.copy(), X.copy()
    slot = np.where(free, np.cumsum(free) - 1, -1)
    m = int(free.sum())
    start = np.searchsorted(point, np.arange(len(X) + 1))
    k = len(frame)
    U, W = np.empty((m, 6, 6)), np.empty((k, 6, 3))
    V, gp = np.empty((len(X), 3, 3)), np.empty((len(X), 3))
    gc, e = np.empty((m, 6)), np.empty(k)
    S, b = np.empty((6 * m, 6 * m)), np.empty(6 * m)
    damping = 1e-4
    cost = _linearise(R, p, X, slot, frame, point, uv, size, f, cx, cy, U, W, V, gc, gp, e)
    for _ in range(steps):
        _reduce(U, W, V, gc, gp, slot, frame, start, damping, S, b)
        try:
            d = cho_solve(cho_factor(S, lower=True, check_finite=False), b, check_finite=False) if m else b
        except LinAlgError:
            damping *= 10.0
            continue
        R1, p1, X1 = _moved(R, p, X, d, W, V, gp, slot, frame, start, damping)
        new = _linearise(R1, p1, X1, slot, frame, point, uv, size, f, cx, cy, U, W, V, gc, gp, e)
        if new < cost:
            gain = (cost - new) / cost
            R, p, X, cost = R1, p1, X1, new
            damping = max(damping * 0.1, 1e-9)
            if gain < 1e-4:
                break
        else:
            damping *= 10.0
            if damping > 1e3:
                break
            _linearise(R, p, X, slot, frame, point, uv, size, f, cx, cy, U, W, V, gc, gp, e)
    _linearise(R, p, X, slot, frame, point, uv, size, f, cx, cy, U, W, V, gc, gp, e)
    return R, p, X, e


@kernel
def _linearise(
    R: Array, p: Array, X: Array, slot: np.ndarray, frame: np.ndarray, point: np.ndarray, uv: Array, size: Array,
    f: float, cx: float, cy: float, U: Array, W: Array, V: Array, gc: Array, gp: Array, e: Array,
) -> float:  # fmt: skip
    """Normal equations by blocks, residuals e and the robust cost."""
    U[:] = 0.0
    V[:] = 0.0
    gc[:] = 0.0
    gp[:] = 0.0
    D, A, B = np.empty((2, 3)), np.empty((2, 6)), np.empty((2, 3))
    r = np.empty(2)
    cost = 0.0
    for o in range(frame.shape[0]):
        i, j = frame[o], point[o]
        dx, dy, dz = X[j, 0] - p[i, 0], X[j, 1] - p[i, 1], X[j, 2] - p[i, 2]
        x = R[i, 0, 0] * dx + R[i, 0, 1] * dy + R[i, 0, 2] * dz
        y = R[i, 1, 0] * dx + R[i, 1, 1] * dy + R[i, 1, 2] * dz
        z = R[i, 2, 0] * dx + R[i, 2, 1] * dy + R[i, 2, 2] * dz
        u, v = seen(x, y, z, f, cx, cy)
        slopes(x, y, z, f, D)
        s = 1.0 / size[o]
        r[0], r[1] = s * (uv[o, 0] - u), s * (uv[o, 1] - v)
        norm = math.hypot(r[0], r[1])
        e[o] = norm
        w = 1.0 if norm < HUBER else HUBER / norm
        cost += 0.5 * norm * norm if norm < HUBER else HUBER * (norm - 0.5 * HUBER)
        for a in range(2):
            for c in range(3):
                B[a, c] = s * (D[a, 0] * R[i, 0, c] + D[a, 1] * R[i, 1, c] + D[a, 2] * R[i, 2, c])
                A[a, 3 + c] = -B[a, c]
            A[a, 0] = s * (D[a, 2] * y - D[a, 1] * z)
            A[a, 1] = s * (D[a, 0] * z - D[a, 2] * x)
            A[a, 2] = s * (D[a, 1] * x - D[a, 0] * y)
        for c in range(3):
            gp[j, c] += w * (B[0, c] * r[0] + B[1, c] * r[1])
            for d in range(3):
                V[j, c, d] += w * (B[0, c] * B[0, d] + B[1, c] * B[1, d])
        k = slot[i]
        if k >= 0:
            for c in range(6):
                gc[k, c] += w * (A[0, c] * r[0] + A[1, c] * r[1])
                for d in range(6):
                    U[k, c, d] += w * (A[0, c] * A[0, d] + A[1, c] * A[1, d])
                for d in range(3):
                    W[o, c, d] = w * (A[0, c] * B[0, d] + A[1, c] * B[1, d])
    return cost


@kernel
def _inverse(V: Array, damping: float, out: Array) -> None:
    """Inverse of a symmetric 3x3 with its diagonal raised; 0 where it has none."""
    a, b, c = V[0, 0] * (1.0 + damping) + 1e-9, V[0, 1], V[0, 2]
    d, e, f = V[1, 1] * (1.0 + damping) + 1e-9, V[1, 2], V[2, 2] * (1.0 + damping) + 1e-9
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * A + b * B + c * C
    k = 1.0 / det if det > 1e-200 else 0.0
    out[0, 0], out[0, 1], out[0, 2] = k * A, k * B, k * C
    out[1, 0], out[1, 1], out[1, 2] = k * B, k * (a * f - c * c), k * (b * c - a * e)
    out[2, 0], out[2, 1], out[2, 2] = k * C, k * (b * c - a * e), k * (a * d - b * b)


@kernel
def _reduce(
    U: Array, W: Array, V: Array, gc: Array, gp: Array, slot: np.ndarray, frame: np.ndarray, start: np.ndarray,
    damping: float, S: Array, b: Array,
) -> None:  # fmt: skip
    """S (6m, 6m, lower triangle) and b (6m,) of the keyframes alone."""
    m = U.shape[0]
    S[:] = 0.0
    for k in range(m):
        for c in range(6):
            b[6 * k + c] = gc[k, c]
            for d in range(6):
                S[6 * k + c, 6 * k + d] = U[k, c, d]
            S[6 * k + c, 6 * k + c] += damping * U[k, c, c] + 1e-9
    Vi, Y = np.empty((3, 3)), np.empty((6, 3))
    for j in range(V.shape[0]):
        _inverse(V[j], damping, Vi)
        for o in range(start[j], start[j + 1]):
            k = slot[frame[o]]
            if k < 0:
                continue
            for c in range(6):
                for d in range(3):
                    Y[c, d] = W[o, c, 0] * Vi[0, d] + W[o, c, 1] * Vi[1, d] + W[o, c, 2] * Vi[2, d]
                b[6 * k + c] -= Y[c, 0] * gp[j, 0] + Y[c, 1] * gp[j, 1] + Y[c, 2] * gp[j, 2]
            for q in range(start[j], start[j + 1]):
                l = slot[frame[q]]
                if l < 0 or l > k:
                    continue
                for c in range(6):
                    for d in range(6):
                        S[6 * k + c, 6 * l + d] -= Y[c, 0] * W[q, d, 0] + Y[c, 1] * W[q, d, 1] + Y[c, 2] * W[q, d, 2]


@kernel
def _moved(
    R: Array, p: Array, X: Array, d: Array, W: Array, V: Array, gp: Array, slot: np.ndarray, frame: np.ndarray,
    start: np.ndarray, damping: float,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Poses and points after the step d of the keyframes and what follows from it for the points."""
    R1, p1, X1 = R.copy(), p.copy(), X.copy()
    for i in range(R.shape[0]):
        k = slot[i]
        if k >= 0:
            R1[i] = small_turn(d[6 * k], d[6 * k + 1], d[6 * k + 2]) @ R[i]
            for c in range(3):
                p1[i, c] += d[6 * k + 3 + c]
    Vi, g = np.empty((3, 3)), np.empty(3)
    for j in range(X.shape[0]):
        _inverse(V[j], damping, Vi)
        for c in range(3):
            g[c] = gp[j, c]
        for o in range(start[j], start[j + 1]):
            k = slot[frame[o]]
            if k >= 0:
                for c in range(3):
                    for a in range(6):
                        g[c] -= W[o, a, c] * d[6 * k + a]
        for c in range(3):
            X1[j, c] += Vi[c, 0] * g[0] + Vi[c, 1] * g[1] + Vi[c, 2] * g[2]
    return R1, p1, X1
