"""What the sections `guidance:` and `speeds:` of an aircraft's vehicle.yaml mean. Angles in degrees here, and only here.

Plain dataclasses: the reader of vehicle.yaml builds and checks them by their type hints; every __post_init__ raises
ValueError on numbers that cannot be flown.
"""

from __future__ import annotations

from dataclasses import dataclass

from landing_sim.control.checks import STRICT, positive


@dataclass(frozen=True, slots=True)
class GearSettings:
    """Main wheels at rest, from the cg: forward, to the side, down [m]."""

    forward_m: float
    side_m: float
    down_m: float

    __pydantic_config__ = STRICT


@dataclass(frozen=True, slots=True)
class HoldOffSettings:
    """Near the ground a steady sink matters more than the place: from from_height_m down to to_height_m of the wheels the
    share of a height error that is flown back falls from 1 to `share`."""

    from_height_m: float
    to_height_m: float
    share: float

    __pydantic_config__ = STRICT

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

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        positive(
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

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        positive(bank_deg=self.bank_deg, join_m=self.join_m, end_m=self.end_m, intercept=self.intercept_limit_deg)


@dataclass(frozen=True, slots=True)
class DecrabSettings:
    """Heading moves from crab to the runway's between these heights of the wheels, with the wing low that it takes.

    Attitude is corrected for the wind smoothed over wind_filter_s, on the whole approach: gusts are faster.
    """

    start_height_m: float
    end_height_m: float
    fraction: float = 1.0
    wind_filter_s: float = 1.0

    __pydantic_config__ = STRICT

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

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        positive(climb_deg=self.climb_deg, pull_mps2=self.pull_mps2, underground_m=self.underground_m)


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

    __pydantic_config__ = STRICT


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

    __pydantic_config__ = STRICT

    def __post_init__(self) -> None:
        positive(reference_kt=self.reference_kt, at_mass_kg=self.at_mass_kg, least_kt=self.least_kt)
