"""The shape of the code: who may import whom, and that what is public says what it is."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

import landing_sim

ROOT = Path(landing_sim.__file__).parent
TRUTH = {"world", "plants", "sensors"}
ONBOARD = {"vision", "estimators", "control"}
ANYONE = {"signals", "geometry", "noise", "jit", "records", "types"}
# Only these may name concrete parts of both sides.
JOINERS = {"missions", "cli"}
ALLOWED_OURS = {
    "geometry": {"geometry", "jit", "types"},
    "loop": {"signals", "interfaces"},
    "signals": {"geometry", "records", "types"},
    "interfaces": ANYONE,
    "record": ANYONE | {"record"},
    **{part: ANYONE | TRUTH | {"interfaces"} for part in TRUTH},
    **{part: ANYONE | ONBOARD | {"interfaces"} for part in ONBOARD},
}
ONLY_IN = {
    "jsbsim": {"plants/jsbsim.py", "plants/jsbsim_lander.py", "plants/jsbsim_quadrotor.py"},
    "rerun": {"record/replay.py", "record/stage.py", "record/lunar_replay.py", "record/quadrotor_replay.py"},
}


def modules() -> list[Path]:
    return sorted(p for p in ROOT.rglob("*.py") if "__pycache__" not in p.parts)


def imports(path: Path) -> Iterator[str]:
    """Every module a file imports, anywhere in it, `from a import b` as a.b."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{name.name}" for name in node.names)


def ours(path: Path) -> set[str]:
    """Top-level parts of landing_sim that a file imports."""
    return {name.split(".")[1] for name in imports(path) if name.startswith("landing_sim.")}


def part(path: Path) -> str:
    return path.relative_to(ROOT).with_suffix("").parts[0]


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_import_rules(path: Path) -> None:
    used = ours(path)
    name = part(path)
    if name in ALLOWED_OURS:
        assert used <= ALLOWED_OURS[name], f"{name} must not import {sorted(used - ALLOWED_OURS[name])}"
    if name not in JOINERS:
        assert not (used & TRUTH and used & ONBOARD), "only missions and cli may name both sides"
    for package, places in ONLY_IN.items():
        if str(path.relative_to(ROOT)) not in places:
            assert not any(n.split(".")[0] == package for n in imports(path)), f"only {places} may import {package}"


def test_the_rules_find_offenders(tmp_path: Path) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text("def f():\n    from landing_sim.world import wind\n    import landing_sim.vision.masks, jsbsim\n")
    assert ours(bad) == {"world", "vision"}
    assert "jsbsim" in set(imports(bad))


def test_every_part_is_there() -> None:
    assert {p.name for p in ROOT.iterdir() if (p / "__init__.py").is_file()} >= TRUTH | ONBOARD | {"record", "missions"}


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_and_public_names_are_described(path: Path) -> None:
    tree = ast.parse(path.read_text())
    if not tree.body:
        return
    assert ast.get_docstring(tree), f"{path.name} has no docstring"
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            brief = isinstance(node, ast.FunctionDef) and (node.end_lineno or 0) - node.lineno < 4
            assert ast.get_docstring(node) or brief, f"{path.name}: {node.name} has no docstring"


def test_all_modules_import() -> None:
    for module in pkgutil.walk_packages(landing_sim.__path__, "landing_sim."):
        importlib.import_module(module.name)


HEAVY = ("rerun", "matplotlib", "control", "cv2", "numba", "jsbsim", "scipy", "pyarrow")


@pytest.mark.parametrize(
    "arguments", [["--help"], ["list"], ["schema"], ["check", "do128/gust"], ["run", "--help"], ["run", "nothing"]]
)
def test_small_commands_load_nothing_heavy(arguments: list[str]) -> None:
    code = f"""
import sys
from landing_sim import cli
sys.argv = ["landing-sim", *{arguments!r}]
try:
    cli.main()
except SystemExit:
    pass
print("\\n" + " ".join(m for m in {HEAVY!r} if m in sys.modules))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.rsplit("\n", 2)[-2] == ""


def test_no_setting_is_ignored() -> None:
    """Every key of scenario and vehicle files is read somewhere; one that nothing reads would be a silent wish."""
    from landing_sim import scenario, vehicle

    reads: set[str] = set()
    for path in modules():
        if part(path) in ("missions", "runner", "cli", "progress", "vehicle"):  # who is handed a scenario
            reads |= {node.attr for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Attribute)}
    elsewhere = {"schema_version", "mission", "description"}  # read while loading, or for people

    def leaves(model: type[BaseModel]) -> Iterator[str]:
        for name, field in model.model_fields.items():
            nested = [t for t in (field.annotation, *get_args(field.annotation)) if isinstance(t, type)]
            sections = [t for t in nested if issubclass(t, BaseModel)]
            yield from (leaf for section in sections for leaf in leaves(section))
            yield name

    for model in (*scenario.MODELS.values(), vehicle.Vehicle):
        ignored = set(leaves(model)) - reads - elsewhere
        assert not ignored, f"nothing reads {sorted(ignored)} of a {model.__name__}"
