"""What a campaign ran on: processor, software, and whether that software is the same as somebody else's."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from landing_sim.record.log import versions

_PACKAGE = Path(__file__).resolve().parent.parent


@functools.cache
def digest() -> str:
    """Of the package's own source: two machines with the same one fly the same landing."""
    found = hashlib.sha256()
    for file in sorted(_PACKAGE.rglob("*.py")):
        found.update(file.relative_to(_PACKAGE).as_posix().encode())
        found.update(file.read_bytes())
    return found.hexdigest()


def software() -> dict[str, str]:
    """Versions of what results depend on."""
    return {"python": platform.python_version(), "source": digest()[:12], **versions()}


def this_machine() -> dict[str, Any]:
    """Name, processor, cores."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def caches_warm(mark: bool = False) -> bool:
    """Whether compiled kernels of this very source lie on disk; with `mark`, remember that they now do.

    Many processes that all compile at once take as long as one, each: the first landing goes alone until then.
    """
    import numba

    key = hashlib.sha256(f"{digest()} {platform.python_version()} {numba.__version__} {_processor()}".encode())
    stamp = _PACKAGE / "__pycache__" / f"compiled-{key.hexdigest()[:16]}"
    if mark:
        try:
            stamp.parent.mkdir(exist_ok=True)
            for old in stamp.parent.glob("compiled-*"):
                old.unlink(missing_ok=True)
            stamp.touch()
        except OSError:  # not ours to write: kernels go to the user's own cache, and the first landing alone every time
            return False
    return stamp.is_file()


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """One process of this machine at a time, where the package's folder and the system let us say so."""
    with contextlib.ExitStack() as held:
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            stream = held.enter_context((_PACKAGE / "__pycache__" / "compiling.lock").open("w"))
            fcntl.flock(stream, fcntl.LOCK_EX)
        yield
