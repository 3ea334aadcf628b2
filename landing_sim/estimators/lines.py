"""Edges into straight lines: the runway's borders, its threshold, the horizon, and where they cross.

A window says that the edge passes through centre + z direction, with the variance R along the direction. The line
n . (p - c) = 0 is moved by e [px] along its unit normal n and turned by a [rad] about c until

    sum_i (n . (p_i - c))^2 / ((n . s_i)^2 R_i)

is least: the maximum-likelihood line for errors along the search paths s_i.

Source     own; Gibert et al. 2015, section 5, uses the corners, the borders' vanishing point and the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.vanishing import down_from_level_line, lifted
from landing_sim.jit import kernel
from landing_sim.signals import EdgeSet, Feature, Status
from landing_sim.types import Array

_ITERATIONS = 4
_LEAST_SLANT = 0.05  # n . s of windows that search along the line itself: they say nothing of where it is


@dataclass(frozen=True, slots=True)
class LineConfig:
    """When a line counts as seen.

    min_baseline [px] between its outermost windows; limit: standard deviations at which a window is an outlier, if at
    least two windows more than a line needs agree without it.
    """

    min_baseline: float = 4.0
    limit: float = 4.0


@dataclass(frozen=True, slots=True)
class ImageLine:
    """A straight line n . (p - centre) = 0 of the image, and how well it is known.

    cov (2, 2): of its displacement along n at the centre [px] and of its direction [rad], > 0 turning n from u to v.
    Windows that contradict each other without one being the culprit make it larger.
    """

    n: Array  # (2,) unit normal towards the side that the windows' directions point to: into the runway, up to the sky
    centre: Array  # (2,) [px]
    cov: Array
    used: int  # windows
    dropped: int  # outliers, 0 or 1

    @property
    def offset(self) -> float:
        """n . p [px] of its points."""
        return float(self.n @ self.centre)

    @property
    def homogeneous(self) -> Array:
        """(3,): l . (u, v, 1) = 0, unit normal."""
        return np.array([self.n[0], self.n[1], -self.offset])

    @property
    def gradient(self) -> Array:
        """(3, 2) of l by the two errors of which cov is the covariance."""
        t = np.array([-self.n[1], self.n[0]])
        return np.array([[0.0, t[0]], [0.0, t[1]], [-1.0, -float(t @ self.centre)]])

    def sigma_at(self, uv: Array) -> float:
        """[px] standard deviation of the line's place normal to itself near the point (2,)."""
        g = np.array([1.0, self.n[1] * (uv[0] - self.centre[0]) - self.n[0] * (uv[1] - self.centre[1])])
        return math.sqrt(float(g @ self.cov @ g))


@dataclass(frozen=True, slots=True)
class Crossings:
    """Points where lines cross: uv (k, 2) [px] and their joint covariance (2 k, 2 k), u and v in turn."""

    uv: Array
    cov: Array


@dataclass(frozen=True, slots=True)
class RunwayLines:
    """What one image shows in straight lines; None what it does not.

    corners: threshold and left, threshold and right border; vanishing: where the borders meet, one point.
    """

    left: ImageLine | None
    right: ImageLine | None
    threshold: ImageLine | None
    horizon: ImageLine | None

    @property
    def corners(self) -> Crossings | None:
        if self.left is None or self.right is None or self.threshold is None:
            return None
        return crossings([(self.threshold, self.left), (self.threshold, self.right)])

    @property
    def vanishing(self) -> Crossings | None:
        return None if self.left is None or self.right is None else crossings([(self.left, self.right)])


def held_to(point: Crossings, line: ImageLine, sigma: float = 0.0) -> Crossings:
    """One point, drawn to a line on which it is known to lie: the borders' vanishing point to the level's horizon.

    sigma [px] of what else the line's place is uncertain by, as f times that of the dip (its height is only believed).
    From the side, and where borders are short, this makes the difference: along themselves they say little.
    """
    uv, cov = point.uv[0], point.cov
    a = float(line.n @ cov @ line.n)
    gain = cov @ line.n / (a + line.sigma_at(uv) ** 2 + sigma * sigma)
    uv = uv - gain * float(line.n @ (uv - line.centre))
    return Crossings(uv[None], cov - np.outer(gain, line.n @ cov))


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


def fit_line(
    points: Array,
    directions: Array,
    variances: Array,
    config: LineConfig | None = None,
    expected: tuple[Array, float] | None = None,
) -> ImageLine | None:
    """The line through edge points (m, 2) [px] with variances (m,) [px^2] along unit directions (m, 2).

    One outlier is left out where at least four points tell which it is (three with `expected`). `expected`: a unit normal
    (2,) and its standard deviation [rad], if the line's direction is known from elsewhere: then one point is enough.
    None for fewer than two points, or less than config.min_baseline between them.
    """
    k = config or LineConfig()
    prior = np.zeros(4)
    if expected is not None:
        prior[:2], prior[2], prior[3] = expected[0], expected[1], 1.0
    if len(points) < (1 if expected is not None else 2):
        return None
    ok, n, c, cov, out = _robust(
        np.ascontiguousarray(points), np.ascontiguousarray(directions), np.ascontiguousarray(variances),
        prior, k.min_baseline, k.limit,
    )  # fmt: skip
    dropped = int(out >= 0)
    return ImageLine(n, c, cov, len(points) - dropped, dropped) if ok else None


def runway_lines(
    z: Array,
    R: Array,
    edges: EdgeSet,
    lens: Intrinsics,
    dip: float = 0.0,
    config: LineConfig | None = None,
    threshold_normal: tuple[Array, float] | None = None,
) -> RunwayLines:
    """All lines of one "edges" measurement: z (n,) [px], R (n,) [px^2], edges its geometry; windows not FOUND do not count.

    dip [rad] of the horizon: the points seen on it are raised by as much, so that `horizon` is the line at which level
    lines vanish (dip 0: a straight line through what is seen). threshold_normal: see `fit_line`, `threshold_direction`.
    """
    found = edges.status == Status.FOUND
    points = edges.centre + z[:, None] * edges.direction

    def line(feature: Feature, expected: tuple[Array, float] | None = None) -> ImageLine | None:
        ok = found & (edges.feature == feature)
        return fit_line(points[ok], edges.direction[ok], R[ok], config, expected)

    horizon = line(Feature.HORIZON)
    if horizon is not None and dip != 0.0:
        ok = found & (edges.feature == Feature.HORIZON)
        down = down_from_level_line(horizon.homogeneous, lens)
        for _ in range(3):
            horizon = fit_line(lifted(points[ok], down, dip, lens), edges.direction[ok], R[ok], config)
            if horizon is None:
                break
            down = down_from_level_line(horizon.homogeneous, lens)
    return RunwayLines(line(Feature.LEFT), line(Feature.RIGHT), line(Feature.THRESHOLD, threshold_normal), horizon)


def crossings(pairs: Sequence[tuple[ImageLine, ImageLine]]) -> Crossings | None:
    """Where the lines of each pair cross; a line in several pairs correlates their points. None if two are parallel."""
    lines: list[ImageLine] = []
    for pair in pairs:
        lines += [line for line in pair if not any(line is known for known in lines)]
    uv, J = np.empty((len(pairs), 2)), np.zeros((2 * len(pairs), 2 * len(lines)))
    for k, (a, b) in enumerate(pairs):
        x = np.cross(a.homogeneous, b.homogeneous)
        if abs(x[2]) < 1e-9:
            return None
        uv[k] = x[:2] / x[2]
        # n_a . dp = da, n_b . dp = db, where da is by how much line a moves along its normal at the point
        inverse = np.linalg.inv(np.array([a.n, b.n]))
        for row, line in enumerate((a, b)):
            moves = -np.array([uv[k, 0], uv[k, 1], 1.0]) @ line.gradient
            at = next(i for i, known in enumerate(lines) if known is line)
            J[2 * k : 2 * k + 2, 2 * at : 2 * at + 2] += np.outer(inverse[:, row], moves)
    cov = np.zeros((2 * len(lines), 2 * len(lines)))
    for i, line in enumerate(lines):
        cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = line.cov
    return Crossings(uv, J @ cov @ J.T)


def threshold_direction(uv: Array, R_CL: Array, dpsi: float, lens: Intrinsics) -> Array:
    """(2,) unit normal, towards the runway, that a level threshold's image must have near the point uv (2,) [px].

    R_CL (3, 3): level axes (forward, right, down; heading of the body) to the camera's; dpsi [rad] runway's heading in L.
    """
    ca, sa = math.cos(dpsi), math.sin(dpsi)

    def seen(d_L: Array) -> Array:  # image of a direction at the point
        d = R_CL @ d_L
        return lens.f * d[:2] - (uv - np.array([lens.cx, lens.cy])) * d[2]  # type: ignore[no-any-return]

    across, along = seen(np.array([-sa, ca, 0.0])), seen(np.array([ca, sa, 0.0]))
    n = np.array([-across[1], across[0]]) / math.hypot(across[0], across[1])
    return n if n @ along > 0.0 else -n
