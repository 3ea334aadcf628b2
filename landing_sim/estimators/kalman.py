"""Kalman steps on a covariance that may be split into blocks, dense or as U-D factors, compiled.

A filter in one piece has one block. The paper's split filter has two: cross-covariances between them are not carried and
the transition's cross terms are dropped, but every innovation is weighed with the *total* variance

    s = sum_b H_b P_b H_b' + R

(with its own half alone, each half would correct for the same innovation). For Bierman's update of block b this means an
effective noise R_b = s - H_b P_b H_b'. Scalars are processed one after another at a common linearisation point, which is
identical to the batch update.

Block b covers the covariance indices starts[b] .. starts[b+1]-1.

Source     Bierman 1977, chapters V and VI (U-D update, modified weighted Gram-Schmidt); Dickmanns & Schell 1992, eqs.
           (9)-(14) and section 4. Departs: total innovation variance for the split filter; eq. (12) in a symmetric form.
"""

from __future__ import annotations

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array


@kernel
def ud_factor(P: Array) -> tuple[Array, Array]:
    """U (n, n) unit upper triangular and D (n,) with P = U diag(D) U', for P symmetric, positive semidefinite."""
    n = P.shape[0]
    A = P.copy()
    U = np.eye(n)
    D = np.zeros(n)
    for j in range(n - 1, -1, -1):
        D[j] = A[j, j]
        if D[j] <= 0.0:
            D[j] = 0.0
            continue
        for i in range(j):
            U[i, j] = A[i, j] / D[j]
        for k in range(j):
            for i in range(k + 1):
                A[i, k] -= U[i, j] * D[j] * U[k, j]
    return U, D


@kernel
def ud_product(U: Array, D: Array) -> Array:
    """P = U diag(D) U'."""
    n = D.shape[0]
    P = np.empty((n, n))
    for i in range(n):
        for j in range(i, n):
            acc = 0.0
            for k in range(j, n):
                acc += U[i, k] * D[k] * U[j, k]
            P[i, j] = acc
            P[j, i] = acc
    return P


@kernel
def own_blocks(M: Array, starts: Array) -> Array:
    """M (n, n) without what couples one block to another; M itself where there is one block."""
    if len(starts) == 2:
        return M
    out = np.zeros(M.shape)
    for b in range(starts.shape[0] - 1):
        for i in range(starts[b], starts[b + 1]):
            for j in range(starts[b], starts[b + 1]):
                out[i, j] = M[i, j]
    return out


@kernel
def predict_dense(P: Array, Phi: Array, Qd: Array, starts: Array) -> Array:
    """P- = Phi P+ Phi' + Qd (eq. 9), blocks kept apart; P and Qd are symmetric and couple none.

    Row by row, each from its beginning, so that the processor takes several of its entries at a time; most of Phi is zero
    and left out, which changes no bit.
    """
    n = P.shape[0]
    Phi = own_blocks(Phi, starts)
    T = np.zeros((n, n))  # Phi P+
    for i in range(n):
        for k in range(n):
            a = Phi[i, k]
            if a != 0.0:
                for j in range(n):
                    T[i, j] += a * P[k, j]
    TT = T.T.copy()
    out = np.empty((n, n))
    for j in range(n):
        for i in range(j + 1):
            out[j, i] = Qd[j, i]
        for k in range(n):
            a = Phi[j, k]
            if a != 0.0:
                for i in range(j + 1):
                    out[j, i] += TT[k, i] * a
        for i in range(j):
            out[i, j] = out[j, i]
    return out


@kernel
def predict_ud(U: Array, D: Array, Phi: Array, Qd: Array, starts: Array) -> tuple[Array, Array]:
    """The same on U-D factors: modified weighted Gram-Schmidt on [Phi U, U_q]."""
    n = D.shape[0]
    U_out, D_out = np.eye(n), np.zeros(n)
    U_q, D_q = ud_factor(Qd)
    for b in range(starts.shape[0] - 1):
        lo, m = starts[b], starts[b + 1] - starts[b]
        W = np.zeros((m, 2 * m))
        Dw = np.empty(2 * m)
        for j in range(m):
            Dw[j], Dw[m + j] = D[lo + j], D_q[lo + j]
        for i in range(m):
            for k in range(m):
                a = Phi[lo + i, lo + k]
                if a != 0.0:
                    for j in range(k, m):
                        W[i, j] += a * U[lo + k, lo + j]
            for j in range(i, m):
                W[i, m + j] = U_q[lo + i, lo + j]
        for j in range(m - 1, -1, -1):
            d = 0.0
            for k in range(2 * m):
                d += W[j, k] * W[j, k] * Dw[k]
            D_out[lo + j] = d
            if d <= 0.0:
                continue
            for i in range(j):
                acc = 0.0
                for k in range(2 * m):
                    acc += W[i, k] * Dw[k] * W[j, k]
                acc /= d
                U_out[lo + i, lo + j] = acc
                for k in range(2 * m):
                    W[i, k] -= acc * W[j, k]
    return U_out, D_out


@kernel
def innovation_variance(P: Array, Hn: Array, R: Array) -> Array:
    """s (m,) = diag(H P H') + R, before any update."""
    m, n = Hn.shape
    s, seen = np.empty(m), np.empty(n, np.int64)
    for i in range(m):
        count = 0
        for a in range(n):
            if Hn[i, a] != 0.0:
                seen[count] = a
                count += 1
        acc = R[i]
        for k in range(count):
            a = seen[k]
            for l in range(count):
                b = seen[l]
                acc += Hn[i, a] * P[a, b] * Hn[i, b]
        s[i] = acc
    return s


@kernel
def update_dense(P: Array, Hn: Array, R: Array, nu: Array, use: Array, starts: Array) -> tuple[Array, Array, float]:
    """Sequential update; P, symmetric, is changed in place. Returns P, dx (n,), the normalised innovation squared."""
    n = P.shape[0]
    dx, PH, own = np.zeros(n), np.empty(n), np.zeros(n)
    nis = 0.0
    for i in range(Hn.shape[0]):
        if not use[i]:
            continue
        e = nu[i]
        s = R[i]
        for a in range(n):
            PH[a] = 0.0
        for b in range(n):
            h = Hn[i, b]
            if h != 0.0:
                for a in range(n):
                    PH[a] += P[b, a] * h  # a row of P is a column
        for a in range(n):
            s += Hn[i, a] * PH[a]
            e -= Hn[i, a] * dx[a]
        nis += e * e / s
        for a in range(n):
            dx[a] += PH[a] * e / s
        for b in range(starts.shape[0] - 1):
            for a in range(n):
                own[a] = PH[a] if starts[b] <= a < starts[b + 1] else 0.0
            for a in range(n):
                for c in range(n):
                    P[a, c] -= own[a] * own[c] / s
    return P, dx, nis


@kernel
def update_ud(
    U: Array, D: Array, Hn: Array, R: Array, nu: Array, use: Array, starts: Array
) -> tuple[Array, Array, Array, float]:
    """Bierman's sequential update; U, D are changed in place. Returns U, D, dx and the NIS."""
    n = D.shape[0]
    dx = np.zeros(n)
    f, v, k_gain = np.empty(n), np.empty(n), np.empty(n)
    nis = 0.0
    blocks = starts.shape[0] - 1
    own = np.empty(blocks)
    for i in range(Hn.shape[0]):
        if not use[i]:
            continue
        e = nu[i]
        s = R[i]
        for b in range(blocks):
            own[b] = 0.0
            for j in range(starts[b], starts[b + 1]):
                e -= Hn[i, j] * dx[j]
                acc = Hn[i, j]
                for k in range(starts[b], j):
                    acc += U[k, j] * Hn[i, k]
                f[j] = acc
                v[j] = D[j] * acc
                own[b] += acc * v[j]
            s += own[b]
        nis += e * e / s
        for b in range(blocks):
            alpha = s - own[b]
            for j in range(starts[b], starts[b + 1]):
                before = alpha
                alpha += f[j] * v[j]
                D[j] *= before / alpha
                lam = -f[j] / before
                k_gain[j] = v[j]
                for k in range(starts[b], j):
                    old = U[k, j]
                    U[k, j] = old + k_gain[k] * lam
                    k_gain[k] += old * v[j]
            for j in range(starts[b], starts[b + 1]):
                dx[j] += k_gain[j] * e / s
    return U, D, dx, nis


@kernel
def integrated_noise(Phi: Array, q: Array, dt: float, starts: Array) -> Array:
    """Qd (n, n) of white noise with densities q (n,): the integral in eq. (9) by the trapezium rule,

    Qd = (Phi q Phi' + q) dt / 2, within each block.
    """
    n = q.shape[0]
    Phi = own_blocks(Phi, starts)
    spread = np.empty((n, n))  # (Phi q)'
    for i in range(n):
        for k in range(n):
            spread[k, i] = Phi[i, k] * q[k]
    out = np.zeros((n, n))
    for j in range(n):
        out[j, j] = q[j]
        for k in range(n):
            a = Phi[j, k]
            if a != 0.0:
                for i in range(j + 1):
                    out[j, i] += spread[k, i] * a
        for i in range(j + 1):
            out[j, i] *= 0.5 * dt
            out[i, j] = out[j, i]
    return out


@kernel
def expand(driving: Array, index: Array, keep: Array) -> Array:
    """Transition of the covered states (n, n): states below m coupled by driving (m, m), of others the share keep (n,)."""
    n, m = index.shape[0], driving.shape[0]
    out = np.zeros((n, n))
    for i in range(n):
        out[i, i] = keep[i]
        if index[i] < m:
            for j in range(n):
                if index[j] < m:
                    out[i, j] = driving[index[i], index[j]]
    return out
