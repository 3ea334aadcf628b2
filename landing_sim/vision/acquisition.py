"""Cold start: one whole image into a pose, with no prior but that the runway is in view.

    1 horizon line        -> which way is down, up to its dip
    2 two borders with a common vanishing point on the level -> heading; the believed width -> height and lateral place
    3 threshold across the strips free of paint -> range
    4 many windows along what has been found, Gauss-Newton on all six -> pose and covariance

Source     own; the accuracy aimed at is that of a trial implementation (range 0.5 %, height 0.3 %, lateral 0.3 m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import camera_from_body, from_euler, to_euler, wrap
from landing_sim.signals import CameraSample, Feature, Status
from landing_sim.types import Array
from landing_sim.vision.believed import BelievedCamera, RunwayMap
from landing_sim.vision.hough import borders, depth_profile, edge_points, horizon_line
from landing_sim.vision.windows import EdgeConfig, SearchConfig, WindowPlanner


@dataclass(frozen=True, slots=True)
class AcquisitionConfig:
    """Limits of what is searched, and when a result is believed.

    edge_snr of an edge point; max_roll, max_heading [rad] of the camera against the horizon and of the runway against the
    optical axis; heights [m] of the camera above the runway; horizon_share of the image's width that it must span;
    min_points of each border, geometric mean; max_residual: rms of the final residuals over their standard deviations.
    """

    edge_snr: float = 4.5
    max_roll: float = math.radians(30.0)
    max_heading: float = math.radians(28.0)
    min_height: float = 1.5
    max_height: float = 300.0
    horizon_share: float = 0.5
    min_points: float = 12.0
    max_residual: float = 4.0


@dataclass(frozen=True, slots=True)
class Acquired:
    """z (6,) x, y, H [m] of the cg, phi, theta, psi [rad]; R (6, 6) its covariance; None with a reason if not found."""

    z: Array | None
    R: Array | None
    reason: str = ""


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
        # wide first, then just wide enough for what is left
        self._planners = [
            WindowPlanner(runway, camera, SearchConfig(search_min=s, search_max=s), edges) for s in (12, 6, 4)
        ]

    def acquire(self, sample: CameraSample, pan: float, tilt: float) -> Acquired:
        """The cg's pose from one image and the platform angles [rad] that are believed."""
        image, c = sample.frame.full(), self._config
        points = edge_points(image, self._camera.noise, c.edge_snr)
        found, a, b = horizon_line(points, image.shape[1], image.shape[0], c.max_roll, c.horizon_share)
        if not found:
            return Acquired(None, None, "no horizon in view")
        below = points[points[:, 1] > a + b * points[:, 0] + 2.0]
        R_CB = camera_from_body(pan, tilt)
        pose, reason = self._coarse(image, below, a, b, R_CB)
        if pose is None:
            return Acquired(None, None, reason)
        return self._fine(sample, pose, pan, tilt)

    def _coarse(self, image: np.ndarray, below: Array, a: float, b: float, R_CB: Array) -> tuple[Array | None, str]:
        c, width, slope = self._config, self._runway.width, self._runway.slope
        polarity = 1.0 if self._runway.brighter else -1.0
        step, height = 1.5 / self._lens[0], 30.0  # the height only bends the first horizon, by 3 mrad
        headings = np.arange(-c.max_heading, c.max_heading, step)
        for _ in range(2):
            R_LC = level_from_horizon(a, b, self._lens, horizon_dip(height))
            score, heading, k_left, k_right = borders(
                below, R_LC, self._lens, slope, polarity, headings, width / c.max_height, width / c.min_height
            )
            if score < c.min_points:
                return None, f"no pair of borderlines: {score:.0f} edge points at best, {c.min_points:.0f} wanted"
            height = width / (k_right - k_left)
            headings = heading + np.arange(-0.03, 0.03, 0.5 * step)
        y = -0.5 * (k_left + k_right) * height

        ca, sa, cs, ss = math.cos(heading), math.sin(heading), math.cos(slope), math.sin(slope)
        R_RC = np.array([[ca, sa, 0.0], [-sa, ca, 0.0], [0.0, 0.0, 1.0]]) @ R_LC
        R_DR = np.array([[cs, 0.0, -ss], [0.0, 1.0, 0.0], [ss, 0.0, cs]])  # along, right, down normal to the runway
        distance = self._threshold(image, R_RC.T @ R_DR.T, height, y, polarity)
        if distance is None:
            return None, "borderlines found, but no threshold between them"
        x, H = -(distance * cs + height * ss), height * cs - distance * ss
        R_RB = R_RC @ R_CB
        p_RB = np.array([x, y, -H]) - R_RB @ np.array(self._camera.p_BC)
        return np.array([p_RB[0], p_RB[1], -p_RB[2], *to_euler(R_RB)]), ""

    def _threshold(self, image: np.ndarray, R_CD: Array, height: float, y: float, polarity: float) -> float | None:
        """Distance [m] ahead of the camera along the runway at which the strips free of paint begin."""
        strips = self._runway.clean_strips()
        offsets = np.concatenate([s[0] + (s[1] - s[0]) * np.array([0.35, 0.5, 0.65]) for s in strips]) - y
        scale = height * self._lens[0]  # pixels below the horizon, times metres
        nearest = 1.0 / max(10.0, 2.0 * height)
        g = depth_profile(image, R_CD, self._lens, height, offsets, nearest, int(scale * nearest))
        if len(g) < 9:
            return None
        response = np.full(len(g), -np.inf)
        mask = polarity * np.array([-1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0]) / 3.0
        response[3:-3] = np.correlate(g, mask)
        response[np.isnan(response)] = -np.inf
        k = int(np.argmax(response))
        noise = self._camera.noise * math.sqrt(2.0 / 3.0 / len(offsets))
        if not response[k] > max(4.0, 5.0 * noise) or nearest * scale - k <= 0.0:
            return None
        return 1.0 / (nearest - k / scale)

    def _fine(self, sample: CameraSample, pose: Array, pan: float, tilt: float) -> Acquired:
        """Gauss-Newton with Huber weights on windows placed along the predicted lines, search narrowing."""
        cov, nothing = np.zeros((6, 6)), np.empty(0)
        r, J = nothing, nothing
        for planner in (*self._planners, self._planners[-1]):
            w = planner.place(pose, cov, pan, tilt, self._counts)
            z, variance, _, status = planner.measure(sample.frame, w)
            ok = status == Status.FOUND
            feature = w.feature[ok]
            for name, least in ((Feature.LEFT, 3), (Feature.RIGHT, 3), (Feature.THRESHOLD, 1), (Feature.HORIZON, 2)):
                if np.count_nonzero(feature == name) < least:
                    return Acquired(None, None, f"too few windows found on the {name.name.lower()} edge")
            centre, direction = w.centre[ok], w.direction[ok]
            sigma = np.sqrt(variance[ok])
            for _ in range(3):
                h, J = planner.predict(feature, centre, direction, pose, pan, tilt)
                r, J = (z[ok] - h) / sigma, J / sigma[:, None]
                limit = 2.0 * max(1.0, float(np.median(np.abs(r))))
                weight = np.minimum(1.0, limit / np.maximum(np.abs(r), 1e-9))
                try:
                    pose = pose + np.linalg.solve(J.T @ (weight[:, None] * J), J.T @ (weight * r))
                except np.linalg.LinAlgError:
                    return Acquired(None, None, "edges found do not determine a pose")
            pose[3:] = [wrap(angle) for angle in pose[3:]]
            if not np.all(np.isfinite(pose)) or pose[2] < 0.0 or pose[2] > 2.0 * self._config.max_height:
                return Acquired(None, None, "the fit left the runway")
        h, _ = planner.predict(feature, centre, direction, pose, pan, tilt)
        r = (z[ok] - h) / sigma
        spread = float(np.sqrt(np.mean(np.minimum(r * r, 25.0))))
        if spread > self._config.max_residual:
            return Acquired(None, None, f"edges do not fit a runway: residuals {spread:.1f} sigma")
        R = np.linalg.inv(J.T @ J) * max(1.0, spread) ** 2 + self._encoder_covariance(pose, pan, tilt)
        return Acquired(pose, 0.5 * (R + R.T))

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
