"""A lunar plain: heights, and brightness as the sun lights it, from kilometres down to a centimetre.

Three layers, made alike: a map of the whole descent, and two periodic pieces with what is too small for it. Brightness is
their product, held as pyramids so that a receptor's wide or narrow view is a few look-ups. x, y as in R; heights are above
z = 0, where the landing site's mean is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.jit import kernel
from landing_sim.noise import NoiseStream
from landing_sim.types import Array
from landing_sim.world.terrain_relief import Scale, fractal, lit, relief

SITE = 150.0  # [m] half length of the landing site
LEVELS = 8  # of a pyramid: the coarsest cell is 128 of the finest


@dataclass(frozen=True, slots=True)
class TerrainConfig:
    """elevation, azimuth : [rad] of the sun, azimuth from +x towards +y; slope : [rad] rms from metre to metre."""

    elevation: float = math.radians(22.0)
    azimuth: float = math.radians(35.0)
    slope: float = math.radians(1.5)
    deepest: float = 40.0  # [m] of the one large crater; 0 = none
    flat: bool = False  # brightness as on relief, heights all zero: a picture of the Moon on a table


@dataclass(frozen=True, slots=True)
class Layer:
    """heights (rows, columns) [m] at `cell` [m], and the pyramid of light, each level half as fine as the one before."""

    cell: float
    heights: np.ndarray
    light: tuple[np.ndarray, ...] = field(repr=False)


class Terrain:
    """The plain of one seed.

    Raises ValueError for a sun that is not above the horizon or further than 45 deg off the track's direction.
    """

    def __init__(self, config: TerrainConfig, noise: NoiseStream) -> None:
        if not 0.0 < config.elevation <= 0.5 * math.pi:
            raise ValueError(f"the sun must be above the horizon, not at {math.degrees(config.elevation):g} deg")
        if abs(math.sin(config.azimuth)) > math.sqrt(0.5) + 1e-9:
            raise ValueError("the sun must stand within 45 deg of the track, before or behind")
        self.config = config
        scales = (
            Scale(1280, 2560, 1.6, config.slope, 9000, 8.0, 120.0, 900, 2.0, longest=800.0),
            Scale(1024, 1024, 0.16, 1.5 * config.slope, 4000, 0.8, 8.0, 900, 0.3, longest=16.0),
            Scale(1024, 1024, 0.016, 2.0 * config.slope, 3000, 0.08, 0.8, 900, 0.05, longest=1.6),
        )
        layers = []
        for i, scale in enumerate(scales):
            whole = i == 0
            heights = relief(scale, noise, (0.0, SITE) if whole else None, config.deepest if whole else 0.0)
            light = np.empty_like(heights)
            lit(heights, scale.cell, config.elevation, config.azimuth, light)
            if whole:
                light *= 1.0 + np.float32(0.06) * fractal(scale.rows, scale.columns, scale.cell, 0.3, 300.0, noise)
                half = round(SITE / scale.cell)
                middle = slice(scale.columns // 2 - half, scale.columns // 2 + half)
                heights -= heights[scale.rows // 2 - 20 : scale.rows // 2 + 20, middle].mean()
            if config.flat:
                heights[:] = 0.0
            layers.append(Layer(scale.cell, heights, pyramid(light)))
        self.layers = tuple(layers)

    def height(self, x: float, y: float) -> float:
        """[m] of the ground at (x, y), down to a decimetre's detail."""
        a, b, _ = self.layers
        return _height(a.heights, a.cell, x, y) + _height(b.heights, b.cell, x, y)

    def brightness(self, x: Array, y: Array, footprint: float) -> Array:
        """(n,) at the points x, y (n,) [m] as seen with a view of one sigma `footprint` [m]; 1 on level bare ground."""
        return np.array([_light(self._all, float(a), float(b), footprint) for a, b in zip(x, y)])

    @property
    def _all(self) -> tuple[tuple[float, tuple[np.ndarray, ...]], ...]:
        return tuple((layer.cell, layer.light) for layer in self.layers)


def pyramid(light: np.ndarray) -> tuple[np.ndarray, ...]:
    """LEVELS of it, each halved by a Gaussian from the one before, wrapping round."""
    import cv2

    out = [light]
    while len(out) < LEVELS:
        wide = cv2.copyMakeBorder(out[-1], 4, 4, 4, 4, cv2.BORDER_WRAP)
        out.append(np.ascontiguousarray(cv2.pyrDown(wide)[2:-2, 2:-2]))
    return tuple(out)


@kernel
def bilinear(values: np.ndarray, column: float, row: float) -> float:
    """values (rows, columns) between its cells, wrapping round."""
    rows, columns = values.shape
    i, j = math.floor(column), math.floor(row)
    u, v = column - i, row - j
    i0, j0 = i % columns, j % rows
    i1, j1 = (i + 1) % columns, (j + 1) % rows
    above = (1.0 - u) * values[j0, i0] + u * values[j0, i1]
    below = (1.0 - u) * values[j1, i0] + u * values[j1, i1]
    return (1.0 - v) * above + v * below


@kernel
def _height(heights: np.ndarray, cell: float, x: float, y: float) -> float:
    return bilinear(heights, x / cell + 0.5 * heights.shape[1], y / cell + 0.5 * heights.shape[0])


@kernel
def look_up(light: tuple[np.ndarray, ...], cell: float, x: float, y: float, footprint: float) -> float:
    """Between the two levels of a pyramid whose cells are next to `footprint` [m]."""
    level = min(max(math.log2(max(footprint, 1e-9) / cell), 0.0), len(light) - 1.001)
    k = int(level)
    share = level - k
    out = 0.0
    for n in range(2):
        values = light[k + n]
        scale = cell * 2.0 ** (k + n)
        # a level's first cell lies on the first of the level below
        value = bilinear(
            values,
            x / scale + 0.5 * light[0].shape[1] * cell / scale,
            y / scale + 0.5 * light[0].shape[0] * cell / scale,
        )
        out += (share if n else 1.0 - share) * value
    return out


@kernel
def _light(layers: tuple, x: float, y: float, footprint: float) -> float:  # type: ignore[type-arg]
    out = 1.0
    for cell, light in layers:
        out *= look_up(light, cell, x, y, footprint)
    return out
