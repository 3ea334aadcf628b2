"""Landing on a runway whose size nobody told: inertial and air data carry the state, images and motion range the runway.

    inertial unit, vanes, airspeed --> attitude, rates, velocities, wind
    edges --> a Ranging (gibert.py, kinematic_ekf.py) --> course, place, width

Late images are for `Rewind` to apply when they were taken: the scene is then moved on by the inertial increments since,
which is exact.

Source     Gibert et al. 2015, section 4.2; the acquisition gives the first ray, a first guess the range on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from landing_sim.estimators.observer import scene as sc
from landing_sim.estimators.observer.looking import Image, Ranging
from landing_sim.estimators.observer.scene import Scene, carriage, from_course
from landing_sim.estimators.reckoning import followed
from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import from_euler, to_euler, turned, wrap
from landing_sim.jit import kernel
from landing_sim.signals import Command, Estimate, Measurement
from landing_sim.types import Array

RAD = math.pi / 180.0
NAMES = (
    *("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H"),
    *("wx", "wy", "wz", "epan", "etilt", "W", "spread", "d1", "d2", "dW"),
)
# rows of NAMES that are states of the scene: row, state, sign; and the variances of those that come from instruments
_ROWS: np.ndarray = np.array(
    [
        (8, sc.COURSE, -1),
        (9, sc.X, 1),
        (10, sc.Y, 1),
        (11, sc.H, 1),
        (15, sc.EPAN, 1),
        (16, sc.ETILT, 1),
        (17, sc.WIDTH, 1),
    ]
)
_REST: Array = np.square(
    np.array([*[0.2] * 3, *[0.05 * RAD] * 6, *[0.02] * 3, *[1.0] * 3, *[1e-5] * 2, 1e-3, *[1e-3] * 4])
)


@dataclass(frozen=True, slots=True)
class ObserverConfig:
    """first_range [m] to the threshold, None: the acquisition's own; trust: relative spread from which the range counts."""

    first_range: float | None = None
    trust: float = 0.1
    first_spread: float = 0.6  # relative, of the first guess
    wind_filter: float = 0.2  # [s]
    pose_factor: float = 4.0  # an acquired pose is as much worse than its covariance says, far out
    camera_sigma: float = 0.3 * RAD  # of its mounting
    lost_after: int = 30  # images that showed nothing


_STILL = np.zeros(3)
_NOTHING = np.zeros(9)


class Memory(NamedTuple):
    """All that the observer remembers; never changed in place. A tuple: dozens are made where an image is late.

    What is made with every reading is made by position, which costs a third of `_replace`."""

    t: float
    scene: Scene | None = None  # at the time of the last inertial reading
    inertial: Array | None = None  # (12,) the last reading
    t_inertial: float = -math.inf
    airspeed: float = math.nan
    wind: Array = _STILL
    t_wind: float = -math.inf
    on_ground: bool = False
    trusted: bool = False
    unseen: Array = _NOTHING  # (9,) u v w p q r phi theta psi where there is no scene: see `reckoning.reckoned`


class RunwayObserver:
    """interfaces.Estimator. The runway's level, its size unknown."""

    def __init__(self, config: ObserverConfig, ranging: Ranging, nominal_width: float, lever: Array) -> None:
        """nominal_width [m]: what acquired poses are scaled by; lever (3,) [m]: the camera in body axes."""
        self.config, self.ranging = config, ranging
        self._nominal, self._lever = nominal_width, np.asarray(lever, dtype=float)

    def init(self, t: float) -> Memory:
        return Memory(t)

    def predict(self, memory: Memory, command: Command, t: float) -> Memory:
        """Time passes; the next inertial reading says what happened meanwhile."""
        return memory if t <= memory.t else Memory(t, *memory[1:])

    def update(self, memory: Memory, measurement: Measurement) -> Memory:
        """Raises ValueError for a measurement of a kind it has no use for."""
        match measurement.kind:
            case "inertial":
                return self._inertial(memory, measurement.z)
            case "airspeed":
                return Memory(*memory[:4], float(measurement.z[0]), *memory[5:])  # type: ignore[arg-type]
            case "flow_angles":
                return self._wind(memory, measurement.z)
            case "on_ground":
                down = bool(measurement.z[0] > 0.5)
                return memory if down == memory.on_ground else memory._replace(on_ground=down)
            case "pose":
                return self._start(memory, measurement)
            case "edges":
                return self._look(memory, measurement)
            case "gyro":
                return memory  # the inertial unit has its own
        raise ValueError(f"the range observer does not know measurements of kind {measurement.kind!r}")

    def read(self, memory: Memory, t: float | None = None) -> Estimate:
        """The estimate at the memory's time; an age `t` asked for is ignored (see Rewind)."""
        scene, z = memory.scene, memory.inertial
        if scene is None or z is None:
            told = np.concatenate([memory.unseen, np.zeros(len(NAMES) - len(memory.unseen))])
            return Estimate(memory.t, NAMES, told, None, False, {"on_ground": memory.on_ground})
        mean = _mean(
            z, scene.s, memory.t - memory.t_inertial, self._lever, memory.wind, scene.spread, scene.d[0], scene.d[1],
            scene.d[2],
        )  # fmt: skip
        flags = {
            "threshold_in_view": scene.threshold_in_view,
            "on_ground": memory.on_ground,
            "lost": scene.misses >= self.config.lost_after and not memory.on_ground,
            "range_valid": memory.trusted,
        }
        return Estimate(memory.t, NAMES, mean, _covariance(scene.P), True, flags, scene.residuals)

    # ------------------------------------------------------------------------------------------- updates

    def _inertial(self, memory: Memory, z: Array) -> Memory:
        scene, dt = memory.scene, memory.t - memory.t_inertial
        if scene is not None and memory.inertial is not None:
            scene = self.ranging.move(scene, _way(scene.s, memory.inertial, z, self._lever), dt)
        unseen = memory.unseen if scene is not None else _unseen(memory, z, dt)
        return Memory(memory.t, scene, z, memory.t, *memory[4:-1], unseen)

    def _wind(self, memory: Memory, flow: Array) -> Memory:
        """What is left of the velocity over the ground when the one through the air is taken off, smoothed.

        flow (2,): angle of attack and sideslip [rad], which mean nothing on the wheels.
        """
        V = memory.airspeed
        if memory.scene is None or memory.inertial is None or memory.on_ground or not V > 0.0:
            return memory
        dt = memory.t - memory.t_wind
        share = dt / (dt + self.config.wind_filter) if math.isfinite(dt) else 1.0
        wind = _wind(memory.inertial, memory.scene.s, flow, V, memory.wind, share)
        return Memory(*memory[:5], wind, memory.t, *memory[7:])

    def _start(self, memory: Memory, m: Measurement) -> Memory:
        """From an acquired pose: the ray is believed, the range on it is the guess; a scale that is trusted stays."""
        c, z = self.config, memory.inertial
        if z is None:
            return memory
        camera = m.z[:3] + from_euler(m.z[3], m.z[4], m.z[5]) @ self._lever * (1.0, 1.0, -1.0)
        if memory.scene is not None and memory.trusted:
            factor = memory.scene.s[sc.WIDTH] / self._nominal
        else:
            factor = 1.0 if c.first_range is None else c.first_range / math.hypot(camera[0], camera[1])
        s = np.zeros(sc.N)
        s[[sc.X, sc.Y, sc.H]] = factor * camera
        s[sc.WIDTH] = factor * self._nominal
        s[sc.COURSE] = wrap(z[2] - m.z[5])
        # acquired attitudes are the camera's: how they differ from the inertial unit's is an error of the mounting
        phi, theta, _ = to_euler(carriage(z, s).R_RB)
        s[sc.EROLL], s[sc.ETILT] = m.z[3] - phi, theta - m.z[4]
        L = np.zeros((sc.N, 6))
        L[sc.X, 0] = L[sc.Y, 1] = L[sc.H, 2] = factor
        L[sc.EROLL, 3], L[sc.ETILT, 4], L[sc.COURSE, 5] = 1.0, -1.0, -1.0
        P = c.pose_factor**2 * (L @ m.R @ L.T)
        # pitch came from the horizon, whose dip was taken for a height that is as uncertain as the scale
        dipped = np.zeros(sc.N)
        dipped[sc.ETILT], dipped[sc.H] = 1.0, abs(s[sc.X])
        P += (0.5 * c.first_spread * horizon_dip(float(camera[2]))) ** 2 * np.outer(dipped, dipped)
        P[sc.EPAN, sc.EPAN] = c.camera_sigma**2
        P[sc.COURSE, sc.COURSE] += c.camera_sigma**2
        P[sc.COURSE, sc.EPAN] = P[sc.EPAN, sc.COURSE] = -(c.camera_sigma**2)
        return memory._replace(scene=self.ranging.start(s, P, memory.t))

    def _look(self, memory: Memory, m: Measurement) -> Memory:
        if memory.scene is None or memory.inertial is None:
            return memory
        scene = self.ranging.look(
            memory.scene, Image(memory.t, m, memory.inertial), carriage(memory.inertial, memory.scene.s)
        )
        return memory._replace(scene=scene, trusted=memory.trusted or scene.spread <= self.config.trust)


def _unseen(memory: Memory, z: Array, dt: float) -> Array:
    """`Memory.unseen` after a reading z (12,), dt [s] after the one before: pitch from where it began."""
    phi, theta, _, p, q, r = z[:6].tolist()
    if memory.inertial is None or not memory.airspeed > 0.0:
        return _NOTHING
    _, _, w, *_, pitch, _ = memory.unseen.tolist()
    pitch += theta - float(memory.inertial[1])
    return np.array([memory.airspeed, 0.0, followed(w, q, memory.airspeed, dt), p, q, r, phi, pitch, 0.0])


@kernel
def _mean(
    z: Array, s: Array, since: float, lever: Array, wind: Array, spread: float, d1: float, d2: float, d3: float
) -> Array:
    """Mean of `read` (22,): the cg, `since` [s] after the inertial reading z (12,), from the camera's place s (N,)."""
    R_RB, v_R = carriage(z, s)
    out = np.empty(len(NAMES))
    arm = turned(R_RB, lever[0], lever[1], lever[2])
    for k in range(3):
        out[k] = R_RB[0, k] * v_R[0] + R_RB[1, k] * v_R[1] + R_RB[2, k] * v_R[2]
        out[3 + k], out[12 + k] = z[3 + k], wind[k]
        out[9 + k] = s[k] + (-1.0 if k == 2 else 1.0) * (v_R[k] * since - arm[k])
    angles = to_euler(R_RB)
    out[6], out[7], out[8] = angles[0], angles[1], angles[2]
    out[15], out[16], out[17], out[18] = s[sc.EPAN], s[sc.ETILT], s[sc.WIDTH], spread
    out[19], out[20], out[21] = d1, d2, d3
    return out


@kernel
def _covariance(P: Array) -> Array:
    """Covariance of `read` (22, 22) from the scene's (N, N)."""
    out = np.zeros((len(NAMES), len(NAMES)))
    for i in range(len(_ROWS)):
        for j in range(len(_ROWS)):
            out[_ROWS[i, 0], _ROWS[j, 0]] = _ROWS[i, 2] * _ROWS[j, 2] * P[_ROWS[i, 1], _ROWS[j, 1]]
    for i in range(len(NAMES)):
        out[i, i] += _REST[i]
    return out


@kernel
def _way(s: Array, before: Array, z: Array, lever: Array) -> Array:
    """(3,) [m] of the camera in R between two inertial readings (12,)."""
    then = turned(from_euler(before[0], before[1], before[2]), lever[0], lever[1], lever[2])
    now = turned(from_euler(z[0], z[1], z[2]), lever[0], lever[1], lever[2])
    way, out = (
        turned(from_course(s), z[9] + now[0] - then[0], z[10] + now[1] - then[1], z[11] + now[2] - then[2]),
        np.empty(3),
    )
    out[0], out[1], out[2] = way
    return out


@kernel
def _wind(z: Array, s: Array, flow: Array, V: float, before: Array, share: float) -> Array:
    """(3,) [m/s] wind in R: the velocity over the ground less that through the air, `share` of it new."""
    R_RB, v_R = carriage(z, s)
    forward = V * math.cos(flow[1])
    air = turned(R_RB, forward * math.cos(flow[0]), V * math.sin(flow[1]), forward * math.sin(flow[0]))
    out = np.empty(3)
    for k in range(3):
        out[k] = before[k] + share * (v_R[k] - air[k] - before[k])
    return out
