"""Sensor noise that depends on key, frame and pixel only, so that any window of any frame can be made again."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array

QUANTILES = 65536  # 16 bits of hash a pixel


@cache
def gaussian_quantiles() -> np.ndarray:
    """(65536,) float32: standard normal quantiles at the middle of each of as many equal probabilities."""
    from scipy.special import ndtri

    return ndtri((np.arange(QUANTILES) + 0.5) / QUANTILES).astype(np.float32)  # type: ignore[no-any-return]


@lru_cache(maxsize=4)
def developed(palette: tuple[float, ...], gain: float, offset: float, sigma: float) -> np.ndarray:
    """(n, 65536) uint8: what `develop` makes of each of n greys with each of the quantiles; read by `develop_flat`."""
    value = (np.array(palette) * gain + offset)[:, None] + sigma * gaussian_quantiles().astype(np.float64) + 0.5
    return np.clip(value, 0.0, 255.0).astype(np.uint8)


@kernel
def mix(x: np.uint64) -> np.uint64:
    """Finaliser of splitmix64: 64 bits in, 64 well mixed bits out (Steele, Lea & Flood 2014, fig. 16)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel
def stream_of(key: np.uint64, index: int) -> np.uint64:
    """Start of the noise sequence of frame `index`."""
    return mix(mix(key) + np.uint64(index) * np.uint64(0xD1B54A32D192ED03))


@uncounted
def develop(
    out: np.ndarray, r0: int, c0: int, block: Array, w: int, h: int, u0: int, v0: int, stream: np.uint64, lens: Array,
    quantiles: np.ndarray, noise: Array,
) -> None:  # fmt: skip
    """Lens gain and offset, sensor noise and quantisation of a block; lens (3,): gain, offset, noise sigma.

    The noise of pixel (u, v) is 16 bits of the hash of its counter (four pixels share one hash), through a table of
    Gaussian quantiles. noise (>= w + 6,) is working space.
    """
    gain, offset, sigma = lens[0], lens[1], lens[2]
    skip = u0 & 3
    for c in range(w + 6):
        noise[c] = 0.0
    for r in range(h):
        if sigma > 0.0:
            counter = stream + np.uint64(((v0 + r) << 20) + (u0 >> 2) + 1) * np.uint64(0x9E3779B97F4A7C15)
            for g in range((skip + w + 3) >> 2):
                bits = mix(counter)
                counter += np.uint64(0x9E3779B97F4A7C15)
                for lane in range(4):
                    noise[4 * g + lane] = sigma * quantiles[(bits >> np.uint64(16 * lane)) & np.uint64(0xFFFF)]
        row, drawn = out[r0 + r, c0 : c0 + w], noise[skip : skip + w]
        for c in range(w):
            value = block[r, c] * gain + offset + drawn[c] + 0.5
            value = value if value > 0.0 else 0.0
            row[c] = np.uint8(value if value < 255.0 else 255.0)


@uncounted
def develop_flat(
    out: np.ndarray, r0: int, c0: int, grey: np.ndarray, w: int, h: int, u0: int, v0: int, stream: np.uint64,
    hashes: np.ndarray,
) -> None:  # fmt: skip
    """`develop` of a block of one grey, given as its row (65536,) of `developed`.

    hashes (>= (w + 6) / 4,) uint64 is working space.
    """
    bits = hashes.view(np.uint16)  # the lanes of `develop`, on a little-endian machine
    skip = u0 & 3
    for r in range(h):
        counter = stream + np.uint64(((v0 + r) << 20) + (u0 >> 2) + 1) * np.uint64(0x9E3779B97F4A7C15)
        for g in range((skip + w + 3) >> 2):
            hashes[g] = mix(counter)
            counter += np.uint64(0x9E3779B97F4A7C15)
        row, drawn = out[r0 + r, c0 : c0 + w], bits[skip : skip + w]
        for c in range(w):
            row[c] = grey[drawn[c]]


@kernel
def develop_frame(image: Array, lens: Array, quantiles: np.ndarray, key: np.uint64, index: int) -> np.ndarray:
    """(height, width) uint8 of an image drawn elsewhere: lens, noise and quantisation as in all frames."""
    height, width = image.shape
    out = np.empty((height, width), np.uint8)
    develop(out, 0, 0, image, width, height, 0, 0, stream_of(key, index), lens, quantiles, np.empty(width + 6))
    return out
