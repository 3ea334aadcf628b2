"""A place for a quadrotor to land in: textured ground, boxes and roofs on it, shadows and things left lying about.

R: the ground is z = 0, z points down, so a box of height h has its top at z = -h. Everything is made from one noise key.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.noise import Noise, NoiseStream
from landing_sim.types import Array
from landing_sim.world.planes_texture import Texture, texture
from landing_sim.world.terrain_relief import uniform

GROUND_TEXELS, GROUND_CELL = 4096, 0.002  # a tile of 8.2 m
BOX_TEXELS, BOX_CELL = 1024, 0.001
SHADOW = 0.45  # of the light is left in a shadow
SOFT = 0.01  # [m] width of a shadow's edge


@dataclass(frozen=True, slots=True)
class Box:
    """A box standing on the ground. Raises ValueError for one that has no size or a top that dips below the ground.

    x, y : [m] its centre in R; yaw : [rad] of its own x axis from R's, towards y; length, width : [m] along its own x, y
    height : [m] of its top's centre above the ground
    slope : (2,) how much the top rises per metre along its own x, y: a tilted roof
    tone : mean grey of its top; its sides are darker
    """

    x: float
    y: float
    yaw: float = 0.0
    length: float = 0.57
    width: float = 0.57
    height: float = 0.14
    slope: tuple[float, float] = (0.0, 0.0)
    tone: float = 150.0

    def __post_init__(self) -> None:
        values = (self.x, self.y, self.yaw, self.length, self.width, self.height, *self.slope, self.tone)
        if not all(map(math.isfinite, values)) or min(self.length, self.width, self.height) <= 0.0:
            raise ValueError(f"box needs finite numbers with length, width, height > 0; got {self}")
        lowest = self.height - 0.5 * (abs(self.slope[0]) * self.length + abs(self.slope[1]) * self.width)
        if lowest < 0.0:
            raise ValueError(f"box: at this slope its top dips {-lowest:.3g} m below the ground; got {self}")

    def corners(self) -> Array:
        """(4, 3) [m] the top's corners in R, round it in order."""
        u = 0.5 * self.length * np.array([-1.0, 1.0, 1.0, -1.0])
        v = 0.5 * self.width * np.array([-1.0, -1.0, 1.0, 1.0])
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        top = self.height + self.slope[0] * u + self.slope[1] * v
        return np.column_stack([self.x + c * u - s * v, self.y + s * u + c * v, -top])

    def top(self, x: float, y: float) -> float:
        """[m] height of its top above (x, y), or -inf beside it."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        u, v = c * (x - self.x) + s * (y - self.y), c * (y - self.y) - s * (x - self.x)
        if abs(u) > 0.5 * self.length or abs(v) > 0.5 * self.width:
            return -math.inf
        return self.height + self.slope[0] * u + self.slope[1] * v


@dataclass(frozen=True, slots=True)
class Shade:
    """A convex patch of ground that is darker (or, with light > 1, brighter): corners ((x, y), ...) [m] in order."""

    corners: tuple[tuple[float, float], ...]
    light: float = SHADOW

    def __post_init__(self) -> None:
        p = np.array(self.corners, dtype=float)
        if p.ndim != 2 or p.shape[1:] != (2,) or len(p) < 3 or not np.isfinite(p).all() or not self.light >= 0.0:
            raise ValueError(f"shade needs three corners (x, y) or more and light >= 0, got {self}")
        side = np.roll(p, -1, axis=0) - p
        turn = side[:, 0] * np.roll(side, -1, axis=0)[:, 1] - side[:, 1] * np.roll(side, -1, axis=0)[:, 0]
        if not ((turn > 0.0).all() or (turn < 0.0).all()):
            raise ValueError(f"shade: corners must go round a convex shape, got {self.corners}")


@dataclass(frozen=True, slots=True)
class Sun:
    """Where the light comes from: [rad] above the horizon, and from +x towards +y."""

    elevation: float = math.radians(50.0)
    azimuth: float = math.radians(120.0)

    def __post_init__(self) -> None:
        if not 0.05 < self.elevation <= 0.5 * math.pi:
            raise ValueError(
                f"the sun must stand 3 deg above the horizon or higher, not {math.degrees(self.elevation):g}"
            )


class Scene:
    """What there is to see and to stand on.

    Parameters
    ----------
    boxes : none may overlap another
    shades : shadows of things that are not in the scene, paint
    sun : casts the boxes' shadows on the ground (not on one another); None = overcast, no shadows
    contrast : of all textures: 1 as they are, 0 plain
    tone : mean grey of the ground
    """

    __slots__ = ("boxes", "contrast", "shades", "sun", "textures", "tone")

    def __init__(
        self,
        boxes: tuple[Box, ...],
        noise: NoiseStream,
        shades: tuple[Shade, ...] = (),
        sun: Sun | None = None,
        contrast: float = 1.0,
        tone: float = 115.0,
    ) -> None:
        if not (math.isfinite(contrast) and contrast >= 0.0 and math.isfinite(tone)):
            raise ValueError(f"scene needs a contrast >= 0 and a finite tone, got {contrast}, {tone}")
        self.boxes, self.sun, self.contrast, self.tone = boxes, sun, contrast, tone
        self.shades = (*shades, *(shadow(box, sun) for box in boxes if sun is not None))
        key, sizes = noise.key(), (GROUND_TEXELS, BOX_TEXELS) if contrast > 0.0 else (64, 64)  # nobody looks at those
        self.textures: tuple[Texture, ...] = (  # of the ground, then of each box
            texture(Noise(key, "ground"), sizes[0], GROUND_CELL),
            *(texture(Noise(key, f"box {i}"), sizes[1], BOX_CELL) for i in range(len(boxes))),
        )

    def height(self, x: float, y: float) -> float:
        """[m] of what is at (x, y) above the ground: a box's top, or 0."""
        highest = 0.0
        for box in self.boxes:
            highest = max(highest, box.top(x, y))
        return highest


def shadow(box: Box, sun: Sun) -> Shade:
    """The ground that the box shades, what it stands on included."""
    from scipy.spatial import ConvexHull

    top = box.corners()
    along = 1.0 / math.tan(sun.elevation)
    cast = top[:, :2] + top[:, 2:] * along * np.array([math.cos(sun.azimuth), math.sin(sun.azimuth)])
    both = np.vstack([top[:, :2], cast])
    return Shade(tuple((float(x), float(y)) for x, y in both[ConvexHull(both).vertices]))


def clutter(
    noise: NoiseStream, count: int, area: tuple[float, float, float, float], clear: tuple[Box, ...] = ()
) -> tuple[tuple[Box, ...], tuple[Shade, ...]]:
    """`count` parked boxes too low, too small, too narrow or too high to land on, and as many patches painted or shaded.

    area : x from, x to, y from, y to [m]
    clear : boxes that are kept clear of, by 10 cm
    Raises ValueError when so many do not fit.
    """
    boxes: list[Box] = []
    shades: list[Shade] = []
    x0, x1, y0, y1 = area
    for _ in range(200 * max(count, 1)):
        s = uniform(noise, 12)
        kind = len(boxes) % 4
        length, width, height = (
            (0.3 + 0.4 * s[0], 0.3 + 0.4 * s[1], 0.02 + 0.03 * s[2]),  # low
            (0.08 + 0.10 * s[0], 0.08 + 0.10 * s[1], 0.08 + 0.15 * s[2]),  # small
            (0.5 + 0.3 * s[0], 0.06 + 0.10 * s[1], 0.08 + 0.15 * s[2]),  # narrow
            (0.10 + 0.10 * s[0], 0.10 + 0.10 * s[1], 0.25 + 0.15 * s[2]),  # high
        )[kind]
        at = x0 + (x1 - x0) * s[3], y0 + (y1 - y0) * s[4]
        box = Box(
            float(at[0]), float(at[1]), float(math.pi * s[5]), float(length), float(width), float(height),
            tone=float(90.0 + 90.0 * s[6]),
        )  # fmt: skip
        if len(boxes) < count and all(_apart(box, other, 0.1) for other in (*boxes, *clear)):
            boxes.append(box)
            flat = Box(
                float(x0 + (x1 - x0) * s[7]), float(y0 + (y1 - y0) * s[8]), float(math.pi * s[9]), length=0.5, width=0.5
            )
            shades.append(Shade(tuple((float(x), float(y)) for x, y, _ in flat.corners()), float(0.5 + 0.8 * s[10])))
        if len(boxes) == count:
            return tuple(boxes), tuple(shades)
    raise ValueError(f"clutter: {count} boxes do not fit into {area} m")


def _apart(one: Box, other: Box, gap: float) -> bool:
    """Whether circles round both boxes keep `gap` [m]."""
    reach = 0.5 * (math.hypot(one.length, one.width) + math.hypot(other.length, other.width))
    return math.hypot(one.x - other.x, one.y - other.y) > reach + gap
