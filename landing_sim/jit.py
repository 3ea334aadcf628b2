"""Compiled kernels: one decorator, so that caching and floating-point rules are the same everywhere.

`fastmath` stays off: reassociated sums would make results depend on the processor. Division by zero gives inf or nan, as in
numpy: checks in every division are not paid for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile `function` with numba, cached on disk."""
    return numba.njit(cache=True, fastmath=False, error_model="numpy")(function)  # type: ignore[no-any-return]
