"""The rival on the same state: an extended Kalman filter that ranges an unknown runway by the edges themselves.

State: x, y, H of the cg, the runway's course and width, the camera's pan and tilt errors, the inertial velocity's bias (scene.py).
Measurements are the edge displacements of the 4D filter with the attitude from the inertial unit; errors of attitude that are
new in every image are states of one image only.

Source     measurement: Dickmanns & Schell 1992, eq. (4), see edge_model.py. That an EKF on x and W ranges on the glide path,
           where the aim point's bearing does not: own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

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
# a scene's states as those of edge_model; a larger course is a smaller heading
_COLUMNS: np.ndarray = np.array([states.X, states.Y, states.H, states.PSI, states.WIDTH, states.EPAN, states.ETILT])
_ONE_BLOCK: np.ndarray = np.array([0, sc.N], dtype=np.int64)
_WITH_NOISE: np.ndarray = np.array([0, sc.N + 3], dtype=np.int64)


@dataclass(frozen=True, slots=True)
class EkfConfig:
    """Noise of the kinematic filter. Spectral densities are square roots, per sqrt(Hz)."""

    first_spread: float = 0.6  # relative, of the first guess of the range
    q_position: float = 0.05  # [m]
    q_course: float = 0.005 * RAD
    q_camera: float = 0.002 * RAD
    q_bias: float = 0.02  # [m/s]
    velocity_sigma: float = 0.5  # [m/s] prior of the inertial velocity's bias, each axis
    attitude_noise: float = 0.01 * RAD  # of each image, common to all its edges
    gate_sigma: float = 5.0
    start_frames: int = 10  # robust and ungated
    huber: float = 2.0


class KinematicEkf:
    """looking.Ranging by a Kalman filter."""

    def __init__(self, config: EkfConfig, lens: Intrinsics, lever: Array) -> None:
        self.config = config
        self._focal = np.array([lens.f, lens.cx, lens.cy])
        self._lever = np.asarray(lever, dtype=float)
        c = config
        q = np.zeros(sc.N)
        q[[sc.X, sc.Y, sc.H]] = c.q_position**2
        q[sc.COURSE], q[[sc.EPAN, sc.ETILT]] = c.q_course**2, c.q_camera**2
        q[sc.BX :] = c.q_bias**2
        self._q = q

    def start(self, s: Array, P: Array, t: float) -> Scene:
        """The guess's error is one of scale: of all lengths together."""
        c = self.config
        P = P.copy()
        P[sc.BX :, sc.BX :] = np.eye(3) * c.velocity_sigma**2
        lengths = np.zeros(sc.N)
        rows = [sc.X, sc.Y, sc.H, sc.WIDTH]
        lengths[rows] = s[rows]
        return Scene(s, P + c.first_spread**2 * np.outer(lengths, lengths), c.first_spread, t)

    def move(self, scene: Scene, way_R: Array, dt: float) -> Scene:
        Phi = sc.transition(way_R, dt)
        P = kalman.predict_dense(scene.P, Phi, np.diag(self._q * dt), _ONE_BLOCK)
        return replace(scene, s=sc.moved(scene.s, way_R, dt), P=P)

    def look(self, scene: Scene, image: Image, carried: Carriage) -> Scene:
        c, m = self.config, image.edges
        edges = m.geometry
        if edges is None:
            raise ValueError("a measurement of kind 'edges' needs its EdgeSet")
        n = len(m.z)
        found = np.isfinite(m.z)
        h, Hx = np.empty(n), np.empty((n, states.N))
        x = np.zeros(states.N)
        x[_COLUMNS] = scene.s[: len(_COLUMNS)]
        x[states.PHI : states.PSI + 1] = to_euler(carried.R_RB)
        edge_model(
            x, edges.feature, edges.centre, edges.direction, edges.pan, edges.tilt,
            self._lever, self._focal, 0.0, h, Hx,
        )  # fmt: skip
        Hn = np.zeros((n, sc.N))
        Hn[:, : len(_COLUMNS)] = Hx[:, _COLUMNS]
        Hn[:, sc.COURSE] *= -1.0
        nu = np.where(found, m.z - h, 0.0)
        use: np.ndarray = found & np.isfinite(nu)
        # what the attitude's own noise moves, it moves in all windows together: taken as three more states of this image
        noise = Hx[:, states.PHI : states.PSI + 1] * c.attitude_noise
        H_all = np.ascontiguousarray(np.hstack([Hn, noise]))
        P_all = np.zeros((sc.N + 3, sc.N + 3))
        P_all[: sc.N, : sc.N] = scene.P
        P_all[sc.N :, sc.N :] = np.eye(3)
        R = np.where(found, m.R, 1.0)
        status = edges.status.copy()
        s2 = kalman.innovation_variance(P_all, H_all, R)
        if scene.frames >= c.start_frames:
            use &= nu * nu <= c.gate_sigma**2 * s2
            status[found & ~use] = Status.REJECTED
        else:
            R = R * np.maximum(1.0, np.abs(nu) / (c.huber * np.sqrt(s2)))
        P_new, step, nis = kalman.update_dense(P_all, H_all, R, nu, use, _WITH_NOISE)
        dof = int(use.sum())
        s = scene.s + step[: sc.N]
        P = np.ascontiguousarray(P_new[: sc.N, : sc.N])
        return replace(
            scene,
            s=s,
            P=P,
            spread=math.sqrt(max(P[sc.WIDTH, sc.WIDTH], 0.0)) / max(abs(s[sc.WIDTH]), 1.0),
            t_image=image.t,
            d=sc.observability(s, carried.v_R),
            misses=0 if dof else scene.misses + 1,
            threshold_in_view=bool(np.any(use & (edges.feature == Feature.THRESHOLD))),
            frames=scene.frames + 1,
            residuals=Residuals(np.where(found, m.z - h, np.nan), status, nis, dof),
        )
