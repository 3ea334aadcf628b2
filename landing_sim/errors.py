"""Errors a user can act on: where in which file, what is wrong, what was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

Location = tuple[str | int, ...]
"""Keys and list indices from the top of a file to a value."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A place in a text: line and column from 1. `source` is a file, or an option such as ``--set wind.gust``."""

    source: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        return self.source if self.source.startswith("--") else f"{self.source}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong, printed as ``file:line:col: path: message``."""

    mark: Mark
    location: Location
    message: str

    def __str__(self) -> str:
        return f"{self.mark}: {dotted(self.location)}: {self.message}"


class ConfigError(ValueError):
    """A file that cannot be used. `problems` holds everything found wrong with it; str() prints one a line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


class ScenarioError(ConfigError):
    """A scenario that cannot be flown as written."""


class VehicleError(ConfigError):
    """An aircraft's vehicle.yaml that cannot be used as written."""


def dotted(location: Location) -> str:
    """``runway.taxiways.0.x_m``; "(file)" for the file as a whole."""
    return ".".join(map(str, location)) or "(file)"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` (did you mean 'x'?)`` for the known word nearest to `word`, else an empty string."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f" (did you mean {near[0]!r}?)" if near else ""
