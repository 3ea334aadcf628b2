"""The range observer on an unknown runway: high gain, along the ray, with outputs that fade instead of dividing by zero.

With rho = 1 / X of the threshold ahead of the camera and the outputs y1, y2 (bearings) and s = W / X (angular width),

    y_i' = d_i rho,    d1 = v1 y1 - v2,    d2 = v1 y2 - v3,    d_s = v1 s           (v: the camera's velocity in R)
    y_i += l1 e_i,     rho += l2 sum(w_i d_i e_i) / (sum(w_i d_i^2) + eps^2)         (w_i: inverse variances, normalised)

On the glide path the aim point's d1 = d2 = 0: no observer can range it. The runway's width keeps d_s = v1 s > 0.
Where all d are small against eps the range is carried by the inertial velocity alone.

Across the way the place is seen and its rate is told: what the two steadily disagree by is an error of the velocity
(of the unit, or of the course, which a camera bolted on askew turns), and is integrated out of it,

    b += l_b X e_i     (i = 1, 2; faded while the range is uncertain, since a wrong scale disagrees likewise)

Source     Gibert et al. 2015, eqs. (7)-(13). Departs: its inverse of dPsi/dx (a division by d1) is replaced by the
           smooth form; the third output and its unknown width, and the velocity's error, are ours; discrete gains that
           are exact for a held measurement. When the threshold has left the image, height and offset follow from the
           borders and the width found so far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from landing_sim.estimators.observer import scene as sc
from landing_sim.estimators.observer.bearings import Seen, see
from landing_sim.estimators.observer.looking import Image
from landing_sim.estimators.observer.scene import Carriage, Scene
from landing_sim.estimators.ranging.fused import correct, faded
from landing_sim.estimators.ranging.gains import pole_pair
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import from_euler, product
from landing_sim.jit import kernel
from landing_sim.types import Array

RAD = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class GibertConfig:
    """attitude: "horizon" believes the horizon's roll and pitch and takes only their changes from the inertial unit;
    bandwidth [rad/s] of the range at first, a double pole; bearing_rate [1/s] of the bearings; eps [m/s] of angular
    motion below which the range is carried; velocity_sigma [m/s] believed of the inertial unit; first_spread: relative, of
    the first guess. The error is believed to fall at half the bandwidth, since a double pole's begins slowly."""

    outputs: Literal["both", "width", "point"] = "both"
    attitude: Literal["inertial", "horizon"] = "inertial"
    bandwidth: float = 0.6
    later: float = 0.7  # share of the bandwidth that is left when the first guess has been forgotten
    hurry: float = 10.0  # [s] in which it falls to that
    bearing_rate: float = 2.0
    bias_rate: float = 0.08  # [1/s] at which the velocity's error across the way is found
    bias_limit: float = 2.0  # [m/s]
    bias_spread: float = 0.02  # of the range, from which its error rather than the velocity's is taken for the cause
    eps: float = 0.1
    floor: float = 25.0  # [m/s] of bearings: what moves slower than this is drowned in the velocity's error over d
    limit: float = 0.02  # largest share of the range that one image may correct
    velocity_sigma: float = 0.3
    bearing_floor: float = 2e-4  # [rad] common to all windows of an image: attitude
    first_spread: float = 0.6
    images: float = 25.0  # errors of edges last for as many: what one tells of directions counts for 1 / this
    course_drift: float = 0.01 * RAD  # [rad / sqrt(s)]
    tilt_drift: float = 0.003 * RAD
    least_range: float = 30.0  # [m] an estimate that runs through zero steers into the ground


class Gibert:
    """looking.Ranging with gains that depend on time alone."""

    def __init__(self, config: GibertConfig, lens: Intrinsics) -> None:
        self.config = config
        self._lens = np.array([lens.f, lens.cx, lens.cy])
        self._use = np.array(
            {"both": (1.0, 1.0, 1.0), "width": (0.0, 0.0, 1.0), "point": (1.0, 1.0, 0.0)}[config.outputs]
        )
        c = config
        self._rule = Rule(
            c.bandwidth, c.later, c.hurry, c.bearing_rate, c.bias_rate, c.bias_limit, c.bias_spread, c.eps, c.floor,
            c.limit, c.velocity_sigma, c.bearing_floor, c.images, c.course_drift, c.tilt_drift, c.least_range,
        )  # fmt: skip

    def start(self, s: Array, P: Array, t: float) -> Scene:
        """The course is the camera's: what its mounting turns it by, this observer cannot tell from the runway's."""
        P = np.diag(np.diag(P))
        P[sc.COURSE, sc.COURSE] -= P[sc.EPAN, sc.EPAN]
        P[sc.EPAN, sc.EPAN] = 0.0
        return Scene(s, P, self.config.first_spread, t, t)

    def move(self, scene: Scene, way_R: Array, dt: float) -> Scene:
        s, P, spread = _move(scene.s, scene.P, scene.spread, way_R, dt, scene.threshold_in_view, self._rule)
        return scene._replace(s=s, P=P, spread=spread)

    def look(self, scene: Scene, image: Image, carried: Carriage) -> Scene:
        m = image.edges
        edges = m.geometry
        if edges is None:
            raise ValueError("a measurement of kind 'edges' needs its EdgeSet")
        s, P, spread, d, shown, in_view = _look(
            scene.s, scene.P, scene.spread, image.t - scene.t_image, image.t - scene.t_start, m.z, m.R, edges.feature,
            edges.status, edges.centre, edges.direction, edges.pan, edges.tilt, self._lens, carried.R_RB, carried.v_R,
            self.config.attitude == "horizon", self._use, self._rule,
        )  # fmt: skip
        if not shown:
            return scene._replace(misses=scene.misses + 1, threshold_in_view=False)
        return scene._replace(
            s=s,
            P=P,
            spread=spread,
            t_image=image.t,
            d=d,
            misses=0,
            threshold_in_view=in_view,
            frames=scene.frames + 1,
        )


class Rule(NamedTuple):
    """What the kernels need of `GibertConfig`."""

    bandwidth: float
    later: float
    hurry: float
    bearing_rate: float
    bias_rate: float
    bias_limit: float
    bias_spread: float
    eps: float
    floor: float
    limit: float
    velocity_sigma: float
    bearing_floor: float
    images: float
    course_drift: float
    tilt_drift: float
    least_range: float


@kernel
def _move(
    s: Array, P: Array, spread: float, way_R: Array, dt: float, threshold_in_view: bool, c: Rule
) -> tuple[Array, Array, float]:
    """s, P, spread after the cg has moved by way_R (3,) [m] in dt [s]."""
    out, P = sc.moved(s, way_R, dt), P.copy()
    P[sc.COURSE, sc.COURSE] += c.course_drift**2 * dt
    P[sc.ETILT, sc.ETILT] += c.tilt_drift**2 * dt
    if threshold_in_view:  # carried: the error stays in metres while the range shrinks
        before, now = abs(s[sc.X]), max(abs(out[sc.X]), c.least_range)
        spread = spread * before / now + c.velocity_sigma * dt / now
    return out, P, spread


@kernel
def _look(
    s: Array, P: Array, spread: float, dt: float, since: float, z: Array, R: Array, feature: np.ndarray,
    status: np.ndarray, centre: Array, direction: Array, pan: float, tilt: float, lens: Array, R_RB: Array, v_R: Array,
    by_horizon: bool, use: Array, c: Rule,
) -> tuple[Array, Array, float, tuple[float, float, float], bool, bool]:  # fmt: skip
    """s, P, spread, d after an image, whether it showed anything, and whether the threshold; edges as `bearings.see` has
    them, dt and since [s] from the last image and from the start."""
    s, P, d = s.copy(), P.copy(), (0.0, 0.0, 0.0)
    ahead = np.array([-s[sc.X], -s[sc.Y], s[sc.H]])  # from the camera to the threshold's middle, R
    if s[sc.EROLL] != 0.0:
        R_RB = product(R_RB, from_euler(s[sc.EROLL], 0.0, 0.0))
    seen = see(z, R, feature, status, centre, direction, pan - s[sc.EPAN], tilt - s[sc.ETILT], lens, R_RB, ahead[2])
    borders, threshold = not math.isnan(seen.k[0]), not math.isnan(seen.y[0])
    if not (borders or threshold) and math.isnan(seen.turned[0]):
        return s, P, spread, d, False, False
    dt = min(max(dt, 1e-3), 0.5)
    fast = 1.0 - math.exp(-c.bearing_rate * dt)
    dip = 0.5 * spread * horizon_dip(ahead[2])  # how far it may be wrong
    if by_horizon and not math.isnan(seen.level[0]):
        s[sc.EROLL] -= fast * seen.level[0]
        dip = 0.0
    turn = _course(s, P, seen, dip, c)
    cos, sin = math.cos(turn), math.sin(turn)  # into axes turned to the right by as much
    ahead[0], ahead[1] = cos * ahead[0] + sin * ahead[1], cos * ahead[1] - sin * ahead[0]
    right, below = ahead[1], ahead[2]
    in_view = threshold and ahead[0] > 0.0
    if in_view:
        y, along = seen.y, cos + seen.y[0] * sin
        y[0], y[1], y[2] = (y[0] * cos - sin) / along, y[1] / along, y[2] / along**2
        right, below = y[0] * ahead[0] - right, y[1] * ahead[0] - below
        s[sc.WIDTH], d, spread = correct_range(ahead, s[sc.WIDTH], y, seen.y_var, v_R, spread, dt, since, use, c)
        _learn(s, right, below, spread, dt, c)
    elif borders:
        _borders(ahead, s[sc.WIDTH], seen.k, seen.k_var, fast)
        _learn(s, (ahead[1] - right) / fast, (ahead[2] - below) / fast, 0.0, dt, c)
    s[sc.X], s[sc.Y], s[sc.H] = -ahead[0], -ahead[1], ahead[2]
    _cover(s, P, spread)
    return s, P, spread, d, True, in_view


@kernel
def _course(s: Array, P: Array, seen: Seen, dip: float, c: Rule) -> float:
    """The course and the tilt error follow the vanishing point; returns by how much the axes have turned [rad].

    The point lies best along the borders' own direction, which is neither heading nor rise: the two are estimated
    together, with the horizon's say on the tilt, as far as the scale of its dip is known.
    """
    a, b, e = P[sc.COURSE, sc.COURSE], P[sc.COURSE, sc.ETILT], P[sc.ETILT, sc.ETILT]
    course = tilt = 0.0
    if not math.isnan(seen.level[1]):
        below = e + c.images * (dip**2 + c.bearing_floor**2)
        course, tilt = b / below * seen.level[1], e / below * seen.level[1]
        a, b, e = a - b * b / below, b - b * e / below, e - e * e / below
    if not math.isnan(seen.turned[0]):
        floor, cov = c.bearing_floor**2, seen.turned_cov
        p = a + c.images * (cov[0, 0] + floor)
        q = b + c.images * cov[0, 1]
        r = e + c.images * (cov[1, 1] + floor)
        det = p * r - q * q
        g00, g01 = (a * r - b * q) / det, (b * p - a * q) / det
        g10, g11 = (b * r - e * q) / det, (e * p - b * q) / det
        off_course, off_tilt = seen.turned[0] - course, seen.turned[1] - tilt
        course, tilt = course + g00 * off_course + g01 * off_tilt, tilt + g10 * off_course + g11 * off_tilt
        a, b, e = a - g00 * a - g01 * b, b - 0.5 * (g00 * b + g01 * e + g10 * a + g11 * b), e - g10 * b - g11 * e
    P[sc.COURSE, sc.COURSE], P[sc.ETILT, sc.ETILT] = a, e
    P[sc.COURSE, sc.ETILT] = P[sc.ETILT, sc.COURSE] = b
    s[sc.COURSE] += course
    s[sc.ETILT] += tilt
    return course


@kernel
def correct_range(
    ahead: Array, width: float, y: Array, var: Array, v_R: Array, spread: float, dt: float, since: float, use: Array,
    c: Rule,
) -> tuple[float, tuple[float, float, float], float]:  # fmt: skip
    """One correction of the way to the threshold `ahead` (3,), in place; returns width, d and spread."""
    omega = c.bandwidth * (c.later + (1.0 - c.later) * math.exp(-since / c.hurry))
    rho = 1.0 / max(ahead[0], c.least_range)
    was = np.array([ahead[1] * rho, ahead[2] * rho, width * rho])
    d = np.array([v_R[0] * was[0] - v_R[1], v_R[0] * was[1] - v_R[2], v_R[0] * was[2]])
    # poles: the range's twice for the width, the range's and the bearings' for these
    l1, l2 = pole_pair(1.0, omega, dt)
    fast, slow = 1.0 - math.exp(-c.bearing_rate * dt), 1.0 - math.exp(-omega * dt)
    share = np.array([fast / slow, fast / slow, 1.0])
    common = np.array([c.bearing_floor**2, c.bearing_floor**2, 0.0])
    var = var + common
    weights = faded(use * np.min(var) / var, d, np.array([c.floor, c.floor, 0.0]))
    e = y - was
    got = correct(was, rho, e * share, d, weights, (l1, l2), c.eps, c.limit)
    below = got.observed**2 + c.eps**2
    noise = l2 * math.sqrt(np.sum((weights * d * share) ** 2 * var)) / (below * rho)
    spread = math.hypot(spread * (1.0 - got.observed**2 / below * 0.5 * omega * dt), noise)
    X = max(1.0 / got.rho, c.least_range)
    ahead[0], ahead[1], ahead[2] = X, (was[0] + fast * e[0]) * X, (was[1] + fast * e[1]) * X
    return got.z[2] * X, (d[0], d[1], d[2]), spread


@kernel
def _borders(ahead: Array, width: float, k: Array, var: Array, gain: float) -> None:
    """Height and offset in `ahead` (3,) from the borders, whose distance is known by now."""
    Z = width / (k[1] - k[0])
    sigma = Z * math.sqrt(var[0] + var[1]) / (k[1] - k[0])
    if abs(Z - ahead[2]) <= 2.0 + 4.0 * sigma + 0.2 * Z:
        ahead[1] += gain * (0.5 * (k[0] + k[1]) * Z - ahead[1])
        ahead[2] += gain * (Z - ahead[2])


@kernel
def _learn(s: Array, right: float, below: float, spread: float, dt: float, c: Rule) -> None:
    """The velocity's error across the way, from how far the runway is `right` of and `below` where it was expected [m].

    Before the place is corrected; with bearing_rate far above bias_rate the poles are these two.
    """
    gain = c.bearing_rate * c.bias_rate * dt / (1.0 + (spread / c.bias_spread) ** 2)
    s[sc.BY] = min(max(s[sc.BY] + gain * right, -c.bias_limit), c.bias_limit)
    s[sc.BZ] = min(max(s[sc.BZ] + gain * below, -c.bias_limit), c.bias_limit)


@kernel
def _cover(s: Array, P: Array, spread: float) -> None:
    """Covariance of place and width: one scale, and what bearings leave."""
    rows, free = (sc.X, sc.Y, sc.H, sc.WIDTH), 1e-3 * max(abs(s[sc.X]), 50.0)
    left = ((10.0 * free) ** 2, free**2, free**2, 0.0)
    for i in range(4):
        for j in range(4):
            P[rows[i], rows[j]] = spread**2 * s[rows[i]] * s[rows[j]] + (left[i] if i == j else 0.0)
