"""A flight made on paper: kinematics in place of an aircraft, drawn errors in place of a filter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.noise import Noise
from landing_sim.signals import (
    CameraSample,
    CameraTruth,
    Command,
    EdgeSet,
    Estimate,
    Feature,
    Measurement,
    Reference,
    Residuals,
    Sample,
    Status,
    Step,
    Touchdown,
    Truth,
)

K = Intrinsics.centred(512, 512, 2000.0)
LEVER = np.array([3.0, 0.0, -0.3])
CYCLE = 0.06
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz", "bp", "bq", "br")
SIGMA = np.array([0.3, 0.2, 0.2, 2e-3, 2e-3, 2e-3, 1e-3, 5e-4, 1e-3, 2.0, 0.2, 0.1, 0.3, 0.3, 0.3, 1e-3, 1e-3, 1e-3])
TOUCHDOWN_X, WHEELS_BELOW = 555.0, 1.8


@dataclass(frozen=True)
class FlatFrame:
    """Grass, runway and sky, one ray a pixel."""

    p_RC: np.ndarray
    R_CR: np.ndarray
    width: int = K.width
    height: int = K.height

    def full(self) -> np.ndarray:
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        rays = np.stack([(u - K.cx) / K.f, (v - K.cy) / K.f, np.ones_like(u, float)], axis=-1) @ self.R_CR
        down = rays[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = -self.p_RC[2] / down
            x, y = self.p_RC[0] + scale * rays[..., 0], self.p_RC[1] + scale * rays[..., 1]
        on = (down > 0.0) & (x > 0.0) & (x < 1680.0) & (np.abs(y) < 14.5)
        return np.where(down <= 0.004, 190, np.where(on, 145, 90)).astype(np.uint8)

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        return self.full()[v0 : v0 + height, u0 : u0 + width]

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
        return np.stack([self.window(int(u), int(v), width, height) for u, v in corners])


def fly(seed: int = 1, duration: float = 50.0, acquired: float = 0.12) -> Iterator[Step]:
    """Glide from -950 m, flare, touch at 555 m, roll out; correlated errors with the spread the covariance claims."""
    noise = Noise(seed, "synthetic")
    error = SIGMA * noise.normal(len(SIGMA))
    keep = math.exp(-CYCLE / 2.0)
    x, speed = -950.0, 50.0
    for k in range(round(duration / CYCLE)):
        t = k * CYCLE
        error = keep * error + math.sqrt(1.0 - keep**2) * SIGMA * noise.normal(len(SIGMA))
        truth = _truth(k, t, x, speed)
        yield _step(truth, error, t >= acquired - 1e-9, k)
        speed = (
            50.0
            if x < -250.0
            else max(43.0, speed - 0.45 * CYCLE)
            if x < TOUCHDOWN_X
            else max(0.0, speed - 2.2 * CYCLE)
        )
        x += speed * CYCLE


def touchdown() -> Touchdown:
    return Touchdown(
        t=_touchdown_time(), x=TOUCHDOWN_X, y=0.1, sink_rate=0.4, airspeed=43.0, groundspeed=43.0, pitch=0.05,
        bank=0.001, heading_error=0.002, sideslip=0.01,
    )  # fmt: skip


def _touchdown_time() -> float:
    return next(step.truth.t for step in fly() if step.truth.p_RB[0] >= TOUCHDOWN_X)


def _height(x: float) -> float:
    """Glide of 2.7 deg into an exponential flare of the wheels, smooth at -250 m."""
    if x >= TOUCHDOWN_X:
        return WHEELS_BELOW
    glide = math.tan(math.radians(2.7))
    start = 15.2 + WHEELS_BELOW
    return (
        start - glide * (x + 250.0)
        if x < -250.0
        else (start - WHEELS_BELOW) * math.exp(-(x + 250.0) / 250.0) * ((TOUCHDOWN_X - x) / (TOUCHDOWN_X + 250.0))
        + WHEELS_BELOW
    )


def _truth(k: int, t: float, x: float, speed: float) -> Truth:
    y = -85.0 * math.exp(-(((x + 950.0) / 260.0) ** 2)) if x > -950.0 else -85.0
    slope = (y - -85.0 * math.exp(-(((x + 949.0) / 260.0) ** 2))) / -1.0 if x > -950.0 else 0.0
    psi, phi = math.atan(slope), math.radians(6.0) * math.sin((x + 950.0) / 110.0) * math.exp(-(x + 950.0) / 300.0)
    height = _height(x)
    climb = (_height(x + 0.5) - _height(x - 0.5)) * speed
    theta = math.atan2(climb, max(speed, 1.0)) + math.radians(4.0) * (x < TOUCHDOWN_X)
    R_RB = from_euler(phi, theta, psi)
    wheels = height - WHEELS_BELOW
    wind = np.array([0.0, -1.0 if x > -800.0 else 0.0, 0.0])
    return Truth(
        tick=12 * k, t=t, p_RB=np.array([x, y, -height]), R_RB=R_RB,
        v_RB_R=np.array([speed, speed * slope, -climb]), w_RB_B=np.zeros(3), euler=np.array([phi, theta, psi]),
        wind_R=wind, airspeed=float(np.linalg.norm(np.array([speed, speed * slope, -climb]) - wind)), alpha=0.05, beta=0.0,
        surfaces=np.array([0.01, 0.0, 0.0, 1.0]), thrust=3000.0, wheels_height=np.full(3, wheels),
        on_ground=np.full(3, wheels <= 1e-9), load_factor=1.0,
    )  # fmt: skip


def _step(truth: Truth, error: np.ndarray, valid: bool, k: int) -> Step:
    pan, tilt = -float(truth.euler[2]), -float(truth.euler[1])
    R_CR = camera_from_body(pan, tilt) @ truth.R_RB.T
    camera = CameraTruth(truth.p_RB + truth.R_RB @ LEVER, R_CR, pan, tilt)
    sample = CameraSample(FlatFrame(camera.p_RC, R_CR), k, pan, tilt, pan, tilt)
    uvw = truth.R_RB.T @ truth.v_RB_R
    true = np.concatenate([uvw, truth.w_RB_B, truth.euler, truth.p_RB[:2], [-truth.p_RB[2]], truth.wind_R, np.zeros(3)])
    measurement, innovation = _edges(truth, camera, k)
    seen, status = np.isfinite(innovation), measurement.geometry.status
    residuals = Residuals(innovation, status, float(np.sum(innovation[seen] ** 2)) / 0.045, int(seen.sum()))
    flags = {"threshold_in_view": bool(truth.p_RB[0] < -120)}
    estimate = Estimate(truth.t, STATES, true + error, np.diag(SIGMA**2), valid, flags, residuals)
    x = truth.p_RB[0]
    mode = (
        "acquire"
        if not valid
        else "capture"
        if x < -600
        else "glide"
        if x < -250
        else "flare"
        if x < TOUCHDOWN_X
        else "rollout"
    )
    if truth.v_RB_R[0] < 1.0:
        mode = "stopped"
    reference = Reference(mode, 47.0, _height(x), 0.0, 0.0, 0.0, 0.0, extra={"psi_wind": 0.02})
    samples = (
        Sample("camera", truth.t, truth.t, sample),
        Sample("gyro", truth.t, truth.t, truth.w_RB_B + 1e-3),
        Sample("airspeed", truth.t, truth.t, truth.airspeed),
    )
    command = Command(elevator=0.02, throttle=0.4)
    measurements = (measurement,)
    return Step(truth, camera, samples, measurements, estimate, reference, command, residuals)


def _edges(truth: Truth, camera: CameraTruth, k: int) -> tuple[Measurement, np.ndarray]:
    """Ten windows on the true edges, each off by a fixed pattern, so that z and innovations are known."""
    features, centres, directions, statuses = [], [], [], []
    for feature, y, xs in (
        (Feature.LEFT, -14.5, (30.0, 150.0, 400.0)),
        (Feature.RIGHT, 14.5, (30.0, 150.0, 400.0)),
        (Feature.THRESHOLD, -6.0, (0.0,)),
        (Feature.THRESHOLD, 6.0, (0.0,)),
    ):
        for x in xs:
            ahead = max(x, truth.p_RB[0] + 60.0 + x) if feature < Feature.THRESHOLD else x
            c = camera.R_CR @ (np.array([ahead, y, 0.0]) - camera.p_RC)
            u, v = (K.cx + K.f * c[0] / c[2], K.cy + K.f * c[1] / c[2]) if c[2] > 1.0 else (-1.0, -1.0)
            features.append(feature)
            inside = 0.0 < u < 511.0 and 0.0 < v < 511.0
            centres.append((u, v) if inside else (0.0, 0.0))
            directions.append((0.0, 1.0) if feature == Feature.THRESHOLD else (1.0, 0.0))
            statuses.append(Status.FOUND if inside else Status.OUT_OF_VIEW)
    for u in (100.0, 400.0):
        features.append(Feature.HORIZON)
        centres.append((u, 255.5))
        directions.append((0.0, 1.0))
        statuses.append(Status.FOUND)
    status = np.array(statuses, np.int64)
    z = np.where(status == Status.FOUND, 0.3 * np.cos(np.arange(10.0) + k), np.nan)
    edges = EdgeSet(np.array(features, np.int64), np.array(centres), np.array(directions), status, 0.0, 0.0)
    return Measurement("edges", truth.t, truth.t, z, np.full(10, 0.04), edges), z
