"""How far a path is from the true one: as it is, and after the similarity that fits best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from landing_sim.types import Array


class PathError(NamedTuple):
    """All [m] but scale.

    absolute : (n,) distance as it is; aligned : (n,) after the best similarity; scale : of the path over the true one's
    """

    absolute: Array
    aligned: Array
    scale: float

    @property
    def median(self) -> float:
        return float(np.median(self.absolute))

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.aligned**2)))


def path_error(p_hat: Array, p: Array) -> PathError:
    """Compare positions p_hat (n, 3) with the true ones p (n, 3) of the same times. Raises ValueError below 3 positions.

    Source     Umeyama 1991, eqs. (38)-(43).
    """
    if len(p) < 3 or p.shape != p_hat.shape:
        raise ValueError(f"paths of {p_hat.shape} and {p.shape} cannot be compared")
    a, b = p_hat - p_hat.mean(0), p - p.mean(0)
    U, d, Vt = np.linalg.svd(b.T @ a / len(p))
    S = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = U @ S @ Vt
    scale = float((d * np.diag(S)).sum() / np.mean((a**2).sum(1)))
    aligned = np.linalg.norm(b - scale * a @ R.T, axis=1)
    return PathError(np.linalg.norm(p_hat - p, axis=1), aligned, 1.0 / scale)
