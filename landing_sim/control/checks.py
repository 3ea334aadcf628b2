"""What every settings class of a vehicle.yaml asks of its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

STRICT = {"extra": "forbid", "strict": True, "allow_inf_nan": False}  # for vehicle.py, which builds them with pydantic


def increasing(name: str, values: Sequence[float]) -> None:
    """Raises     ValueError"""
    if len(values) < 2 or any(b <= a for a, b in pairwise(values)):
        raise ValueError(f"{name} must be two or more increasing numbers, not {list(values)}")


def positive(**values: float) -> None:
    """Raises     ValueError"""
    for name, value in values.items():
        if not value > 0.0:
            raise ValueError(f"{name} must be positive, not {value}")
