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

from landing_sim.estimators.line_fit import (
    CENTRE,
    COLUMNS,
    COV,
    DROPPED,
    NO_PRIOR,
    NORMAL,
    USED,
    cross_rows,
    fit_row,
    fit_rows,
)
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.signals import EdgeSet
from landing_sim.types import Array


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
    row = np.empty(COLUMNS)
    fit_row(
        np.ascontiguousarray(points), np.ascontiguousarray(directions), np.ascontiguousarray(variances),
        _prior(expected), k.min_baseline, k.limit, row,
    )  # fmt: skip
    return _line(row)


def _prior(expected: tuple[Array, float] | None) -> Array:
    return NO_PRIOR if expected is None else np.array([*expected[0], expected[1], 1.0])


def _line(row: Array) -> ImageLine | None:
    if row[USED] == 0.0:
        return None
    cov = np.array([[row[COV], row[COV + 1]], [row[COV + 1], row[COV + 2]]])
    return ImageLine(row[NORMAL : NORMAL + 2], row[CENTRE : CENTRE + 2], cov, int(row[USED]), int(row[DROPPED]))


def _row(line: ImageLine) -> Array:
    return np.array([*line.n, *line.centre, line.cov[0, 0], line.cov[0, 1], line.cov[1, 1], line.used, line.dropped])


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
    k = config or LineConfig()
    rows = fit_rows(
        z, R, edges.feature, edges.status, edges.centre, edges.direction, np.array([lens.f, lens.cx, lens.cy]), dip,
        _prior(threshold_normal), k.min_baseline, k.limit,
    )  # fmt: skip
    return RunwayLines(*(_line(row) for row in rows))


def crossings(pairs: Sequence[tuple[ImageLine, ImageLine]]) -> Crossings | None:
    """Where the lines of each pair cross; a line in several pairs correlates their points. None if two are parallel."""
    lines: list[ImageLine] = []
    for pair in pairs:
        lines += [line for line in pair if not any(line is known for known in lines)]
    at = [[next(i for i, known in enumerate(lines) if known is line) for line in pair] for pair in pairs]
    ok, uv, cov = cross_rows(np.array([_row(line) for line in lines]), np.array(at, dtype=np.int64))
    return Crossings(uv, cov) if ok else None


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
