"""Lines of an unknown runway in a whole image: edge points, the horizon, and two borders with a common vanishing point.

All exhaustive and deterministic: no draws, so nothing to seed.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array

SMOOTH = 2.0  # [px] sigma of the derivative filter
_BINS = 4000  # directions about the vanishing point, at most
_BIN = 1.5  # [px] their width at the points' mean distance


def edge_points(image: np.ndarray, noise: float, snr: float) -> Array:
    """(n, 4) u, v [px], gradient gu, gv [grey levels/px] at its ridge: where it exceeds snr times its noise.

    Derivatives of a Gaussian, suppressed to local maxima across the edge, sub-pixel by a parabola.
    """
    import cv2

    radius = int(3.0 * SMOOTH)
    k = np.arange(-radius, radius + 1, dtype=float)
    g = np.exp(-0.5 * (k / SMOOTH) ** 2)
    g /= g.sum()
    d = k * g / (k * k * g).sum()
    gu = cv2.sepFilter2D(image, cv2.CV_32F, d, g)
    gv = cv2.sepFilter2D(image, cv2.CV_32F, g, d)
    # one grey level of rounding at least: a noise-free image has edges too
    sigma = math.sqrt(noise * noise + 1.0 / 12.0) * math.sqrt((g * g).sum() * (d * d).sum())
    return _ridges(gu, gv, max(snr * sigma, 0.3), radius)  # type: ignore[no-any-return]


@kernel
def _ridges(gu: np.ndarray, gv: np.ndarray, least: float, border: int) -> Array:
    h, w = gu.shape
    out, n = np.empty((h * w // 4, 4)), 0
    for v in range(border, h - border):
        for u in range(border, w - border):
            a, b = float(gu[v, u]), float(gv[v, u])
            m = math.sqrt(a * a + b * b)
            if m < least:
                continue
            du, dv = (1, 0) if abs(a) >= abs(b) else (0, 1)
            m0 = math.sqrt(gu[v - dv, u - du] ** 2 + gv[v - dv, u - du] ** 2)
            m1 = math.sqrt(gu[v + dv, u + du] ** 2 + gv[v + dv, u + du] ** 2)
            if m > m0 and m >= m1 and n < len(out):
                s = 0.5 * (m1 - m0) / (2.0 * m - m0 - m1)
                out[n, 0], out[n, 1], out[n, 2], out[n, 3] = u + s * du, v + s * dv, a, b
                n += 1
    return out[:n].copy()


@kernel
def _bits(x: np.uint64) -> int:
    n = 0
    while x != np.uint64(0):
        x &= x - np.uint64(1)
        n += 1
    return n


@kernel
def horizon_line(points: Array, width: int, height: int, max_roll: float, share: float) -> tuple[bool, float, float]:
    """found, a, b of the horizon v = a + b u: of the edges with the bright side up, the one that spans most columns.

    Votes are counted once per column group, so that length counts and not density. Of all lines that span at least 0.8 of
    the best one the uppermost is taken; it must span `share` of the image. Refined by least squares with inliers within
    2 px. |roll| <= max_roll [rad].
    """
    n_roll, step = 2 * int(max_roll / 0.004) + 1, 1.5
    n_bins = int((height + 2.0 * width * math.tan(max_roll)) / step) + 2
    low = -width * math.tan(max_roll)
    a = b = 0.0
    votes, slopes = np.zeros((n_roll, n_bins), dtype=np.uint64), np.empty(n_roll)
    for r in range(n_roll):
        slopes[r] = math.tan((r - n_roll // 2) * 0.004)
    for i in range(len(points)):
        u, v, gu, gv = points[i]
        if gv >= 0.0:
            continue
        column = np.uint64(1) << np.uint64(int(64.0 * u / width))
        centre = -gu / gv  # slope of the edge there: only rolls near it are voted for
        for r in range(n_roll):
            slope = slopes[r]
            if abs(slope - centre) < 0.25:
                votes[r, int((v - slope * u - low) / step)] |= column
    best_span, limit = 0, np.inf
    while True:  # the longest line, then any nearly as long one clearly above it
        longest, best_v = 0, 0.0
        for r in range(n_roll):
            slope = slopes[r]
            for k in range(n_bins - 1):
                v = low + (k + 1.0) * step + slope * 0.5 * width
                if v < limit - 12.0:
                    span = _bits(votes[r, k] | votes[r, k + 1])
                    if span > longest and span >= 0.8 * best_span:
                        longest, best_v, b = span, v, slope
        if longest == 0:
            break
        best_span, limit = max(best_span, longest), best_v
        a = best_v - b * 0.5 * width
    if best_span < share * 64.0:
        return False, 0.0, 0.0
    for _ in range(4):
        s0 = su = sv = suu = suv = 0.0
        for i in range(len(points)):
            u, v, gu, gv = points[i]
            if gv < 0.0 and abs(v - a - b * u) < 4.0:
                u -= 0.5 * width
                s0, su, sv, suu, suv = s0 + 1.0, su + u, sv + v, suu + u * u, suv + u * v
        det = s0 * suu - su * su
        if det <= 0.0:
            return False, 0.0, 0.0
        b = (s0 * suv - su * sv) / det
        a = (sv - b * su) / s0 - b * 0.5 * width
    return True, a, b


@kernel
def borders(
    points: Array,
    R_LC: Array,
    lens: Array,
    slope: float,
    polarity: float,
    headings: Array,
    limits: Array,
    tried: Array,
) -> tuple[float, float, float, float]:
    """score, heading [rad], K_left, K_right of the pair of lines that looks most like a runway's borders.

    In the levelled frame L (x along the optical axis, horizontal; z down) the runway runs at an unknown heading. A straight
    line along it, b to the right and h below the camera (normal to its surface), is the set of rays with b / h = K. For
    each heading tried the edge points are sorted by the direction K in which they lie from the vanishing point, in bins as
    wide as an edge is at their mean distance from it, and by whether brightness rises with K; the left border is
    a rising one (polarity +1), the right border a falling one. Score: the geometric mean of the numbers of points of both.

    limits (4,): K_right - K_left at least and at most; |K| at most; standard deviation over mean of the depth of a border's
    points below the horizon at least, which lines across the runway do not reach. Pairs like one of the rows heading,
    K_left, K_right of `tried` are passed over.
    """
    n = len(points)
    sums = np.zeros((2, 3, _BINS + 2))  # by polarity and bin: number of points, sum of depths and of their squares
    best, heading, left, right = 0.0, 0.0, 0.0, 0.0
    cs, ss = math.cos(slope), math.sin(slope)
    where, depth, far = np.empty(n), np.empty(n), np.empty(n)
    ray_u, ray_v, g_u, g_v, steep = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        ray_u[i], ray_v[i] = (points[i, 0] - lens[1]) / lens[0], (points[i, 1] - lens[2]) / lens[0]
        g_u[i], g_v[i] = points[i, 2], points[i, 3]
        steep[i] = g_u[i] ** 2 + g_v[i] ** 2
    y, w = np.empty(3), np.empty(3)
    for t in range(len(headings)):
        ca, sa = math.cos(headings[t]), math.sin(headings[t])
        for c in range(3):  # offset to the right and depth below the camera, both linear in (u, v, 1)
            x_c = ca * R_LC[0, c] + sa * R_LC[1, c]
            y[c] = -sa * R_LC[0, c] + ca * R_LC[1, c]
            w[c] = ss * x_c + cs * R_LC[2, c]
        for i in range(n):  # without a branch, so that several points are taken at a time
            a, b = ray_u[i], ray_v[i]
            p, q = y[0] * a + y[1] * b + y[2], w[0] * a + w[1] * b + w[2]
            du, dv = y[0] * q - p * w[0], y[1] * q - p * w[1]  # gradient of K, up to scale
            along = du * g_u[i] + dv * g_v[i]
            runs_along = along * along >= 0.85 * (du * du + dv * dv) * steep[i]
            # p / (|p| + q) grows with K from -1 to 1; falling edges are set off by 3
            at = p / (abs(p) + q) + (1.0 if along * polarity > 0.0 else 4.0)
            where[i] = at if (q > 1e-3) & runs_along else math.nan  # at the horizon and above there is no ground
            depth[i], far[i] = q, math.sqrt(p * p + q * q)
        total, m = 0.0, 0
        for i in range(n):
            if where[i] == where[i]:
                total += far[i]
                m += 1
        if m == 0:
            continue
        bins = min(_BINS, max(90, int(2.0 * lens[0] * total / m / _BIN)))
        sums[:, :, : bins + 2] = 0.0
        for i in range(n):
            if where[i] == where[i]:
                falls = 1 if where[i] >= 3.0 else 0
                k = int(0.5 * (where[i] - 3.0 * falls) * bins) + 1
                sums[falls, 0, k] += 1.0
                sums[falls, 1, k] += depth[i]
                sums[falls, 2, k] += depth[i] * depth[i]
        most = 0.0  # that any right border may have
        for j in range(2, bins + 1):
            most = max(most, sums[1, 0, j - 1] + sums[1, 0, j] + sums[1, 0, j + 1])
        for i in range(1, bins + 1):
            L = _votes(sums[0], i, limits[3])
            if L * most <= best * best or abs(_tangent(i, bins)) > limits[2]:
                continue
            for j in range(i + 1, bins + 1):
                if L * (sums[1, 0, j - 1] + sums[1, 0, j] + sums[1, 0, j + 1]) <= best * best:
                    continue
                score = math.sqrt(L * _votes(sums[1], j, limits[3]))
                if score > best and abs(_tangent(j, bins)) <= limits[2]:
                    k_l, k_r = _tangent(i, bins), _tangent(j, bins)
                    if limits[0] <= k_r - k_l <= limits[1] and not _like(headings[t], k_l, k_r, tried):
                        best, heading, left, right = score, headings[t], k_l, k_r
    return best, heading, left, right


@kernel
def _votes(sums: Array, i: int, ratio: float) -> float:
    """Points of bin i and half of those beside it; 0 if they do not reach from near to far."""
    n = 0.5 * sums[0, i - 1] + sums[0, i] + 0.5 * sums[0, i + 1]
    if n == 0.0:
        return 0.0
    mean = (0.5 * sums[1, i - 1] + sums[1, i] + 0.5 * sums[1, i + 1]) / n
    square = (0.5 * sums[2, i - 1] + sums[2, i] + 0.5 * sums[2, i + 1]) / n
    return n if square - mean * mean >= (ratio * mean) ** 2 else 0.0


@kernel
def _like(heading: float, k_l: float, k_r: float, tried: Array) -> bool:
    left, right = math.atan(k_l), math.atan(k_r)
    for i in range(len(tried)):
        l, r = math.atan(tried[i, 1]), math.atan(tried[i, 2])
        near = 0.12 * (r - l) + 0.02
        if abs(heading - tried[i, 0]) < 0.15 and abs(left - l) < near and abs(right - r) < near:
            return True
    return False


@kernel
def _tangent(i: int, bins: int) -> float:
    """K in the middle of bin i (from 1)."""
    s = 2.0 * (i - 0.5) / bins - 1.0
    return s / (1.0 - abs(s))


@kernel
def depth_profile(
    image: np.ndarray, R_CD: Array, lens: Array, height: float, offsets: Array, nearest: float, count: int
) -> Array:
    """(count,) grey levels along the runway, averaged over parallel lines, at equal steps in the image.

    R_CD: from the runway's directions (along, right, down normal to it) to C; height [m] above its surface; offsets [m] of
    the lines to the right of the camera. Entry i lies at the distance 1 / (nearest - i / (height f)) ahead, nearest in 1/m;
    NaN where no line is in the image.
    """
    out = np.full(count, np.nan)
    h, w = image.shape
    for i in range(count):
        rho = nearest - i / (height * lens[0])
        if rho <= 0.0:
            break
        total, seen = 0.0, 0
        for k in range(len(offsets)):
            # the ray to (1 / rho, offset, height), scaled by rho
            x = R_CD[0, 0] + rho * (R_CD[0, 1] * offsets[k] + R_CD[0, 2] * height)
            y = R_CD[1, 0] + rho * (R_CD[1, 1] * offsets[k] + R_CD[1, 2] * height)
            z = R_CD[2, 0] + rho * (R_CD[2, 1] * offsets[k] + R_CD[2, 2] * height)
            if z <= 0.0:
                continue
            u, v = lens[1] + lens[0] * x / z, lens[2] + lens[0] * y / z
            if 0.0 <= u < w - 1.0 and 0.0 <= v < h - 1.0:
                iu, iv = int(u), int(v)
                a, b = u - iu, v - iv
                top = image[iv, iu] + a * (float(image[iv, iu + 1]) - float(image[iv, iu]))
                bottom = image[iv + 1, iu] + a * (float(image[iv + 1, iu + 1]) - float(image[iv + 1, iu]))
                total += top + b * (bottom - top)
                seen += 1
        if seen > 0:
            out[i] = total / seen
    return out
