"""Meadows and fields about a runway, as a flat ground with brightness from decametres down to a decimetre.

Three periodic pieces, each a decade finer than the one before; brightness is their product, held as pyramids as the lunar
terrain's is. The same number of the same seed is the same field.

Figures    images of nature have the same contrast in every octave (amplitude ~ 1/k: Field 1987, J. Opt. Soc. Am. A 4). How
           much, a tenth rms a decade, is ours: mown grass has less, ploughed land more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.types import Array
from landing_sim.world.terrain import look_up, pyramid
from landing_sim.world.terrain_relief import fractal

CELLS = (8.0, 0.8, 0.08)  # [m] of the pieces
SIDE = 512  # cells of each, either way
DECADE = 20.0  # [cells] longest wavelength of a piece: shorter ones than two cells are the next one's


@dataclass(frozen=True, slots=True)
class FieldConfig:
    """contrast : rms of the brightness of each decade of wavelengths, over its mean."""

    contrast: float = 0.1


class Field:
    """The ground of one seed: z = 0 in R, everywhere. Raises ValueError for a contrast outside 0 ... 0.3."""

    def __init__(self, config: FieldConfig, noise: NoiseStream) -> None:
        if not 0.0 < config.contrast <= 0.3:
            raise ValueError(f"a field's contrast must lie between 0 and 0.3, not {config.contrast:g}")
        self.layers = tuple(
            (cell, pyramid(1.0 + np.float32(config.contrast) * fractal(SIDE, SIDE, cell, 0.0, DECADE * cell, noise)))
            for cell in CELLS
        )

    def height(self, x: float, y: float) -> float:
        """[m] of the ground at (x, y)."""
        return 0.0

    def brightness(self, x: Array, y: Array, footprint: float) -> Array:
        """(n,) at the points x, y (n,) [m] as seen with a view of one sigma `footprint` [m]; 1 in the mean."""
        out = np.ones(len(x))
        for cell, light in self.layers:
            out *= [look_up(light, cell, float(a), float(b), footprint) for a, b in zip(x, y)]
        return out
