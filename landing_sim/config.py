"""From a YAML document to frozen, typed values: overrides, validation, messages that name the place and the likely word."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import is_dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from landing_sim.errors import ConfigError, Location, Mark, Problem, did_you_mean
from landing_sim.yamlfile import MAX_DEPTH, Document, kind_of, parse_value


class Section(BaseModel):
    """A frozen part of a file: unknown keys, loose types, NaN and infinity are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")  # of models, of dataclasses
S = TypeVar("S", bound=Section)


def override(document: Document, assignments: Iterable[str]) -> None:
    """Apply `path=value` strings, as given with --set, onto a document. Raises ConfigError, for all of them at once."""
    problems: list[Problem] = []
    for assignment in assignments:
        path, equals, text = assignment.partition("=")
        mark = Mark(f"--set {path}")
        keys = [part.strip() for part in path.split(".")]
        if not equals or not all(keys):
            problems.append(Problem(mark, (), "must look like path.to.key=value"))
            continue
        try:
            value = parse_value(text, mark.source)
        except ConfigError as error:
            problems += [Problem(mark, tuple(keys), problem.message) for problem in error.problems]
            continue
        problem = assign(document, keys, value, mark)
        if problem:
            problems.append(problem)
    if problems:
        raise ConfigError(problems)


def assign(document: Document, keys: list[str], value: Any, mark: Mark) -> Problem | None:
    """Put a value into a document; what is wrong with it will be said to stand at `mark`. A Problem if it has no place."""
    if len(keys) > MAX_DEPTH:
        return Problem(mark, (), f"nested deeper than {MAX_DEPTH} levels")
    location: Location = ()

    def put(node: Any, rest: list[str]) -> Any:
        nonlocal location
        if not rest:
            return value
        key: str | int = rest[0]
        if isinstance(node, tuple | list):
            if not rest[0].isdecimal() or int(rest[0]) >= len(node):
                raise LookupError(f"the list has {len(node)} items, counted from 0")
            key = int(rest[0])
            location = (*location, key)
            return (*node[:key], put(node[key], rest[1:]), *node[key + 1 :])
        if node is not None and not isinstance(node, dict):
            raise LookupError(f"is a {kind_of(node)}, which has no key {key!r}")
        location = (*location, key)
        return {**(node or {}), key: put((node or {}).get(key), rest[1:])}

    try:
        document.data = put(document.data, keys)
    except LookupError as error:
        return Problem(mark, location, str(error.args[0]))
    for marks in (document.keys, document.values):
        for old in [known for known in marks if known[: len(location)] == location]:
            del marks[old]
        # Parents that --set brought into being have no other place to point at.
        for depth in range(1, len(location) + 1):
            marks.setdefault(location[:depth], mark)
    return None


def validate(document: Document, model: type[S]) -> S:
    """The document as a `model`. Raises ConfigError with every problem and its place."""
    try:
        # As JSON, where strictness allows mappings for dataclasses.
        return model.model_validate_json(json.dumps(document.data))
    except ValidationError as error:
        raise ConfigError(_problems(document, model, error)) from None


def _problems(document: Document, model: type[Section], error: ValidationError) -> list[Problem]:
    out: list[Problem] = []
    for item in error.errors(include_url=False):
        location: Location = tuple(item["loc"])
        if item["type"] == "inconsistent":
            out += [Problem(document.mark(at), at, message) for at, message in item["ctx"]["problems"]]
            continue
        if item["type"] == "missing":
            mark = document.mark(location[:-1], key=True)
        else:
            mark = document.mark(location, key=item["type"] in _UNKNOWN)
        out.append(Problem(mark, location, _message(item, model)))
    return sorted(out, key=lambda problem: (problem.mark.source, problem.mark.line, problem.mark.column))


def _message(item: Any, model: type[Section]) -> str:
    context, found = item.get("ctx", {}), _show(item["input"])
    match item["type"]:
        case kind if kind in _UNKNOWN:
            *parents, key = item["loc"]
            return f"unknown key{did_you_mean(str(key), _fields(model, tuple(parents)))}"
        case "missing":
            return "missing: this key is required"
        case "literal_error" if len(context["expected"]) > 120:
            near = did_you_mean(str(item["input"]), re.findall(r"'([^']*)'", context["expected"]))
            return f"unknown word {found}{near}"
        case "literal_error":
            near = did_you_mean(str(item["input"]), re.findall(r"'([^']*)'", context["expected"]))
            return f"must be {context['expected']}, not {found}{near}"
        case "finite_number":
            return f"must be a finite number, not {found}"
        case "value_error":
            return str(context["error"])
        case "model_type" | "dataclass_type" | "dict_type":
            return f"must be a mapping of keys to values, not {found}"
        case "tuple_type":
            return f"must be a list, not {found}"
    return f"{item['msg'].replace('Input should be', 'must be')}, not {found}"


def inconsistent(problems: list[tuple[Location, str]]) -> None:
    """For a model's validator: raise for values that are each fine but do not fit together; nothing if there are none.

    `problems` are (location from the top of the file, message).
    """
    if problems:
        text = "; ".join(f"{'.'.join(map(str, where))}: {message}" for where, message in problems)
        raise PydanticCustomError("inconsistent", "{text}", {"text": text, "problems": problems})


def _fields(model: Any, location: Location) -> list[str]:
    """Names of the keys known at a location of a model."""
    named = False  # the key is a name in a mapping of names to models
    for key in location:
        if named:
            named = False
        elif not isinstance(key, int):
            annotation = get_type_hints(model).get(key)
            model, named = _model_in(annotation), get_origin(annotation) is dict
        if model is None:
            return []
    return list(get_type_hints(model)) if model else []


def _model_in(annotation: Any) -> Any:
    """The model or dataclass in an annotation such as `Gust | None` or `tuple[Taxiway, ...]`."""
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


def _show(value: Any) -> str:
    if isinstance(value, dict | list | tuple):
        return f"a {kind_of(value)}"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
