"""Simple solid shapes for the 3-D view: triangles as (vertices (n, 3) float32, indices (m, 3) uint32)."""

from __future__ import annotations

import numpy as np

from landing_sim.types import Array

Mesh = tuple[np.ndarray, np.ndarray]


def polygons(corners: list[Array]) -> Mesh:
    """Convex polygons, (k, 3) corners each, as fans of triangles."""
    vertices, triangles, start = [], [], 0
    for polygon in corners:
        k = len(polygon)
        vertices.append(polygon)
        triangles += [(start, start + i, start + i + 1) for i in range(1, k - 1)]
        start += k
    return np.concatenate(vertices).astype(np.float32), np.array(triangles, np.uint32)


def rectangle(x0: float, x1: float, y0: float, y1: float, lift: float, slope: float = 0.0) -> Array:
    """(4, 3) corners in R of a rectangle lying `lift` [m] above the runway's plane; slope [rad] > 0 uphill along x.

    The lift keeps layers apart: coplanar triangles flicker.
    """
    rise = np.tan(slope)
    return np.array([[x, y, -lift - rise * x] for x, y in ((x0, y0), (x0, y1), (x1, y1), (x1, y0))])


def grass(width: float, length: float, slope: float) -> list[Array]:
    """The ground around the runway. Under it lies a second one, deep enough not to flicker through, to close the seams."""
    half, x0, x1, side = 0.5 * width, -3000.0, length + 2000.0, 1500.0
    pieces = ((x0, 0.0, -side, side), (length, x1, -side, side), (0.0, length, -side, -half), (0.0, length, half, side))
    return [rectangle(x0, x1, -side, side, -6.0, slope), *(rectangle(*piece, 0.0, slope) for piece in pieces)]


def normals(mesh: Mesh) -> np.ndarray:
    """(n, 3) float32 of flat faces: every vertex belongs to one of them."""
    vertices, triangles = mesh
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    out = np.zeros_like(vertices)
    out[triangles.ravel()] = np.repeat(face, 3, axis=0)
    return out


def markings(width: float, length: float, slope: float, lift: float) -> list[Array]:
    """Borderlines, centreline and threshold stripes, for the eye of whoever watches the replay."""
    half, side = 0.5 * width, 0.9
    out = [rectangle(0.0, length, s * half - (s > 0) * side, s * half + (s < 0) * side, lift, slope) for s in (-1, 1)]
    out += [rectangle(x, x + 30.0, -0.45, 0.45, lift, slope) for x in np.arange(48.0, length - 60.0, 50.0)]
    count = max(2, int((half - 2.0) / 3.6))
    for s in (-1.0, 1.0):
        for i in range(count):
            y = s * (1.8 + 3.6 * i)
            out.append(rectangle(6.0, 36.0, min(y, y + s * 1.8), max(y, y + s * 1.8), lift, slope))
    return out


def aircraft(span: float, length: float) -> Mesh:
    """A high-wing twin, nose along +x, z down, the cg at the origin."""
    parts = [
        _box((-0.55 * length, 0.42 * length), (-0.75, 0.75), (-0.9, 0.9), nose=0.35),
        _box((-0.6, 1.3), (-0.5 * span, 0.5 * span), (-1.15, -0.95)),
        _box((-0.58 * length, -0.46 * length), (-0.2 * span, 0.2 * span), (-1.05, -0.9)),
        _box((-0.6 * length, -0.44 * length), (-0.12, 0.12), (-3.2, -0.9)),
    ]
    parts += [_box((-0.8, 2.1), (y - 0.45, y + 0.45), (-0.95, -0.1), nose=0.5) for y in (-0.18 * span, 0.18 * span)]
    vertices, triangles, start = [], [], 0
    for v, t in parts:
        vertices.append(v)
        triangles.append(t + start)
        start += len(v)
    return np.concatenate(vertices).astype(np.float32), np.concatenate(triangles).astype(np.uint32)


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], nose: float = 1.0) -> Mesh:
    """A box; its front face scaled by `nose`. Every face has its own corners, so that faces shade flat."""
    cy, cz = 0.5 * (y[0] + y[1]), 0.5 * (z[0] + z[1])

    def corner(front: int, right: int, down: int) -> tuple[float, float, float]:
        s = nose if front else 1.0
        return x[front], cy + s * (y[right] - cy), cz + s * (z[down] - cz)

    faces = []
    for axis in range(3):
        for value in (0, 1):
            loop = [(0, 0), (1, 0), (1, 1), (0, 1)]
            faces.append([corner(*(*ab[:axis], value, *ab[axis:])) for ab in (loop if value else loop[::-1])])
    return polygons([np.array(face) for face in faces])
