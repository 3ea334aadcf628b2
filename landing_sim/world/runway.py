"""The runway as it really is: size, slope, exits, paint and how bright everything is. The believed one lives onboard."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landing_sim.types import Array
from landing_sim.world.markings import Marking, runway_markings

SKY, GRASS, SURFACE, PAINT = 0, 1, 2, 3  # what a point of the scene is made of: index into Greys.palette

STRIP_SIDE, STRIP_END = 150.0, 60.0  # [m] graded ground beside and beyond the runway: ICAO Annex 14, 3.4 (runway strip)
TAXIWAY_OVERLAP = 3.0  # [m] a taxiway's mouth is drawn this far into the runway, so that no seam shows


@dataclass(frozen=True, slots=True)
class Greys:
    """Grey levels 0..255 of a clear day, before the lens: contrast 55 between surface and grass."""

    sky: float = 180.0
    grass: float = 90.0
    surface: float = 145.0
    paint: float = 215.0

    def __post_init__(self) -> None:
        if not all(0.0 <= g <= 255.0 for g in self.palette):
            raise ValueError(f"grey levels must lie within 0..255, got {self.palette.tolist()}")

    @property
    def palette(self) -> Array:
        return np.array([self.sky, self.grass, self.surface, self.paint])


@dataclass(frozen=True, slots=True)
class Taxiway:
    """A paved exit at right angles. Its mouth widens by `flare` to each side, at 45 degrees."""

    x: float  # [m] of its centreline from the threshold
    width: float = 12.0  # [m]
    side: str = "right"  # "left" (y < 0) or "right"
    flare: float = 12.0  # [m]
    length: float = 100.0  # [m] from the runway's edge

    def __post_init__(self) -> None:
        sizes = (self.x, self.width, self.flare, self.length)
        if not all(map(math.isfinite, sizes)) or self.width <= 0.0 or self.flare < 0.0 or self.length <= self.flare:
            raise ValueError(f"taxiway needs width > 0, flare >= 0, length > flare, all finite; got {self}")
        if self.side not in ("left", "right"):
            raise ValueError(f"taxiway side must be 'left' or 'right', not {self.side!r}")

    @property
    def mouth(self) -> tuple[float, float]:
        """Part of the runway's edge [m] that the mouth takes away."""
        half = 0.5 * self.width + self.flare
        return self.x - half, self.x + half


@dataclass(frozen=True, slots=True)
class Runway:
    """A rectangle through the origin of R, rising along x by `slope`; its threshold is level.

    Raises ValueError for sizes that are not positive and finite, a slope beyond 10 degrees, or a taxiway mouth that
    reaches past an end.
    """

    width: float = 29.0  # [m]
    length: float = 1680.0  # [m] along the surface
    slope: float = 0.0  # [rad] > 0 uphill
    painted: bool = True
    taxiways: tuple[Taxiway, ...] = ()
    greys: Greys = field(default_factory=Greys)

    def __post_init__(self) -> None:
        for name in ("width", "length"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"runway {name} must be positive and finite, got {value}")
        if not abs(self.slope) <= math.radians(10.0):
            raise ValueError(f"runway slope must lie within 10 degrees, got {self.slope} rad")
        for taxiway in self.taxiways:
            if taxiway.mouth[0] < 0.0 or taxiway.mouth[1] > self.length:
                raise ValueError(f"mouth of {taxiway} reaches past the runway's end (0..{self.length} m)")

    @property
    def markings(self) -> tuple[Marking, ...]:
        return runway_markings(self.width, self.length) if self.painted else ()

    def to_R(self, xy: Array) -> Array:
        """(..., 3) [m], frame R, of points (..., 2) of the surface: along it from the threshold, and to the right."""
        x = xy[..., 0]
        return np.stack([x * math.cos(self.slope), xy[..., 1], -x * math.sin(self.slope)], axis=-1)

    def corners(self) -> Array:
        """(4, 3) [m], frame R: threshold left, far left, far right, threshold right."""
        return self.to_R(_rectangle(0.0, self.length, -0.5 * self.width, 0.5 * self.width))

    def quads(self) -> tuple[Array, np.ndarray]:
        """Everything drawn on the ground, bottom first.

        Returns
        -------
        points : (m, 4, 3) [m], frame R, convex quadrilaterals; opposite edges are 0-2 and 1-3
        material : (m,) int64, GRASS, SURFACE or PAINT

        The ground around is level; where the runway slopes, the graded strip around it slopes with it.
        """
        flat = [quad for taxiway in self.taxiways for quad in self._taxiway(taxiway)]
        flat.append(_rectangle(0.0, self.length, -0.5 * self.width, 0.5 * self.width))
        paved = len(flat)
        flat += [_rectangle(m.x0, m.x1, m.y0, m.y1) for m in self.markings]
        material = np.full(len(flat), PAINT, dtype=np.int64)
        material[:paved] = SURFACE
        if self.slope != 0.0:
            side = 0.5 * self.width + STRIP_SIDE
            flat.insert(0, _rectangle(-STRIP_END, self.length + STRIP_END, -side, side))
            material = np.insert(material, 0, GRASS)
        return self.to_R(np.array(flat)), material

    def _taxiway(self, taxiway: Taxiway) -> list[Array]:
        half, edge, inside = 0.5 * taxiway.width, 0.5 * self.width, min(TAXIWAY_OVERLAP, 0.5 * self.width)
        straight = _rectangle(taxiway.x - half, taxiway.x + half, edge - inside, edge + taxiway.length)
        x0, x1 = max(0.0, taxiway.mouth[0] - inside), min(self.length, taxiway.mouth[1] + inside)
        a, b, outer = taxiway.x - half, taxiway.x + half, edge + taxiway.flare
        mouth = np.array([[x0, edge - inside], [x1, edge - inside], [b, outer], [a, outer]])
        quads = [straight, mouth] if taxiway.flare > 0.0 else [straight]
        # Mirrored quadrilaterals are listed backwards, so that all run the same way round.
        return quads if taxiway.side == "right" else [quad[::-1] * [1.0, -1.0] for quad in quads]


def _rectangle(x0: float, x1: float, y0: float, y1: float) -> Array:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
