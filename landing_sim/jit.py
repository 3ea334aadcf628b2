"""Compiled kernels: one decorator, so that caching and floating-point rules are the same everywhere.

`fastmath` stays off: reassociated sums would make results depend on the processor. Division by zero gives inf or nan, as in
numpy: checks in every division are not paid for. An index that may be negative, for all numba knows, is looked at in every
access: loops over pixels take their row first, and count in it from zero.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import config, event

from landing_sim.jit_cache import LOCATORS

F = TypeVar("F", bound=Callable[..., object])


class _Uncollected(event.Listener):  # type: ignore[misc]
    """No garbage is collected while numba compiles, and what it has made is never looked through: of the millions of
    objects most live on, and a fifth of the time went into looking for cycles among them."""

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    def on_start(self, event: object) -> None:
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: object) -> None:
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.freeze()
            gc.enable()


event.register("numba:compile", _Uncollected())


def kernel(function: F) -> F:
    """Compile `function` with numba, cached on disk."""
    return _compiled(function, counted=True)


def uncounted(function: F) -> F:
    """`kernel` for what neither makes nor returns an array, nor calls a kernel that returns one: it counts no references.

    Each count is an atomic operation, and numba counts at every call of a small kernel and at every row taken of an array:
    a sixth of all time in kernels. numba itself refuses one that makes an array. What a kernel returned to it would never
    be freed, and what it returned itself might be freed too soon: numba says nothing of either, a test does.
    """
    return _compiled(function, counted=False)


def _compiled(function: F, counted: bool) -> F:
    before = config.CACHE_LOCATOR_CLASSES  # the process's other kernels are none of our business
    config.CACHE_LOCATOR_CLASSES = before or LOCATORS
    try:
        options = {} if counted else {"_nrt": False}
        return numba.njit(cache=True, fastmath=False, error_model="numpy", no_cfunc_wrapper=True, **options)(function)  # type: ignore[no-any-return]
    finally:
        config.CACHE_LOCATOR_CLASSES = before


def direct(compiled: Callable[..., Any]) -> Callable[..., Any]:
    """What calls a kernel without the dispatcher's look at the types of its arguments, half of what a small call costs.

    For kernels that are called every step with the very same arrays: another shape or type is not noticed any more, it is
    read as if it were the one compiled for. The kernel itself, where it has not been compiled yet, or for several types.
    """
    overloads = list(getattr(compiled, "overloads", {}).values())  # none where numba is switched off
    return overloads[0].entry_point if len(overloads) == 1 else compiled
