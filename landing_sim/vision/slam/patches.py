"""Image patches warped through the plane they lie on, and aligned to a fraction of a pixel.

A map point keeps the pixels around it in the keyframe that first saw it. How that patch looks from another pose is computed
by sending its pixels through the horizontal plane at the point; what is left is a shift of a few pixels, found by inverse
compositional alignment, with a constant difference in brightness. As the same pixels are used for ever, nothing drifts.

Pixel u of pyramid level k lies at u 2^k of level 0 (cv2.pyrDown keeps even pixels).

Source     Klein & Murray 2007, section 5.3 (patch search: warp, coarse to fine); Baker & Matthews 2004, section 3.2
           (inverse compositional alignment).
           Departs: the warp goes through the horizontal plane exactly on the fisheye, not by an affine map; every pixel of
           the patch follows it (through nine exact points and a biquadratic between them).
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.vision.slam.lens import ray, seen

MAX_STEPS = 12
CONVERGED = 0.01  # [px] of the level looked at


@kernel
def through_plane(
    u: float, v: float, R_s: Array, p_s: Array, R_c: Array, p_c: Array, z: float, f: float, cx: float, cy: float
) -> tuple[float, float, bool]:
    """Pixel in camera c of what camera s sees at u, v on the horizontal plane at z [m] in R; False if the plane is not in
    front of either."""
    x, y, w = ray(u, v, f, cx, cy)
    dz = R_s[0, 2] * x + R_s[1, 2] * y + R_s[2, 2] * w
    if not dz > 0.02:
        return 0.0, 0.0, False
    k = (z - p_s[2]) / dz
    ax = p_s[0] + k * (R_s[0, 0] * x + R_s[1, 0] * y + R_s[2, 0] * w) - p_c[0]
    ay = p_s[1] + k * (R_s[0, 1] * x + R_s[1, 1] * y + R_s[2, 1] * w) - p_c[1]
    az = z - p_c[2]
    if not (k > 0.0 and az > 0.02):
        return 0.0, 0.0, False
    u, v = seen(
        R_c[0, 0] * ax + R_c[0, 1] * ay + R_c[0, 2] * az,
        R_c[1, 0] * ax + R_c[1, 1] * ay + R_c[1, 2] * az,
        R_c[2, 0] * ax + R_c[2, 1] * ay + R_c[2, 2] * az,
        f, cx, cy,
    )  # fmt: skip
    return u, v, True


@kernel
def template(image: np.ndarray, u: float, v: float, half: int, T: Array, gu: Array, gv: Array) -> bool:
    """Grey levels T and their slopes gu, gv, each ((2 half + 1)^2,), around u, v [px]; False at the border."""
    h, w = image.shape
    iu, iv = math.floor(u), math.floor(v)
    if iu < half + 1 or iv < half + 1 or iu + half + 2 >= w or iv + half + 2 >= h:
        return False
    a, b = u - iu, v - iv
    w00, w01, w10, w11 = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
    side = 2 * half + 3
    S = np.empty((side, side))
    for i in range(side):
        for j in range(side):
            y, x = iv + i - half - 1, iu + j - half - 1
            S[i, j] = w00 * image[y, x] + w01 * image[y, x + 1] + w10 * image[y + 1, x] + w11 * image[y + 1, x + 1]
    n = 0
    for i in range(1, side - 1):
        for j in range(1, side - 1):
            T[n] = S[i, j]
            gu[n] = 0.5 * (S[i, j + 1] - S[i, j - 1])
            gv[n] = 0.5 * (S[i + 1, j] - S[i - 1, j])
            n += 1
    return True


@kernel
def warped_offsets(
    u: float, v: float, step: float, half: int, R_s: Array, p_s: Array, R_c: Array, p_c: Array, z: float,
    f: float, cx: float, cy: float, ou: Array, ov: Array,
) -> bool:  # fmt: skip
    """Where the pixels of a patch around u, v, `step` apart in camera s, fall in camera c, from where its centre does [px].

    ou, ov ((2 half + 1)^2,). False if the plane at z is not seen.
    """
    U, V = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b, ok = through_plane(
                u + (j - 1) * half * step, v + (i - 1) * half * step, R_s, p_s, R_c, p_c, z, f, cx, cy
            )
            if not ok:
                return False
            U[i, j], V[i, j] = a, b
    u0, v0 = U[1, 1], V[1, 1]
    n = 0
    for i in range(2 * half + 1):
        y = (i - half) / half
        l0, l1, l2 = 0.5 * y * (y - 1.0), 1.0 - y * y, 0.5 * y * (y + 1.0)
        a0 = l0 * U[0, 0] + l1 * U[1, 0] + l2 * U[2, 0]
        a1 = l0 * U[0, 1] + l1 * U[1, 1] + l2 * U[2, 1]
        a2 = l0 * U[0, 2] + l1 * U[1, 2] + l2 * U[2, 2]
        b0 = l0 * V[0, 0] + l1 * V[1, 0] + l2 * V[2, 0]
        b1 = l0 * V[0, 1] + l1 * V[1, 1] + l2 * V[2, 1]
        b2 = l0 * V[0, 2] + l1 * V[1, 2] + l2 * V[2, 2]
        for j in range(2 * half + 1):
            x = (j - half) / half
            m0, m1, m2 = 0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)
            ou[n] = m0 * a0 + m1 * a1 + m2 * a2 - u0
            ov[n] = m0 * b0 + m1 * b1 + m2 * b2 - v0
            n += 1
    return True


@kernel
def shift_of(
    image: np.ndarray, u: float, v: float, scale: float, half: int, T: Array, gu: Array, gv: Array, ou: Array, ov: Array,
    reach: float,
) -> tuple[float, float, float]:  # fmt: skip
    """du, dv [px of this image] from the guess u, v to where the patch lies, and the correlation there (-1: not found).

    ou, ov: where the patch's pixels fall, from its centre [px of level 0]; scale: px of level 0 in one of this image.
    """
    h, w = image.shape
    n = T.shape[0]
    side = 2 * half + 1
    # the patch's scale and shear in this image: d image / d template
    e, q = n // 2 + half, n // 2 + half * side
    axx = (ou[e] - ou[n // 2 - half]) / (2.0 * half * scale)
    ayx = (ov[e] - ov[n // 2 - half]) / (2.0 * half * scale)
    axy = (ou[q] - ou[n // 2 - half * side]) / (2.0 * half * scale)
    ayy = (ov[q] - ov[n // 2 - half * side]) / (2.0 * half * scale)
    mu, mv, mT = 0.0, 0.0, 0.0
    for k in range(n):
        mu += gu[k]
        mv += gv[k]
        mT += T[k]
    mu /= n
    mv /= n
    mT /= n
    huu, huv, hvv, tt = 0.0, 0.0, 0.0, 0.0
    for k in range(n):  # with the mean taken out: the offset in brightness is eliminated
        a, b, c = gu[k] - mu, gv[k] - mv, T[k] - mT
        huu += a * a
        huv += a * b
        hvv += b * b
        tt += c * c
    det = huu * hvv - huv * huv
    if not (det > 1e-3 * (huu + hvv) ** 2 * 0.25 and huu + hvv > 1.0):
        return 0.0, 0.0, -1.0
    du, dv = 0.0, 0.0
    I = np.empty(n)
    low, high_u, high_v = 0.0, w - 1.001, h - 1.001
    for step in range(MAX_STEPS):
        mI = 0.0
        for k in range(n):
            x, y = u + du + ou[k] / scale, v + dv + ov[k] / scale
            if not (x >= low and y >= low and x <= high_u and y <= high_v):
                return 0.0, 0.0, -1.0
            ix, iy = int(x), int(y)
            a, b = x - ix, y - iy
            top = image[iy, ix] * (1.0 - a) + image[iy, ix + 1] * a
            bottom = image[iy + 1, ix] * (1.0 - a) + image[iy + 1, ix + 1] * a
            I[k] = top * (1.0 - b) + bottom * b
            mI += I[k]
        mI /= n
        bu, bv = 0.0, 0.0
        for k in range(n):
            e_k = I[k] - mI - (T[k] - mT)
            bu += (gu[k] - mu) * e_k
            bv += (gv[k] - mv) * e_k
        a, b = (hvv * bu - huv * bv) / det, (huu * bv - huv * bu) / det
        size = math.hypot(a, b)
        if size > 1.5:  # a step further than the patch's own structure means nothing
            a, b = 1.5 * a / size, 1.5 * b / size
        if size < CONVERGED or step == MAX_STEPS - 1:
            if size > 0.1:
                return 0.0, 0.0, -1.0
            du -= axx * a + axy * b
            dv -= ayx * a + ayy * b
            it, ii = 0.0, 0.0
            for k in range(n):
                it += (I[k] - mI) * (T[k] - mT)
                ii += (I[k] - mI) ** 2
            if not ii * tt > 0.0:
                return 0.0, 0.0, -1.0
            return du, dv, it / math.sqrt(ii * tt)
        du -= axx * a + axy * b
        dv -= ayx * a + ayy * b
        if not math.hypot(du, dv) < reach:
            return 0.0, 0.0, -1.0
    return 0.0, 0.0, -1.0


@kernel
def align(
    X: Array, source: np.ndarray, uv_s: Array, R_k: Array, p_k: Array, views: tuple[np.ndarray, ...],
    images: tuple[np.ndarray, ...], level: int, R_c: Array, p_c: Array, half: int, reach: float, uv: Array, size: Array,
    score: Array, f: float, cx: float, cy: float,
) -> None:  # fmt: skip
    """Look for map points in an image, starting from where its pose says that they are.

    A patch that is now seen at another scale than in its source is looked up in a coarser level of the one or the other,
    so that the two have the same sharpness.

    Parameters
    ----------
    X (n, 3) points in R; source (n,) keyframe whose pixels each point keeps, uv_s (n, 2) where in it [px, level 0]
    R_k (m, 3, 3), p_k (m, 3) keyframe poses; views : their pyramids, one (m, h, w) a level
    images : the image's pyramid, one (h, w) a level; level : the finest to look at; reach : shift allowed [px of it]
    half : patches are 2 half + 1 wide
    uv (n, 2) [px, level 0], size (n,) [px] of a pixel of the level it was found in, score (n,): filled; the score is the
    correlation, -1 where nothing was found
    """
    n = 2 * half + 1
    T, gu, gv, ou, ov = np.empty(n * n), np.empty(n * n), np.empty(n * n), np.empty(n * n), np.empty(n * n)
    top = len(views) - 1
    mid = n * n // 2
    for i in range(X.shape[0]):
        score[i] = -1.0
        k = source[i]
        qx, qy, qz = X[i, 0] - p_c[0], X[i, 1] - p_c[1], X[i, 2] - p_c[2]
        u, v = seen(
            R_c[0, 0] * qx + R_c[0, 1] * qy + R_c[0, 2] * qz,
            R_c[1, 0] * qx + R_c[1, 1] * qy + R_c[1, 2] * qz,
            R_c[2, 0] * qx + R_c[2, 1] * qy + R_c[2, 2] * qz,
            f, cx, cy,
        )  # fmt: skip
        uv[i, 0], uv[i, 1] = u, v
        ls, lc = level, level
        s = 2.0**ls
        if not warped_offsets(uv_s[i, 0], uv_s[i, 1], s, half, R_k[k], p_k[k], R_c, p_c, X[i, 2], f, cx, cy, ou, ov):
            continue
        ax, ay = ou[mid + half] - ou[mid - half], ov[mid + half] - ov[mid - half]
        bx, by = ou[mid + half * n] - ou[mid - half * n], ov[mid + half * n] - ov[mid - half * n]
        area = (ax * by - ay * bx) / (2.0 * half * s) ** 2
        if not 0.03 < area < 30.0:
            continue
        while area > 2.0 and lc < top:
            lc, area = lc + 1, 0.25 * area
        while area < 0.5 and ls < top:
            ls, area = ls + 1, 4.0 * area
        if ls > level:
            s = 2.0**ls
            if not warped_offsets(
                uv_s[i, 0], uv_s[i, 1], s, half, R_k[k], p_k[k], R_c, p_c, X[i, 2], f, cx, cy, ou, ov
            ):
                continue
        if not template(views[ls][k], uv_s[i, 0] / s, uv_s[i, 1] / s, half, T, gu, gv):
            continue
        scale = 2.0**lc
        du, dv, score[i] = shift_of(images[lc], u / scale, v / scale, scale, half, T, gu, gv, ou, ov, reach)
        uv[i, 0] += du * scale
        uv[i, 1] += dv * scale
        size[i] = scale
