"""The pinhole camera: u = cx + f x/z, v = cy + f y/z in frame C (x right, y down, z forward)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pixel centres are integers, so the centre of a 512-pixel row is 255.5."""

    width: int
    height: int
    f: float  # [px]
    cx: float
    cy: float

    @staticmethod
    def centred(width: int, height: int, f: float) -> Intrinsics:
        return Intrinsics(width, height, f, (width - 1) / 2.0, (height - 1) / 2.0)

    @property
    def K(self) -> Array:
        return np.array([[self.f, 0.0, self.cx], [0.0, self.f, self.cy], [0.0, 0.0, 1.0]])


def project(p_C: Array, camera: Intrinsics) -> Array:
    """(n, 2) [px] image of the points p_C (n, 3) [m]; NaN where z <= 0."""
    z = np.where(p_C[:, 2] > 0.0, p_C[:, 2], np.nan)
    return np.column_stack([camera.cx + camera.f * p_C[:, 0] / z, camera.cy + camera.f * p_C[:, 1] / z])
