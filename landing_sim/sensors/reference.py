"""Reference systems that a flight is judged against: differential GPS and radar altimeter, with their errors.

They serve the analogue of Dickmanns & Schell 1992, section 7.2, figs. 12-15, where the optical estimate is compared
with a differential GPS (whose height "showed errors") and a radiometric altimeter. The paper gives no error figures:
the defaults are estimates for equipment of about 1992 (code-differential C/A receiver at about 1 Hz; pulse altimeter).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.sensors.instrument import check_settings, draw_bias
from landing_sim.signals import CameraTruth, Sample, Truth
from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class DifferentialGpsConfig:
    """A code-differential GPS; m and s. Pairs are (horizontal per axis, vertical)."""

    period: float = 1.02  # about 1 Hz, in whole control cycles of 60 ms
    noise: tuple[float, float] = (0.5, 1.0)  # 1 sigma, white
    drift: tuple[float, float] = (1.0, 2.0)  # 1 sigma of the slow (multipath, residual atmosphere) error
    drift_time: float = 60.0  # its correlation time
    bias_sigma: tuple[float, float] = (0.5, 3.0)  # survey and datum error, constant over a run
    bias: tuple[float, float, float] | None = None  # x, y, z in R (z down) instead of a drawn one
    p_BA: tuple[float, float, float] = (0.0, 0.0, 0.0)  # antenna from the cg, body axes
    latency: float = 0.2
    name: str = "dgps"

    def __post_init__(self) -> None:
        (nh, nv), (dh, dv), (bh, bv) = self.noise, self.drift, self.bias_sigma
        check_settings(
            self.name, self.period, self.latency, noise_horizontal=nh, noise_vertical=nv, drift_horizontal=dh,
            drift_vertical=dv, bias_sigma_horizontal=bh, bias_sigma_vertical=bv, drift_time=self.drift_time,
        )  # fmt: skip
        if self.drift_time == 0.0:
            raise ValueError(f"{self.name}: drift_time must be > 0 s; set drift to (0, 0) for none")
        if len(self.p_BA) != 3 or not all(math.isfinite(c) for c in self.p_BA):
            raise ValueError(f"{self.name}: p_BA must be three finite lengths in m, not {self.p_BA}")


class DifferentialGps:
    """interfaces.Sensor: position of the antenna, (3,) [m] in R (z down), + bias + slow drift + white noise.

    The drift is a first-order Gauss-Markov process of each axis, exact for any spacing of the samples.
    """

    channels = 3

    def __init__(self, config: DifferentialGpsConfig, noise: NoiseStream) -> None:
        self.name = config.name
        self.period = config.period
        bias = draw_bias(config.name, config.bias, 1.0, 3, noise)
        self.bias = bias if config.bias is not None else bias * _axes(config.bias_sigma)
        self._noise = noise
        self._config = config
        self._p_BA = np.array(config.p_BA)
        self._white = _axes(config.noise)
        self._slow = _axes(config.drift)
        self._drift = self._slow * noise.normal(3)
        self._t = math.nan

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        config = self._config
        normals = self._noise.normal(6)
        dt = 0.0 if math.isnan(self._t) else truth.t - self._t
        self._t = truth.t
        kept = math.exp(-dt / config.drift_time)
        self._drift = kept * self._drift + math.sqrt(1.0 - kept * kept) * self._slow * normals[:3]
        p_RA = truth.p_RB + truth.R_RB @ self._p_BA
        return Sample(
            self.name, truth.t, truth.t + config.latency, p_RA + self.bias + self._drift + self._white * normals[3:]
        )


def _axes(pair: tuple[float, float]) -> Array:
    """(3,) of (horizontal, vertical)."""
    return np.array([pair[0], pair[0], pair[1]])


def level_ground(x: float, y: float) -> float:
    """Height [m] of the ground above the threshold's plane: none."""
    return 0.0


@dataclass(frozen=True, slots=True)
class RadarAltimeterConfig:
    """A radar altimeter; m and s."""

    period: float = 0.06
    noise: float = 0.3  # 1 sigma, white
    bias_sigma: float = 0.3  # constant over a run: residual of the installation delay
    bias: float | None = None  # this bias instead of a drawn one
    scale_sigma: float = 0.01  # 1 sigma of the scale error, constant over a run
    max_height: float = 762.0  # nothing is reported above (2,500 ft)
    below_cg: float = 0.0  # antenna below the cg along body z
    latency: float = 0.0
    name: str = "radar_altimeter"

    def __post_init__(self) -> None:
        check_settings(
            self.name, self.period, self.latency, noise=self.noise, bias_sigma=self.bias_sigma,
            scale_sigma=self.scale_sigma, max_height=self.max_height,
        )  # fmt: skip
        if not math.isfinite(self.below_cg):
            raise ValueError(f"{self.name}: below_cg must be a finite length in m, not {self.below_cg}")


class RadarAltimeter:
    """interfaces.Sensor: height of the antenna above the ground below it, float [m], never below 0; None when too high.

    The beam is wide: the nearest ground answers, so moderate bank and pitch do not lengthen the reading.

    Parameters
    ----------
    ground : (x, y) in R -> height [m] of the ground above the threshold's plane there
    """

    channels = 1

    def __init__(
        self,
        config: RadarAltimeterConfig,
        noise: NoiseStream,
        ground: Callable[[float, float], float] = level_ground,
    ) -> None:
        self.name = config.name
        self.period = config.period
        self.bias = float(draw_bias(config.name, config.bias, config.bias_sigma, 1, noise)[0])
        self.scale = 1.0 + config.scale_sigma * float(noise.normal(1)[0])
        self._ground = ground
        self._config = config
        self._noise = noise

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample | None:
        config = self._config
        white = config.noise * float(self._noise.normal(1)[0])
        x, y, z = truth.p_RB + config.below_cg * truth.R_RB[:, 2]
        height = -float(z) - self._ground(float(x), float(y))
        if height > config.max_height:
            return None
        return Sample(self.name, truth.t, truth.t + config.latency, max(0.0, self.scale * height + self.bias + white))
