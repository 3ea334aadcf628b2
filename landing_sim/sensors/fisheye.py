"""Sensor "camera" of a quadrotor: a strapped-down fisheye that looks at a `world.planes.Scene`."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.sensors.fisheye_render import Rays, SceneTables, render
from landing_sim.sensors.latency import Latency
from landing_sim.sensors.render_noise import develop_frame, gaussian_quantiles
from landing_sim.signals import CameraSample, CameraTruth, Sample, Truth
from landing_sim.types import Array
from landing_sim.world.planes import Scene


class FisheyeRenderer:
    """One lens before one scene.

    Parameters
    ----------
    lens, scene : the true ones
    noise : [grey levels] sigma, independent in every pixel and frame
    key : 64-bit key of the pixel noise, from `Noise.key()`
    """

    __slots__ = ("_lens_law", "_quantiles", "_rays", "_tables", "key", "lens", "noise", "scene")

    def __init__(self, lens: Fisheye, scene: Scene, noise: float, key: int) -> None:
        if not (math.isfinite(noise) and noise >= 0.0):
            raise ValueError(f"fisheye camera: noise must be >= 0 grey levels, not {noise}")
        self.lens, self.scene, self.noise, self.key = lens, scene, noise, np.uint64(key)
        self._rays, self._tables = Rays(lens), SceneTables(scene)
        self._lens_law, self._quantiles = np.array([1.0, 0.0, noise]), gaussian_quantiles()

    def light(self, p_RC: Array, R_CR: Array) -> np.ndarray:
        """(height, width) float32 grey levels before noise."""
        return render(self._tables, self._rays, p_RC, R_CR)

    def image(self, p_RC: Array, R_CR: Array, index: int) -> np.ndarray:
        """(height, width) uint8 of frame number `index`."""
        return develop_frame(self.light(p_RC, R_CR), self._lens_law, self._quantiles, self.key, index)

    def frame(self, p_RC: Array, R_CR: Array, index: int) -> FisheyeFrame:
        """Frame number `index` exposed at a pose. Raises ValueError for one that is not finite or not above the ground."""
        if not math.isfinite(sum(p_RC.tolist()) + sum(R_CR.ravel().tolist())):
            raise ValueError(f"camera pose is not finite: p_RC {p_RC}, R_CR {R_CR.tolist()}")
        if p_RC[2] >= 0.0:
            raise ValueError(f"the camera is below the ground: p_RC {p_RC}")
        return FisheyeFrame(self, p_RC.copy(), R_CR.copy(), index)


class FisheyeFrame:
    """signals.Frame: rendered whole when somebody looks, and kept."""

    __slots__ = ("R_CR", "_image", "height", "index", "p_RC", "renderer", "width")

    def __init__(self, renderer: FisheyeRenderer, p_RC: Array, R_CR: Array, index: int) -> None:
        self.renderer, self.p_RC, self.R_CR, self.index = renderer, p_RC, R_CR, index
        self.width, self.height = renderer.lens.width, renderer.lens.height
        self._image: np.ndarray | None = None

    def full(self) -> np.ndarray:
        """(height, width) uint8, not to be written on."""
        if self._image is None:
            self._image = self.renderer.image(self.p_RC, self.R_CR, self.index)
            self._image.flags.writeable = False
        return self._image

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        """(height, width) uint8; raises ValueError if the window leaves the frame."""
        if u0 < 0 or v0 < 0 or u0 + width > self.width or v0 + height > self.height:
            raise ValueError(
                f"window {width}x{height} at ({u0}, {v0}) does not lie inside the {self.width}x{self.height} frame"
            )
        return self.full()[v0 : v0 + height, u0 : u0 + width]

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
        """(n, height, width) at corners (n, 2) [u0, v0]."""
        out = np.empty((len(corners), height, width), np.uint8)
        for i, (u0, v0) in enumerate(corners):
            out[i] = self.window(int(u0), int(v0), width, height)
        return out


class FisheyeCamera:
    """Sensor "camera": a frame each period, arriving late.

    Parameters
    ----------
    renderer : of the true lens and scene
    latency : until a frame arrives; its noise is its own, the pixels have the renderer's key
    period : [s] between frames
    """

    channels = 0  # no numbers that a fault could scale or shift

    __slots__ = ("_index", "_latency", "name", "period", "renderer")

    def __init__(self, renderer: FisheyeRenderer, latency: Latency, period: float = 0.07) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise ValueError(f"fisheye camera: period must be > 0 s, not {period}")
        self.name, self.period, self.renderer = "camera", period, renderer
        self._latency, self._index = latency, 0

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample:
        """Expose a frame at truth.t; pixels are computed when somebody looks."""
        index = self._index
        self._index += 1
        frame = self.renderer.frame(camera.p_RC, camera.R_CR, index)
        return Sample(
            self.name, truth.t, self._latency.arrival(truth.t), CameraSample(frame, index, 0.0, 0.0, 0.0, 0.0)
        )
