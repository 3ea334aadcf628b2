"""Surfaces to look at: leaves of every size, one over the other, on multi-octave mottling, as a pyramid of averages.

The leaves have straight edges and corners at all scales, as natural images do: what a corner detector finds on one height,
it finds on the next. Textures are periodic, so that a tile covers any plane.

Source     leaves whose number falls with the cube of their size look alike at every scale: Lee, Mumford & Huang 2001,
           "Occlusion models for natural images". Ours are rectangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.jit import kernel
from landing_sim.noise import NoiseStream
from landing_sim.types import Array
from landing_sim.world.terrain_relief import fractal, uniform

MEAN = 128.0  # grey of every texture, so that a surface's tone and contrast are set elsewhere
SPREAD = 34.0  # its standard deviation
COVER = 0.45  # of the plane is hidden by the leaves of each factor e in size
LARGEST = 0.6  # [m] a leaf's longer side; no more than an eighth of the tile


@dataclass(frozen=True, slots=True)
class Texture:
    """A periodic tile: `levels` of uint8 (size, size), rows of y and columns of x, each half as fine as the one before.

    Texel (row j, column i) of level k is centred on x = i cell 2^k, y = j cell 2^k.
    """

    cell: float  # [m]
    levels: tuple[np.ndarray, ...] = field(repr=False)


def texture(noise: NoiseStream, size: int, cell: float) -> Texture:
    """A tile of size x size texels of `cell` [m]. Raises ValueError unless size is a power of two >= 64 and cell > 0."""
    if size < 64 or size & (size - 1):
        raise ValueError(f"texture: size must be a power of two >= 64, not {size}")
    if not (math.isfinite(cell) and cell > 0.0):
        raise ValueError(f"texture: cell must be > 0 m, not {cell}")
    largest = min(LARGEST, 0.125 * size * cell)
    # fine leaves on a part, laid out over the whole: they are many, and nobody sees that they repeat under the others
    part = min(size, 1024)
    fine = np.zeros((part, part), np.int16)
    _scatter(fine, cell, 3.0 * cell, 12.0 * cell, noise)
    coarse = np.zeros((size, size), np.int16)
    _scatter(coarse, cell, 12.0 * cell, largest, noise)
    octaves = fractal(min(size, 512), min(size, 512), 1.0, 0.3, 128.0, noise)
    import cv2

    mottle = cv2.resize(np.asarray(12.0 * octaves, dtype=np.float32), (size, size), interpolation=cv2.INTER_LINEAR)
    coarse += np.tile(fine, (size // part, size // part)) // 2
    grey = mottle + coarse
    grey *= np.float32(SPREAD / grey.std())
    grey += np.float32(MEAN - grey.mean())
    np.clip(grey, 0.0, 255.0, out=grey)
    return Texture(cell, _pyramid(np.rint(grey).astype(np.uint8)))


def _scatter(out: np.ndarray, cell: float, smallest: float, largest: float, noise: NoiseStream) -> None:
    """Rectangles with longer sides between two lengths [m] drawn on out (int16, periodic), each over those before it."""
    area = out.size * cell * cell
    # numbers fall with size^-3; a mean leaf covers 0.6 of its longer side squared
    count = math.ceil(COVER * area / (2.0 * 0.6) * (smallest**-2 - largest**-2))
    share = uniform(noise, 6 * count).reshape(6, count)
    longer = smallest / np.sqrt(1.0 - share[0] * (1.0 - (smallest / largest) ** 2))
    half = 0.5 * longer / cell
    grey = np.rint(110.0 * (share[5] - 0.5)).astype(np.int16)
    turn = math.pi * share[4]
    columns, rows = share[1] * out.shape[1], share[2] * out.shape[0]
    _draw(out, columns, rows, half, half * (0.2 + 0.8 * share[3]), np.cos(turn), np.sin(turn), grey)


@kernel
def _draw(
    out: np.ndarray, column: Array, row: Array, long: Array, short: Array, cos: Array, sin: Array, grey: np.ndarray
) -> None:
    height, width = out.shape
    for k in range(len(column)):
        c, s, a, b = cos[k], sin[k], long[k], short[k]
        reach_u, reach_v = a * abs(c) + b * abs(s), a * abs(s) + b * abs(c)
        for j in range(math.ceil(row[k] - reach_v), math.floor(row[k] + reach_v) + 1):
            for i in range(math.ceil(column[k] - reach_u), math.floor(column[k] + reach_u) + 1):
                u, v = i - column[k], j - row[k]
                if abs(c * u + s * v) <= a and abs(c * v - s * u) <= b:
                    out[j % height, i % width] = grey[k]


def _pyramid(grey: np.ndarray) -> tuple[np.ndarray, ...]:
    """Halved by a Gaussian again and again down to 16 texels, wrapping round."""
    import cv2

    out = [grey]
    while len(out[-1]) > 16:
        wide = cv2.copyMakeBorder(out[-1], 4, 4, 4, 4, cv2.BORDER_WRAP)
        out.append(np.ascontiguousarray(cv2.pyrDown(wide)[2:-2, 2:-2]))
    return tuple(out)
