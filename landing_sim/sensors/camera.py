"""The camera as a sensor: lazy frames with exact time stamps, and what the platform's encoders say."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.noise import NoiseStream
from landing_sim.sensors.render import Optics, Renderer
from landing_sim.signals import CameraSample, CameraTruth, Sample, Truth
from landing_sim.types import Array
from landing_sim.world.runway import Runway


class Mount(Protocol):
    """What the camera needs to know of the platform that carries it (`platform.PanTilt`)."""

    pan_cmd: float
    tilt_cmd: float
    pan_rate: float
    tilt_rate: float


@dataclass(frozen=True, slots=True)
class Encoders:
    """Angle readings of the platform. Raises ValueError for negative noise or skew."""

    pan_bias: float = 0.0  # [rad]
    tilt_bias: float = 0.0
    noise: float = 0.0  # [rad] sigma, each axis
    skew: float = 0.0  # [s] how much older than the image the reading is

    def __post_init__(self) -> None:
        values = (self.pan_bias, self.tilt_bias, self.noise, self.skew)
        if not all(map(math.isfinite, values)) or self.noise < 0.0 or self.skew < 0.0:
            raise ValueError(f"encoders must be finite with noise >= 0 and skew >= 0; got {self}")


class Camera:
    """Sensor "camera": one frame each period.

    Parameters
    ----------
    intrinsics, runway, optics, encoders : the true ones
    mount : the platform; read only
    pixel_noise, encoder_noise : separate streams, so that neither disturbs the other
    period : [s] between frames
    latency : [s] from the middle of the exposure until the frame is in the computer's hands
    """

    channels = 0  # no numbers that a fault could scale or shift

    __slots__ = ("_encoder_noise", "_encoders", "_index", "_latency", "_mount", "_past", "name", "period", "renderer")

    def __init__(
        self,
        intrinsics: Intrinsics,
        runway: Runway,
        mount: Mount,
        pixel_noise: NoiseStream,
        encoder_noise: NoiseStream,
        optics: Optics | None = None,
        encoders: Encoders | None = None,
        period: float = 0.06,
        latency: float = 0.0,
    ) -> None:
        if not (math.isfinite(period) and period > 0.0 and math.isfinite(latency) and latency >= 0.0):
            raise ValueError(f"camera needs period > 0 and latency >= 0, got {period}, {latency}")
        self.name = "camera"
        self.period = period
        self.renderer = Renderer(intrinsics, runway, optics or Optics(), pixel_noise.key())
        self._encoders, self._encoder_noise = encoders or Encoders(), encoder_noise
        self._mount, self._latency, self._index = mount, latency, 0
        self._past: deque[tuple[float, float, float]] = deque()

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample:
        """Expose a frame at truth.t; pixels are computed when somebody looks."""
        index = self._index
        self._index += 1
        if self.renderer.optics.exposure > 0.0:
            v, w = camera_motion(truth, camera, self._mount)
            frame = self.renderer.frame(camera.p_RC, camera.R_CR, index, v, w)
        else:
            frame = self.renderer.frame(camera.p_RC, camera.R_CR, index)
        pan, tilt = self._read_encoders(truth.t, camera)
        data = CameraSample(frame, index, pan, tilt, self._mount.pan_cmd, self._mount.tilt_cmd)
        return Sample(self.name, truth.t, truth.t + self._latency, data)

    def _read_encoders(self, t: float, camera: CameraTruth) -> tuple[float, float]:
        e = self._encoders
        pan, tilt = camera.pan, camera.tilt
        if e.skew > 0.0:
            pan, tilt = self._angles_at(t - e.skew, t, camera)
        noise_pan, noise_tilt = self._encoder_noise.normal(2).tolist()
        return pan + e.pan_bias + e.noise * noise_pan, tilt + e.tilt_bias + e.noise * noise_tilt

    def _angles_at(self, wanted: float, t: float, camera: CameraTruth) -> tuple[float, float]:
        """True angles at an earlier time, linear between frames; the oldest known before the first frame."""
        past = self._past
        past.append((t, camera.pan, camera.tilt))
        while len(past) > 1 and past[1][0] <= wanted:
            past.popleft()
        (t0, pan0, tilt0), (t1, pan1, tilt1) = past[0], past[min(1, len(past) - 1)]
        s = min(max((wanted - t0) / (t1 - t0), 0.0), 1.0) if t1 > t0 else 0.0
        return pan0 + s * (pan1 - pan0), tilt0 + s * (tilt1 - tilt0)


def camera_motion(truth: Truth, camera: CameraTruth, mount: Mount) -> tuple[Array, Array]:
    """v_RC_R (3,) [m/s] and w_RC_C (3,) [rad/s]: motion of a camera on a turning mount on a turning aircraft."""
    R_CB = camera.R_CR @ truth.R_RB
    # Rates of the axes as in geometry.so3.camera_from_body: pan about body z, then tilt about the camera's x.
    w_RC_C = R_CB @ (truth.w_RB_B + np.array([0.0, 0.0, mount.pan_rate]))
    w_RC_C[0] += mount.tilt_rate
    lever_R = camera.p_RC - truth.p_RB
    return truth.v_RB_R + np.cross(truth.R_RB @ truth.w_RB_B, lever_R), w_RC_C
