"""The mildest discrete gust that breaks a limit: its size, where it is met, how long it is, from where it blows.

Every direction and shape is tried at every place and length of a grid. What breaks nothing at the size of the mildest
breaker so far is left out at once; else its own size is found by bisection. Then place and length are moved by half, a
quarter, ... of the grid's step as long as that finds a milder one. Deterministic, one flight at a time.

A ramp stays for good, so only level ones are tried: air that rises or falls for ever would do so through the ground.
Bisection finds a size at which the limit breaks and just below which it does not: the smallest where worse gusts do more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal, get_args

Direction = Literal["headwind", "tailwind", "left", "right", "up", "down"]
Shape = Literal["pulse", "ramp"]
_KEYS = {
    "headwind": ("headwind_mps", 1.0),
    "tailwind": ("headwind_mps", -1.0),
    "right": ("lateral_mps", 1.0),
    "left": ("lateral_mps", -1.0),
    "up": ("vertical_mps", 1.0),
    "down": ("vertical_mps", -1.0),
}


@dataclass(frozen=True, slots=True)
class Gust:
    """One-minus-cosine: full velocity [m/s], met at x [m], gradient distance [m]; left and right are where it blows to."""

    direction: Direction
    shape: Shape
    at_x: float
    gradient: float
    size: float

    def words(self) -> str:
        """For people: "up ramp of 7.05 m/s over 45 m, met at x = -95 m"."""
        where = f"over {self.gradient:.0f} m, met at x = {self.at_x:.0f} m"
        return f"{self.direction} {self.shape} of {self.size:.2f} m/s {where}"

    def changes(self) -> tuple[str, ...]:
        """As --set takes it."""
        key, sign = _KEYS[self.direction]
        gust = f"at_x_m: {self.at_x!r}, gradient_m: {self.gradient!r}, shape: {self.shape}, {key}: {sign * self.size!r}"
        return (f"wind.discrete_gust={{{gust}}}",)


@dataclass(frozen=True, slots=True)
class Falsified:
    """The mildest breaker found (None: nothing up to the largest size breaks it), its margin, and what it took."""

    gust: Gust | None
    margin: float  # > 0: by how much the limit is broken; without a gust that of the worst one tried
    flights: int
    tried: tuple[tuple[Gust, float], ...]  # every gust and its margin, in order


def falsify(
    margin: Callable[[Gust], float],
    places: Sequence[float],
    gradients: Sequence[float],
    largest: float,
    *,
    directions: Sequence[Direction] = get_args(Direction),
    shapes: Sequence[Shape] = get_args(Shape),
    tolerance: float = 0.1,
    halvings: int = 2,
) -> Falsified:
    """Search for the mildest gust with margin(gust) > 0.

    places : [m] x where it is met, ascending; gradients : [m] gradient distances, ascending
    largest : [m/s] size beyond which nobody asks; tolerance : [m/s] to which the size is found
    halvings : how often the step of place and length is halved around the best

    Raises ValueError for an empty grid.
    """
    if not (places and gradients and directions and shapes and largest > 0.0 and tolerance > 0.0):
        raise ValueError("falsify: every axis of the grid needs a value, largest and tolerance must be > 0 m/s")
    tried: list[tuple[Gust, float]] = []

    def broken(gust: Gust) -> bool:
        tried.append((gust, margin(gust)))
        return tried[-1][1] > 0.0

    def mildest(gust: Gust, best: Gust | None) -> Gust | None:
        """`gust` at its smallest breaking size, if that is a tolerance or more below the best one's."""
        high = largest if best is None else best.size - tolerance
        if high <= 0.0 or not broken(replace(gust, size=high)):
            return best
        low = 0.0
        while high - low > tolerance:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if broken(replace(gust, size=middle)) else (middle, high)
        return replace(gust, size=high)

    best: Gust | None = None
    for direction, shape, at_x, gradient in product(directions, shapes, places, gradients):
        if shape == "ramp" and direction in ("up", "down"):
            continue
        best = mildest(Gust(direction, shape, at_x, gradient, 0.0), best)
    for k in range(1, halvings + 1):
        if best is not None:
            for moved in _around(best, _step(places) / 2**k, _step(gradients) / 2**k):
                best = mildest(moved, best)
    if best is None:
        worst = max((m for _, m in tried), default=float("nan"))
        return Falsified(None, worst, len(tried), tuple(tried))
    found = next(m for gust, m in reversed(tried) if gust == best)
    return Falsified(best, found, len(tried), tuple(tried))


def _step(values: Sequence[float]) -> float:
    return (values[-1] - values[0]) / (len(values) - 1) if len(values) > 1 else 0.0


def _around(gust: Gust, place: float, length: float) -> Iterator[Gust]:
    for dx, dl in ((-place, 0.0), (place, 0.0), (0.0, -length), (0.0, length)):
        if (dx or dl) and gust.gradient + dl > 0.0:
            yield replace(gust, at_x=gust.at_x + dx, gradient=gust.gradient + dl)
