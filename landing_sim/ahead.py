"""A first flight's kernels compiled by two processes: what it needs last, while it compiles what it needs first itself.

They meet in numba's cache on disk, where each finds what the other has finished. Should a signature below be none that is
flown with any longer, the second process does nothing useful and nothing wrong.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module

from numba.core import event, sigutils

LAST = (
    (
        "vision.placement",
        "place",
        "f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], i8[::1], f8[::1]",
    ),
    ("vision.masks", "measure", "u1[:, :, ::1], i8[::1], f8[:, ::1], i8[:, ::1], f8[::1], f8[::1]"),
    (
        "estimators.runway_steps",
        "edges_dense",
        "f8[::1], f8[:, ::1], i8[::1], i8[::1], f8[::1], f8[::1], f8, f8, i8[::1], i8[::1], f8[:, ::1], f8[:, ::1], f8, f8,"
        "f8[::1], f8[::1], f8",
    ),
    ("estimators.runway_steps", "gyro_dense", "f8[::1], f8[:, ::1], i8[::1], i8[::1], f8[::1], f8[::1], b1[::1]"),
    ("estimators.runway_steps", "airspeed_dense", "f8[::1], f8[:, ::1], i8[::1], i8[::1], f8, f8[::1], b1[::1]"),
    ("vision.prediction", "sight_from", "i8[:, ::1], f8[::1], f8[::1], f8[:, ::1], f8, f8, f8"),
)
"""Module, kernel and arguments of what a flight by runway comes to last, and of what takes half of the time."""


class _AtFirst(event.Listener):  # type: ignore[misc]
    """Does something when something is compiled for the first time."""

    def __init__(self, do: Callable[[], None]) -> None:
        self._do: Callable[[], None] | None = do

    def on_start(self, event: object) -> None:
        do, self._do = self._do, None
        if do is not None:
            do()

    def on_end(self, event: object) -> None:
        """Nothing."""


@contextmanager
def helped() -> Iterator[None]:
    """While this lasts, a second process compiles as soon as anything has to be; not on a machine with a single core."""
    helpers: list[subprocess.Popen[bytes]] = []

    def start() -> None:
        nowhere = subprocess.DEVNULL
        helpers.append(
            subprocess.Popen([sys.executable, "-m", __name__], stdin=nowhere, stdout=nowhere, stderr=nowhere)
        )

    if (os.cpu_count() or 1) < 2:
        yield
        return
    with event.install_listener("numba:compile", _AtFirst(start)):
        try:
            yield
        finally:
            for helper in helpers:
                helper.terminate()
                helper.wait()


def main() -> None:
    """Compile what comes last."""
    for module, name, arguments in LAST:
        types, _ = sigutils.normalize_signature(f"({arguments})")
        getattr(import_module(f"landing_sim.{module}"), name).compile(types)


if __name__ == "__main__":
    main()
