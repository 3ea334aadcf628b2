"""What a user would write in an afternoon, on the same flight: cv2 on full frames, solvePnP, a textbook EKF in numpy.

Every frame is blurred and searched for edges (Canny) as a whole; edge pixels near the predicted sides of the runway give
four lines (twice: in a wide band, then in a narrow one), their intersections the runway's corners, solvePnP the camera's
pose, its Jacobian the pose's covariance. An EKF with a constant velocity, gyros for the attitude and their bias takes the
pose as its measurement, weighs it with that covariance and drops what is five sigma off. It is told the
runway's size, the camera, its place and the encoders' readings, and it starts from the pose that landing-sim acquired.
Tuned by hand on this very landing.

It is flown twice. Frames are part of what it must have for a landing, so it draws its own (`own_frames`), and what that
costs is its cost. Its accuracy is taken on our frames, which are drawn more exactly than that and cheaper.

What it cannot do: find the runway by itself; measure while one of the four sides is out of the picture, which ends it
where the threshold is lost (and with it the flare and the rollout); tell wind from drift; fly (nothing here gives the
airspeed, and it is fed with a flight that landing-sim flew); live with exits in a borderline, with a wrong width, or with
images that come late.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import cv2
import numpy as np

from bench_parts import own_frames, where
from bench_parts.flights import land
from landing_sim.record.judge import threshold_in_view
from landing_sim.record.log import FlightLog
from landing_sim.scenario import Scenario
from landing_sim.signals import CameraSample, Step
from landing_sim.vehicle import Vehicle

FROM = -900.0  # [m] where the comparison begins; it ends where the threshold is lost
COMPARED = {"range": "x", "height": "H", "lateral": "y"}
UP = (1.0, 1.0, -1.0)  # p in R as x, y, H
PARTS = "render", "vision", "predict", "update"
Array = np.ndarray


def rotation(phi: float, theta: float, psi: float) -> Array:
    """R_RB of 3-2-1 Euler angles."""
    cf, sf, ct, st, cp, sp = (f(a) for a in (phi, theta, psi) for f in (math.cos, math.sin))
    return np.array(
        [
            [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
            [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
            [-st, sf * ct, cf * ct],
        ]
    )


def angles(R: Array) -> Array:
    return np.array([math.atan2(R[2, 1], R[2, 2]), -math.asin(R[2, 0]), math.atan2(R[1, 0], R[0, 0])])


def mount(pan: float, tilt: float) -> Array:
    """R_CB of the platform."""
    ca, sa, ce, se = math.cos(pan), math.sin(pan), math.cos(tilt), math.sin(tilt)
    return np.array([[-sa, ca, 0.0], [se * ca, se * sa, ce], [ce * ca, ce * sa, -se]])


@dataclass
class Ekf:
    """x = p_RB (3), v_R (3), phi theta psi, gyro bias (3)."""

    x: Array
    P: Array = field(default_factory=lambda: np.diag(np.square([5, 2, 1, 3, 3, 1, *[0.005] * 3, *[0.002] * 3])))
    acceleration: float = 1.0  # [m/s^2 / sqrt(Hz)]
    drift: float = 0.002  # [rad / sqrt(s)] of the attitude
    gate: float = 5.0

    def predict(self, gyro: Array, dt: float) -> None:
        x, F = self.x, np.eye(12)
        phi, theta = x[6], x[7]
        w = gyro - x[9:]
        sf, cf, tt, ct = math.sin(phi), math.cos(phi), math.tan(theta), math.cos(theta)
        E = np.array([[1.0, sf * tt, cf * tt], [0.0, cf, -sf], [0.0, sf / ct, cf / ct]])
        F[:3, 3:6] = dt * np.eye(3)
        F[6, 6] += dt * (cf * tt * w[1] - sf * tt * w[2])
        F[6, 7] += dt * (sf * w[1] + cf * w[2]) / ct**2
        F[7, 6] += dt * (-sf * w[1] - cf * w[2])
        F[8, 6] += dt * (cf * w[1] - sf * w[2]) / ct
        F[8, 7] += dt * (sf * w[1] + cf * w[2]) * tt / ct
        F[6:9, 9:] = -dt * E
        x[:3] += dt * x[3:6]
        x[6:9] += dt * (E @ w)
        q = np.repeat([0.0, self.acceleration**2, self.drift**2, 0.0], 3)
        Q = np.diag(q * dt)
        Q[:3, :3] = self.acceleration**2 * dt**3 / 3.0 * np.eye(3)
        Q[:3, 3:6] = Q[3:6, :3] = self.acceleration**2 * dt**2 / 2.0 * np.eye(3)
        self.P = F @ self.P @ F.T + Q

    def update(self, z: Array, R: Array) -> None:
        seen = [0, 1, 2, 6, 7, 8]
        H = np.eye(12)[seen]
        nu = z - self.x[seen]
        S = H @ self.P @ H.T + R
        if nu @ np.linalg.solve(S, nu) > self.gate**2 * 6:
            return
        K = self.P @ H.T @ np.linalg.inv(S)
        self.x = self.x + K @ nu
        IKH = np.eye(12) - K @ H
        self.P = IKH @ self.P @ IKH.T + K @ R @ K.T


@dataclass
class Eye:
    """Pixels into a pose."""

    corners: Array  # (4, 3) [m] near left, near right, far right, far left in R
    K: Array
    lever: Array
    wide: float = 5.0  # [px]
    narrow: float = 1.0
    sigma: float = 0.15  # [px] of a corner

    def look(self, image: Array, x: Array, pan: float, tilt: float) -> tuple[Array, Array] | None:
        """z (6,) position and attitude of the aircraft with its covariance; None if not all four sides were found."""
        R_CB = mount(pan, tilt)
        R_RB = rotation(*x[6:9])
        R_CR = R_CB @ R_RB.T
        p_RC = x[:3] + R_RB @ self.lever
        rvec, tvec = cv2.Rodrigues(R_CR)[0], -R_CR @ p_RC
        if np.any((self.corners - p_RC) @ R_CR[2] < 1.0):
            return None
        height, width = image.shape
        smooth = cv2.GaussianBlur(image, (5, 5), 1.0)
        gx, gy = cv2.Sobel(smooth, cv2.CV_16S, 1, 0), cv2.Sobel(smooth, cv2.CV_16S, 0, 1)
        found = cv2.findNonZero(cv2.Canny(gx, gy, 60, 120))
        if found is None:
            return None
        points = found.reshape(-1, 2)
        slope = np.stack([gx, gy], axis=-1).astype(np.float32)
        corners = cv2.projectPoints(self.corners, rvec, tvec, self.K, None)[0].reshape(-1, 2)
        inside = (corners > 4.0) & (corners < np.array([width, height]) - 5.0)
        if not inside.all():
            return None
        for band in (self.wide, self.narrow):
            lines = [self._side(points, slope, corners, i, band) for i in range(4)]
            if any(line is None for line in lines):
                return None
            corners = np.array([self._cross(lines[i - 1], lines[i]) for i in range(4)])
        ok, rvec, tvec = cv2.solvePnP(self.corners, corners, self.K, None, rvec, tvec.reshape(3, 1), True)
        if not ok:
            return None
        J = cv2.projectPoints(self.corners, rvec, tvec, self.K, None)[1][:, :6]
        cov = self.sigma**2 * np.linalg.inv(J.T @ J)
        v = np.concatenate([rvec.ravel(), tvec.ravel()])
        z = self._pose(v, R_CB)
        G = np.empty((6, 6))
        for i, h in enumerate((1e-6,) * 3 + (1e-3,) * 3):
            e = np.zeros(6)
            e[i] = h
            G[:, i] = (self._pose(v + e, R_CB) - self._pose(v - e, R_CB)) / (2 * h)
        return z, G @ cov @ G.T

    def _pose(self, v: Array, R_CB: Array) -> Array:
        R_CR = cv2.Rodrigues(v[:3])[0]
        R_RB = R_CR.T @ R_CB
        return np.concatenate([-R_CR.T @ v[3:] - R_RB @ self.lever, angles(R_RB)])

    def _side(self, points: Array, slope: Array, corners: Array, i: int, band: float) -> Array | None:
        """A line (a, b, c) with a u + b v = c through the edge pixels that lie near side i and get brighter inwards."""
        a, b = corners[i], corners[(i + 1) % 4]
        length = float(np.linalg.norm(b - a))
        along = (b - a) / length
        inwards = np.array([-along[1], along[0]])
        inwards *= np.sign((corners[(i + 2) % 4] - a) @ inwards)
        # no further from a side than a part of what lies between it and the opposite one
        reach, spare = min(band, 0.3 * self._room(corners, i)), min(3.0, 0.1 * length)
        s, d = (points - a) @ along, (points - a) @ inwards
        near = points[(np.abs(d) < reach) & (s > spare) & (s < length - spare)]
        for _ in range(2):  # sub-pixel: the top of a parabola through the slope at three places across the edge
            if len(near) < 6:
                return None
            across = near[:, None] + np.array([-1.0, 0.0, 1.0])[:, None] * inwards
            u, v = across[..., 0].astype(np.float32), across[..., 1].astype(np.float32)
            left, middle, right = (cv2.remap(slope, u, v, cv2.INTER_LINEAR).reshape(-1, 3, 2) @ inwards).T
            curvature = 2.0 * middle - left - right
            top = (middle > 60.0) & (curvature > 1.0)
            shift = np.clip(0.5 * (right - left)[top] / curvature[top], -1.0, 1.0)
            near = near[top] + shift[:, None] * inwards
        if len(near) < 6:
            return None
        vx, vy, px, py = cv2.fitLine(near.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).ravel()
        return np.array([vy, -vx, px * vy - py * vx])

    @staticmethod
    def _room(corners: Array, i: int) -> float:
        """[px] from side i to the nearer end of the opposite one."""
        a, b = corners[i], corners[(i + 1) % 4]
        n = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        return float(min(abs((corners[(i + 2) % 4] - a) @ n), abs((corners[(i + 3) % 4] - a) @ n)))

    @staticmethod
    def _cross(l: Array, m: Array) -> Array:
        return np.linalg.solve(np.array([l[:2], m[:2]]), np.array([l[2], m[2]]))


@dataclass
class Trace:
    """What the baseline believed, cycle by cycle, and what it cost."""

    mean: list[Array] = field(default_factory=list)  # x, y, H [m] of the aircraft's cg
    camera: list[Array] = field(default_factory=list)  # and of the camera
    seen: list[bool] = field(default_factory=list)
    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def median_us(self) -> dict[str, float]:
        return {name: 1e6 * median(self.seconds[name] or [math.nan]) for name in PARTS}


def fly(
    steps: Sequence[Step],
    scenario: Scenario,
    vehicle: Vehicle,
    draw: Callable[[Array, Array], np.ndarray] | None = None,
) -> Trace:
    """Over the samples of a flight, from the pose that landing-sim acquired until the flight is over.

    draw : makes the frame seen from p_RC (3,) [m] with R_CR (3, 3); without it the flight's own frames are looked at
    """
    c, r = scenario.camera, scenario.runway
    K = np.array([[c.focal_px, 0, (c.width_px - 1) / 2], [0, c.focal_px, (c.height_px - 1) / 2], [0, 0, 1.0]])
    half, length = 0.5 * r.width_m, r.length_m
    corners = np.array([[0, -half, 0], [0, half, 0], [length, half, 0], [length, -half, 0]], dtype=float)
    eye = Eye(corners, K, np.array(vehicle.camera.p_BC_m, dtype=float))
    out, ekf, last, clock = Trace(), None, 0.0, time.thread_time
    gyro, speed = np.zeros(3), 0.0
    for step in steps:
        frame: CameraSample | None = None
        for sample in step.samples:
            if sample.sensor == "gyro":
                gyro = np.asarray(sample.data)
            elif sample.sensor == "airspeed":
                speed = float(sample.data)
            elif sample.sensor == "camera":
                frame = sample.data
        if ekf is None:
            pose = next((m.z for m in step.measurements if m.kind == "pose"), None)
            if pose is None:
                continue
            x, y, H, phi, theta, psi = pose
            v = speed * (rotation(phi, theta, psi) @ np.array([1.0, 0.0, 0.0]))
            ekf = Ekf(np.array([x, y, -H, v[0], v[1], -0.052 * speed, phi, theta, psi, 0.0, 0.0, 0.0]))
            last = step.truth.t
        begun = clock()
        if step.truth.t > last:
            ekf.predict(gyro, step.truth.t - last)
            last = step.truth.t
        predicted = clock()
        out.seconds["predict"].append(predicted - begun)
        got = None
        if frame is not None:
            begun = clock()
            image = frame.frame.full() if draw is None else draw(*frame.frame.poses[0])  # type: ignore[attr-defined]
            rendered = clock()
            got = eye.look(image, ekf.x, frame.pan, frame.tilt)
            looked = clock()
            if got is not None:
                ekf.update(*got)
                out.seconds["update"].append(clock() - looked)
                out.seconds["vision"].append(looked - rendered)
                out.seconds["render"].append(rendered - begun)
        out.mean.append(ekf.x[:3] * UP)
        out.camera.append((ekf.x[:3] + rotation(*ekf.x[6:9]) @ eye.lever) * UP)
        out.seen.append(got is not None)
    return out


def window(log: FlightLog) -> np.ndarray:
    """(n,) bool: between FROM and the loss of the threshold, and acquired for 1.5 s."""
    x = log["true_x_m"]
    settled = log["valid"] & (log["t_s"] >= log["t_s"][np.argmax(log["valid"])] + 1.5)
    return settled & (x >= FROM) & threshold_in_view(log)


def beside(scenario: Scenario, vehicle: Vehicle, say: Callable[[str], None] = lambda line: None) -> dict[str, Any]:
    """Accuracy and cost of the baseline and of ours on the same flight, given our 640x480 frames and drawing its own.

    Cost is CPU time per frame for making the pixels that are looked at, looking, and estimating, while the threshold is
    in view: theirs the median frame, ours the mean of a flight, median of five. RMS errors over the same cycles.
    """
    steps: list[Step] = []
    flight = land(scenario, vehicle, watch=steps.append)
    log, use = flight.log, window(flight.log)
    out: dict[str, Any] = {
        "frames": f"{scenario.camera.width_px}x{scenario.camera.height_px}",
        "cycles": int(use.sum()),
    }
    given, drawn = fly(steps, scenario, vehicle), fly(steps, scenario, vehicle, own_frames.artist(scenario))
    lever = np.array(vehicle.camera.p_BC_m, dtype=float)
    own = _accuracy(drawn, log, use, lever)
    out |= _accuracy(given, log, use, lever) | {
        f"own_frames_{key}": value for key, value in own.items() if not key.startswith("our_")
    }
    # ours over the same part of the flight, finding the runway included: it ends where the threshold is lost
    seen = float(log["t_s"][threshold_in_view(log)][-1]) if use.any() else flight.seconds
    until = scenario.model_copy(update={"time": scenario.time.model_copy(update={"limit_s": seen})})
    parts = [where.parts_of(until, vehicle) for _ in range(5)]
    frames = int(np.sum(log["meas_frame"][log["t_s"] <= seen] >= 0))

    def ours(*names: str) -> float:
        return sum(median(1e6 * p[n]["seconds"] for p in parts) for n in names if n in parts[0]) / frames

    our_render, our_vision = ours("render windows"), ours("front end")
    our_estimate = ours("estimator: predict", "estimator: update", "estimator: read", "readings")
    our_total = our_render + our_vision + our_estimate
    cost = given.median_us() | {"own_render": drawn.median_us()["render"]}
    on_board = cost["vision"] + cost["predict"] + cost["update"]
    out |= {
        "own_render_us": cost["own_render"], "render_us": cost["render"], "vision_us": cost["vision"],
        "estimate_us": cost["predict"] + cost["update"], "frame_us": cost["own_render"] + on_board,
        "our_render_us": our_render, "our_vision_us": our_vision, "our_estimate_us": our_estimate,
        "our_frame_us": our_total,
        "cost_ratio": (cost["own_render"] + on_board) / our_total,
        "cost_ratio_on_our_frames": (cost["render"] + on_board) / our_total,
        "cost_ratio_without_rendering": on_board / (our_vision + our_estimate),
    }  # fmt: skip
    return out


def _accuracy(trace: Trace, log: FlightLog, use: np.ndarray, lever: Array) -> dict[str, float]:
    """RMS errors [m] of a trace, which ends with the log, and of ours in the cycles to use; their ratios.

    Of the aircraft's cg, and with `camera_` before the name of the camera at `lever` (3,) [m] from it: what is seen tells
    where the camera is. From there to the cg both go by a heading and a pitch in which they have the bias of the
    platform's encoders, which nothing on board can see: through the transport's 25 m of lever, 1.3 cm.
    """
    first, out = len(log) - len(trace.mean), {}
    ours = np.column_stack([log.estimate(name) for name in ("x", "y", "H", "phi", "theta", "psi")])
    ours_camera = ours[:, :3] + np.array([rotation(*attitude) @ lever for attitude in ours[:, 3:]]) * UP
    for place, theirs, mine in (("", trace.mean, ours[:, :3]), ("camera_", trace.camera, ours_camera)):
        truth = np.column_stack([log[f"true_{place}{axis}_m"] for axis in "xyz"]) * UP
        error = np.full((len(log), 3), np.nan)
        error[first:] = np.array(theirs) - truth[first:]
        for name, column in zip(COMPARED, (0, 2, 1)):
            a, b = error[use, column], (mine - truth)[use, column]
            rms = [float(np.sqrt(np.mean(e**2))) if len(e) else math.nan for e in (a, b)]
            out |= {
                f"{place}{name}_rms_m": rms[0],
                f"our_{place}{name}_rms_m": rms[1],
                f"{place}{name}_ratio": rms[0] / rms[1] if rms[1] else math.nan,
            }
    out["measured_share"] = float(np.mean(np.array(trace.seen, bool)[use[first:]])) if use.any() else math.nan
    return out
