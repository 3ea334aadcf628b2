"""What a runway filter is made of: its settings, what it remembers, and which states it covers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from landing_sim.estimators import states
from landing_sim.signals import Residuals
from landing_sim.types import Array

RAD = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class FilterConfig:
    """Which filter, and its noise. Spectral densities are square roots, per sqrt(Hz)."""

    kind: Literal["augmented", "plain", "split"] = "augmented"
    factorisation: Literal["dense", "ud"] = "dense"
    width: Literal["known", "state", "separate"] = "known"
    process_noise: Literal["integrated", "constant"] = "integrated"  # eq. (9), or the constant Q of eqs. (13)-(14)
    gate_sigma: float | None = 4.0
    airspeed_sigma: float = 0.5  # [m/s] of a reading, for the separate width filter
    encoder_sigma: float = 0.03 * RAD  # [rad] prior of the platform's encoder bias
    encoder_noise: float = 0.005 * RAD  # [rad] of each reading, common to all edges of an image
    gyro_bias_sigma: float = 0.1 * RAD
    width_sigma: float = 4.0  # [m] prior, where width is estimated
    wind: tuple[float, float] = (0.0, 0.0)  # [m/s] prior along x and y of R
    wind_sigma: tuple[float, float, float] = (3.0, 3.0, 1.0)  # [m/s] prior
    q_velocity: tuple[float, float, float] = (0.03, 0.04, 0.05)  # [m/s^2]
    q_velocity_alone: float = 0.15  # where wind and offsets are no states and act as noise
    q_rates: tuple[float, float, float] = (1.5 * RAD, 1.0 * RAD, 1.0 * RAD)  # [rad/s^2]
    q_attitude: float = 0.02 * RAD
    q_position: float = 0.02
    q_wind: tuple[float, float, float] = (0.35, 0.25, 0.2)  # in air that no turbulence is reported for
    turbulence: float = 0.0  # [m/s] wind at 20 ft that the reported turbulence goes with
    turbulence_velocity: float = 0.02  # [1/sqrt(s)] times that, added to q_velocity: gusts within a cycle
    offset_sigma: tuple[float, float, float] = (0.006, 0.045, 0.02)  # coefficients X, Z, m; see mismatch.py
    offset_drift: float = 0.05  # share of that by which they wander, per sqrt(s): with the speed they change
    q_width: float = 0.0
    q_ground_velocity: float = 2.0  # on the wheels
    q_ground_rates: float = 6.0 * RAD
    start_frames: int = 8  # iterated, robust, ungated
    start_iterations: int = 4
    start_rates: float = 4.0  # the delayed downwash is not known yet: q_rates times this while starting
    huber: float = 2.0
    watchdog_share: float = 0.35  # smoothed share of rejected edges that means "locked out"
    watchdog_memory: float = 5.0  # frames
    lost_after: int = 30  # frames without edges of the runway
    pose_gate: float = 5.0  # when flying blind: a pose further off than this many sigma is not believed
    approach_angle: float = -3.0 * RAD  # believed flight path while nothing is known


_STILL = np.zeros(3)


class Memory(NamedTuple):
    """All that the filter remembers; never changed in place. A tuple: four or five are made a cycle, those of every
    cycle by position, which costs half of `_replace`."""

    t: float
    valid: bool
    x: Array  # (26,)
    shadow: Array  # (6,) believed actuators, flap, thrust, delayed downwash
    P: Array  # (n, n) covariance, or U where D is given
    D: Array | None
    airspeed: float = 50.0  # last readings, for the start
    gyro: Array = _STILL
    frames: int = 0  # images since the start (or since the watchdog's last re-inflation)
    misses: int = 0  # images in a row without an edge of the runway
    rejected: float = 0.0  # smoothed share
    on_ground: bool = False
    threshold_in_view: bool = False
    reinflated: int = 0
    residuals: Residuals | None = None  # of the latest image
    width_variance: float = 0.0  # [m^2] of the separate width filter


@dataclass(frozen=True, slots=True)
class Blocks:
    """Which states a filter covers, in covariance order, and where each block starts."""

    index: np.ndarray  # (n,) state of each covariance row
    starts: np.ndarray

    @staticmethod
    def of(config: FilterConfig) -> Blocks:
        groups: list[tuple[int, ...]]
        if config.kind == "split":
            groups = [states.LONGITUDINAL, states.LATERAL]
        elif config.kind == "plain":
            groups = [states.PAPER]
        else:
            wind: tuple[int, ...] = states.WIND
            if config.width == "state":
                wind = wind[1:]  # along-track wind and width scale the scene alike: not both
            groups = [states.PAPER + wind + states.OFFSET + states.GYRO_BIAS + states.ENCODER]
        if config.width == "state":
            groups[0] += (states.WIDTH,)
        bounds = np.cumsum([0] + [len(g) for g in groups])
        return Blocks(np.array(sum(groups, ()), dtype=np.int64), bounds.astype(np.int64))
