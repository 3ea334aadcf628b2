"""The first two keyframes: corners followed from one image to another, and the motion between the two from the homography
of the plane that most of them lie on.

Source     Faugeras & Lustman 1988 (motion from a homography); Klein & Murray 2007, section 6.1 (start of the map).
           Departs: of the solutions, that which the inertial unit's relative rotation and gravity say.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from landing_sim.types import Array
from landing_sim.vision.slam.pose import turned

WINDOW, LEVELS = (15, 15), 3  # of the optical flow
ENOUGH = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)
ROUND_TRIP = 0.5  # [px] a corner followed there and back must end where it began
STEEP = 0.64  # cosine: rays further than 50 deg off the axis have too much noise on the image plane z = 1
INLIER = 0.006  # on the plane z = 1: 1.5 px of the middle of the image at f = 262 px
MOST_TURN = 0.05  # [rad] rotation of the homography against the inertial unit's
MOST_TILT = 0.12  # [rad] its plane against the level


class Motion(NamedTuple):
    """q_2 = R q_1 + t, t in shares of the plane's distance from camera 1; n (3,) the plane's normal in C1, away from it."""

    R: Array
    t: Array
    n: Array
    inliers: int


def follow(before: np.ndarray, now: np.ndarray, uv: Array) -> tuple[Array, np.ndarray]:
    """Where corners uv (n, 2) [px] of one image lie in the next, and which of them came back to where they started."""
    if not len(uv):
        return uv, np.zeros(0, bool)
    a = uv.astype(np.float32).reshape(-1, 1, 2)
    there, back = np.zeros((2, len(uv), 1), np.uint8)
    b, c = np.empty_like(a), np.empty_like(a)
    cv2.calcOpticalFlowPyrLK(before, now, a, b, there, winSize=WINDOW, maxLevel=LEVELS, criteria=ENOUGH)
    cv2.calcOpticalFlowPyrLK(now, before, b, c, back, winSize=WINDOW, maxLevel=LEVELS, criteria=ENOUGH)
    h, w = now.shape
    new = b.reshape(-1, 2).astype(float)
    good = (there.ravel() == 1) & (back.ravel() == 1) & (np.linalg.norm((c - a).reshape(-1, 2), axis=1) < ROUND_TRIP)
    return new, good & (new > 4.0).all(1) & (new < [w - 5.0, h - 5.0]).all(1)


def plane_motion(rays_1: Array, rays_2: Array, R_said: Array, down_1: Array) -> Motion | str:
    """Motion between two cameras that see rays_1, rays_2 (n, 3) of the same, mostly coplanar, points.

    R_said (3, 3) : the rotation C1 to C2 that the inertial unit tells; down_1 (3,) gravity's direction in C1.
    A string says why there is none. cv2.findHomography draws from its own generator, seeded in every call: same input, same
    bits.
    """
    mild = (rays_1[:, 2] > STEEP) & (rays_2[:, 2] > STEEP)
    if mild.sum() < 30:
        return f"{mild.sum()} corners near the middle of the image, 30 needed"
    a, b = rays_1[mild, :2] / rays_1[mild, 2:], rays_2[mild, :2] / rays_2[mild, 2:]
    H, inlier = cv2.findHomography(a, b, cv2.RANSAC, INLIER, maxIters=500, confidence=0.999)
    if H is None or inlier.sum() < 20:
        return "no plane fits the corners"
    _, turns, shifts, normals = cv2.decomposeHomographyMat(H, np.eye(3))
    best, least = None, np.inf
    for R, t, n in zip(turns, shifts, normals):
        t, n = t.ravel(), n.ravel()
        if n[2] < 0.0:
            t, n = -t, -n
        turn = turned(R, R_said)
        tilt = np.arccos(np.clip(n @ down_1, -1.0, 1.0))
        if turn < MOST_TURN and tilt < MOST_TILT and turn + tilt < least:
            best, least = Motion(R, t, n, int(inlier.sum())), turn + tilt
    return best or "the homography disagrees with the inertial unit"


def meet(R_1: Array, p_1: Array, rays_1: Array, R_2: Array, p_2: Array, rays_2: Array) -> tuple[Array, Array]:
    """Points (n, 3) in R nearest to pairs of rays, and the angles (n,) [rad] between these. NaN for parallel rays.

    R (3, 3) is R_CR, p (3,) p_RC, rays (n, 3) unit directions in C. Both may have a leading axis n.
    """
    d_1, d_2 = np.einsum("...ji,...j->...i", R_1, rays_1), np.einsum("...ji,...j->...i", R_2, rays_2)
    base = np.asarray(p_2 - p_1)
    c = np.einsum("ni,ni->n", d_1, d_2)
    b_1, b_2 = (d_1 * base).sum(-1), (d_2 * base).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        k_1 = (b_1 - c * b_2) / (1.0 - c * c)
        k_2 = (c * b_1 - b_2) / (1.0 - c * c)
    middle = 0.5 * (p_1 + k_1[:, None] * d_1 + p_2 + k_2[:, None] * d_2)
    middle[(k_1 <= 0.0) | (k_2 <= 0.0)] = np.nan
    return middle, np.arccos(np.clip(c, -1.0, 1.0))
