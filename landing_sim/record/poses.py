"""Poses of a whole flight as rerun takes them in one call: its matrices are converted one by one, quaternions together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from landing_sim.record.stage import rerun
from landing_sim.types import Array


def quaternions(R: Array | Sequence[Array]) -> Array:
    """(n, 4) x, y, z, w of unit length for rotation matrices (n, 3, 3); either of the two signs.

    Source     the outer product 4 q q^T is linear in R; its row with the largest diagonal is the best conditioned one
               (Shepperd 1978).
    """
    R = np.asarray(R)
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(R, 0, -1)
    products = np.array([
        [1.0 + a - e - i, d + b, g + c, h - f],
        [d + b, 1.0 - a + e - i, h + f, c - g],
        [g + c, h + f, 1.0 - a - e + i, d - b],
        [h - f, c - g, d - b, 1.0 + a + e + i],
    ])  # fmt: skip
    largest = np.argmax(np.einsum("iin->in", products), axis=0)
    q = products[largest, :, np.arange(len(R))]
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def poses(translation: Array, R: Array | Sequence[Array]) -> Any:
    """Columns for `send_columns`: places (n, 3) [m] and rotations (n, 3, 3)."""
    return rerun().Transform3D.columns(translation=translation, quaternion=quaternions(R))
