"""The rival: an extended Kalman filter that ranges an unknown runway by its edges.

In units of the runway's width, xi = p_RC / W, an image depends on xi and on directions alone, and with mu = 1 / W

    xi' = mu (v - b),    mu' = 0

is linear: the scale enters by the motion only, where it belongs. (In metres, x, y, H and W, the direction in which the
scene may be scaled changes with every correction, and the filter takes that for information: it was sure to 1 % of a range
50 % off, within a second.) Estimated besides: the runway's course, errors of the camera's mounting, the velocity's bias b.

Source     measurement: Dickmanns & Schell 1992, eq. (4), see edge_model.py; the rest own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from landing_sim.estimators import kalman, states
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.observer import scene as sc
from landing_sim.estimators.observer.looking import Image
from landing_sim.estimators.observer.scene import Carriage, Scene
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.so3 import to_euler
from landing_sim.signals import Feature, Residuals, Status
from landing_sim.types import Array

RAD = math.pi / 180.0
XI = slice(sc.X, sc.H + 1)  # (x, y, H) / W
MU = sc.WIDTH  # 1 / W
# edge_model's columns for a scene's states; a larger course is a smaller heading, a roll error a larger roll
_COLUMNS: np.ndarray = np.array(
    [states.X, states.Y, states.H, states.PSI, states.WIDTH, states.EPAN, states.ETILT, states.PHI]
)
_ONE_BLOCK: np.ndarray = np.array([0, sc.N], dtype=np.int64)
_WITH_NOISE: np.ndarray = np.array([0, sc.N + 3], dtype=np.int64)
_NO_LEVER = np.zeros(3)


@dataclass(frozen=True, slots=True)
class EkfConfig:
    """Noise of the kinematic filter. Spectral densities are square roots, per sqrt(Hz)."""

    attitude: Literal["inertial", "horizon"] = "inertial"  # whether the horizon's windows count
    first_spread: float = 0.6  # relative, of the first guess of the range
    q_position: float = 0.03  # [m]
    q_course: float = 0.003 * RAD
    q_camera: float = 0.001 * RAD
    q_edge: float = 0.02  # [px]
    q_bias: float = 0.01  # [m/s]
    edge_floor: float = 0.35  # [px] of each window: what is wrong with it stays so for many images
    edge_sigma: float = 0.1  # [px] prior of what paint and blur move all windows of a feature by
    velocity_sigma: float = 0.5  # [m/s] prior of the inertial velocity's bias, each axis
    attitude_noise: float = 0.01 * RAD  # of each image, common to all its edges
    widest: float = 100.0  # [m] there are no wider runways: a range that noise drives towards infinity comes back late
    gate_sigma: float = 5.0
    start_frames: int = 10  # robust and ungated
    huber: float = 2.0


class KinematicEkf:
    """looking.Ranging by a Kalman filter; Scene.own is the covariance in the states xi, course, mu, errors, b."""

    def __init__(self, config: EkfConfig, lens: Intrinsics) -> None:
        self.config = config
        self._focal = np.array([lens.f, lens.cx, lens.cy])
        c = config
        self._q = np.zeros(sc.N)
        self._q[sc.COURSE] = c.q_course**2
        self._q[[sc.EPAN, sc.ETILT, sc.EROLL]] = c.q_camera**2
        self._q[[sc.SIDE, sc.NEAR]] = c.q_edge**2
        self._q[sc.BX :] = c.q_bias**2

    def start(self, s: Array, P: Array, t: float) -> Scene:
        c = self.config
        own, mu = P.copy(), 1.0 / s[sc.WIDTH]
        own[XI, :] *= mu
        own[:, XI] *= mu
        own[MU, MU] = (c.first_spread * mu) ** 2
        own[sc.SIDE, sc.SIDE] = own[sc.NEAR, sc.NEAR] = c.edge_sigma**2
        own[sc.BX :, sc.BX :] = np.eye(3) * c.velocity_sigma**2
        return self._scene(Scene(s, P, c.first_spread, t), s, own)

    def move(self, scene: Scene, way_R: Array, dt: float) -> Scene:
        s, own = scene.s, scene.own
        assert own is not None  # `start` made it
        mu = 1.0 / s[sc.WIDTH]
        way = way_R - s[sc.BX :] * dt
        Phi = np.eye(sc.N)
        Phi[XI, MU] = way * (1.0, 1.0, -1.0)
        Phi[sc.X, sc.COURSE], Phi[sc.Y, sc.COURSE] = mu * way_R[1], -mu * way_R[0]
        Phi[sc.X, sc.BX], Phi[sc.Y, sc.BY], Phi[sc.H, sc.BZ] = -mu * dt, -mu * dt, mu * dt
        q = self._q * dt
        q[XI] = (self.config.q_position * mu) ** 2 * dt
        own = kalman.predict_dense(own, Phi, np.diag(q), _ONE_BLOCK)
        return self._scene(scene, sc.moved(s, way_R, dt), own)

    def look(self, scene: Scene, image: Image, carried: Carriage) -> Scene:
        c, m, own = self.config, image.edges, scene.own
        edges = m.geometry
        if edges is None or own is None:
            raise ValueError("a measurement of kind 'edges' needs its EdgeSet, and a start before it")
        n, W = len(m.z), float(scene.s[sc.WIDTH])
        h, Hx = np.empty(n), np.empty((n, states.N))
        x = np.zeros(states.N)
        x[states.PHI : states.PSI + 1] = to_euler(carried.R_RB)
        x[_COLUMNS[:-1]] += scene.s[: sc.EROLL]
        x[states.PSI] -= scene.s[sc.COURSE]
        x[states.PHI] += scene.s[sc.EROLL]
        edge_model(
            x, edges.feature, edges.centre, edges.direction, edges.pan, edges.tilt, _NO_LEVER, self._focal, 0.0, h, Hx
        )
        Hn = np.zeros((n, sc.N + 3))
        Hn[:, : len(_COLUMNS)] = Hx[:, _COLUMNS]
        Hn[:, sc.COURSE] *= -1.0
        Hn[:, XI] *= W
        Hn[:, MU] = 0.0  # a scene scaled looks the same
        borders, threshold = edges.feature <= Feature.RIGHT, edges.feature == Feature.THRESHOLD
        Hn[borders, sc.SIDE] = Hn[threshold, sc.NEAR] = 1.0
        h += Hn[:, sc.SIDE] * scene.s[sc.SIDE] + Hn[:, sc.NEAR] * scene.s[sc.NEAR]
        # the attitude's own noise is new in every image and moves all its windows together: three states of this image
        Hn[:, sc.N :] = Hx[:, states.PHI : states.PSI + 1] * c.attitude_noise
        P = np.zeros((sc.N + 3, sc.N + 3))
        P[: sc.N, : sc.N] = own
        P[sc.N :, sc.N :] = np.eye(3)
        found = np.isfinite(m.z)
        if c.attitude == "inertial":  # the horizon's dip depends on the scale, which would be taken for known
            found = found & (edges.feature != Feature.HORIZON)
        nu = np.where(found, m.z - h, 0.0)
        use: np.ndarray = found & np.isfinite(nu)
        R = np.where(found, m.R + c.edge_floor**2, 1.0)
        status = edges.status.copy()
        s2 = kalman.innovation_variance(P, Hn, R)
        if scene.frames >= c.start_frames:
            use &= nu * nu <= c.gate_sigma**2 * s2
            status[found & ~use] = Status.REJECTED
        else:
            R = R * np.maximum(1.0, np.abs(nu) / (c.huber * np.sqrt(s2)))
        P, step, nis = kalman.update_dense(P, Hn, R, nu, use, _WITH_NOISE)
        s = scene.s + step[: sc.N]
        mu = max(1.0 / W + step[MU], 0.5 / W, 1.0 / c.widest)
        s[sc.WIDTH] = 1.0 / mu
        s[XI] = (scene.s[XI] / W + step[XI]) / mu
        dof = int(use.sum())
        after = scene._replace(
            t_image=image.t,
            d=sc.observability(s, carried.v_R),
            misses=0 if dof else scene.misses + 1,
            threshold_in_view=bool(np.any(use & (edges.feature == Feature.THRESHOLD))),
            frames=scene.frames + 1,
            residuals=Residuals(np.where(found, m.z - h, np.nan), status, nis, dof),
        )
        return self._scene(after, s, np.ascontiguousarray(P[: sc.N, : sc.N]))

    def _scene(self, scene: Scene, s: Array, own: Array) -> Scene:
        """With the covariance in metres for whoever reads the scene."""
        W = float(s[sc.WIDTH])
        T = np.eye(sc.N)
        T[XI, XI] *= W
        T[XI, MU] = -s[XI] * W
        T[MU, MU] = -W * W
        return scene._replace(s=s, own=own, P=T @ own @ T.T, spread=W * math.sqrt(max(own[MU, MU], 0.0)))
