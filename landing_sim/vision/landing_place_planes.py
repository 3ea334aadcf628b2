"""Planes in two views of one scene: homographies by random sampling, and planes aligned with both views.

Directions are unit vectors in R, so that only the camera's movement is left between the views: a plane v . X = 1, X seen
from the first camera, takes the direction a there to a + t (v . a) in the second; t = p_first - p_second.

Source     Brockers et al. 2012, section 3.4; Cheng 2010 (the plane whose homography aligns two views best, the movement
           being known). Departs: features are aligned, not grey levels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from landing_sim.jit import kernel
from landing_sim.noise import NoiseStream
from landing_sim.types import Array

NEIGHBOURS = 16  # of a point, among which the others of a local sample are drawn
STEPS = 8  # of an alignment, at most


@dataclass(frozen=True, slots=True)
class Plane:
    """v (3,) [1/m]: v . X = 1, X from the first camera in R; members (n,) bool: features on it; error [rad]: their rms."""

    v: Array
    members: np.ndarray
    error: float

    @property
    def distance(self) -> float:
        """[m] from the first camera."""
        return 1.0 / math.sqrt(float(self.v @ self.v))

    @property
    def normal(self) -> Array:
        """(3,) unit, away from the camera."""
        return self.v * self.distance

    @property
    def tilt(self) -> float:
        """[rad] from level."""
        return math.acos(min(1.0, float(self.normal[2])))


def homography(
    a: Array, b: Array, tolerance: float, tries: int, noise: NoiseStream, local: bool
) -> tuple[Array, np.ndarray] | None:
    """H (3, 3) with b ~ H a for most of the directions a, b (n, 3), and which (n,); None where no four agree on any.

    tolerance : [rad] between b and H a; tries : samples of four
    local : the last three of a sample are drawn from the neighbours of the first: a small plane among many others
    """
    n = len(a)
    if n < 4:
        return None
    share = ndtr(noise.normal(4 * tries)).reshape(tries, 4)
    pick = np.minimum((share * n).astype(np.int64), n - 1)
    if local and n > NEIGHBOURS:
        near = np.argsort(-(a @ a.T), axis=1, kind="stable")[:, :NEIGHBOURS]
        pick[:, 1:] = near[pick[:, :1], (share[:, 1:] * NEIGHBOURS).astype(np.int64)]
    H, _ = _sampled(np.ascontiguousarray(a), np.ascontiguousarray(b), pick, tolerance)
    for _ in range(3):  # all that agree say it again
        inside = _off(H, a, b) < tolerance
        if inside.sum() < 4:
            return None
        H = _fitted(a[inside], b[inside])
    return H, _off(H, a, b) < tolerance


@kernel
def _sampled(a: Array, b: Array, pick: np.ndarray, tolerance: float) -> tuple[Array, float]:
    """The homography of the sample that fits best, and its cost: squared errors [rad^2], no more than tolerance^2 each."""
    best, least = np.eye(3), math.inf
    limit = tolerance * tolerance
    for k in range(len(pick)):
        A, B = _basis(a, pick[k]), _basis(b, pick[k])
        det = np.linalg.det(A)
        if not abs(det) > 1e-9 or not abs(np.linalg.det(B)) > 1e-9:
            continue
        H = B @ np.linalg.inv(A)
        cost = 0.0
        for i in range(len(a)):
            x = H[0, 0] * a[i, 0] + H[0, 1] * a[i, 1] + H[0, 2] * a[i, 2]
            y = H[1, 0] * a[i, 0] + H[1, 1] * a[i, 1] + H[1, 2] * a[i, 2]
            z = H[2, 0] * a[i, 0] + H[2, 1] * a[i, 1] + H[2, 2] * a[i, 2]
            length = math.sqrt(x * x + y * y + z * z)
            along = (x * b[i, 0] + y * b[i, 1] + z * b[i, 2]) / length
            cost += min(limit, 2.0 - 2.0 * along)  # the squared chord
            if cost >= least:
                break
        if cost < least:
            best, least = H, cost
    return best, least


@kernel
def _basis(a: Array, four: np.ndarray) -> Array:
    """(3, 3) with columns along the first three directions, scaled so that they add up to the fourth."""
    A = np.empty((3, 3))
    for c in range(3):
        A[:, c] = a[four[c]]
    if not abs(np.linalg.det(A)) > 1e-9:
        return np.zeros((3, 3))
    return A * (np.linalg.inv(A) @ a[four[3]])


def _off(H: Array, a: Array, b: Array) -> Array:
    """(n,) [rad] between b and H a; pi / 2 or more on the other side."""
    p = a @ H.T
    p /= np.linalg.norm(p, axis=1)[:, None]
    return np.asarray(np.linalg.norm(p - b, axis=1))


def _fitted(a: Array, b: Array) -> Array:
    """H (3, 3) by least squares on b x H a = 0, of the sign that keeps a and b on one side."""
    zero = np.zeros_like(a)
    rows = np.concatenate([
        np.concatenate([zero, -b[:, 2:] * a, b[:, 1:2] * a], axis=1),
        np.concatenate([b[:, 2:] * a, zero, -b[:, :1] * a], axis=1),
        np.concatenate([-b[:, 1:2] * a, b[:, :1] * a, zero], axis=1),
    ])  # fmt: skip
    H = np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 3)
    return np.asarray(H if float(np.sum((a @ H.T) * b)) > 0.0 else -H)


def plane_of(H: Array, t: Array) -> Array:
    """v (3,) [1/m] of the plane that induces H ~ I + t v', in the least-squares sense; t (3,) [m].

    The middle singular value of I + t v' is 1: that is H's scale.
    """
    scaled = H / np.linalg.svd(H, compute_uv=False)[1]
    return np.asarray((scaled - np.eye(3)).T @ t / float(t @ t))


def aligned(v: Array, a: Array, b: Array, t: Array, tolerance: float) -> Array:
    """The plane v (3,) for which a + t (v . a) points along b best. Three unknowns; starts at v.

    Gauss-Newton with Tukey's weights: errors beyond `tolerance` [rad] do not count.
    """
    for _ in range(STEPS):
        e, J = _errors(v, a, b, t)
        w = _weights(e, tolerance)
        N = (a * (w * np.sum(J * J, axis=1))[:, None]).T @ a  # the error's derivative to v is J a'
        step = np.linalg.lstsq(N, a.T @ (w * np.sum(J * e, axis=1)), rcond=1e-9)[0]
        v = v - step
        if float(step @ step) < 1e-14:
            break
    return v


def aligned_along(normal: Array, s: float, a: Array, b: Array, t: Array, tolerance: float) -> float:
    """s [1/m] of the plane s normal, as `aligned`: one unknown, its inverse distance. normal (3,) unit; starts at s."""
    along = a @ normal
    for _ in range(STEPS):
        e, J = _errors(s * normal, a, b, t)
        w = _weights(e, tolerance)
        weight = float(np.sum(w * along * along * np.sum(J * J, axis=1)))
        if weight <= 0.0:
            break
        step = float(np.sum(w * along * np.sum(J * e, axis=1))) / weight
        s -= step
        if abs(step) < 1e-7:
            break
    return s


def misalignment(v: Array, a: Array, b: Array, t: Array) -> Array:
    """(n,) [rad] between a + t (v . a) and b."""
    return np.asarray(np.linalg.norm(_errors(v, a, b, t)[0], axis=1))


def _errors(v: Array, a: Array, b: Array, t: Array) -> tuple[Array, Array]:
    """Errors (n, 3) [rad] and their derivative (n, 3) to v . a."""
    p = a + np.multiply.outer(a @ v, t)
    length = np.linalg.norm(p, axis=1)[:, None]
    u = p / length
    return u - b, (t - u * (u @ t)[:, None]) / length


def _weights(e: Array, tolerance: float) -> Array:
    return np.asarray(np.maximum(0.0, 1.0 - np.sum(e * e, axis=1) / tolerance**2) ** 2)
