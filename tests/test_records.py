"""What is made and called many times a cycle is made and called as cheaply as it should be, and is otherwise the same."""

from __future__ import annotations

import copy
import importlib
import inspect
import pickle
import pkgutil
import re
import sys
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
import pytest

import landing_sim
from landing_sim.jit import direct, kernel, uncounted
from landing_sim.records import record


@record
class Fast:
    a: float
    b: str = "b"
    extra: Mapping[str, float] = field(default_factory=dict)


@record
class Held:
    a: float


@dataclass(frozen=True, slots=True)
class Plain:
    a: float
    b: str = "b"
    extra: Mapping[str, float] = field(default_factory=dict)


def test_a_record_is_the_frozen_dataclass() -> None:
    for given, named in (((1.0,), {}), ((1.0, "c"), {}), ((), {"extra": {"x": 2.0}, "a": 1.0})):
        fast, plain = Fast(*given, **named), Plain(*given, **named)  # type: ignore[arg-type]
        assert asdict(fast) == asdict(plain)
        assert fast == Fast(*given, **named) and fast != Fast(2.0)  # type: ignore[arg-type]
        assert pickle.loads(pickle.dumps(fast)) == fast
    assert not hasattr(Fast(1.0), "__dict__") and isinstance(Fast(1.0), Fast) and type(Fast(1.0)) is Fast
    assert pickle.loads(pickle.dumps(Fast(1.0, extra={"x": 2.0}))) == Fast(1.0, extra={"x": 2.0})
    assert copy.deepcopy(Fast(1.0)) == Fast(1.0) and hash(Held(1.0)) == hash(Held(1.0))
    assert [(f.name, f.type) for f in fields(Fast)] == [(f.name, f.type) for f in fields(Plain)]
    assert replace(Fast(1.0), b="d") == Fast(1.0, "d")
    assert repr(Fast(1.0)) == "Fast(a=1.0, b='b', extra={})"
    assert Fast(1.0).extra is not Fast(1.0).extra


def test_a_record_cannot_be_changed() -> None:
    fast = Fast(1.0)
    with pytest.raises(FrozenInstanceError):
        fast.a = 2.0  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        del fast.a
    with pytest.raises(TypeError):
        Fast()  # type: ignore[call-arg]
    with pytest.raises(TypeError):
        Fast(1.0, "b", {}, 2.0)  # type: ignore[call-arg]


def test_a_record_does_without_post_init() -> None:
    with pytest.raises(AssertionError, match="__post_init__"):

        @record
        class Checked:
            a: float

            def __post_init__(self) -> None: ...

    with pytest.raises(AssertionError, match="base"):

        @record
        class Derived(Plain):
            c: float = 0.0


@kernel
def scaled(x: np.ndarray, by: float) -> float:
    return float(by * x[0])


def test_a_kernel_is_called_directly_once_it_is_compiled_for_one_type_alone() -> None:
    x = np.array([3.0])
    if not scaled.overloads:  # type: ignore[attr-defined]
        assert direct(scaled) is scaled
    assert scaled(x, 2.0) == 6.0
    straight = direct(scaled)
    assert straight is not scaled and straight(x, 2.0) == 6.0 and straight(x, 2) == 6.0
    with pytest.raises(TypeError):
        straight(x)
    scaled(np.array([3], dtype=np.int64), 2.0)
    assert direct(scaled) is scaled


@uncounted
def total(x: np.ndarray) -> float:
    row = x[1:]  # a view, which `kernel` would count
    return float(row[0] + row[1])


def test_an_uncounted_kernel_leaves_what_it_is_given_as_often_referred_to_as_before() -> None:
    x = np.arange(3.0)
    before = sys.getrefcount(x)
    assert total(x) == 3.0
    assert sys.getrefcount(x) == before


def test_an_uncounted_kernel_that_makes_an_array_is_refused() -> None:
    @uncounted
    def makes(x: np.ndarray) -> float:
        return float(np.zeros(3)[0] + x[0])

    with pytest.raises(Exception, match="array passed into the function"):
        makes(np.zeros(1))


def returns_numbers(compiled: Any) -> bool:
    parts = re.split(r"[\[\], ]+", str(inspect.signature(compiled.py_func).return_annotation).rstrip("]"))
    return set(parts) <= {"tuple", "float", "int", "bool", "None", "np.uint64", "Vector"}


def test_no_uncounted_kernel_returns_an_array_or_is_handed_one_by_a_kernel_it_calls() -> None:
    found = 0
    for module in pkgutil.walk_packages(landing_sim.__path__, "landing_sim."):
        for name, thing in vars(importlib.import_module(module.name)).items():
            if getattr(thing, "targetoptions", {}).get("_nrt") is False:
                found += 1
                assert returns_numbers(thing), name
                named = (thing.py_func.__globals__.get(other) for other in thing.py_func.__code__.co_names)
                for called in (other for other in named if hasattr(other, "py_func")):
                    assert returns_numbers(called), (name, called)
    assert found > 30
