"""The terrain as a camera sees it: for recordings and for people. No sensor measures in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.world.terrain import Terrain, bilinear, look_up

LEVEL_GREY = 105.0  # [DN] of level ground; the sky is black
FAR = 6000.0  # [m] beyond which nothing is drawn


@kernel
def _picture(
    p: Array, R_RC: Array, f: float, cu: float, cv: float, top: float, layers: tuple, heights: tuple,  # type: ignore[type-arg]
    out: np.ndarray,
) -> None:  # fmt: skip
    rows, columns = out.shape
    pixel = 1.0 / f
    for v in range(rows):
        for u in range(columns):
            x, y = (u - cu) / f, (v - cv) / f
            d = R_RC @ np.array([x, y, 1.0])
            d /= math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            out[v, u] = 0.0
            if d[2] < 0.01 and -p[2] > top:
                continue
            s = max((-p[2] - top) / max(d[2], 1e-3), 0.0)
            before, reached = s, False
            while s < FAR:
                qx, qy = p[0] + s * d[0], p[1] + s * d[1]
                ground = 0.0
                for cell, h in heights:
                    ground += bilinear(h, qx / cell + 0.5 * h.shape[1], qy / cell + 0.5 * h.shape[0])
                above = -(p[2] + s * d[2]) - ground
                if above < 0.0:
                    reached = True
                    break
                before = s
                s += max(0.35 * above, 0.6 * s * pixel, 0.02)
            if not reached:
                continue
            near, far = before, s
            for _ in range(8):
                s = 0.5 * (near + far)
                qx, qy = p[0] + s * d[0], p[1] + s * d[1]
                ground = 0.0
                for cell, h in heights:
                    ground += bilinear(h, qx / cell + 0.5 * h.shape[1], qy / cell + 0.5 * h.shape[0])
                if -(p[2] + s * d[2]) < ground:
                    far = s
                else:
                    near = s
            value = 1.0
            for cell, light in layers:
                value *= look_up(light, cell, p[0] + s * d[0], p[1] + s * d[1], s * pixel)
            out[v, u] = value


def picture(terrain: Terrain, intrinsics: Intrinsics, p_RC: Array, R_CR: Array) -> np.ndarray:
    """(height, width) uint8 of the terrain from p_RC (3,) [m], R_CR (3, 3): light as it is, a gamma for the eye."""
    out = np.empty((intrinsics.height, intrinsics.width))
    layers = tuple((layer.cell, layer.light) for layer in terrain.layers)
    heights = tuple((layer.cell, layer.heights) for layer in terrain.layers)
    K = intrinsics.K
    top = float(terrain.layers[0].heights.max() + terrain.layers[1].heights.max()) + 0.1
    _picture(
        np.asarray(p_RC, dtype=float), np.ascontiguousarray(R_CR.T), float(K[0, 0]), float(K[0, 2]), float(K[1, 2]),
        top, layers, heights, out,
    )  # fmt: skip
    return np.asarray(np.clip(LEVEL_GREY * out**0.8, 0.0, 255.0), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class TerrainFrame:
    """signals.Frame: the picture, when somebody asks for it."""

    terrain: Terrain
    intrinsics: Intrinsics
    p_RC: Array
    R_CR: Array
    width: int
    height: int

    def full(self) -> np.ndarray:
        return picture(self.terrain, self.intrinsics, self.p_RC, self.R_CR)

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        return self.full()[v0 : v0 + height, u0 : u0 + width]

    def windows(self, corners: np.ndarray, width: int, height: int) -> np.ndarray:
        """(n, height, width) at corners (n, 2) [u0, v0]."""
        whole = self.full()
        return np.array([whole[v : v + height, u : u + width] for u, v in corners])
