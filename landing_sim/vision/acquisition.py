"""Cold start: one whole image into a pose, with no prior but that the runway is in view.

    1 horizon line        -> which way is down, up to its dip
    2 two borders with a common vanishing point on the level -> heading; the believed width -> height and lateral place
    3 threshold across the strips free of paint -> range
    4 many windows along what has been found, Gauss-Newton on all six -> pose and covariance

Source     own; the accuracy aimed at is that of a trial implementation (range 0.5 %, height 0.3 %, lateral 0.3 m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import camera_from_body, from_euler, to_euler, wrap
from landing_sim.signals import CameraSample, Feature, Status
from landing_sim.types import Array
from landing_sim.vision.believed import BelievedCamera, RunwayMap
from landing_sim.vision.hough import borders, depth_profile, edge_points, horizon_line
from landing_sim.vision.layout import INNER, OUTER
from landing_sim.vision.prediction import camera_pose
from landing_sim.vision.threshold import clean_strips, in_metres
from landing_sim.vision.windows import EdgeConfig, SearchConfig, WindowPlanner

_PROFILE_BIAS = 0.3  # [px] of the threshold in the mean of many lines: paint beside the strips


@dataclass(frozen=True, slots=True)
class AcquisitionConfig:
    """Limits of what is searched, and when a result is believed.

    edge_snr of an edge point; max_roll, max_heading [rad] of the camera against the horizon and of the runway against the
    optical axis; heights and range [m] of the camera over and from the threshold; horizon_share of the image's width that
    it must span; min_points of each border, geometric mean; min_depth_spread: standard deviation over mean of its
    points' depths below the horizon; max_side: distance of a border to the side of the camera over the height;
    max_residual: rms of the final residuals over their standard deviations; max_contrast_ratio between the runway's three
    edges; hypotheses: pairs of borderlines tried, best first.
    """

    edge_snr: float = 4.5
    max_roll: float = math.radians(30.0)
    max_heading: float = math.radians(28.0)
    min_height: float = 1.5
    max_height: float = 500.0
    max_range: float = 10000.0
    horizon_share: float = 0.5
    min_points: float = 12.0
    min_depth_spread: float = 0.11
    max_side: float = 7.5
    max_residual: float = 4.0
    max_contrast_ratio: float = 2.2
    hypotheses: int = 16


@dataclass(frozen=True, slots=True)
class Acquired:
    """z (6,) x, y, H [m] of the cg, phi, theta, psi [rad]; R (6, 6) its covariance; None with a reason if not found."""

    z: Array | None
    R: Array | None
    reason: str = ""


class _Seen(NamedTuple):
    """The edges found in one image, (n,) or (n, 2)."""

    feature: np.ndarray
    centre: Array
    direction: Array
    z: Array
    variance: Array
    contrast: Array


class Acquisition:
    """Finds the runway in whole images: the believed runway and camera, made ready once."""

    __slots__ = ("_camera", "_config", "_counts", "_lens", "_planners", "_runway")

    def __init__(
        self,
        runway: RunwayMap,
        camera: BelievedCamera,
        config: AcquisitionConfig | None = None,
        edges: EdgeConfig | None = None,
    ) -> None:
        self._runway, self._camera, self._config = runway, camera, config or AcquisitionConfig()
        k = camera.intrinsics
        self._lens: Array = np.array([k.f, k.cx, k.cy], dtype=float)
        self._counts = np.array([16, 16, 9, 16], dtype=np.int64)
        # weak edges are welcome where there are many of them; wide first, then just wide enough for what is left
        edges = replace(edges or EdgeConfig(), min_snr=3.0)
        self._planners = [
            WindowPlanner(runway, camera, SearchConfig(search_min=s, search_max=s, clear_of_paint=0.0), edges)
            for s in (12, 6, 4)
        ]

    def acquire(self, sample: CameraSample, pan: float, tilt: float) -> Acquired:
        """The cg's pose from one image and the platform angles [rad] that are believed."""
        image, c = sample.frame.full(), self._config
        points = edge_points(image, self._camera.noise, c.edge_snr)
        found, a, b = horizon_line(points, image.shape[1], image.shape[0], c.max_roll, c.horizon_share)
        if not found:
            return Acquired(None, None, "no horizon in view")
        below = points[points[:, 1] > a + b * points[:, 0] + 2.0]
        tried, reason = np.empty((0, 3)), ""
        for _ in range(c.hypotheses):
            pair = self._borders(below, a, b, tried)
            if pair is None:
                break
            tried = np.vstack([tried, pair[1:4]])
            got = self._from_pair(sample, pair, pan, tilt)
            if got.z is not None:
                return got
            reason = reason or got.reason  # the best pair's
        return Acquired(None, None, reason or "no pair of borderlines")

    def _borders(self, below: Array, a: float, b: float, tried: Array) -> tuple[Array, float, float, float] | None:
        """R_LC, heading, K_left, K_right of the best pair of borderlines not yet tried; see `borders`."""
        c, width = self._config, self._runway.width
        polarity = 1.0 if self._runway.brighter else -1.0
        limits = np.array([width / c.max_height, width / c.min_height, c.max_side, c.min_depth_spread])
        step, height = 2.0 / self._lens[0], 30.0  # the height only bends the first horizon, by 3 mrad
        headings = np.arange(-c.max_heading, c.max_heading, step)
        for _ in range(2):
            R_LC = level_from_horizon(a, b, self._lens, horizon_dip(height))
            score, heading, k_left, k_right = borders(
                below, R_LC, self._lens, self._runway.slope, polarity, headings, limits, tried
            )
            if score < c.min_points:
                return None
            height = width / (k_right - k_left)
            headings = heading + np.arange(-0.03, 0.03, 0.25 * step)
        return R_LC, heading, k_left, k_right

    def _from_pair(
        self, sample: CameraSample, pair: tuple[Array, float, float, float], pan: float, tilt: float
    ) -> Acquired:
        R_LC, heading, k_left, k_right = pair
        height = self._runway.width / (k_right - k_left)
        y = -0.5 * (k_left + k_right) * height
        ca, sa, slope = math.cos(heading), math.sin(heading), self._runway.slope
        R_RC = np.array([[ca, sa, 0.0], [-sa, ca, 0.0], [0.0, 0.0, 1.0]]) @ R_LC
        found = self._threshold(sample.frame.full(), R_RC, height, y)
        if found is None:
            return Acquired(None, None, "borderlines found, but no threshold between them")
        distance = found[0]
        x = -(distance * math.cos(slope) + height * math.sin(slope))
        z = distance * math.sin(slope) - height * math.cos(slope)
        R_RB = R_RC @ camera_from_body(pan, tilt)
        p_RB = np.array([x, y, z]) - R_RB @ np.array(self._camera.p_BC)
        return self._fine(sample, np.array([p_RB[0], p_RB[1], -p_RB[2], *to_euler(R_RB)]), pan, tilt)

    def _threshold(
        self, image: np.ndarray, R_RC: Array, height: float, y: float
    ) -> tuple[float, Array, float, float] | None:
        """Where the strips free of paint begin, seen from `height` [m] above the runway's surface, y [m] off its middle.

        Returns the distance [m] ahead of the camera along the runway, the threshold centre's pixel (2,), the variance
        [px^2] of its place along the runway's image, and its contrast [grey levels]; None if there is no such edge.
        """
        slope, f = self._runway.slope, self._lens[0]
        cs, ss = math.cos(slope), math.sin(slope)
        R_CD = R_RC.T @ np.array([[cs, 0.0, ss], [0.0, 1.0, 0.0], [-ss, 0.0, cs]])  # D: along, right, down normal
        row = in_metres(self._runway.row(), self._runway.width)
        strips = clean_strips(self._runway.width, row[OUTER], row[INNER])
        # clear of the stripes, and of the centre line in the middle one
        offsets = np.concatenate([s[0] + (s[1] - s[0]) * np.array([0.25, 0.35, 0.65, 0.75]) for s in strips]) - y
        scale = height * f  # pixels below the horizon, times metres
        nearest = 1.0 / max(10.0, 2.0 * height)
        below = horizon_dip(height) + 8.0 / f + max(0.0, ss)  # of the runway's direction, to be below the horizon
        farthest = max(1.0 / self._config.max_range, below / height)
        g = depth_profile(image, R_CD, self._lens, height, offsets, nearest, int(scale * (nearest - farthest)))
        if len(g) < 12:
            return None
        mask = np.array([-1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0]) / 3.0
        response = np.full(len(g), -np.inf)
        response[3:-3] = np.correlate(g, mask) * (1.0 if self._runway.brighter else -1.0)
        response[np.isnan(response)] = -np.inf
        k = int(np.argmax(response[1:-1])) + 1
        less, peak, more = response[k - 1 : k + 2]
        independent = 0.6 * len(offsets)  # neighbouring lines share pixels
        noise = self._camera.noise / math.sqrt(independent)
        if not (peak > max(3.0, 2.8 * noise * math.sqrt(2.0 / 3.0)) and np.isfinite(less + more)):
            return None
        # open ground in front of the threshold, and on either side of what lies behind it
        rho = nearest - k / scale
        end = min(len(g), max(k + 8, int(scale * (nearest - rho / (1.0 + rho * self._runway.length))) - 4))
        for side in (-1.0, 1.0):
            lines = side * np.array([0.65, 0.75]) * self._runway.width - y
            rise = g[:end] - depth_profile(image, R_CD, self._lens, height, lines, nearest, end)
            before, behind = rise[max(0, k - 40) : max(0, k - 4)], rise[k + 4 :]
            before, behind = before[np.isfinite(before)], behind[np.isfinite(behind)]
            if len(before) and abs(np.mean(before)) > 0.5 * peak:
                return None
            # all the way to its far end: a painted block has edges like a runway's, but is shorter for its width
            parts = np.array_split(behind, max(1, min(4, len(behind) // 8)))
            if any(len(part) and abs(np.mean(part)) < 0.4 * peak for part in parts):
                return None
        rho = nearest - (k + 0.5 * (more - less) / (2.0 * peak - more - less)) / scale
        ray = R_CD @ np.array([1.0, -rho * y, rho * height])
        uv = self._lens[1:] + f * ray[:2] / ray[2]
        return 1.0 / rho, uv, 3.5 * (noise / peak) ** 2 + _PROFILE_BIAS**2, peak

    def _fine(self, sample: CameraSample, pose: Array, pan: float, tilt: float) -> Acquired:
        """Gauss-Newton with Huber weights on windows placed along the predicted lines, search narrowing."""
        platform = np.array([pan, tilt, self._runway.width])
        cov, nothing = np.zeros((9, 9)), np.empty(0)
        r, J = nothing, nothing
        for planner in (*self._planners, self._planners[-1]):
            w = planner.place(np.concatenate([pose, platform]), cov, self._counts)
            z, variance, contrast, status = planner.measure(sample.frame, w)
            weak = contrast < 3.7 * self._camera.noise / np.sqrt(2.0 * w.half + 1.0)  # 4.5 sigma
            ok = (status == Status.FOUND) & ~(weak & (w.feature == Feature.THRESHOLD))
            seen = _Seen(w.feature[ok], w.centre[ok], w.direction[ok], z[ok], variance[ok], contrast[ok])
            if not np.any(seen.feature == Feature.THRESHOLD):
                seen = self._with_threshold(sample, seen, np.concatenate([pose, platform]))
            for name in Feature:
                if np.count_nonzero(seen.feature == name) < (1 if name == Feature.THRESHOLD else 2):
                    return Acquired(None, None, f"too few windows found on the {name.name.lower()} edge")
            sigma = np.sqrt(seen.variance)
            for _ in range(3):
                h, J = planner.predict(seen.feature, seen.centre, seen.direction, np.concatenate([pose, platform]))
                r, J = (seen.z - h) / sigma, J[:, :6] / sigma[:, None]
                limit = 2.0 * max(1.0, float(np.median(np.abs(r))))
                weight = np.minimum(1.0, limit / np.maximum(np.abs(r), 1e-9))
                try:
                    pose = pose + np.linalg.solve(J.T @ (weight[:, None] * J), J.T @ (weight * r))
                except np.linalg.LinAlgError:
                    return Acquired(None, None, "edges found do not determine a pose")
            pose[3:] = [wrap(angle) for angle in pose[3:]]
            if not np.all(np.isfinite(pose)) or pose[2] < 0.0 or pose[2] > 2.0 * self._config.max_height:
                return Acquired(None, None, "the fit left the runway")
        # the same two materials meet at all three edges of the runway; paint taken for one of them shows here
        left, right, near = (
            float(np.median(seen.contrast[seen.feature == f])) for f in (Feature.LEFT, Feature.RIGHT, Feature.THRESHOLD)
        )
        if max(left, right, near) > self._config.max_contrast_ratio * min(left, right, near):
            return Acquired(None, None, f"edges of different contrast: {left:.0f}, {right:.0f}, threshold {near:.0f}")
        h, _ = planner.predict(seen.feature, seen.centre, seen.direction, np.concatenate([pose, platform]))
        r = (seen.z - h) / sigma
        spread = float(np.sqrt(np.mean(np.minimum(r * r, 25.0))))
        if spread > self._config.max_residual:
            return Acquired(None, None, f"edges do not fit a runway: residuals {spread:.1f} sigma")
        R = np.linalg.inv(J.T @ J) * max(1.0, spread) ** 2 + self._encoder_covariance(pose, pan, tilt)
        return Acquired(pose, 0.5 * (R + R.T))

    def _with_threshold(self, sample: CameraSample, seen: _Seen, sight: Array) -> _Seen:
        """Where the threshold is too faint for single windows: its place in the mean of all clean strips instead."""
        p_RC, R_CR = camera_pose(sight, np.array(self._camera.p_BC))
        slope = self._runway.slope
        height = -p_RC[2] * math.cos(slope) - p_RC[0] * math.sin(slope)
        found = self._threshold(sample.frame.full(), R_CR.T, height, p_RC[1])
        if found is None:
            return seen
        _, uv, variance, contrast = found
        along = self._lens[0] * R_CR[:2, 0] - (uv - self._lens[1:]) * R_CR[2, 0]  # image of the runway's direction
        return _Seen(
            np.append(seen.feature, int(Feature.THRESHOLD)),
            np.vstack([seen.centre, uv]),
            np.vstack([seen.direction, along / np.linalg.norm(along)]),
            np.append(seen.z, 0.0),
            np.append(seen.variance, variance),
            np.append(seen.contrast, contrast),
        )

    def _encoder_covariance(self, pose: Array, pan: float, tilt: float) -> Array:
        """(6, 6): the image fixes the camera's attitude; the body's inherits the platform's error."""
        lever, R_RB = np.array(self._camera.p_BC), from_euler(pose[3], pose[4], pose[5])
        R_RC = R_RB @ camera_from_body(pan, tilt).T
        out, eps = np.zeros((6, 6)), 1e-4
        for d_pan, d_tilt in ((eps, 0.0), (0.0, eps)):
            turned = R_RC @ camera_from_body(pan + d_pan, tilt + d_tilt)
            d = np.empty(6)
            d[:3] = (R_RB - turned) @ lever
            d[2] = -d[2]
            d[3:] = [wrap(angle) for angle in to_euler(turned) - pose[3:]]
            d *= self._camera.encoder_sigma / eps
            out += np.outer(d, d)
        return out


def level_from_horizon(a: float, b: float, lens: Array, dip: float) -> Array:
    """R_LC of the frame whose z is down and whose x is the horizontal part of the optical axis.

    The horizon v = a + b u [px] is seen `dip` [rad] below the level; lens: f, cx, cy [px].
    """
    # plane of rays to the horizon: v - a - b u = 0 with u = cx + f x / z
    n = np.array([-b * lens[0], lens[0], lens[2] - a - b * lens[1]])
    n /= np.linalg.norm(n)
    ahead = np.array([0.0, 0.0, 1.0]) - n[2] * n
    ahead /= np.linalg.norm(ahead)
    down = math.cos(dip) * n + math.sin(dip) * ahead
    x = np.array([0.0, 0.0, 1.0]) - down[2] * down
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(down, x), down])
