"""Elongated ternary masks: where, along its search path, an edge crosses a window, to a few hundredths of a pixel.

A mask is `length` pixels long, laid along the predicted edge, with the profile - - - 0 + + + across it, or - 0 + where
something else is near: an arm of 3 or of 1 pixel. Sliding it along the search path is the same as first averaging the rows
of pixels along the edge and then correlating the averaged profile P with the ternary one:

    R(k) = P(k+1) + P(k+2) + P(k+3) - P(k-1) - P(k-2) - P(k-3)

The mask is sheared to the predicted slope at sub-pixel accuracy (linear interpolation): shearing by whole pixels costs
0.2 px. The peak of R is refined by a parabola through three points.

Source     Dickmanns & Schell 1992, section 3 and fig. 3 (elongated ternary masks). Departs: sub-pixel shear, the
           parabola's own bias removed, and a variance told with each measurement.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array
from landing_sim.vision.layout import (
    ALONG,
    ARM,
    CORNER,
    FEATURE,
    HALF,
    NORMAL_STEP,
    OFFSET,
    ORIGIN,
    SEARCH,
    STATUS,
    STEP,
)

_FIRST = 0.4  # of the best contrast in the window: what the first edge on the way in must have
REACH = 4  # steps beyond the search range that the mask and the parabola look at

_FOUND, _NO_CONTRAST, _AMBIGUOUS = 0, 2, 3  # values of signals.Status


@kernel
def _phi(s: float) -> float:
    return 0.5 * math.erfc(-s * 0.7071067811865476)


@kernel
def _response(delta: float, blur: float, arm: int) -> float:
    """R(0) for an ideal edge of unit contrast and Gaussian `blur` at `delta`."""
    r = 0.0
    for k in range(1, arm + 1):
        r += _phi((k - delta) / blur) - _phi((-k - delta) / blur)
    return r


@kernel
def _parabola(delta: float, blur: float, arm: int) -> tuple[float, float]:
    """What the three-point parabola makes of an ideal edge of unit contrast and Gaussian `blur` at `delta`, and its
    curvature D = 2 R(0) - R(1) - R(-1)."""
    N, D = -2.0 * _phi(-delta / blur), 0.0
    for i in range(3):
        k = 1 if i == 0 else arm if i == 1 else arm + 1
        up, down = _phi((k - delta) / blur), _phi((-k - delta) / blur)
        N += (-1.0 if i == 0 else 1.0) * (up + down)
        D += (1.0 if i < 2 else -1.0) * (up - down)
    return 0.5 * N / D, D


@kernel
def pulled(begin: float, end: float, brighter: float, blur: float) -> float:
    """By how much [steps] an arm of 1 measures an edge of unit contrast too far up: beyond it, the scene is by as much as
    `brighter` brighter between begin and end [steps].

    Source     own: the mask's response to all three blurred edges, read as `measure` reads it.
    """
    P = np.empty(2 * REACH + 1)
    for k in range(2 * REACH + 1):
        s = float(k - REACH)
        P[k] = _phi(s / blur) + brighter * (_phi((s - begin) / blur) - _phi((s - end) / blur))
    best = 2
    for k in range(2, 2 * REACH - 1):
        if P[k + 1] - P[k - 1] > P[best + 1] - P[best - 1]:
            best = k
    N = P[best + 2] - 2.0 * P[best] + P[best - 2]
    raw = 0.5 * N / (2.0 * (P[best + 1] - P[best - 1]) - P[best + 2] + P[best - 2])
    arm: int = np.int64(1)  # type: ignore[assignment]  # numba compiles a constant for itself
    return best - REACH + _edge_at(raw, blur, arm)[0]


@kernel
def _edge_at(raw: float, blur: float, arm: int) -> tuple[float, float]:
    """Where an ideal edge is of which the parabola makes `raw`, and the parabola's gain there."""
    d, gain = raw, 1.0
    for _ in range(2):
        gain = (_parabola(d + 0.05, blur, arm)[0] - _parabola(d - 0.05, blur, arm)[0]) / 0.1
        d = min(0.6, max(-0.6, d + (raw - _parabola(d, blur, arm)[0]) / gain))
    return d, gain


@uncounted
def profile(
    image: np.ndarray, u: float, v: float, du: float, dv: float, au: float, av: float, half: int, reach: int, P: Array
) -> tuple[float, float]:
    """Fill P[0 : 2 reach + 1] with grey levels averaged along the edge; P[reach] is at (u, v), in pixels of `image`.

    (du, dv) is one step across the edge, (au, av) one along it; 2 half + 1 pixels are averaged.
    Returns the mean of a (1 - a) over the interpolations made across and along the edge: what they add to the blur
    (across) and take from the noise (both).
    """
    n = 2 * half + 1
    across, along = 0.0, 0.0
    for k in range(2 * reach + 1):
        P[k] = 0.0
    step_along_v = abs(dv) >= abs(du)
    for j in range(-half, half + 1):
        u0, v0 = u + j * au - reach * du, v + j * av - reach * dv
        for k in range(2 * reach + 1):
            x, y = u0 + k * du, v0 + k * dv
            iu, iv = math.floor(x), math.floor(y)
            a, b = x - iu, y - iv
            top, bottom = float(image[iv, iu]), float(image[iv + 1, iu])
            if a > 0.0:
                top += a * (float(image[iv, iu + 1]) - top)
                bottom += a * (float(image[iv + 1, iu + 1]) - bottom)
            P[k] += top + b * (bottom - top)
        a, b = u0 - math.floor(u0), v0 - math.floor(v0)
        if step_along_v:
            across += b * (1.0 - b)
            along += a * (1.0 - a)
        else:
            across += a * (1.0 - a)
            along += b * (1.0 - b)
    for k in range(2 * reach + 1):
        P[k] /= n
    return across / n, along / n


@kernel
def measure(
    images: np.ndarray, look: np.ndarray, F: Array, I: np.ndarray, polarity: Array, rule: Array
) -> tuple[Array, Array, Array, np.ndarray]:
    """Displacement of the edge in every window of one image.

    Parameters
    ----------
    images : (m, h, w) uint8: pixels of the windows look (m,), rows of F and I (see `layout`)
    polarity : (4,) by Feature: +1 if brightness rises along the step, else -1
    rule : blur [px] sigma of the optics; noise [grey levels] sigma of a pixel; min_contrast [grey levels]; min_snr,
        contrast over its own standard deviation; ambiguity: an edge is doubtful if another one in the window has more than
        this share of its contrast; floor [px] standard deviation added for what the model of an edge leaves out

    Returns
    -------
    z (n,) [px] along the direction from the centre; variance (n,) [px^2]; contrast (n,) [grey levels]; status (n,) int64.
    All n rows; z and variance are NaN where not found. With an arm of 1 the first edge on the way into the runway counts
    and not the best one, and nothing is ambiguous: what is painted lies behind it.

    The parabola's own bias, up to 0.02 px, is taken out with the response of an ideal edge. The variance follows from
    it too: with a numerator N = R(1) - R(-1) and a curvature D, var = (var N / 4 + z^2 var D) / D^2, and white pixel noise
    gives var N = 10 - 8 b, var D = 6 - 16 b times the variance of P (arm 1: 6 - 12 b and 10 - 28 b), where b is the mean
    a (1 - a) of the interpolation across the edge.
    """
    n = len(I)
    z, variance, contrast = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n)
    status = I[:, STATUS].copy()
    blur, noise, min_contrast, min_snr, ambiguity, floor = rule[0], rule[1], rule[2], rule[3], rule[4], rule[5]
    longest = 2 * (I[:, SEARCH].max() + REACH) + 1 if n else 1
    P, R = np.empty(longest), np.empty(longest)
    for m in range(len(look)):
        i = look[m]
        half, search, arm = I[i, HALF], I[i, SEARCH], I[i, ARM]
        su, sv, advance = F[i, STEP], F[i, STEP + 1], F[i, NORMAL_STEP]
        reach = search + REACH
        across, along = profile(
            images[m], F[i, ORIGIN] - I[i, CORNER], F[i, ORIGIN + 1] - I[i, CORNER + 1], su, sv,
            F[i, ALONG], F[i, ALONG + 1], half, reach, P,
        )  # fmt: skip
        for k in range(arm, 2 * reach + 1 - arm):
            r = P[k + 1] - P[k - 1]
            if arm == 3:
                r = P[k + 1] + P[k + 2] + P[k + 3] - P[k - 1] - P[k - 2] - P[k - 3]
            R[k] = polarity[I[i, FEATURE]] * r
        best, second = -1, 0.0
        for k in range(reach - search, reach + search + 1):
            if R[k] > R[k - 1] and R[k] >= R[k + 1] and (best < 0 or R[k] > R[best]):
                best = k
        if best < 0:
            status[i] = _NO_CONTRAST
            continue
        for k in range(reach - search, reach + search + 1):
            if R[k] > R[k - 1] and R[k] >= R[k + 1]:
                if arm == 1 and k < best and R[k] > _FIRST * R[best]:
                    best = k
                elif arm == 3 and abs(k - best) > 3:
                    second = max(second, R[k])
        length = 2 * half + 1
        # neighbours along the edge share pixels where the path is sheared: their sum is nearly that of whole pixels
        var_P = (noise * noise + 1.0 / 12.0) / length * (1.0 - 2.0 * along / length)
        contrast[i] = R[best] / arm  # a lower bound until the blur is known
        if contrast[i] < max(min_contrast, min_snr * math.sqrt(2.0 * arm * var_P) / arm):
            status[i] = _NO_CONTRAST
            continue
        if second > ambiguity * R[best] and second > min_snr * math.sqrt(2.0 * arm * var_P):
            status[i] = _AMBIGUOUS
            continue
        b = blur / advance
        b = math.sqrt(b * b + across)
        raw = 0.5 * (R[best + 1] - R[best - 1]) / (2.0 * R[best] - R[best + 1] - R[best - 1])
        d, gain = _edge_at(raw, b, arm)
        size = math.hypot(su, sv)
        z[i] = (best - reach + d) * size + F[i, OFFSET]
        contrast[i] = R[best] / _response(d, b, arm)
        D = contrast[i] * _parabola(d, b, arm)[1] * gain
        var_N, var_D = 10.0 - 8.0 * across, 6.0 - 16.0 * across
        if arm == 1:
            var_N, var_D = 6.0 - 12.0 * across, 10.0 - 28.0 * across
        var = var_P * (var_N / 4.0 + raw * raw * var_D) / (D * D)
        variance[i] = (var + floor * floor / (advance * advance)) * size * size
        status[i] = _FOUND
    return z, variance, contrast, status
