"""YAML files into plain data, remembering where every value stands.

Built on the events of ruamel's parser rather than its constructors: nothing but mappings, lists and YAML 1.2 core
scalars can come out (``on`` is a string, ``1e3`` a number), and limits are met while reading. Tags, anchors and
aliases are refused. Sequences become tuples, so that models stay frozen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from landing_sim.errors import ConfigError, Location, Mark, Problem

MAX_BYTES = 1 << 20
MAX_DEPTH = 20
MAX_VALUES = 20_000
_INT = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_CONSTANTS = {"": None, "~": None} | {
    word: value
    for name, value in (("null", None), ("true", True), ("false", False))
    for word in (name, name.capitalize(), name.upper())
}


@dataclass(slots=True)
class Document:
    """Plain data and the marks of its keys and values."""

    source: str
    data: dict[str, Any] = field(default_factory=dict)
    keys: dict[Location, Mark] = field(default_factory=dict)
    values: dict[Location, Mark] = field(default_factory=dict)

    def mark(self, location: Location, key: bool = False) -> Mark:
        """Where a value (or its key) stands; that of the nearest parent for what is not written down."""
        while location:
            found = (self.keys if key else self.values).get(location)
            if found:
                return found
            location, key = location[:-1], True
        return Mark(self.source)


def load(path: Path) -> Document:
    """Read a file that holds one YAML mapping. Raises ConfigError."""
    return parse(_text(path), str(path))


def _text(path: Path) -> str:
    def fail(message: str) -> ConfigError:
        return ConfigError([Problem(Mark(str(path)), (), message)])

    if path.is_dir():
        raise fail("is a directory, not a file")
    if not path.is_file():
        raise fail("is not a regular file" if path.exists() else "no such file")
    try:
        with path.open("rb") as stream:
            raw = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise fail(f"cannot be read: {error.strerror}") from None
    if len(raw) > MAX_BYTES:
        raise fail(f"larger than {MAX_BYTES >> 20} MiB")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - (raw.rfind(b"\n", 0, error.start) + 1) + 1
        raise ConfigError([Problem(Mark(str(path), line, column), (), "not UTF-8 text")]) from None


def parse(text: str, source: str) -> Document:
    """Parse YAML text that holds one mapping. `source` names it in errors. Raises ConfigError."""
    document = Document(source)
    data = _build(text, document)
    if not isinstance(data, dict):
        found = "empty" if data is None else f"a {kind_of(data)}"
        raise ConfigError([Problem(Mark(source), (), f"must hold a mapping of keys to values, but is {found}")])
    document.data = data
    return document


def parse_value(text: str, source: str) -> Any:
    """One YAML value, as typed after `--set path=`. Raises ConfigError."""
    return _build(text, Document(source))


def _build(text: str, document: Document) -> Any:
    source = document.source
    problems: list[Problem] = []
    try:
        data = _Builder(document, problems).value(iter(YAML(typ="safe", pure=True).parse(text)))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = Mark(source, mark.line + 1, mark.column + 1) if mark else Mark(source)
        problems.append(Problem(where, (), f"not YAML: {error.problem or error.context}"))
    except YAMLError as error:
        line, column = _reader_position(text, error)
        problems.append(Problem(Mark(source, line, column), (), f"not YAML: {getattr(error, 'reason', error)}"))
    except RecursionError:
        problems.append(Problem(Mark(source), (), f"nested deeper than {MAX_DEPTH} levels"))
    # ruamel lets a few malformed inputs escape as plain Python errors; to the user they are the same thing.
    except (ValueError, AttributeError, IndexError, KeyError, AssertionError, NotImplementedError, TypeError) as error:
        if isinstance(error, ConfigError):
            problems.extend(error.problems)
        else:
            problems.append(Problem(Mark(source), (), f"not YAML: {error}"))
    if problems:
        raise ConfigError(problems)
    return data


def _reader_position(text: str, error: YAMLError) -> tuple[int, int]:
    at = getattr(error, "position", 0)
    at = at if isinstance(at, int) else 0
    return text.count("\n", 0, at) + 1, at - (text.rfind("\n", 0, at) + 1) + 1


class _Builder:
    """Events of one document into plain data. Depth is bounded by MAX_DEPTH, so recursion is safe."""

    def __init__(self, document: Document, problems: list[Problem]) -> None:
        self.document, self.problems, self.count = document, problems, 0

    def value(self, events: Iterator[Event]) -> Any:
        result: Any = None
        seen = 0
        for event in events:
            if isinstance(event, DocumentStartEvent):
                seen += 1
                if seen > 1:
                    self._stop(event, (), "more than one YAML document")
            elif isinstance(event, ScalarEvent | MappingStartEvent | SequenceStartEvent | AliasEvent):
                result = self._node(event, events, ())
        return result

    def _node(self, event: Event, events: Iterator[Event], at: Location) -> Any:
        self.count += 1
        if self.count > MAX_VALUES:
            self._stop(event, at, f"more than {MAX_VALUES} values")
        if len(at) > MAX_DEPTH:
            self._stop(event, at[:3], f"nested deeper than {MAX_DEPTH} levels")
        if isinstance(event, AliasEvent):
            self._problem(event, at, "aliases are not allowed: write the value out")
            return None
        if getattr(event, "anchor", None) is not None:
            self._problem(event, at, "anchors are not allowed: write the value out")
        tag = getattr(event, "ctag", None)
        if tag is not None:
            self._problem(event, at, f"tags are not allowed: {tag}")
        if isinstance(event, MappingStartEvent):
            return self._mapping(events, at)
        if isinstance(event, SequenceStartEvent):
            return self._sequence(events, at)
        return self._scalar(event, at)

    def _mapping(self, events: Iterator[Event], at: Location) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for event in events:
            if isinstance(event, MappingEndEvent):
                break
            if isinstance(event, ScalarEvent):
                key = event.value
                self._node(event, events, at)
            else:
                self._stop(event, at, "a key must be a plain word")
            here = (*at, key)
            if key in out:
                first = self.document.keys[here].line
                self._problem(event, here, f"duplicate key, first given on line {first}")
            self.document.keys.setdefault(here, self._mark(event))
            value_event = next(events)
            # A value left empty has no place of its own.
            empty = isinstance(value_event, ScalarEvent) and not value_event.value and value_event.style is None
            self.document.values.setdefault(here, self._mark(event if empty else value_event))
            out[key] = self._node(value_event, events, here)
        return out

    def _sequence(self, events: Iterator[Event], at: Location) -> tuple[Any, ...]:
        out: list[Any] = []
        for event in events:
            if isinstance(event, SequenceEndEvent):
                break
            here = (*at, len(out))
            self.document.keys[here] = self.document.values[here] = self._mark(event)
            out.append(self._node(event, events, here))
        return tuple(out)

    def _scalar(self, event: Any, at: Location) -> Any:
        text = event.value
        if not text.isprintable() and any("\ud800" <= letter <= "\udfff" for letter in text):
            self._problem(event, at, "half of a surrogate pair is not a character")
        if event.style is not None or not event.implicit[0]:
            return text
        if text in _CONSTANTS:
            return _CONSTANTS[text]
        if len(text) > 100:
            return text
        if _INT.fullmatch(text):
            return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
        if _FLOAT.fullmatch(text):
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        return text

    def _mark(self, event: Event) -> Mark:
        return Mark(self.document.source, event.start_mark.line + 1, event.start_mark.column + 1)

    def _problem(self, event: Event, at: Location, message: str) -> None:
        self.problems.append(Problem(self._mark(event), at, message))

    def _stop(self, event: Event, at: Location, message: str) -> Any:
        raise ConfigError([Problem(self._mark(event), at, message)])


def kind_of(value: Any) -> str:
    """What a value is called in messages."""
    if isinstance(value, dict):
        return "mapping"
    if isinstance(value, list | tuple):
        return "list"
    if isinstance(value, bool):
        return "truth value"
    if isinstance(value, int | float):
        return "number"
    return "text" if isinstance(value, str) else "null"
