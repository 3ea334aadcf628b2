"""A compiled kernel is not used any more once what it was made from has changed, in whatever file that is."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from landing_sim import jit_cache

INNER = """
from landing_sim.jit import kernel
from landing_sim.constants import ADDED

@kernel
def inner(x: float) -> float:
    return {factor} * x + ADDED
"""
OUTER = """
from landing_sim.jit import uncounted
from landing_sim.inner import inner

@uncounted
def outer(x: float) -> float:
    return inner(x)

print(outer(3.0), sum(outer.stats.cache_hits.values()))
"""


def run(folder: Path) -> list[str]:
    command = [sys.executable, "-c", "import landing_sim.outer"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.split()


def test_a_change_in_what_a_kernel_calls_or_names_is_noticed(tmp_path: Path) -> None:
    package = tmp_path / "landing_sim"
    package.mkdir()
    for name in ("__init__.py", "jit.py", "jit_cache.py"):
        shutil.copy(jit_cache.PACKAGE / name, package)
    (package / "outer.py").write_text(OUTER)
    (package / "inner.py").write_text(INNER.format(factor=1.0))
    (package / "constants.py").write_text("ADDED = 0.0\n")
    assert run(tmp_path) == ["3.0", "0"]
    assert run(tmp_path) == ["3.0", "1"]  # found again
    (package / "inner.py").write_text(INNER.format(factor=2.0))
    assert run(tmp_path) == ["6.0", "0"]
    (package / "constants.py").write_text("ADDED = 1.0\n")
    assert run(tmp_path) == ["7.0", "0"]
    assert run(tmp_path) == ["7.0", "1"]


def test_a_kernels_sources_are_what_it_imports_at_first_and_second_hand() -> None:
    def of(module: str) -> set[str]:
        return {
            file.relative_to(jit_cache.PACKAGE).as_posix() for file in jit_cache.sources(jit_cache.PACKAGE / module)
        }

    assert of("sensors/render_windows.py") >= {"sensors/render_kernels.py", "sensors/render_lines.py", "jit.py"}
    assert "geometry/runway_image.py" in of("sensors/render_windows.py")  # by render_lines
    assert "control/guidance.py" not in of("sensors/render_windows.py")
    hough, windows = (jit_cache.PACKAGE / module for module in ("vision/hough.py", "sensors/render_windows.py"))
    assert jit_cache.stamp(hough) != jit_cache.stamp(windows)
