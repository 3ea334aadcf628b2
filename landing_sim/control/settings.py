"""What the sections `control:` and `guidance:` of an aircraft's vehicle.yaml mean. Angles in degrees here, and only here.

Plain dataclasses: the reader of vehicle.yaml builds and checks them by their type hints; every __post_init__ raises
ValueError on numbers that cannot be flown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

_STRICT = {
    "extra": "forbid",
    "strict": True,
    "allow_inf_nan": False,
}  # for vehicle.py, which builds these with pydantic


def _increasing(name: str, values: Sequence[float]) -> None:
    if len(values) < 2 or any(b <= a for a, b in pairwise(values)):
        raise ValueError(f"{name} must be two or more increasing numbers, not {list(values)}")


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not value > 0.0:
            raise ValueError(f"{name} must be positive, not {value}")


@dataclass(frozen=True, slots=True)
class TrimPointSettings:
    """A flight condition to design for. Gains are scheduled over airspeed."""

    airspeed_mps: float
    flight_path_deg: float

    __pydantic_config__ = _STRICT


@dataclass(frozen=True, slots=True)
class ModeSettings:
    """A wanted mode: eigenvalue real ± imag·j [1/s] and the ratios of the eigenvector's components that matter."""

    name: str
    real: float
    imag: float = 0.0
    shape: dict[str, float] = field(default_factory=dict)

    __pydantic_config__ = _STRICT

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

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        for sizes in (self.typical, self.authority, self.tolerance):
            _positive(**sizes)
        if self.rho < 0.0:
            raise ValueError("rho must be 0 or more")


@dataclass(frozen=True, slots=True)
class ThrustSettings:
    """Believed thrust of all engines together at idle and at full throttle over airspeed; lag of the engines."""

    airspeed_mps: tuple[float, ...]
    idle_n: tuple[float, ...]
    full_n: tuple[float, ...]
    lag_s: float

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _increasing("thrust.airspeed_mps", self.airspeed_mps)
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

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _positive(max_deg=self.max_deg, rate_dps=self.rate_dps)
        if not (self.smoothing_s >= 0.0 and self.recovery_s >= 0.0):
            raise ValueError("smoothing_s and recovery_s must be 0 or more")


@dataclass(frozen=True, slots=True)
class GroundEffectSettings:
    """How trim changes near the ground, over the height of the main wheels: what to add to elevator and alpha."""

    height_m: tuple[float, ...]
    elevator_deg: tuple[float, ...]
    alpha_deg: tuple[float, ...]

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _increasing("ground_effect.height_m", self.height_m)
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

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _increasing("rollout.groundspeed_mps", self.groundspeed_mps)
        n = len(self.groundspeed_mps)
        if not n == len(self.attitude_deg) == len(self.elevator_deg) == len(self.brake):
            raise ValueError("rollout: groundspeed_mps, attitude_deg, elevator_deg and brake must be equally long")


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Where the platform looks: the runway's direction, raised by elevation_deg; before acquisition, these angles."""

    elevation_deg: float = 0.0
    max_deg: float = 60.0

    __pydantic_config__ = _STRICT


@dataclass(frozen=True, slots=True)
class GustSettings:
    """Elevator against the lift that a gust along the nose gives or takes, at airspeed_mps (as 1/V² elsewhere).

    What is faster than the wind smoothed over filter_s is a gust, answered so and by nothing else; airspeed less gusts is
    what is fed back and what gains and trim are scheduled over.
    """

    elevator_deg_per_mps: float
    airspeed_mps: float
    filter_s: float

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _positive(airspeed_mps=self.airspeed_mps, filter_s=self.filter_s)


@dataclass(frozen=True, slots=True)
class SpeedSettings:
    """Approach speed by rule, calibrated airspeeds: V_ref = max(reference (m / at_mass)^1/2, least), then
    V_app = V_ref + max(add_least, headwind_share headwind).

    Without it approach_mps is flown whatever the mass.
    """

    reference_kt: float
    at_mass_kg: float
    least_kt: float
    add_least_kt: float
    headwind_share: float

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _positive(reference_kt=self.reference_kt, at_mass_kg=self.at_mass_kg, least_kt=self.least_kt)


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

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _increasing("control.trim_points airspeed_mps", sorted(p.airspeed_mps for p in self.trim_points))
        if set(self.integral_limits) != {"int_V", "int_H"}:
            raise ValueError("integral_limits needs exactly int_V and int_H")
        if not 0.0 <= self.flap <= 1.0:
            raise ValueError(f"flap must be 0 ... 1, not {self.flap}")


@dataclass(frozen=True, slots=True)
class GearSettings:
    """Main wheels at rest, from the cg: forward, to the side, down [m]."""

    forward_m: float
    side_m: float
    down_m: float

    __pydantic_config__ = _STRICT


@dataclass(frozen=True, slots=True)
class HoldOffSettings:
    """Near the ground a steady sink matters more than the place: from from_height_m down to to_height_m of the wheels the
    share of a height error that is flown back falls from 1 to `share`."""

    from_height_m: float
    to_height_m: float
    share: float

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        if not self.from_height_m > self.to_height_m >= 0.0:
            raise ValueError("hold_off: from_height_m must be above to_height_m")
        if not 0.0 < self.share <= 1.0:  # without any, it might float for ever
            raise ValueError(f"hold_off: share must be above 0 and at most 1, not {self.share}")


@dataclass(frozen=True, slots=True)
class PathSettings:
    """Glide and flare of the main wheels: H = (flare_height + sink_height) exp(-s/L) - sink_height to touchdown_x."""

    glide_deg: float
    flare_height_m: float  # of the wheels, where glide and flare meet
    sink_height_m: float  # how far below the surface the flare aims: more is firmer and hits the spot better
    touchdown_x_m: float
    approach_mps: float
    touchdown_mps: float
    height_error_limit_m: float  # larger deviations are flown back at this one's rate
    hold_off: HoldOffSettings | None = None
    straight_from_m: float | None = None  # from this height the path keeps its slope, past its end with idling engines
    turbulence_share: float = 0.0  # of the wind at 20 ft that goes with reported turbulence, added to touchdown_mps

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _positive(
            glide_deg=self.glide_deg,
            flare_height_m=self.flare_height_m,
            sink_height_m=self.sink_height_m,
            height_error_limit_m=self.height_error_limit_m,
            touchdown_mps=self.touchdown_mps,
        )
        if self.approach_mps < self.touchdown_mps:
            raise ValueError("approach_mps must not be below touchdown_mps")
        if self.turbulence_share < 0.0:
            raise ValueError(f"turbulence_share must be 0 or more, not {self.turbulence_share}")


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """Tangential capture of the centreline by a turn at constant bank; bank stays within the limit.

    Within join_m the course is proportional to the offset; below end_m the lateral feedback takes over, trimmed at
    integral_per_s times the offset, up to the width of end_m: what is believed of the crosswind may be a little wrong.
    """

    bank_deg: float
    bank_limit_deg: float
    intercept_limit_deg: float
    join_m: float
    end_m: float
    heading_error_limit_deg: float
    integral_per_s: float = 0.0

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _positive(bank_deg=self.bank_deg, join_m=self.join_m, end_m=self.end_m, intercept=self.intercept_limit_deg)


@dataclass(frozen=True, slots=True)
class DecrabSettings:
    """Heading moves from crab to the runway's between these heights of the wheels, with the wing low that it takes.

    Attitude is corrected for the wind smoothed over wind_filter_s, on the whole approach: gusts are faster.
    """

    start_height_m: float
    end_height_m: float
    fraction: float = 1.0
    wind_filter_s: float = 1.0

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        if not self.start_height_m > self.end_height_m >= 0.0:
            raise ValueError("decrab: start_height_m must be above end_height_m")


@dataclass(frozen=True, slots=True)
class GoAroundSettings:
    """When an approach is given up. Below decision_height_m it is continued, unless the wheels are believed to be more than
    underground_m below the surface while none bears weight.
    """

    decision_height_m: float
    stable_by_m: float
    max_y_m: float
    max_height_error_m: float
    max_speed_error_mps: float
    unstable_s: float
    blackout_s: float
    climb_deg: float
    pull_mps2: float = 1.5
    acquire_s: float = 3.0  # without a runway found: climb away
    hold_s: float = 40.0  # without its range known: climb away, and
    hold_height_m: float = 60.0  # below this wheel height
    underground_m: float = 3.0

    __pydantic_config__ = _STRICT

    def __post_init__(self) -> None:
        _positive(climb_deg=self.climb_deg, pull_mps2=self.pull_mps2, underground_m=self.underground_m)


@dataclass(frozen=True, slots=True)
class GuidanceSettings:
    """Section `guidance:`."""

    gear: GearSettings
    path: PathSettings
    capture: CaptureSettings
    decrab: DecrabSettings
    go_around: GoAroundSettings
    touchdown_height_m: float  # estimated wheel height that counts as touchdown, if the estimate has no flag on_ground
    touchdown_confirm_s: float
    bounce_height_m: float = 0.5  # wheel height in the rollout from which the flare is flown again
    stopped_mps: float = 0.5

    __pydantic_config__ = _STRICT
