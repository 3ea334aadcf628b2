"""Relief of a lunar plain at one scale: fractal ground, bowl craters with rims, boulders; and how the sun lights it.

Arrays are (rows of y, columns of x), periodic in both, so that a small piece can be laid out like tiles.

Figures    craters: depth 0.2 of the diameter when fresh, rims 0.04 of it, less when old (Pike 1977); cumulative numbers
           fall with the diameter squared, as where small craters are in balance (Trask 1966).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.jit import kernel
from landing_sim.noise import NoiseStream
from landing_sim.types import Array

DARK = 0.02  # of the light on level ground: what is left in a shadow


@dataclass(frozen=True, slots=True)
class Scale:
    """One layer: (rows, columns) cells of `cell` [m]; what is on it."""

    rows: int
    columns: int
    cell: float
    slope: float  # [rad] rms of the fractal part over one cell's neighbours
    craters: int
    smallest: float  # [m] diameters
    largest: float
    boulders: int
    boulder: float  # [m] diameter of the smallest; few are five times as large
    hurst: float = 1.0
    longest: float = math.inf  # [m] wavelength of the fractal part


def uniform(noise: NoiseStream, size: int) -> Array:
    """(size,) in 0..1 out of normals."""
    from scipy.special import ndtr

    return np.asarray(ndtr(noise.normal(size)))


def fractal(rows: int, columns: int, cell: float, hurst: float, longest: float, noise: NoiseStream) -> np.ndarray:
    """(rows, columns) float32 of unit rms, spectrum of amplitude ~ k^-(1 + hurst) at wavelengths up to `longest` [m]."""
    spectrum = np.fft.rfft2(noise.normal(rows * columns).reshape(rows, columns).astype(np.float32))
    ky, kx = np.fft.fftfreq(rows, cell)[:, None], np.fft.rfftfreq(columns, cell)[None, :]
    k = np.hypot(kx, ky)
    k[0, 0] = 1.0
    weight = k ** -(1.0 + hurst)
    weight[k < 1.0 / longest] = 0.0
    weight[0, 0] = 0.0
    out = np.fft.irfft2(spectrum * weight, s=(rows, columns))
    return np.asarray(out / out.std(), dtype=np.float32)


def relief(
    scale: Scale, noise: NoiseStream, spared: tuple[float, float] | None = None, deepest: float = 0.0
) -> np.ndarray:
    """(rows, columns) float32 heights [m] of mean zero.

    spared : [m] x from the middle and half width of a strip across that has no crater of more than 12 m, no boulder of more
        than a metre: a landing site
    deepest : [m] depth of one fresh crater beside the track; 0 = none
    """
    out = fractal(scale.rows, scale.columns, scale.cell, scale.hurst, scale.longest, noise)
    steep = math.sqrt(float(np.mean(np.diff(out, axis=1) ** 2))) / scale.cell
    out *= np.float32(math.tan(scale.slope) / steep)
    share = uniform(noise, 4 * scale.craters).reshape(4, -1)
    low = (scale.smallest / scale.largest) ** 2
    diameter = scale.smallest / np.sqrt(1.0 - share[0] * (1.0 - low))
    depth = diameter * (0.025 + 0.165 * share[3] ** 2)
    at = share[1:3] * [[scale.columns], [scale.rows]]
    if deepest > 0.0:
        diameter[0], depth[0] = 5.0 * deepest, deepest
        at[0, 0], at[1, 0] = scale.columns * (0.30 + 0.1 * share[1, 0]), scale.rows * 0.5 + 2.0 * deepest / scale.cell
    keep = np.ones(len(diameter), bool)
    if spared is not None:
        x = (at[0] - 0.5 * scale.columns) * scale.cell
        keep &= (np.abs(x - spared[0]) > spared[1] + diameter) | (diameter < 12.0)
    order = np.argsort(-diameter)
    order = order[keep[order]]
    _craters(out, at[0, order], at[1, order], 0.5 * diameter[order] / scale.cell, depth[order])
    share = uniform(noise, 3 * scale.boulders).reshape(3, -1)
    size = scale.boulder / np.sqrt(1.0 - share[0] * 0.96)
    for k in range(scale.boulders):
        x = (share[1, k] - 0.5) * scale.columns * scale.cell
        if spared is None or abs(x - spared[0]) > spared[1] or size[k] < 1.0:
            _boulder(
                out, share[1, k] * scale.columns, share[2, k] * scale.rows, 0.5 * size[k] / scale.cell, 0.4 * size[k]
            )
    return out - np.float32(out.mean())


@kernel
def _craters(out: np.ndarray, column: Array, row: Array, radius: Array, depth: Array) -> None:
    for k in range(len(radius)):
        _crater(out, column[k], row[k], radius[k], depth[k])


@kernel
def _crater(out: np.ndarray, column: float, row: float, radius: float, depth: float) -> None:
    """A parabolic bowl with a rim, and what was thrown out of it falling with r^-3. The old ground sinks in the bowl."""
    rows, columns = out.shape
    rim = 0.2 * depth
    reach = int(3.0 * radius) + 1
    base = out[int(row) % rows, int(column) % columns]
    for j in range(int(row) - reach, int(row) + reach + 1):
        for i in range(int(column) - reach, int(column) + reach + 1):
            r = math.hypot(i - column, j - row) / radius
            if r > 3.0:
                continue
            old = out[j % rows, i % columns]
            if r < 1.0:
                level = base + (old - base) * r * r * r * r
                new = level - depth + (depth + rim) * r * r
            else:
                new = old + rim * (r**-3.0 - 1.0 / 27.0)
            out[j % rows, i % columns] = new


@kernel
def _boulder(out: np.ndarray, column: float, row: float, radius: float, height: float) -> None:
    rows, columns = out.shape
    reach = int(radius) + 2
    for j in range(int(row) - reach, int(row) + reach + 1):
        for i in range(int(column) - reach, int(column) + reach + 1):
            r2 = ((i - column) ** 2 + (j - row) ** 2) / (radius * radius)
            if r2 < 1.0:
                out[j % rows, i % columns] += height * math.sqrt(1.0 - r2)


@kernel
def lit(heights: np.ndarray, cell: float, elevation: float, azimuth: float, out: np.ndarray) -> None:
    """out (rows, columns): light over that on level ground (Lambert), DARK in shadows.

    The sun stands `elevation` [rad] above, `azimuth` [rad] from +x towards +y, within 45 deg of +x or -x. Shadows are swept
    away from it, column by column; twice round, as the ground is periodic.
    """
    rows, columns = heights.shape
    sx, sy, sz = math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)
    away = -1 if sx > 0.0 else 1  # columns are visited from the sun's side
    shift = sy / abs(sx)  # rows towards the sun, per column
    drop = cell * math.tan(elevation) / abs(math.cos(azimuth))  # of a shadow's upper edge, per column
    edge = np.full(rows, -1e9)
    before = np.full(rows, -1e9)
    for step in range(2 * columns):
        i = (away * step) % columns
        left, right = (i - 1) % columns, (i + 1) % columns
        for j in range(rows):
            at = j + shift
            k = math.floor(at)
            share = at - k
            edge[j] = (1.0 - share) * before[k % rows] + share * before[(k + 1) % rows] - drop
        for j in range(rows):
            h = heights[j, i]
            if step >= columns:
                gx = (heights[j, right] - heights[j, left]) / (2.0 * cell)
                gy = (heights[(j + 1) % rows, i] - heights[(j - 1) % rows, i]) / (2.0 * cell)
                light = max(0.0, (-gx * sx - gy * sy + sz) / math.sqrt(1.0 + gx * gx + gy * gy)) / sz
                depth = (edge[j] - h) / (0.5 * drop)  # soft by half a cell
                light *= 1.0 - min(1.0, max(0.0, depth))
                out[j, i] = DARK + (1.0 - DARK) * light
            before[j] = max(edge[j], h)
