"""What a row of photoreceptors sees of the terrain: where each looks, and its Gaussian view of the brightness there."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array
from landing_sim.world.terrain import Terrain, bilinear, look_up

FWHM = math.sqrt(8.0 * math.log(2.0))  # of a Gaussian, in sigmas
TAP = 0.83  # [sigma] between look-ups: with the pyramid's own blur the view has the width asked for
LIGHT = 0.8  # [sigma] of the pyramid's cells
EVEN, SMOOTH = 0.1, 40.0  # [cells] a view narrower or wider than this sees no structure of a layer: one look-up will do


@kernel
def _ground(a: np.ndarray, cell_a: float, b: np.ndarray, cell_b: float, x: float, y: float) -> float:
    return bilinear(a, x / cell_a + 0.5 * a.shape[1], y / cell_a + 0.5 * a.shape[0]) + bilinear(
        b, x / cell_b + 0.5 * b.shape[1], y / cell_b + 0.5 * b.shape[0]
    )


@kernel
def strike(p: Array, d: Array, a: np.ndarray, cell_a: float, b: np.ndarray, cell_b: float, guess: float) -> float:
    """[m] along the unit vector d (3,), frame R, from p (3,) to the ground; -1 where it looks above the horizon.

    Found by following the ray from a guess: the nearest crossing as long as the ground is less steep than the ray.
    """
    if d[2] < 0.05:
        return -1.0
    s = guess if guess > 0.0 else -p[2] / d[2]
    for _ in range(12):
        above = -(p[2] + s * d[2]) - _ground(a, cell_a, b, cell_b, p[0] + s * d[0], p[1] + s * d[1])
        s += 0.8 * above / d[2]
        if abs(above) < 2e-4 * s:
            break
    return max(s, 1e-3)


@kernel
def look(
    p: Array,
    d: Array,
    sigma: float,
    s: float,
    layers: tuple,
    out_point: Array,  # type: ignore[type-arg]
) -> float:
    """Brightness of a view of one sigma `sigma` [rad] about d (3,), whose ground is s [m] away; out_point its x, y [m]."""
    x, y = p[0] + s * d[0], p[1] + s * d[1]
    out_point[0], out_point[1] = x, y
    across = s * sigma
    along = across / d[2]
    flat = math.hypot(d[0], d[1])
    ux, uy = (d[0] / flat, d[1] / flat) if flat > 1e-6 else (1.0, 0.0)
    level = LIGHT * math.sqrt(across * along)
    out = 1.0
    for cell, light in layers:
        if level < EVEN * cell or level > SMOOTH * cell:
            out *= look_up(light, cell, x, y, level)
            continue
        total, weights = 0.0, 0.0
        for i in range(-2, 3):
            for j in range(-2, 3):
                w = math.exp(-0.5 * (i * i + j * j))
                fx, fy = x + TAP * (i * along * ux - j * across * uy), y + TAP * (i * along * uy + j * across * ux)
                total += w * look_up(light, cell, fx, fy, level)
                weights += w
        out *= total / weights
    return out


@kernel
def see(
    p0: Array, R0: Array, p1: Array, R1: Array, count: int, angles: Array, sigma: float, layers: tuple,  # type: ignore[type-arg]
    a: np.ndarray, cell_a: float, b: np.ndarray, cell_b: float, distance: Array, hit: Array,
) -> Array:  # fmt: skip
    """(count, n) brightness seen by receptors at `angles` (n,) [rad] below the body's horizontal, on the way from one pose
    (excluded) to the next; `distance` (n,) [m] is kept as the next guess, hit (n, 2) is where they look at the end.
    """
    n = len(angles)
    out = np.empty((count, n))
    for k in range(count):
        share = (k + 1.0) / count
        p = (1.0 - share) * p0 + share * p1
        R = (1.0 - share) * R0 + share * R1  # a turn of less than a degree
        for i in range(n):
            c, s = math.cos(angles[i]), math.sin(angles[i])
            d = np.array([R[0, 0] * c + R[0, 2] * s, R[1, 0] * c + R[1, 2] * s, R[2, 0] * c + R[2, 2] * s])
            d /= math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            distance[i] = strike(p, d, a, cell_a, b, cell_b, distance[i])
            out[k, i] = look(p, d, sigma, distance[i], layers, hit[i]) if distance[i] > 0.0 else 0.0
    return out


class Eye:
    """Receptors at `angles` (n,) [rad] below the body's horizontal over a terrain, acceptance [rad] at half height."""

    def __init__(self, terrain: Terrain, angles: Array, acceptance: float) -> None:
        self.angles, self._sigma = np.array(angles, dtype=float), acceptance / FWHM
        big, small, _ = terrain.layers
        self._ground = (big.heights, big.cell, small.heights, small.cell)
        self._layers = tuple((layer.cell, layer.light) for layer in terrain.layers)
        self._distance = np.full(len(angles), -1.0)
        self.hit = np.full((len(angles), 2), np.nan)

    def between(self, p0: Array, R0: Array, p1: Array, R1: Array, count: int) -> Array:
        """(count, n) brightness on the way from pose p0 (3,), R0 (3, 3) = R_RB, not counted, to p1, R1."""
        return see(
            p0, R0, p1, R1, count, self.angles, self._sigma, self._layers, *self._ground, self._distance, self.hit
        )

    def points(self, terrain: Terrain) -> Array:
        """(n, 3) where the receptors looked last, frame R."""
        return np.array([(x, y, -terrain.height(x, y)) for x, y in self.hit])
