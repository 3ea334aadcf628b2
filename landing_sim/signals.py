"""The data that flows around the loop: frozen, SI and radians, frames as in the README's glossary.

Frames     R runway: origin threshold centre, x along the landing direction, y right, z down, level at the threshold.
           B body: forward, right, down. C camera: x right, y down, z forward (optical axis).
           ``v_A = R_AB @ v_B``; p_RB is the position of B's origin (the nominal cg) seen from R.
Angles     3-2-1 Euler: yaw psi (0 along the landing direction), pitch theta, roll phi.
Wind       velocity of the air in R: a headwind has a negative x component.
Controls   elevator > 0 nose down, aileron > 0 right wing down, rudder > 0 nose left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from landing_sim.records import record
from landing_sim.types import Array

# --------------------------------------------------------------------------------------------- truth side


@record
class Truth:
    """State of the world at one tick. Only plant, world, sensors, the log and the judge may see it."""

    tick: int
    t: float  # [s]
    p_RB: Array  # (3,) [m] cg from the threshold, frame R
    R_RB: Array  # (3, 3)
    v_RB_R: Array  # (3,) [m/s] velocity of the cg relative to the ground, frame R
    w_RB_B: Array  # (3,) [rad/s] p, q, r
    euler: Array  # (3,) [rad] phi, theta, psi
    wind_R: Array  # (3,) [m/s] velocity of the air at the cg
    airspeed: float  # [m/s] true
    alpha: float  # [rad]
    beta: float  # [rad]
    surfaces: Array  # (4,) [rad, rad, rad, 0..1] elevator, aileron, rudder, flap: positions reached, not commanded
    thrust: float  # [N] total
    wheels_height: Array  # (3,) [m] left main, right main, tail or nose: wheel bottom above the surface, normal to it
    on_ground: np.ndarray  # (3,) bool, the same wheels
    load_factor: float  # normal, 1 in level flight


@dataclass(frozen=True, slots=True)
class Touchdown:
    """First contact of a main wheel, at plant-step resolution, measured in the runway's surface frame."""

    t: float  # [s]
    x: float  # [m] of the wheel that touched first
    y: float  # [m] of the middle between the main wheels: a wheel's own is half the track off on a perfect landing
    sink_rate: float  # [m/s] of that wheel, normal to the surface, > 0 downwards
    airspeed: float
    groundspeed: float
    pitch: float  # [rad]
    bank: float
    heading_error: float
    sideslip: float


@record
class CameraTruth:
    """Where the camera really is when a frame is exposed."""

    p_RC: Array  # (3,) [m]
    R_CR: Array  # (3, 3)
    pan: float  # [rad] true platform angles
    tilt: float


# --------------------------------------------------------------------------------------------- between the sides


@record
class Command:
    """What the onboard side asks of the aircraft and of the camera platform."""

    elevator: float = 0.0  # [rad] + nose down
    aileron: float = 0.0  # [rad] + right wing down
    rudder: float = 0.0  # [rad] + nose left
    throttle: float = 0.0  # 0 idle .. 1 full, all engines
    flap: float = 0.0  # 0 .. 1
    brake_left: float = 0.0  # 0 .. 1
    brake_right: float = 0.0  # 0 .. 1
    pan: float = 0.0  # [rad] platform angle asked for, + right
    tilt: float = 0.0  # [rad] + up


class Frame(Protocol):
    """An image that is computed where it is looked at. Pixel centres are integers; (0, 0) is the top-left centre."""

    width: int
    height: int

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        """(height, width) uint8 grey levels; columns u0.., rows v0... The window must lie inside the frame."""

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
        """(n, height, width) uint8 for n corners (n, 2) int64 [u0, v0]: the same pixels, one call.

        looked (n, 4) int64: first column and row of each that are looked at, and those behind the last; other pixels mean
        nothing then.
        """

    def full(self) -> np.ndarray:
        """(height, width) uint8: the same pixels as the windows."""


@record
class Sample:
    """One reading of one sensor: valid at t_valid, in the computer's hands at t_arrival."""

    sensor: str
    t_valid: float
    t_arrival: float
    # gyro: (3,) [rad/s]; airspeed: float [m/s]; flow_angles: (2,) [rad]; inertial: InertialReading; camera: CameraSample
    data: Any  # a faulted sensor sends nothing


@record
class CameraSample:
    """A frame together with what the platform's encoders said when it was exposed."""

    frame: Frame
    index: int
    pan: float  # [rad] encoder readings: with bias, noise and, if so configured, skew
    tilt: float
    pan_cmd: float  # [rad] the angles asked for (all that a system without encoders would know)
    tilt_cmd: float


@dataclass(frozen=True, slots=True)
class InertialReading:
    """What an inertial reference unit says, against local level and true north at the aircraft (N: north, east, down)."""

    euler: Array  # (3,) [rad] phi, theta, psi of the body; psi from true north
    rates: Array  # (3,) [rad/s] p, q, r
    v_N: Array  # (3,) [m/s] velocity over the ground
    moved_N: Array  # (3,) [m] way of the cg since the reading before: the exact integral of a velocity with this bias


@dataclass(frozen=True, slots=True)
class StrapdownReading:
    """What a strapped-down inertial unit with its own attitude filter says, as on a multirotor's autopilot."""

    a_B: Array  # (3,) [m/s^2] specific force, averaged since the reading before
    euler: Array  # (3,) [rad] phi, theta, psi of the body against R, as the autopilot believes them


# --------------------------------------------------------------------------------------------- onboard side


class Feature(IntEnum):
    """What an edge window looks at."""

    LEFT = 0
    RIGHT = 1
    THRESHOLD = 2
    HORIZON = 3


class Status(IntEnum):
    """What came of a window. Everything but FOUND is missing, and says why."""

    FOUND = 0
    OUT_OF_VIEW = 1
    NO_CONTRAST = 2
    AMBIGUOUS = 3
    DROPPED_BY_MAP = 4  # a mapped taxiway mouth lies there
    TOO_SHORT = 5
    REJECTED = 6  # set by the estimator's gate


@record
class EdgeSet:
    """The windows of one image: where they were put and what they were meant to find.

    Window i searches along the unit vector direction[i] from centre[i]; the measurement z[i] is the signed
    displacement of the edge [px] along it.
    """

    feature: np.ndarray  # (n,) int64 Feature
    centre: Array  # (n, 2) [px] u, v
    direction: Array  # (n, 2)
    status: np.ndarray  # (n,) int64 Status; z is NaN where not FOUND
    pan: float  # [rad] platform angles the front end was told
    tilt: float


@record
class Measurement:
    """What a front end or an inertial sensor tells the estimator.

    kinds      "edges": z (n,) px, R (n,) variances, geometry an EdgeSet
               "pose": z (6,) x, y, H of the cg, phi, theta, psi of the body; R (6, 6): acquisition
               "gyro": z (3,) rad/s, R (3,); "airspeed": z (1,) m/s, R (1,); "on_ground": z (1,) 0 or 1
               "inertial": z (12,) euler, rates, v_N, moved_N of an InertialReading; "flow_angles": z (2,) alpha, beta
               "strapdown": z (6,) a_B, euler of a StrapdownReading; "position": z (3,) x, y, z of the cg in R, R (3,)
               "way_point": z (3,) x, y, z in R of the middle of the landing place
    """

    kind: str
    t_valid: float
    t_arrival: float
    z: Array
    R: Array
    geometry: EdgeSet | None = None


@record
class Residuals:
    """What the estimator made of its last "edges" measurement."""

    innovation: Array  # (n,) [px] z - h(x-); NaN where nothing was measured
    status: np.ndarray  # (n,) int64 Status, with the gate's REJECTED
    nis: float  # normalised innovation squared of what was used
    dof: int


@record
class Estimate:
    """What is believed at time t. `valid` is False until the runway has been acquired; what gyros and airspeed tell may
    stand in p q r, phi, theta, u, w even so, all else means nothing.

    Names used by all aircraft estimators: u v w [m/s] INERTIAL velocity in body axes; p q r [rad/s]; phi theta psi
    [rad]; x y H [m] cg in R with H = -z; wx wy wz [m/s] wind in R; bp bq br [rad/s] gyro bias; W [m] runway width.
    """

    t: float
    names: tuple[str, ...]
    mean: Array  # (n,)
    cov: Array | None  # (n, n)
    valid: bool
    flags: Mapping[str, bool] = field(default_factory=dict)  # threshold_in_view, on_ground, lost, reinflated
    residuals: Residuals | None = None  # of the latest image

    def __getitem__(self, name: str) -> float:
        return float(self.mean[self.names.index(name)])

    def get(self, name: str, default: float = 0.0) -> float:
        return float(self.mean[self.names.index(name)]) if name in self.names else default


@record
class Reference:
    """What guidance asks of the controller.

    `mode` is the flight phase, in order: "acquire", "hold" (only while an estimate flags `range_valid` False), "capture",
    "glide", "flare", "decrab", "rollout", "stopped", or "go_around". Angles in rad, SI.
    Feed-forward terms are zero where unused.
    """

    mode: str
    airspeed: float
    height: float  # [m] of the cg
    climb_rate: float  # [m/s] dH/dt wanted
    y: float
    psi: float
    phi: float
    theta_ff: float = 0.0
    r_ff: float = 0.0
    extra: Mapping[str, float] = field(default_factory=dict)


@record
class Step:
    """One control cycle, as yielded by the loop: everything a log, a replay or a judge needs."""

    truth: Truth
    camera: CameraTruth
    samples: tuple[Sample, ...]
    measurements: tuple[Measurement, ...]
    estimate: Estimate
    reference: Reference
    command: Command
    residuals: Residuals | None = None  # of the image that came in this cycle, if one did
