"""The columnar log of a flight: one row a control cycle, one column a quantity, its unit in its name.

    true_*  the world       est_*, sd_*  what the filter believes, and its 1-sigma   ref_*, cmd_*  guidance, controller
    meas_*  raw readings    window_*  (n, m) edge windows, padded with -1 or NaN     flag_*  of the estimate

It holds no clock, host or path. builder.py takes it down, parquet.py stores it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from landing_sim.signals import Touchdown
from landing_sim.types import Array

SCHEMA = 1

UNITS = (
    dict.fromkeys(("u", "v", "w", "vx", "vy", "vz", "wx", "wy", "wz"), "mps")
    | dict.fromkeys(("p", "q", "r", "bp", "bq", "br"), "radps")
    | dict.fromkeys(("phi", "theta", "psi"), "rad")
    | dict.fromkeys(("x", "y", "H", "W", "lx", "ly", "lH"), "m")
)
"""Unit suffix of every name an `Estimate` may carry; another name is logged as it is."""

RIGID = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H")
"""The paper's twelve states: what the world can contradict, so what NEES is taken over."""


class LogError(ValueError):
    """A file that is not a log, or steps that do not make one."""


@dataclass(frozen=True, slots=True)
class FlightLog:
    """columns: name -> (n,) or (n, m) array; meta: what JSON can hold (scenario, seed, versions, touchdown, end)."""

    columns: Mapping[str, np.ndarray]
    meta: Mapping[str, Any]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.columns["t_s"])

    @property
    def touchdown(self) -> Touchdown | None:
        found = self.meta.get("touchdown")
        return None if found is None else Touchdown(**found)

    def estimate(self, name: str) -> Array:
        """(n,) what was believed; NaN before the runway was acquired, and where the filter has no such state."""
        column = f"est_{with_unit(name)}"
        return self.columns[column] if column in self.columns else np.full(len(self), np.nan)

    def sigma(self, name: str) -> Array:
        column = f"sd_{with_unit(name)}"
        return self.columns[column] if column in self.columns else np.full(len(self), np.nan)

    def truth(self, name: str) -> Array:
        """(n,) the truth of an estimate's name, at the time the estimate is for; NaN where there is none."""
        column = f"true_{with_unit(name)}"
        if name == "W":
            return np.full(len(self), float(self.meta.get("runway_width_m", np.nan)))
        if column not in self.columns:
            return np.full(len(self), np.nan)
        t, at, values = self.columns["t_s"], self.columns["est_t_s"], self.columns[column]
        return values if np.array_equal(t, at) else np.interp(at, t, values)

    def error(self, name: str) -> Array:
        """(n,) estimate minus truth; angles wrapped to (-pi, pi]."""
        difference = self.estimate(name) - self.truth(name)
        return np.arctan2(np.sin(difference), np.cos(difference)) if name in ("phi", "theta", "psi") else difference


def with_unit(name: str) -> str:
    """The column of an estimate's name, less its prefix."""
    return f"{name}_{UNITS[name]}" if name in UNITS else name


@functools.cache
def versions() -> dict[str, str]:
    """Of the packages whose numbers the results depend on."""
    packages = ("landing-sim", "jsbsim", "numpy", "scipy", "numba", "opencv-python-headless", "control")
    found = {}
    for package in packages:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found
