"""What the section `control:` of an aircraft's vehicle.yaml means. Angles in degrees here, and only here.

Plain dataclasses: the reader of vehicle.yaml builds and checks them by their type hints; every __post_init__ raises
ValueError on numbers that cannot be flown.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from landing_sim.control.checks import STRICT, increasing, positive


@dataclass(frozen=True, slots=True)
class TrimPointSettings:
    """A flight condition to design for. Gains are scheduled over airspeed."""

    airspeed_mps: float
    flight_path_deg: float

    __pydantic_config__ = STRICT


@dataclass(frozen=True, slots=True)
class ModeSettings:
    """A wanted mode: eigenvalue real ± imag·j [1/s] and the ratios of the eigenvector's components that matter."""

    name: str
    real: float
    imag: float = 0.0
    shape: dict[str, float] = field(default_factory=dict)

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        if self.real >= 0.0 or self.imag < 0.0:
            raise ValueError(f"mode {self.name!r}: real must be negative and imag 0 or more")


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """One half of the aircraft. States u w q theta H int_V int_H or v p r phi psi y; m, m/s, rad, s.

    `typical` sizes scale the states when eigenvectors are fitted; `tolerance` (default: typical) makes the weights Q0 of
    the plain LQ part; `authority` is the use of each input [deg, N] worth as much as a tolerance.
    """

    modes: tuple[ModeSettings, ...]
    typical: dict[str, float]
    authority: dict[str, float]
    rho: float
    tolerance: dict[str, float] = field(default_factory=dict)

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        for sizes in (self.typical, self.authority, self.tolerance):
            positive(**sizes)
        if self.rho < 0.0:
            raise ValueError("rho must be 0 or more")


@dataclass(frozen=True, slots=True)
class ThrustSettings:
    """Believed thrust of all engines together at idle and at full throttle over airspeed; lag of the engines."""

    airspeed_mps: tuple[float, ...]
    idle_n: tuple[float, ...]
    full_n: tuple[float, ...]
    lag_s: float

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        increasing("thrust.airspeed_mps", self.airspeed_mps)
        if not len(self.airspeed_mps) == len(self.idle_n) == len(self.full_n):
            raise ValueError("thrust: airspeed_mps, idle_n and full_n must be equally long")
        if any(full <= idle for idle, full in zip(self.idle_n, self.full_n)):
            raise ValueError("thrust: full_n must exceed idle_n")


@dataclass(frozen=True, slots=True)
class LimitSettings:
    """Believed limits of one control surface, about zero, and the time constant its commands are smoothed with.

    recovery_s, of the elevator only: a command that outran the rate limit is followed in its changes at once, in what is
    left of it with this time constant, so that a surface turns when its command does; 0 catches up at the full rate, which
    comes late by up to a quarter of a swing.
    """

    max_deg: float
    rate_dps: float
    lag_s: float
    smoothing_s: float = 0.0
    recovery_s: float = 0.0

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        positive(max_deg=self.max_deg, rate_dps=self.rate_dps)
        if not (self.smoothing_s >= 0.0 and self.recovery_s >= 0.0):
            raise ValueError("smoothing_s and recovery_s must be 0 or more")


@dataclass(frozen=True, slots=True)
class GroundEffectSettings:
    """How trim changes near the ground, over the height of the main wheels: what to add to elevator and alpha."""

    height_m: tuple[float, ...]
    elevator_deg: tuple[float, ...]
    alpha_deg: tuple[float, ...]

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        increasing("ground_effect.height_m", self.height_m)
        if not len(self.height_m) == len(self.elevator_deg) == len(self.alpha_deg):
            raise ValueError("ground_effect: height_m, elevator_deg and alpha_deg must be equally long")


@dataclass(frozen=True, slots=True)
class RolloutSettings:
    """On the wheels: attitude and elevator over groundspeed, steering, brakes.

    elevator = schedule + attitude_gain (theta - schedule) + pitch_rate_gain q; both schedules are approached from the
    values at touchdown, at attitude_rate_dps and elevator_rate_dps. Heading asked for: -y_gain y, limited. Steering
    u = heading_gain error - yaw_rate_gain r [rad]; rudder -u, growing below steering_mps with its square over airspeed's
    up to fourfold, and brakes ± brake_steering u.
    """

    groundspeed_mps: tuple[float, ...]
    attitude_deg: tuple[float, ...]
    elevator_deg: tuple[float, ...]
    brake: tuple[float, ...]
    attitude_rate_dps: float
    elevator_rate_dps: float
    attitude_gain: float
    pitch_rate_gain_s: float
    roll_gain: float
    roll_rate_gain_s: float
    y_gain_deg_per_m: float
    heading_limit_deg: float
    heading_gain: float
    yaw_rate_gain_s: float
    brake_steering_per_deg: float
    steering_mps: float
    brake_rate_per_s: float = 0.5
    flap: float | None = None  # on the wheels; as in flight if not given

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        increasing("rollout.groundspeed_mps", self.groundspeed_mps)
        n = len(self.groundspeed_mps)
        if not n == len(self.attitude_deg) == len(self.elevator_deg) == len(self.brake):
            raise ValueError("rollout: groundspeed_mps, attitude_deg, elevator_deg and brake must be equally long")


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Where the platform looks: the runway's direction, raised by elevation_deg; before acquisition, these angles."""

    elevation_deg: float = 0.0
    max_deg: float = 60.0

    __pydantic_config__ = STRICT


@dataclass(frozen=True, slots=True)
class GustSettings:
    """Elevator against the lift that a gust along the nose gives or takes, at airspeed_mps (as 1/V² elsewhere).

    What is faster than the wind smoothed over filter_s is a gust, answered so and by nothing else; airspeed less gusts is
    what is fed back and what gains and trim are scheduled over. How a reported wind falls towards the ground is no gust.
    """

    elevator_deg_per_mps: float
    airspeed_mps: float
    filter_s: float

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        positive(airspeed_mps=self.airspeed_mps, filter_s=self.filter_s)


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """Section `control:`."""

    trim_points: tuple[TrimPointSettings, ...]
    flap: float
    loop_delay_s: float  # computing, hold and transport delay that margins are quoted with
    longitudinal: AxisSettings
    lateral: AxisSettings
    thrust: ThrustSettings
    elevator: LimitSettings
    aileron: LimitSettings
    rudder: LimitSettings
    integral_limits: dict[str, float]  # int_V [m], int_H [m s]
    rollout: RolloutSettings
    ground_effect: GroundEffectSettings | None = None
    camera: CameraSettings = CameraSettings()
    gust: GustSettings | None = None

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        increasing("control.trim_points airspeed_mps", sorted(p.airspeed_mps for p in self.trim_points))
        if set(self.integral_limits) != {"int_V", "int_H"}:
            raise ValueError("integral_limits needs exactly int_V and int_H")
        if not 0.0 <= self.flap <= 1.0:
            raise ValueError(f"flap must be 0 ... 1, not {self.flap}")
