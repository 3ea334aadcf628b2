"""What a row of photoreceptors on an aircraft sees of the field ahead: each ray's Gaussian view of the brightness there."""

from __future__ import annotations

import math

import numpy as np

from landing_sim.jit import kernel
from landing_sim.sensors.optic_flow_eye import EVEN, FWHM, LIGHT, TAP
from landing_sim.types import Array
from landing_sim.world.field import DECADE, Field
from landing_sim.world.terrain import look_up

LOWEST = 0.02  # of the ray's downward part: below that it looks at the horizon's haze, and sees nothing
GONE = 0.4 * DECADE  # [cells] a view wider than this sees nothing of a layer's longest waves


@kernel
def see_field(
    p0: Array, R0: Array, p1: Array, R1: Array, count: int, angles: Array, sigma: float, layers: tuple, hit: Array,  # type: ignore[type-arg]
) -> Array:  # fmt: skip
    """(count, n) brightness seen by receptors at `angles` (n,) [rad] below the body's x axis, on the way from one pose
    (excluded) to the next, over the plane z = 0; hit (n, 2) is where they look at the end, NaN above the horizon.
    """
    n = len(angles)
    out = np.zeros((count, n))
    for k in range(count):
        share = (k + 1.0) / count
        p = (1.0 - share) * p0 + share * p1
        R = (1.0 - share) * R0 + share * R1  # a turn of less than a degree
        for i in range(n):
            c, s = math.cos(angles[i]), math.sin(angles[i])
            dx, dy, dz = R[0, 0] * c + R[0, 2] * s, R[1, 0] * c + R[1, 2] * s, R[2, 0] * c + R[2, 2] * s
            if dz < LOWEST or p[2] >= 0.0:
                hit[i, 0] = hit[i, 1] = math.nan
                continue
            far = -p[2] / dz
            hit[i, 0], hit[i, 1] = p[0] + far * dx, p[1] + far * dy
            flat = math.hypot(dx, dy)
            across = sigma * far
            out[k, i] = _view(hit[i, 0], hit[i, 1], dx / flat, dy / flat, across / dz, across, layers)
    return out


@kernel
def _view(x: float, y: float, ux: float, uy: float, along: float, across: float, layers: tuple) -> float:  # type: ignore[type-arg]
    """Brightness about x, y of one sigma `along` and `across` [m] the direction (ux, uy): as `optic_flow_eye.look`, but
    with three rows, as the view is long and narrow, and nothing of what is too fine to be seen."""
    level = LIGHT * math.sqrt(across * along)
    out = 1.0
    for cell, light in layers:
        if across > GONE * cell:
            continue
        if level < EVEN * cell:
            out *= look_up(light, cell, x, y, level)
            continue
        total, weights = 0.0, 0.0
        for i in range(-2, 3):
            for j in range(-1, 2):
                w = math.exp(-0.5 * (i * i + j * j))
                a, c = TAP * i * along, TAP * j * across
                total += w * look_up(light, cell, x + a * ux - c * uy, y + a * uy + c * ux, level)
                weights += w
        out *= total / weights
    return out


class FieldEye:
    """Receptors at `angles` (n,) [rad] below the body's x axis over a field, acceptance [rad] at half height.

    They sit in the cg: against hundreds of metres to what they look at, metres of an airframe do not count. Lower than
    `blind` [m] they are dark: what is not used on board is not drawn.
    """

    def __init__(self, field: Field, angles: Array, acceptance: float, blind: float = 0.0) -> None:
        self.angles, self._sigma, self._layers = np.array(angles, dtype=float), acceptance / FWHM, field.layers
        self._blind = blind
        self.hit = np.full((len(angles), 2), np.nan)

    def between(self, p0: Array, R0: Array, p1: Array, R1: Array, count: int) -> Array:
        """(count, n) brightness on the way from pose p0 (3,), R0 (3, 3) = R_RB, not counted, to p1, R1."""
        if -p1[2] <= self._blind:
            self.hit[:] = np.nan
            return np.zeros((count, len(self.angles)))
        return see_field(p0, R0, p1, R1, count, self.angles, self._sigma, self._layers, self.hit)
