"""Straight lines through edge points and where they cross, compiled: the arithmetic of `lines`, which explains it.

A line is a row of nine floats: unit normal, centre [px], covariance of displacement and direction (three of them), windows
used and windows dropped. No windows used: no line.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import HORIZON, THRESHOLD, Vector
from landing_sim.geometry.vanishing import down_of, raised_point
from landing_sim.jit import kernel
from landing_sim.types import Array

NORMAL, CENTRE, COV, USED, DROPPED, COLUMNS = 0, 2, 4, 7, 8, 9  # COV takes three

_ITERATIONS = 4
_LEAST_SLANT = 0.05  # n . s of windows that search along the line itself: they say nothing of where it is
_FOUND = 0  # of signals.Status
NO_PRIOR = np.zeros(4)


@kernel
def _fit(
    p: Array, s: Array, var: Array, keep: np.ndarray, prior: Array, least: float
) -> tuple[bool, Array, Array, Array, float]:
    """ok, n (2,), centre (2,), cov (2, 2), squared normalised residuals; prior (4,): normal, sigma, whether given."""
    n, c, cov = np.zeros(2), np.zeros(2), np.zeros((2, 2))
    w = s_u = s_v = 0.0
    for i in range(len(p)):
        if keep[i]:
            w += 1.0 / var[i]
            c += p[i] / var[i]
            s_u += s[i, 0]
            s_v += s[i, 1]
    if w == 0.0:
        return False, n, c, cov, 0.0
    c /= w
    if prior[3] > 0.0:
        n[:] = prior[:2]
    else:
        uu = uv = vv = 0.0
        for i in range(len(p)):
            if keep[i]:
                du, dv = p[i, 0] - c[0], p[i, 1] - c[1]
                uu, uv, vv = uu + du * du / var[i], uv + du * dv / var[i], vv + dv * dv / var[i]
        along = 0.5 * math.atan2(2.0 * uv, uu - vv)
        n[0], n[1] = -math.sin(along), math.cos(along)
    if n[0] * s_u + n[1] * s_v < 0.0:
        n *= -1.0
    chi2 = 0.0
    for turn in range(_ITERATIONS + 1):
        ee = ea = aa = be = ba = chi2 = 0.0
        lo, hi = math.inf, -math.inf
        t_u, t_v = -n[1], n[0]
        for i in range(len(p)):
            slant = n[0] * s[i, 0] + n[1] * s[i, 1]
            if not keep[i] or abs(slant) < _LEAST_SLANT:
                continue
            du, dv = p[i, 0] - c[0], p[i, 1] - c[1]
            across, along = n[0] * du + n[1] * dv, t_u * du + t_v * dv
            lo, hi = min(lo, along), max(hi, along)
            q = 1.0 / (slant * slant * var[i])
            ee, ea, aa = ee + q, ea - q * along, aa + q * along * along
            be, ba = be + q * across, ba - q * across * along
            chi2 += q * across * across
        if prior[3] > 0.0:
            turned = (prior[0] * t_u + prior[1] * t_v) * (1.0 if prior[0] * n[0] + prior[1] * n[1] >= 0.0 else -1.0)
            q = 1.0 / (prior[2] * prior[2])
            aa, ba, chi2 = aa + q, ba + q * turned, chi2 + q * turned * turned
        elif not hi - lo >= least:
            return False, n, c, cov, 0.0
        det = ee * aa - ea * ea
        if not det > 0.0:
            return False, n, c, cov, 0.0
        if turn == _ITERATIONS:
            cov[0, 0], cov[1, 1] = aa / det, ee / det
            cov[0, 1] = cov[1, 0] = -ea / det
            break
        e, a = (aa * be - ea * ba) / det, (ee * ba - ea * be) / det
        c += e * n
        ca, sa = math.cos(a), math.sin(a)
        n[0], n[1] = ca * n[0] - sa * n[1], sa * n[0] + ca * n[1]
    return True, n, c, cov, chi2


@kernel
def _robust(
    p: Array, s: Array, var: Array, prior: Array, least: float, limit: float
) -> tuple[bool, Array, Array, Array, int]:
    """The line, with the one window left out that contradicts all others; index of it or -1."""
    m = len(p)
    keep = np.ones(m, dtype=np.bool_)
    ok, n, c, cov, chi2 = _fit(p, s, var, keep, prior, least)
    free = m - 2 + (1 if prior[3] > 0.0 else 0)
    if not ok or free < 1 or chi2 <= limit * limit:
        return ok, n, c, cov, -1
    worst = -1
    if free >= 2:
        best = math.inf
        for i in range(m):
            keep[i] = False
            fits, n_i, c_i, cov_i, chi2_i = _fit(p, s, var, keep, prior, least)
            keep[i] = True
            if fits and chi2_i < best:
                best, worst = chi2_i, i
                n, c, cov = n_i, c_i, cov_i
        chi2, free = best, free - 1
        if worst < 0:
            return False, n, c, cov, -1
    if chi2 > limit * limit:  # more than one, or too few to tell which
        cov = cov * (chi2 / free)
    return True, n, c, cov, worst


@kernel
def fit_row(p: Array, s: Array, var: Array, prior: Array, least: float, limit: float, row: Array) -> None:
    """Fill `row` with the line through points p (m, 2), variances var (m,) along directions s (m, 2): see `fit_line`."""
    for k in range(COLUMNS):
        row[k] = 0.0
    if len(p) < (1 if prior[3] > 0.0 else 2):
        return
    ok, n, c, cov, out = _robust(p, s, var, prior, least, limit)
    if ok:
        row[NORMAL], row[NORMAL + 1], row[CENTRE], row[CENTRE + 1] = n[0], n[1], c[0], c[1]
        row[COV], row[COV + 1], row[COV + 2] = cov[0, 0], cov[0, 1], cov[1, 1]
        row[DROPPED] = 1.0 if out >= 0 else 0.0
        row[USED] = len(p) - row[DROPPED]


@kernel
def fit_rows(
    z: Array, R: Array, feature: np.ndarray, status: np.ndarray, centre: Array, direction: Array, lens: Array, dip: float,
    prior: Array, least: float, limit: float,
) -> Array:  # fmt: skip
    """(4, 9) the line of each Feature; lens (3,) f, cx, cy; prior (4,) of the threshold; see `runway_lines`."""
    rows = np.empty((4, COLUMNS))
    p, s, var = np.empty((len(z), 2)), np.empty((len(z), 2)), np.empty(len(z))
    nothing = np.zeros(4)
    for kind in range(4):
        m = 0
        for i in range(len(z)):
            if status[i] == _FOUND and feature[i] == kind:
                for k in range(2):
                    p[m, k] = centre[i, k] + z[i] * direction[i, k]
                    s[m, k] = direction[i, k]
                var[m] = R[i]
                m += 1
        fit_row(p[:m], s[:m], var[:m], prior if kind == THRESHOLD else nothing, least, limit, rows[kind])
        if kind == HORIZON and dip != 0.0 and rows[kind, USED] > 0.0:
            raised, down = np.empty((m, 2)), _down(rows[kind], lens)
            for _ in range(3):
                for i in range(m):
                    raised[i, 0], raised[i, 1] = raised_point(p[i, 0], p[i, 1], down, dip, lens[0], lens[1], lens[2])
                fit_row(raised, s[:m], var[:m], nothing, least, limit, rows[kind])
                if rows[kind, USED] == 0.0:
                    break
                down = _down(rows[kind], lens)
    return rows


@kernel
def _down(row: Array, lens: Array) -> Vector:
    a, b = row[NORMAL], row[NORMAL + 1]
    return down_of(a, b, -(a * row[CENTRE] + b * row[CENTRE + 1]), lens[0], lens[1], lens[2])


@kernel
def cross_rows(rows: Array, pairs: np.ndarray) -> tuple[bool, Array, Array]:
    """Whether all pairs (k, 2) of the lines cross, where (k, 2), and their covariance (2 k, 2 k); see `crossings`."""
    n_lines, n = len(rows), len(pairs)
    uv, J = np.zeros((n, 2)), np.zeros((2 * n, 2 * n_lines))
    for k in range(n):
        a, b = rows[pairs[k, 0]], rows[pairs[k, 1]]
        h_a = -(a[0] * a[CENTRE] + a[1] * a[CENTRE + 1])
        h_b = -(b[0] * b[CENTRE] + b[1] * b[CENTRE + 1])
        det = a[0] * b[1] - a[1] * b[0]
        if abs(det) < 1e-9:
            return False, uv, J
        u, v = (a[1] * h_b - h_a * b[1]) / det, (h_a * b[0] - a[0] * h_b) / det
        uv[k, 0], uv[k, 1] = u, v
        # n_a . dp = da, n_b . dp = db, where da is by how much line a moves along its normal at the point
        for turn in range(2):
            at, line = pairs[k, turn], rows[pairs[k, turn]]
            moves = (u - line[CENTRE]) * line[NORMAL + 1] - (v - line[CENTRE + 1]) * line[NORMAL]
            by_u, by_v = (b[1] / det, -b[0] / det) if turn == 0 else (-a[1] / det, a[0] / det)
            J[2 * k, 2 * at] += by_u
            J[2 * k, 2 * at + 1] += by_u * moves
            J[2 * k + 1, 2 * at] += by_v
            J[2 * k + 1, 2 * at + 1] += by_v * moves
    cov = np.zeros((2 * n, 2 * n))
    for i in range(2 * n):
        for j in range(2 * n):
            for l in range(n_lines):
                c = rows[l]
                cov[i, j] += (
                    J[i, 2 * l] * (c[COV] * J[j, 2 * l] + c[COV + 1] * J[j, 2 * l + 1])
                    + J[i, 2 * l + 1] * (c[COV + 1] * J[j, 2 * l] + c[COV + 2] * J[j, 2 * l + 1])
                )  # fmt: skip
    return True, uv, cov
