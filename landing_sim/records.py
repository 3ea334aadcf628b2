"""Frozen dataclasses that are made many times a cycle: the same class, but a cheaper `__init__`."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def record(cls: type[T]) -> type[T]:
    """`dataclass(frozen=True, slots=True)` whose `__init__` writes into the slots themselves.

    A frozen dataclass looks up `object.__setattr__` and the slot by its name for every field: two fifths of what it
    takes to make one. For classes without `__post_init__` only.
    """
    made: Any = dataclass(frozen=True, slots=True)(cls)
    assert not hasattr(made, "__post_init__"), f"{cls.__name__} has a __post_init__: it would not be called"
    known: dict[str, Any] = {"MISSING": MISSING}
    head, body = ["self"], []
    for f in fields(made):
        known[f"set_{f.name}"] = getattr(made, f.name).__set__
        value = f.name
        if f.default_factory is not MISSING:
            known[f"new_{f.name}"] = f.default_factory
            head.append(f"{f.name}=MISSING")
            value = f"new_{f.name}() if {f.name} is MISSING else {f.name}"
        elif f.default is not MISSING:
            known[f"default_{f.name}"] = f.default
            head.append(f"{f.name}=default_{f.name}")
        else:
            head.append(f.name)
        body.append(f"    set_{f.name}(self, {value})")
    exec("\n".join([f"def __init__({', '.join(head)}):", *body]), known)
    made.__init__ = known["__init__"]
    return made  # type: ignore[no-any-return]
