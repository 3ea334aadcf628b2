"""The equidistant fisheye: a ray at the angle theta off the optical axis falls r = f theta off the image's centre.

Frame C: x right, y down, z along the optical axis. Pixel centres are integers; the axis meets the middle of the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.types import Array

NEAR = 1e-5  # [rad] off the axis within which the series replace theta / rho: their error is NEAR^4


@dataclass(frozen=True, slots=True)
class Fisheye:
    """Width and height [px], focal length [px/rad]. Raises ValueError unless the image lies within theta < pi.

    261.9 px at 640 x 480 see 140 deg across the width (Brockers et al. 2012, section 4.1).
    """

    width: int
    height: int
    focal: float

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.height > 0 and math.isfinite(self.focal) and self.focal > 0.0):
            raise ValueError(f"fisheye needs width, height and focal > 0, got {self}")
        if math.hypot(self.cx, self.cy) >= math.pi * self.focal:
            raise ValueError(f"fisheye: the corners of {self.width} x {self.height} px look further round than 180 deg")

    @property
    def cx(self) -> float:
        return (self.width - 1) / 2.0

    @property
    def cy(self) -> float:
        return (self.height - 1) / 2.0

    def project(self, p_C: Array) -> Array:
        """(..., 2) [px] image of the directions or points p_C (..., 3), of any length; NaN straight behind and at 0.

        The image is bounded, the model is not: `inside` says what the sensor sees.
        """
        p_C = np.asarray(p_C, float)
        scale = self.focal * _angle_ratio(p_C)
        return np.stack([self.cx + scale * p_C[..., 0], self.cy + scale * p_C[..., 1]], axis=-1)

    def rays(self, uv: Array) -> Array:
        """(..., 3) unit directions in C of the pixels uv (..., 2)."""
        uv = np.asarray(uv, float)
        x, y = (uv[..., 0] - self.cx) / self.focal, (uv[..., 1] - self.cy) / self.focal
        theta = np.hypot(x, y)
        ratio = np.sinc(theta / np.pi)
        return np.stack([ratio * x, ratio * y, np.cos(theta)], axis=-1)

    def jacobian(self, p_C: Array) -> Array:
        """(..., 2, 3) [px per unit of p_C] derivative of `project` at p_C (..., 3)."""
        p_C = np.asarray(p_C, float)
        x, y, z = p_C[..., 0], p_C[..., 1], p_C[..., 2]
        ratio = _angle_ratio(p_C)
        flat, whole = x * x + y * y, x * x + y * y + z * z
        near = (flat < (NEAR * z) ** 2) & (z > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = np.where(near, 0.0, (z / whole - ratio) / np.where(near, 1.0, flat))  # times flat: NEAR^2
        J = np.empty((*p_C.shape[:-1], 2, 3))
        J[..., 0, 0] = ratio + x * x * bend
        J[..., 0, 1] = J[..., 1, 0] = x * y * bend
        J[..., 1, 1] = ratio + y * y * bend
        J[..., 0, 2] = -x / whole
        J[..., 1, 2] = -y / whole
        J *= self.focal
        return J

    def inside(self, uv: Array, margin: float = 0.0) -> np.ndarray:
        """(...) bool: the pixels uv (..., 2) that lie in the image, `margin` [px] or more from its outermost centres."""
        u, v = uv[..., 0], uv[..., 1]
        right, low = self.width - 1 - margin, self.height - 1 - margin
        return np.asarray((u >= margin) & (u <= right) & (v >= margin) & (v <= low))


def _angle_ratio(p_C: Array) -> Array:
    """(...) theta / rho of p_C (..., 3), rho its distance from the axis: 1 / z on the axis, NaN behind and at 0."""
    x, y, z = p_C[..., 0], p_C[..., 1], p_C[..., 2]
    rho = np.hypot(x, y)
    near = (rho < NEAR * z) & (z > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(rho > 0.0, np.arctan2(rho, z) / rho, np.nan)
        return np.asarray(np.where(near, (1.0 - (rho / z) ** 2 / 3.0) / z, far))
