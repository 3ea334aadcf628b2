"""Landing on a runway whose size nobody told: inertial and air data carry the state, images and motion range the runway.

    inertial unit, vanes, airspeed --> attitude, rates, velocities, wind
    edges --> a Ranging (gibert.py, kinematic_ekf.py) --> course, place, width

Late images are for `Rewind` to apply when they were taken: the scene is then moved on by the inertial increments since,
which is exact.

Source     Gibert et al. 2015, section 4.2; the acquisition gives the first ray, a first guess the range on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from landing_sim.estimators.observer import scene as sc
from landing_sim.estimators.observer.looking import Image, Ranging
from landing_sim.estimators.observer.scene import Scene, carriage
from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.geometry.so3 import from_euler, to_euler, wrap
from landing_sim.signals import Command, Estimate, Measurement
from landing_sim.types import Array

RAD = math.pi / 180.0
NAMES = (
    *("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H"),
    *("wx", "wy", "wz", "epan", "etilt", "W", "spread", "d1", "d2", "dW"),
)
# rows of NAMES from the scene's states, and the variances of those that come from instruments
_OF_SCENE = np.zeros((len(NAMES), sc.N))
for _name, _state, _sign in (("x", sc.X, 1), ("y", sc.Y, 1), ("H", sc.H, 1), ("psi", sc.COURSE, -1), ("W", sc.WIDTH, 1),
                             ("epan", sc.EPAN, 1), ("etilt", sc.ETILT, 1)):  # fmt: skip
    _OF_SCENE[NAMES.index(_name), _state] = _sign
_REST = np.diag(np.square([*[0.2] * 3, *[0.05 * RAD] * 6, *[0.02] * 3, *[1.0] * 3, *[1e-5] * 2, 1e-3, *[1e-3] * 4]))


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


@dataclass(frozen=True, slots=True)
class Memory:
    """All that the observer remembers; never changed in place."""

    t: float
    scene: Scene | None = None  # at the time of the last inertial reading
    inertial: Array | None = None  # (12,) the last reading
    t_inertial: float = -math.inf
    airspeed: float = math.nan
    wind: Array = field(default_factory=lambda: np.zeros(3))
    t_wind: float = -math.inf
    on_ground: bool = False
    trusted: bool = False


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
        return memory if t <= memory.t else replace(memory, t=t)

    def update(self, memory: Memory, measurement: Measurement) -> Memory:
        """Raises ValueError for a measurement of a kind it has no use for."""
        match measurement.kind:
            case "inertial":
                return self._inertial(memory, measurement.z)
            case "airspeed":
                return replace(memory, airspeed=float(measurement.z[0]))
            case "flow_angles":
                return self._wind(memory, measurement.z)
            case "on_ground":
                return replace(memory, on_ground=bool(measurement.z[0] > 0.5))
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
            return Estimate(memory.t, NAMES, np.zeros(len(NAMES)), None, False, {"on_ground": memory.on_ground})
        s = scene.s
        carried = carriage(z, s)
        since = memory.t - memory.t_inertial
        way = carried.v_R * since - carried.R_RB @ self._lever
        p = s[sc.X], s[sc.Y], s[sc.H]
        p = p[0] + way[0], p[1] + way[1], p[2] - way[2]
        uvw = carried.R_RB.T @ carried.v_R
        phi, theta, psi = to_euler(carried.R_RB)
        mean = np.array([
            *uvw, *z[3:6], phi, theta, psi, *p, *memory.wind,
            s[sc.EPAN], s[sc.ETILT], s[sc.WIDTH], scene.spread, *scene.d,
        ])  # fmt: skip
        flags = {
            "threshold_in_view": scene.threshold_in_view,
            "on_ground": memory.on_ground,
            "lost": scene.misses >= self.config.lost_after and not memory.on_ground,
            "range_valid": memory.trusted,
        }
        return Estimate(memory.t, NAMES, mean, self._covariance(scene), True, flags, scene.residuals)

    # ------------------------------------------------------------------------------------------- updates

    def _inertial(self, memory: Memory, z: Array) -> Memory:
        scene, dt = memory.scene, memory.t - memory.t_inertial
        if scene is not None and memory.inertial is not None:
            before = memory.inertial
            R_RN = sc.from_course(scene.s)
            lever = (from_euler(z[0], z[1], z[2]) - from_euler(before[0], before[1], before[2])) @ self._lever
            scene = self.ranging.move(scene, R_RN @ (z[9:12] + lever), dt)
        return replace(memory, inertial=z, t_inertial=memory.t, scene=scene)

    def _wind(self, memory: Memory, flow: Array) -> Memory:
        """What is left of the velocity over the ground when the one through the air is taken off, smoothed.

        flow (2,): angle of attack and sideslip [rad], which mean nothing on the wheels.
        """
        V = memory.airspeed
        if memory.scene is None or memory.inertial is None or memory.on_ground or not V > 0.0:
            return memory
        carried = carriage(memory.inertial, memory.scene.s)
        alpha, beta = float(flow[0]), float(flow[1])
        forward = V * math.cos(beta)
        air = np.array([forward * math.cos(alpha), V * math.sin(beta), forward * math.sin(alpha)])
        wind = carried.v_R - carried.R_RB @ air
        dt = memory.t - memory.t_wind
        share = dt / (dt + self.config.wind_filter) if math.isfinite(dt) else 1.0
        return replace(memory, wind=memory.wind + share * (wind - memory.wind), t_wind=memory.t)

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
        return replace(memory, scene=self.ranging.start(s, P, memory.t))

    def _look(self, memory: Memory, m: Measurement) -> Memory:
        if memory.scene is None or memory.inertial is None:
            return memory
        scene = self.ranging.look(
            memory.scene, Image(memory.t, m, memory.inertial), carriage(memory.inertial, memory.scene.s)
        )
        return replace(memory, scene=scene, trusted=memory.trusted or scene.spread <= self.config.trust)

    def _covariance(self, scene: Scene) -> Array:
        return np.asarray(_OF_SCENE @ scene.P @ _OF_SCENE.T + _REST)
