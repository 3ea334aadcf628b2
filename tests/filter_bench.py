"""A matched world for the filters: the filter's own model flies, edges come from geometry with white noise."""

from __future__ import annotations

import numpy as np

from landing_sim.estimators import states
from landing_sim.estimators.aircraft_model import downwash, propagate, thrust
from landing_sim.estimators.belief import AircraftBelief
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.estimators.runway_filter import FilterConfig
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import image_line, plane_normal
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.signals import Command, EdgeSet, Measurement

CAMERA = Intrinsics.centred(512, 512, 2000.0)
LEVER = np.array([3.0, 0.0, -0.3])
WIDTH = 29.0
ENCODER_NOISE, GYRO_NOISE = np.deg2rad(0.005), np.deg2rad(0.1)
COMMAND = Command(elevator=0.005, throttle=0.32, flap=0.5)


def truth_at(rng: np.random.Generator, x_m: float = -900.0, wind: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    x = np.zeros(states.N)
    x[: states.H + 1] = [50.0, 0.3, 0.1, 0, 0, 0, 0.01, -0.05, 0.02, x_m, -3.0, -x_m * 0.052 + 4.0]
    x[states.WX : states.WZ + 1] = wind
    x[states.CX : states.CM + 1] = rng.normal(size=3) * FilterConfig().offset_sigma
    x[states.BP : states.BR + 1] = rng.normal(size=3) * np.deg2rad(0.1)
    x[states.EPAN : states.ETILT + 1] = rng.normal(size=2) * np.deg2rad(0.03)
    x[states.WIDTH] = WIDTH
    return x


def settle(x: np.ndarray, par: np.ndarray) -> np.ndarray:
    alpha = np.arctan2(x[2], x[0])
    return np.array([COMMAND.elevator, 0, 0, 0.5, thrust(COMMAND.throttle, 50.0, par), downwash(x, alpha, 0.5, par)])


def fly(x: np.ndarray, s: np.ndarray, par: np.ndarray, q: np.ndarray, dt: float, rng: np.random.Generator) -> None:
    """One cycle of the true motion, in place, with process noise of density q."""
    Phi = np.empty((18, 18))
    u = np.array([COMMAND.elevator, 0.0, 0.0, COMMAND.throttle, COMMAND.flap])
    steps = 4
    for _ in range(steps):
        propagate(x, s, u, par, False, dt / steps, Phi)
        x += rng.normal(size=states.N) * np.sqrt(q * dt / steps)


def edges(x: np.ndarray, t: float, rng: np.random.Generator, sigma: float = 0.1, threshold: bool = True) -> Measurement:
    """Ten windows on the true lines, noise sigma [px]."""
    psi, theta, phi = x[states.PSI], x[states.THETA], x[states.PHI]
    pan, tilt = -psi, -theta  # roughly fixated
    R_RB = from_euler(phi, theta, psi)
    R_CR = camera_from_body(pan, tilt) @ R_RB.T
    p = np.array([x[states.X], x[states.Y], -x[states.H]]) + R_RB @ LEVER
    kinds = [0, 0, 0, 1, 1, 1] + ([2, 2] if threshold else [0, 1]) + [3, 3]
    at = [0.25, 0.5, 0.9, 0.25, 0.5, 0.9, 0.3, -0.3, 100.0, 400.0]
    depth = max(-p[0], 30.0)
    centre, direction = np.empty((10, 2)), np.empty((10, 2))
    for i, (kind, a) in enumerate(zip(kinds, at)):
        l = image_line(plane_normal(kind, p, WIDTH, 0.0, 0.0), R_CR, CAMERA.f, CAMERA.cx, CAMERA.cy)
        if kind == 2:
            point = np.array([0.0, a * WIDTH, 0.0])
        else:
            point = np.array([p[0] + depth / a, (-0.5 if kind == 0 else 0.5) * WIDTH, 0.0])
        if kind == 3:
            c = np.array([a, -(l[0] * a + l[2]) / l[1]])
        else:
            q = R_CR @ (point - p)
            c = np.array([CAMERA.cx + CAMERA.f * q[0] / q[2], CAMERA.cy + CAMERA.f * q[1] / q[2]])
        centre[i], direction[i] = np.round(c), l[:2] / np.hypot(l[0], l[1])
    feature = np.array(kinds)
    h, Hx = np.empty(10), np.empty((10, states.N))
    unbiased = x.copy()
    unbiased[states.EPAN : states.ETILT + 1] = 0.0
    edge_model(unbiased, feature, centre, direction, pan, tilt, LEVER, focal(), 0.0, h, Hx)
    told = EdgeSet(
        feature,
        centre,
        direction,
        np.zeros(10, dtype=np.int64),
        pan + x[states.EPAN] + ENCODER_NOISE * rng.normal(),
        tilt + x[states.ETILT] + ENCODER_NOISE * rng.normal(),
    )
    return Measurement("edges", t, t, h + sigma * rng.normal(size=10), np.full(10, sigma**2), told)


def focal() -> np.ndarray:
    return np.array([CAMERA.f, CAMERA.cx, CAMERA.cy])


def filter_of(config: FilterConfig, belief: AircraftBelief | None = None, width: float = WIDTH) -> RunwayEkf:
    return RunwayEkf(config, belief or AircraftBelief(), CAMERA, LEVER, width, 0.0)


def pose(x: np.ndarray, t: float, rng: np.random.Generator) -> Measurement:
    """What acquisition would say: 0.5 % of range, and the encoder's bias in the attitude."""
    sd = np.array([0.005 * abs(x[states.X]), 0.3, 0.003 * x[states.H] + 0.05, 0.0005, 0.0003, 0.0003])
    truth = x[[states.X, states.Y, states.H, states.PHI, states.THETA, states.PSI]].copy()
    truth[4] -= x[states.ETILT]
    truth[5] -= x[states.EPAN]
    return Measurement("pose", t, t, truth + sd * rng.normal(size=6), np.diag(sd**2))


def inertial(x: np.ndarray, t: float, rng: np.random.Generator, config: FilterConfig) -> list[Measurement]:
    from landing_sim.estimators.inertial_model import airspeed_model

    gyro = x[3:6] + x[states.BP : states.BR + 1] + GYRO_NOISE * rng.normal(size=3)
    nu, _ = airspeed_model(x, 0.0)
    speed = np.array([-nu[0] + config.airspeed_sigma * rng.normal()])
    return [
        Measurement("gyro", t, t, gyro, np.full(3, GYRO_NOISE**2)),
        Measurement("airspeed", t, t, speed, np.array([config.airspeed_sigma**2])),
    ]


def run(config: FilterConfig, seed: int, frames: int = 200, sigma: float = 0.1, wind: bool = True, **kw: object):
    """Fly `frames` cycles; returns times, true states (frames, 26), estimates, and the filter with its last memory."""
    rng = np.random.default_rng(seed)
    ekf = filter_of(config, **kw)
    par = ekf._par
    x = truth_at(rng, wind=tuple(rng.normal(size=3) * (2.0, 2.0, 0.5)) if wind else (0, 0, 0))
    s = settle(x, par)
    q = np.zeros(states.N)
    q[ekf.blocks.index] = ekf._q["air"]
    memory = ekf.init(0.0)
    truth, out = [], []
    for k in range(frames):
        t = k * 0.06
        memory = ekf.predict(memory, COMMAND, t)
        for m in inertial(x, t, rng, config):
            memory = ekf.update(memory, m)
        if not memory.valid:
            memory = ekf.update(memory, pose(x, t, rng))
        in_view = x[states.X] < -120.0
        memory = ekf.update(memory, edges(x, t, rng, sigma, in_view))
        truth.append(x.copy())
        out.append(ekf.read(memory))
        fly(x, s, par, q, 0.06, rng)
    return np.array(truth), out, ekf, memory


def nees(truth: np.ndarray, estimates: list, ekf: RunwayEkf) -> np.ndarray:
    """(frames,) normalised estimation error squared per state; the encoders' momentary noise left out."""
    out = np.empty(len(estimates))
    for k, e in enumerate(estimates):
        kept = [i for i, name in enumerate(e.names) if name not in ("jpan", "jtilt")]
        d = (e.mean - truth[k][ekf.blocks.index])[kept]
        out[k] = d @ np.linalg.solve(e.cov[np.ix_(kept, kept)], d) / len(d)
    return out
