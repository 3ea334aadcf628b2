"""Where to land: a raised level plane among the features that the localisation tracks anyway. No markers, no pixels.

Two views of the same features and where they were taken from: a homography of the ground, further ones of what is left,
each plane aligned with both views. A plane's patch becomes a way point if it is raised, level, large enough, clear and
wholly in view; way points are pooled, and a pool of enough that agree is a landing place.

Source     Brockers et al. 2012, section 3.4.
           Departs: several planes are looked for besides the ground, and several places pooled apart. Whether one is too
           low, small or tilted is asked of its pool's mean, so that noise does not lift a low step over the limit. A
           rectangle goes round all features that were found on its place so far, and reaches half way to the ground seen
           beside it: a place half in the map, or half in view, would else look like a smaller one. Once it has been
           wholly in view, views of a part of it count too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.noise import NoiseStream
from landing_sim.types import Array
from landing_sim.vision.landing_place_planes import Plane, aligned, aligned_along, homography, misalignment, plane_of
from landing_sim.vision.landing_place_pool import Limits, Pool, Refusal, WayPoint, outside
from landing_sim.vision.landing_place_top import (
    Rectangle,
    foreign,
    gaps,
    halfway,
    in_view,
    on_level,
    patches,
    rectangle,
    uncertainty,
)
from landing_sim.vision.landing_place_views import Pair, View, Views


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """Lengths in m, angles in rad; `near` and `far` in heights above the ground.

    near, far : baseline of a pair; age [s] of the older view
    shared : features that a pair must have in common; least : of them on a plane; enough : on a place, each found twice
    tolerance : between where a feature is and where its plane puts it
    tries : random samples a plane; planes : looked for besides the ground
    ground_share : the ground is the lowest plane with that share of the features of the one with the most
    level : how far the ground may seem tilted
    link : a wider gap splits what lies on one plane
    border : [px] the image's edge that no feature is looked for in
    shrink : of the rectangle within which no more than `foreign` features, or that share of its own, may be off its plane
    nth : of the ground features beside a side, from the nearest, that tells where the place ends at the latest
    doubt : share by which one way point may break the limits of a pool's mean
    same, same_height : a patch whose middle and height are that near to a pool's belongs to it
    """

    near: float = 0.14
    far: float = 0.6
    age: float = 8.0
    shared: int = 40
    least: int = 6
    enough: int = 14
    tolerance: float = 0.006
    tries: int = 128
    planes: int = 4
    ground_share: float = 0.25
    level: float = math.radians(6.0)
    link: float = 0.22
    border: float = 8.0
    shrink: float = 0.04
    foreign: int = 3
    foreign_share: float = 0.08
    nth: int = 3
    doubt: float = 0.4
    same: float = 0.35
    same_height: float = 0.04
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class Candidate:
    """A patch that is not ground: its way point, and why it was not pooled, if it was not."""

    point: WayPoint
    refusal: Refusal | None


@dataclass(frozen=True, slots=True)
class Look:
    """What one look brought.

    candidates : patches above the ground, largest first; refusal : why there are none
    place : the mean way point of a pool that has settled, the same as before while it is settled; None while none is
    pools : of each place seen, the middle (3,) [m] of its features and why it is no landing place, None if it is one
    """

    t: float
    candidates: tuple[Candidate, ...]
    refusal: Refusal | None
    place: WayPoint | None
    pools: tuple[tuple[Array, Refusal | None], ...]


class LandingPlaceDetector:
    """Remembers views and pools.

    Parameters
    ----------
    lens : the believed one
    noise : stream of the random samples
    """

    def __init__(self, lens: Fisheye, noise: NoiseStream, settings: DetectorSettings | None = None) -> None:
        self.lens, self._noise = lens, noise
        self.settings = settings or DetectorSettings()
        self._views = Views(self.settings.age)
        self.pools: list[Pool] = []
        self._chosen: Pool | None = None  # once a place is found, it is that one as long as it is fit

    def look(self, t: float, ids: np.ndarray, rays_C: Array, p_RC: Array, R_CR: Array) -> Look:
        """The features of a frame taken at t [s] from p_RC (3,) [m] with the attitude R_CR (3, 3), metric.

        ids (n,) name the features across frames; rays_C (n, 3) unit. Raises ValueError unless these go together.
        """
        if len(ids) != len(rays_C) or rays_C.shape[1:] != (3,):
            raise ValueError(f"landing place: {len(ids)} features need as many rays (3,), got {rays_C.shape}")
        s = self.settings
        order = np.argsort(ids, kind="stable")
        now = View(t, ids[order], rays_C[order] @ R_CR, np.array(p_RC), np.array(R_CR))
        height = max(0.1, -float(p_RC[2]))
        pair = self._views.pair(now, s.near * height, s.far * height, s.shared)
        self._views.keep(now, 0.02 * height)
        if pair is None:
            return self._look(t, (), Refusal.NO_PAIR)
        candidates, refusal = self._candidates(pair)
        return self._look(t, candidates, refusal)

    def _look(self, t: float, candidates: tuple[Candidate, ...], refusal: Refusal | None) -> Look:
        pools = tuple((pool.middle, pool.refusal(self.settings.limits)) for pool in self.pools)
        settled = [pool for pool, (_, why) in zip(self.pools, pools) if why is None]
        if self._chosen not in settled:
            self._chosen = max(settled, key=lambda pool: len(pool.points)) if settled else None
        return Look(t, candidates, refusal, self._chosen.summary() if self._chosen else None, pools)

    def _candidates(self, pair: Pair) -> tuple[tuple[Candidate, ...], Refusal | None]:
        s = self.settings
        planes = self._planes(pair)
        if not planes:
            return (), Refusal.NO_GROUND
        most = max(int(plane.members.sum()) for plane in planes)
        wide = [plane for plane in planes if plane.members.sum() >= s.ground_share * most]
        ground = max(wide, key=lambda plane: plane.distance)
        if ground.tilt > s.level:
            return (), Refusal.GROUND_TILTED
        found = [c for plane in planes if plane is not ground for c in self._tops(pair, ground, plane)]
        found.sort(key=lambda c: -c.point.features)
        return tuple(found), None if found else Refusal.NOTHING_ELSE

    def _planes(self, pair: Pair) -> list[Plane]:
        """The planes of a pair, that of the most features first."""
        s, t = self.settings, pair.t
        left = np.ones(len(pair.a), bool)
        planes: list[Plane] = []
        for k in range(1 + s.planes):
            at = np.flatnonzero(left)
            if len(at) < s.least:
                break
            found = homography(pair.a[at], pair.b[at], s.tolerance, s.tries, self._noise, local=k > 0)
            if found is None or found[1].sum() < s.least:
                break
            v, inside = plane_of(found[0], t), at[found[1]]
            for _ in range(2):  # all that lie on the plane, as the movement allows it, align it again
                v = aligned(v, pair.a[inside], pair.b[inside], t, s.tolerance)
                off = misalignment(v, pair.a[at], pair.b[at], t)
                inside = at[off < s.tolerance]
            if len(inside) < s.least:
                break
            members = np.zeros(len(left), bool)
            members[inside] = True
            planes.append(Plane(v, members, float(np.sqrt(np.mean(off[off < s.tolerance] ** 2)))))
            left &= ~members
        return planes

    def _tops(self, pair: Pair, ground: Plane, plane: Plane) -> list[Candidate]:
        """Candidates among the patches of one plane."""
        s = self.settings
        at = np.flatnonzero(plane.members)
        a, b = pair.a[at], pair.b[at]
        inverse = aligned_along(ground.normal, float(plane.v @ ground.normal), a, b, pair.t, 2.0 * s.tolerance)
        if inverse <= 0.0:
            return []
        X = pair.first.p + a / (inverse * (a @ ground.normal))[:, None]
        height = ground.distance - 1.0 / inverse
        out = []
        for patch in patches(X[:, :2], s.link):
            if len(patch) < s.least:
                break
            out.append(self._candidate(pair, ground, plane, at[patch], X[patch], height))
        return out

    def _candidate(self, pair: Pair, ground: Plane, plane: Plane, at: np.ndarray, X: Array, height: float) -> Candidate:
        """A patch of features `at`, at X (n, 3) [m], among what is known of its place."""
        s = self.settings
        wide = s.limits.widened(s.doubt)
        if plane.tilt > wide.tilt or not wide.lowest <= height <= wide.highest:
            top = rectangle(X)
            point = _way_point(pair, plane, top, height, len(at))
            return Candidate(point, outside(height, *point.size, plane.tilt, wide))
        pool = self._pool_of(X.mean(axis=0), height)
        pool.collect(pair.ids[at], X)
        known = pool.known(2)
        inner = rectangle(known if len(known) >= s.enough else X)
        for view, rays in ((pair.first, pair.a), (pair.second, pair.b)):
            seen = on_level(rays[ground.members], view.p, inner.z)
            pool.around.append(seen[np.max(abs(seen - inner.centre), axis=1) < s.limits.largest])
        pool.notice(pair.ids[foreign(inner, pair, plane.members, s.shrink)])
        gap = gaps(inner, np.concatenate(pool.around), s.nth)
        bounded = uncertainty(gap) < s.limits.spread
        top = halfway(inner, gap) if bounded else inner
        pool.whole |= in_view(top, pair.second, self.lens, s.border)
        point = _way_point(pair, plane, top, height, len(known))
        refusal = self._refusal(pool, plane, point, bounded)
        if refusal is None:
            pool.add(point)
        return Candidate(point, refusal)

    def _pool_of(self, middle: Array, height: float) -> Pool:
        """The pool of the place that a patch belongs to, a new one if there is none."""
        s = self.settings
        for pool in self.pools:
            near = float(np.hypot(*(pool.middle - middle)[:2])) < s.same
            if near and abs(pool.level - height) < s.same_height:
                return pool
        self.pools.append(Pool(height))
        return self.pools[-1]

    def _refusal(self, pool: Pool, plane: Plane, point: WayPoint, bounded: bool) -> Refusal | None:
        """Why one way point is not pooled."""
        s = self.settings
        if point.features < s.enough:
            return Refusal.TOO_FEW
        unfit = outside(point.height, *point.size, plane.tilt, s.limits.widened(s.doubt))
        if unfit is not None:
            return unfit
        if not pool.whole:
            return Refusal.NOT_IN_VIEW
        if pool.strangers > max(s.foreign, s.foreign_share * point.features):
            return Refusal.CLUTTER
        return None if bounded else Refusal.NOT_SURROUNDED


def _way_point(pair: Pair, plane: Plane, top: Rectangle, height: float, features: int) -> WayPoint:
    shorter, longer = sorted((2.0 * top.half).tolist())
    return WayPoint(pair.second.t, np.array([*top.centre, top.z]), height, (longer, shorter), plane.normal, features)
