"""Earlier views to pair the present one with: far enough apart to tell heights, near enough to share features."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class View:
    """t [s]; ids (n,) sorted; rays (n, 3) unit in R; p (3,) [m] camera in R; R_CR (3, 3)."""

    t: float
    ids: np.ndarray
    rays: Array
    p: Array
    R_CR: Array


@dataclass(frozen=True, slots=True)
class Pair:
    """The features ids (n,) that two views share: directions a from the first camera, b from the second, (n, 3) in R."""

    first: View
    second: View
    ids: np.ndarray
    a: Array
    b: Array

    @property
    def t(self) -> Array:
        """(3,) [m] first camera from the second, R."""
        return self.first.p - self.second.p


class Views:
    """The last `age` [s] of views, each `spacing` [m] or more from the one before.

    nearest, furthest : [m] limits of a pair's baseline
    """

    __slots__ = ("age", "past")

    def __init__(self, age: float) -> None:
        self.age = age
        self.past: deque[View] = deque()

    def pair(self, now: View, nearest: float, furthest: float, features: int) -> Pair | None:
        """`now` with an earlier view `nearest` to `furthest` [m] off that shares `features` with it.

        Of several, that with the greatest product of baseline and features shared; None if there is none.
        """
        while self.past and now.t - self.past[0].t > self.age:
            self.past.popleft()
        best: tuple[float, View, np.ndarray, np.ndarray] | None = None
        for view in self.past:
            apart = float(np.linalg.norm(view.p - now.p))
            if nearest <= apart <= furthest:
                _, i, j = np.intersect1d(view.ids, now.ids, assume_unique=True, return_indices=True)
                if len(i) >= features and (best is None or apart * len(i) > best[0]):
                    best = apart * len(i), view, i, j
        if best is None:
            return None
        _, view, i, j = best
        return Pair(view, now, now.ids[j], view.rays[i], now.rays[j])

    def keep(self, now: View, spacing: float) -> None:
        """Remember the view unless the last one was taken within `spacing` [m] of it."""
        if not self.past or float(np.linalg.norm(self.past[-1].p - now.p)) >= spacing:
            self.past.append(now)
