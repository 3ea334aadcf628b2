"""Pictures of a `world.planes.Scene`: one ray a pixel to the nearest surface, sixteen where surfaces meet.

Textures are read from their pyramids at the pixel's footprint, so that what is far does not flicker.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.world.planes import SOFT, Box, Scene

SUB = 4  # rays a side of a pixel in which surfaces meet
SKY = 215.0
SIDES = np.array([0.62, 0.74, 0.56, 0.68])  # light on a box's sides -x, +x, -y, +y, over that on its top
TOP = 4  # the face of a box after its sides
FACES = 5
BLOCK = 16  # pixels a side, for which the boxes in view are looked up together


class SceneTables:
    """A scene as the kernels read it."""

    __slots__ = ("boxes", "edges", "shades", "surfaces", "texels", "where")

    def __init__(self, scene: Scene) -> None:
        self.boxes = np.array([_row(b) for b in scene.boxes]).reshape(-1, 11)
        self.surfaces = np.array([[scene.tone, scene.contrast], *([b.tone, scene.contrast] for b in scene.boxes)])
        # shades: middle x, y, radius, light, first and last + 1 of their edges; edges: normal inwards x, y, offset
        shades: list[tuple[float, ...]] = []
        edges: list[tuple[float, ...]] = []
        for shade in scene.shades:
            p = np.array(shade.corners)
            middle = p.mean(axis=0)
            along = np.roll(p, -1, axis=0) - p
            normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
            normal *= np.sign(np.sum((middle - p) * normal, axis=1))[:, None]
            first = len(edges)
            edges += [(*n, -float(n @ q)) for n, q in zip(normal, p)]
            reach = float(np.hypot(*(p - middle).T).max()) + SOFT
            shades.append((*middle, reach, shade.light, first, len(edges)))
        self.shades = np.array(shades, dtype=float).reshape(-1, 6)
        self.edges = np.array(edges, dtype=float).reshape(-1, 3)
        levels = [(t.cell * 2.0**k, level) for t in scene.textures for k, level in enumerate(t.levels)]
        self.texels = np.concatenate([level.ravel() for _, level in levels])
        # of each texture: finest cell, size, number of levels, its place among the texels
        place, where = 0, []
        for t in scene.textures:
            where.append((t.cell, len(t.levels[0]), len(t.levels), place))
            place += sum(level.size for level in t.levels)
        self.where = np.array(where, dtype=float)


def _row(b: Box) -> tuple[float, ...]:
    """Centre x, y, cosine and sine of yaw, half length and width, height, slope; z of a ball round it, and its radius."""
    top = b.corners()
    high = float(top[:, 2].min())
    across = float(np.hypot(*(top[:, :2] - top[:, :2].mean(axis=0)).T).max())
    ball = 0.5 * high, math.hypot(across, 0.5 * high) + 1e-9
    return b.x, b.y, math.cos(b.yaw), math.sin(b.yaw), 0.5 * b.length, 0.5 * b.width, b.height, *b.slope, *ball


class Rays:
    """The unit rays of a lens, frame C, ordered for the kernels.

    table : (height + 2, width + 2, 3) float32, of all pixels and a border of one
    cones : (rows, columns, 4) of each block of BLOCK x BLOCK pixels, a cone round its rays: axis and half angle [rad]
    pixel : [rad] a pixel's width
    """

    __slots__ = ("cones", "pixel", "table")

    def __init__(self, lens: Fisheye) -> None:
        u, v = np.meshgrid(np.arange(-1.0, lens.width + 1), np.arange(-1.0, lens.height + 1))
        rays = lens.rays(np.stack([u, v], axis=-1))
        self.table = rays.astype(np.float32)
        self.pixel = 1.0 / lens.focal
        cones = np.empty((-(-lens.height // BLOCK), -(-lens.width // BLOCK), 4))
        for i in range(cones.shape[0]):
            for j in range(cones.shape[1]):
                part = rays[BLOCK * i : BLOCK * (i + 1) + 2, BLOCK * j : BLOCK * (j + 1) + 2].reshape(-1, 3)
                middle = part.mean(axis=0)
                middle /= np.linalg.norm(middle)
                cones[i, j] = *middle, math.acos(min(1.0, float((part @ middle).min()))) + 1e-6
        self.cones = cones


def render(tables: SceneTables, rays: Rays, p_RC: Array, R_CR: Array) -> np.ndarray:
    """(height, width) float32 grey levels, before noise, seen from p_RC (3,) [m] with the attitude R_CR (3, 3).

    The camera must be above the ground; a box that it is inside of is not seen.
    """
    height, width = rays.table.shape[0] - 2, rays.table.shape[1] - 2
    out = np.empty((height, width), np.float32)
    ids = np.empty((height, width), np.int32)
    t = tables
    _render(
        out, ids, rays.table, rays.cones, rays.pixel, np.asarray(p_RC, dtype=float),
        np.ascontiguousarray(R_CR.T, dtype=float), t.boxes, t.surfaces, t.shades, t.edges, t.texels, t.where,
    )  # fmt: skip
    return out


@kernel
def _near(boxes: Array, p: Array, ax: float, ay: float, az: float, cone: float, found: np.ndarray) -> int:
    """How many boxes a cone of half angle `cone` [rad] round the axis (ax, ay, az) may touch; found: which."""
    n = 0
    for k in range(len(boxes)):
        rx, ry, rz = boxes[k, 0] - p[0], boxes[k, 1] - p[1], boxes[k, 9] - p[2]
        far = math.sqrt(rx * rx + ry * ry + rz * rz)
        if far > boxes[k, 10]:
            off = math.acos(min(1.0, max(-1.0, (rx * ax + ry * ay + rz * az) / far)))
            if off > cone + math.asin(boxes[k, 10] / far):
                continue
        found[n] = k
        n += 1
    return n


@kernel
def _enter(boxes: Array, k: int, p: Array, dx: float, dy: float, dz: float) -> tuple[float, int]:
    """Where a ray enters box k: distance, inf if it does not, and face."""
    rx, ry = p[0] - boxes[k, 0], p[1] - boxes[k, 1]
    cos, sin, a, b, gx, gy = boxes[k, 2], boxes[k, 3], boxes[k, 4], boxes[k, 5], boxes[k, 7], boxes[k, 8]
    u, v = cos * rx + sin * ry, cos * ry - sin * rx
    du, dv = cos * dx + sin * dy, cos * dy - sin * dx
    # a division by zero gives the infinity that is right
    near, far = (-a - u) / du, (a - u) / du
    enter, leave, face = (near, far, 0) if du > 0.0 else (far, near, 1)
    near, far = (-b - v) / dv, (b - v) / dv
    first, last, side = (near, far, 2) if dv > 0.0 else (far, near, 3)
    if first > enter:
        enter, face = first, side
    leave = min(leave, last)
    # top: -z <= height + slope . (u, v)
    above = -p[2] - boxes[k, 6] - gx * u - gy * v
    climb = -dz - gx * du - gy * dv
    meets = -above / climb
    if climb < 0.0:
        if meets > enter:
            enter, face = meets, TOP
    else:
        leave = min(leave, meets)
    return (enter, face) if 0.0 < enter < leave else (math.inf, -1)


@kernel
def _texel(texels: np.ndarray, place: int, size: int, i: float, j: float) -> float:
    """Bilinear in one level (size, size), wrapping round; i, j in texels along x and y."""
    i0, j0 = math.floor(i), math.floor(j)
    s, r = i - i0, j - j0
    mask = size - 1
    a, b = int(i0) & mask, (int(i0) + 1) & mask
    c, d = place + (int(j0) & mask) * size, place + ((int(j0) + 1) & mask) * size
    return (1.0 - r) * ((1.0 - s) * texels[c + a] + s * texels[c + b]) + r * (
        (1.0 - s) * texels[d + a] + s * texels[d + b]
    )


@kernel
def _light(x: float, y: float, wide: float, shades: Array, edges: Array) -> float:
    """On the ground at x, y [m]; edges are SOFT or `wide` [m] wide."""
    out = 1.0
    soft = max(wide, SOFT)
    for k in range(len(shades)):
        rx, ry, reach = x - shades[k, 0], y - shades[k, 1], shades[k, 2] + wide
        if rx * rx + ry * ry > reach * reach:
            continue
        inside = math.inf
        for e in range(int(shades[k, 4]), int(shades[k, 5])):
            inside = min(inside, edges[e, 0] * x + edges[e, 1] * y + edges[e, 2])
        out *= 1.0 + min(1.0, max(0.0, 0.5 + inside / soft)) * (shades[k, 3] - 1.0)
    return out


@kernel
def _shade(
    out: np.ndarray, ids: np.ndarray, rays: np.ndarray, n: int, found: np.ndarray, near: int, pixel: float, p: Array,
    boxes: Array, surfaces: Array, shades: Array, edges: Array, texels: np.ndarray, where: Array,
) -> None:  # fmt: skip
    """Greys of n rays (.., 3) in R, and what they hit: 0 the ground, 1 + FACES box + face, -1 the sky.

    Only the first `near` of the boxes `found` are looked for; pixel [rad] is a pixel's width.
    """
    for i in range(n):
        dx, dy, dz = rays[i, 0], rays[i, 1], rays[i, 2]
        t, box, face = math.inf, -1, 0
        if dz > 1e-6:
            t = -p[2] / dz
        for f in range(near):
            met, side = _enter(boxes, found[f], p, dx, dy, dz)
            if met < t:
                t, box, face = met, found[f], side
        if t == math.inf:
            ids[i], out[i] = -1, SKY
            continue
        ids[i] = 0 if box < 0 else 1 + FACES * box + face
        x, y, slant, light = p[0] + t * dx, p[1] + t * dy, dz, 1.0
        if box >= 0:
            cos, sin = boxes[box, 2], boxes[box, 3]
            rx, ry = x - boxes[box, 0], y - boxes[box, 1]
            x, y = cos * rx + sin * ry, cos * ry - sin * rx
            du, dv = cos * dx + sin * dy, cos * dy - sin * dx
            if face == TOP:
                gx, gy = boxes[box, 7], boxes[box, 8]
                slant = (dz + gx * du + gy * dv) / math.sqrt(1.0 + gx * gx + gy * gy)
            else:  # the texture goes over the edge and down
                down = p[2] + t * dz + boxes[box, 6]
                light = SIDES[face]
                if face < 2:
                    slant, x = abs(du), math.copysign(boxes[box, 4] + down, x)
                else:
                    slant, y = abs(dv), math.copysign(boxes[box, 5] + down, y)
        footprint = t * pixel / math.sqrt(max(slant, 1e-4))  # mean of what a pixel covers along and across
        if box < 0 and len(shades) > 0:
            light = _light(x, y, footprint, shades, edges)
        grey = surfaces[box + 1, 0]
        if surfaces[box + 1, 1] > 0.0:
            cell, size, levels, place = (
                where[box + 1, 0],
                int(where[box + 1, 1]),
                where[box + 1, 2],
                int(where[box + 1, 3]),
            )
            while footprint >= 2.0 * cell and levels > 2.0:
                place += size * size
                size >>= 1
                cell *= 2.0
                levels -= 1.0
            value = _texel(texels, place, size, x / cell, y / cell)
            if footprint > cell:
                wide = _texel(texels, place + size * size, size >> 1, 0.5 * x / cell, 0.5 * y / cell)
                value += min(1.0, footprint / cell - 1.0) * (wide - value)
            grey += surfaces[box + 1, 1] * (value - 128.0)
        out[i] = light * grey


@kernel
def _turned(R_RC: Array, x: float, y: float, z: float, out: np.ndarray, i: int) -> None:
    out[i, 0] = R_RC[0, 0] * x + R_RC[0, 1] * y + R_RC[0, 2] * z
    out[i, 1] = R_RC[1, 0] * x + R_RC[1, 1] * y + R_RC[1, 2] * z
    out[i, 2] = R_RC[2, 0] * x + R_RC[2, 1] * y + R_RC[2, 2] * z


@kernel
def _render(
    out: np.ndarray, ids: np.ndarray, table: np.ndarray, cones: Array, pixel: float, p: Array, R_RC: Array,
    boxes: Array, surfaces: Array, shades: Array, edges: Array, texels: np.ndarray, where: Array,
) -> None:  # fmt: skip
    height, width = out.shape
    found = np.empty((cones.shape[0], cones.shape[1], max(len(boxes), 1)), np.int64)
    near = np.empty(cones.shape[:2], np.int64)
    rays = np.empty((max(BLOCK, SUB * SUB), 3))
    axis = np.empty((1, 3))
    for i in range(cones.shape[0]):
        for j in range(cones.shape[1]):
            _turned(R_RC, cones[i, j, 0], cones[i, j, 1], cones[i, j, 2], axis, 0)
            near[i, j] = _near(boxes, p, axis[0, 0], axis[0, 1], axis[0, 2], cones[i, j, 3], found[i, j])
            n = min(BLOCK, width - BLOCK * j)
            for r in range(BLOCK * i, min(BLOCK * (i + 1), height)):
                for k in range(n):
                    c = BLOCK * j + k + 1
                    _turned(R_RC, table[r + 1, c, 0], table[r + 1, c, 1], table[r + 1, c, 2], rays, k)
                _shade(
                    out[r, BLOCK * j :], ids[r, BLOCK * j :], rays, n, found[i, j], near[i, j], pixel, p,
                    boxes, surfaces, shades, edges, texels, where,
                )  # fmt: skip
    greys, hit = np.empty(SUB * SUB), np.empty(SUB * SUB, np.int32)
    for r in range(height):
        for c in range(width):
            which = ids[r, c]
            if not (
                (c > 0 and ids[r, c - 1] != which)
                or (c + 1 < width and ids[r, c + 1] != which)
                or (r > 0 and ids[r - 1, c] != which)
                or (r + 1 < height and ids[r + 1, c] != which)
            ):
                continue
            here, right, below = table[r + 1, c + 1], table[r + 1, c + 2], table[r + 2, c + 1]
            left, above = table[r + 1, c], table[r, c + 1]
            for i in range(SUB):
                for j in range(SUB):
                    a, b = 0.5 * ((i + 0.5) / SUB - 0.5), 0.5 * ((j + 0.5) / SUB - 0.5)
                    x = here[0] + a * (right[0] - left[0]) + b * (below[0] - above[0])
                    y = here[1] + a * (right[1] - left[1]) + b * (below[1] - above[1])
                    z = here[2] + a * (right[2] - left[2]) + b * (below[2] - above[2])
                    _turned(R_RC, x, y, z, rays, SUB * i + j)
            i, j = r // BLOCK, c // BLOCK
            _shade(
                greys, hit, rays, SUB * SUB, found[i, j], near[i, j], pixel, p,
                boxes, surfaces, shades, edges, texels, where,
            )  # fmt: skip
            out[r, c] = greys.mean()
