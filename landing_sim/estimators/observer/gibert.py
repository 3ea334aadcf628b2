"""The range observer on an unknown runway: high gain, along the ray, with outputs that fade instead of dividing by zero.

With rho = 1 / X of the threshold ahead of the camera and the outputs y1, y2 (bearings) and s = W / X (angular width),

    y_i' = d_i rho,    d1 = v1 y1 - v2,    d2 = v1 y2 - v3,    d_s = v1 s           (v: the camera's velocity in R)
    y_i += l1 e_i,     rho += l2 sum(w_i d_i e_i) / (sum(w_i d_i^2) + eps^2)         (w_i: inverse variances, normalised)

On the glide path the aim point's d1 = d2 = 0: no observer can range it. The runway's width keeps d_s = v1 s > 0.
Where all d are small against eps the range is carried by the inertial velocity alone.

Source     Gibert et al. 2015, eqs. (7)-(13). Departs: its inverse of dPsi/dx (a division by d1) is replaced by the
           smooth form; the third output and its unknown width are ours; discrete gains that are exact for a held
           measurement. When the threshold has left the image, height and offset follow from the borders and the width
           found so far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from landing_sim.estimators.observer import scene as sc
from landing_sim.estimators.observer.bearings import Bearings, bearings
from landing_sim.estimators.observer.looking import Image
from landing_sim.estimators.observer.scene import Carriage, Scene
from landing_sim.estimators.ranging.fused import correct, faded
from landing_sim.estimators.ranging.gains import pole_pair
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import from_euler
from landing_sim.types import Array

RAD = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class GibertConfig:
    """bandwidth [rad/s] of the range at first, a double pole; bearing_rate [1/s] of the bearings; eps [m/s] of angular
    motion below which the range is carried; velocity_sigma [m/s] believed of the inertial unit; first_spread: relative, of
    the first guess. The error is believed to fall at half the bandwidth, since a double pole's begins slowly."""

    outputs: Literal["both", "width", "point"] = "both"
    attitude: Literal["inertial", "horizon"] = "inertial"
    bandwidth: float = 0.5
    later: float = 0.7  # share of the bandwidth that is left when the first guess has been forgotten
    hurry: float = 10.0  # [s] in which it falls to that
    bearing_rate: float = 2.0
    eps: float = 0.1
    floor: float = 10.0  # [m/s] of bearings: what moves slower than this is drowned in the velocity's error over d
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
        self.config, self._lens = config, lens
        self._use = np.array(
            {"both": (1.0, 1.0, 1.0), "width": (0.0, 0.0, 1.0), "point": (1.0, 1.0, 0.0)}[config.outputs]
        )
        self._floors = np.array([config.floor, config.floor, 0.0])
        self._common = np.array([config.bearing_floor**2, config.bearing_floor**2, 0.0])

    def start(self, s: Array, P: Array, t: float) -> Scene:
        """The course is the camera's: what its mounting turns it by, this observer cannot tell from the runway's."""
        P = np.diag(np.diag(P))
        P[sc.COURSE, sc.COURSE] -= P[sc.EPAN, sc.EPAN]
        P[sc.EPAN, sc.EPAN] = 0.0
        return Scene(s, P, self.config.first_spread, t, t)

    def move(self, scene: Scene, way_R: Array, dt: float) -> Scene:
        s = sc.moved(scene.s, way_R, dt)
        P = scene.P.copy()
        P[sc.COURSE, sc.COURSE] += self.config.course_drift**2 * dt
        P[sc.ETILT, sc.ETILT] += self.config.tilt_drift**2 * dt
        spread = scene.spread
        if scene.threshold_in_view:  # carried: the error stays in metres while the range shrinks
            before, now = abs(scene.s[sc.X]), max(abs(s[sc.X]), self.config.least_range)
            spread = spread * before / now + self.config.velocity_sigma * dt / now
        return replace(scene, s=s, P=P, spread=spread)

    def look(self, scene: Scene, image: Image, carried: Carriage) -> Scene:
        c, m = self.config, image.edges
        s = scene.s
        if m.geometry is None:
            raise ValueError("a measurement of kind 'edges' needs its EdgeSet")
        ahead = np.array([-s[sc.X], -s[sc.Y], s[sc.H]])  # from the camera to the threshold's middle, R
        R_RB = carried.R_RB if s[sc.EROLL] == 0.0 else carried.R_RB @ from_euler(s[sc.EROLL], 0.0, 0.0)
        seen = bearings(m.z, m.R, m.geometry, self._lens, R_RB, (s[sc.EPAN], s[sc.ETILT]), float(ahead[2]), c.attitude)
        if seen.turned is None and seen.borders is None and seen.threshold is None:
            return replace(scene, misses=scene.misses + 1, threshold_in_view=False)
        s, P = s.copy(), scene.P.copy()
        turn = self._course(s, P, seen, 0.5 * scene.spread * horizon_dip(float(ahead[2])))
        ahead[:2] = _turned(ahead[:2], turn)
        dt = min(max(image.t - scene.t_image, 1e-3), 0.5)
        d, spread = (0.0, 0.0, 0.0), scene.spread
        in_view = seen.threshold is not None and ahead[0] > 0.0
        if seen.threshold is not None and ahead[0] > 0.0:
            y, var = seen.threshold
            ahead, s[sc.WIDTH], d, spread = self._range(
                ahead, s[sc.WIDTH], _bearings_turned(y, turn), var, carried.v_R, spread, dt, image.t - scene.t_start
            )
        elif seen.borders is not None:
            ahead = self._borders(ahead, s[sc.WIDTH], *seen.borders, dt)
        s[sc.X], s[sc.Y], s[sc.H] = -ahead[0], -ahead[1], ahead[2]
        self._cover(s, P, spread)
        return replace(
            scene,
            s=s,
            P=P,
            spread=spread,
            t_image=image.t,
            d=d,
            misses=0,
            threshold_in_view=in_view,
            frames=scene.frames + 1,
        )

    def _course(self, s: Array, P: Array, seen: Bearings, dip: float) -> float:
        """The course and the tilt error follow the vanishing point; returns by how much the axes have turned [rad].

        The point lies best along the borders' own direction, which is neither heading nor rise: the two are estimated
        together, with the horizon's say on the tilt, as far as the scale of its dip is known.
        """
        c, pair = self.config, np.ix_((sc.COURSE, sc.ETILT), (sc.COURSE, sc.ETILT))
        C, off = P[pair], np.zeros(2)
        if seen.pitched is not None:
            gain = C[:, 1] / (C[1, 1] + c.images * (dip**2 + c.bearing_floor**2))
            off = gain * seen.pitched
            C = C - np.outer(gain, C[1])
        if seen.turned is not None:
            z, R = seen.turned
            R = c.images * (R + c.bearing_floor**2 * np.eye(2))
            gain2 = C @ np.linalg.inv(C + R)
            off = off + gain2 @ (z - off)
            C = C - gain2 @ C
        P[pair] = 0.5 * (C + C.T)
        s[[sc.COURSE, sc.ETILT]] += off
        return float(off[0])

    def _range(
        self, ahead: Array, width: float, y: Array, var: Array, v_R: Array, spread: float, dt: float, since: float = 0.0
    ) -> tuple[Array, float, tuple[float, float, float], float]:
        """Way to the threshold (3,), width, d and spread after one correction."""
        c = self.config
        omega = c.bandwidth * (c.later + (1.0 - c.later) * math.exp(-since / c.hurry))
        rho = 1.0 / max(float(ahead[0]), c.least_range)
        was = np.array([ahead[1] * rho, ahead[2] * rho, width * rho])
        d = np.array([v_R[0] * was[0] - v_R[1], v_R[0] * was[1] - v_R[2], v_R[0] * was[2]])
        var = var + self._common
        weights = faded(self._use * float(np.min(var)) / var, d, self._floors)
        e = y - was
        # poles: the range's twice for the width, the range's and the bearings' for these
        l1, l2 = pole_pair(1.0, omega, dt)
        fast, slow = 1.0 - math.exp(-c.bearing_rate * dt), 1.0 - math.exp(-omega * dt)
        share = np.array([fast / slow, fast / slow, 1.0])
        got = correct(was, rho, e * share, d, weights, (l1, l2), c.eps, c.limit)
        below = got.observed**2 + c.eps**2
        noise = l2 * math.sqrt(float(np.sum((weights * d * share) ** 2 * var))) / (below * rho)
        spread = math.hypot(spread * (1.0 - got.observed**2 / below * 0.5 * omega * dt), noise)
        X = max(1.0 / got.rho, c.least_range)
        bearing = was[:2] + fast * e[:2]
        return np.array([X, *(bearing * X)]), float(got.z[2] * X), (float(d[0]), float(d[1]), float(d[2])), spread

    def _borders(self, ahead: Array, width: float, k: Array, var: Array, dt: float) -> Array:
        """Height and offset from the borders, whose distance is known by now."""
        gain = 1.0 - math.exp(-self.config.bearing_rate * dt)
        Z = width / (k[1] - k[0])
        sigma = Z * math.sqrt(var[0] + var[1]) / (k[1] - k[0])
        if abs(Z - ahead[2]) > 2.0 + 4.0 * sigma + 0.2 * Z:
            return ahead
        Y = 0.5 * (k[0] + k[1]) * Z
        return np.array([ahead[0], ahead[1] + gain * (Y - ahead[1]), ahead[2] + gain * (Z - ahead[2])])

    def _cover(self, s: Array, P: Array, spread: float) -> None:
        """Covariance of place and width: one scale, and what bearings leave."""
        length = np.array([s[sc.X], s[sc.Y], s[sc.H], s[sc.WIDTH]])
        free = 1e-3 * max(abs(s[sc.X]), 50.0)
        rows = [sc.X, sc.Y, sc.H, sc.WIDTH]
        P[np.ix_(rows, rows)] = spread**2 * np.outer(length, length) + np.diag(
            [(10.0 * free) ** 2, free**2, free**2, 0.0]
        )


def _turned(v: Array, angle: float) -> Array:
    """(2,) in axes turned by `angle` to the right."""
    c, w = math.cos(angle), math.sin(angle)
    return np.array([c * v[0] + w * v[1], c * v[1] - w * v[0]])


def _bearings_turned(y: Array, angle: float) -> Array:
    """y1, y2, s in axes turned by `angle` to the right."""
    c, w = math.cos(angle), math.sin(angle)
    ahead = c + y[0] * w
    return np.array([(y[0] * c - w) / ahead, y[1] / ahead, y[2] / ahead**2])
