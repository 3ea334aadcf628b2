"""Where compiled kernels are kept, and when they are out of date: when anything they were made from has changed.

numba looks at the file a kernel stands in. But a kernel has swallowed those it calls and the constants it names, and a
change of theirs would go unnoticed until its own file is touched. Here the stamp is of all modules of this package that its
file imports, and that these import.

Source     numba 0.68, `numba.core.caching`; its notes on caching name the limit: symbols that another file defines.
"""

from __future__ import annotations

import hashlib
import re
from functools import cache
from pathlib import Path

from numba.core import caching

PACKAGE = Path(__file__).parent
_IMPORTED = re.compile(rf"^\s*(?:from|import) {PACKAGE.name}((?:\.\w+)*)(?: import (\([^)]*\)|.*))?", re.MULTILINE)


@cache
def _read(file: Path) -> tuple[bytes, frozenset[Path]]:
    """Hash of a module, and the modules of this package that it imports."""
    text = file.read_bytes()
    found = set()
    for dotted, names in _IMPORTED.findall(text.decode()):
        place = PACKAGE.joinpath(*dotted.split(".")[1:])
        inside = {place / f"{name}.py" for name in re.findall(r"\w+", names)}
        found |= {module for module in {place.with_suffix(".py"), place / "__init__.py", *inside} if module.is_file()}
    return hashlib.sha256(text).digest(), frozenset(found)


@cache
def sources(file: Path) -> frozenset[Path]:
    """The module itself, and all of this package that it imports, at first or second hand."""
    known, new = set[Path](), {file}
    while new:
        known |= new
        new = {imported for module in new for imported in _read(module)[1]} - known
    return frozenset(known)


@cache
def stamp(file: Path) -> str:
    """Differs when one of `sources` does."""
    whole = hashlib.sha256()
    for module in sorted(sources(file)):
        whole.update(_read(module)[0])
    return whole.hexdigest()


class _Followed:
    _py_file: str

    def get_source_stamp(self) -> str:
        return stamp(Path(self._py_file))


class Wanted(_Followed, caching.UserProvidedCacheLocator):  # type: ignore[misc]
    """In NUMBA_CACHE_DIR, if that is set."""


class Beside(_Followed, caching.InTreeCacheLocator):  # type: ignore[misc]
    """In __pycache__ beside the module."""


class AtHome(_Followed, caching.UserWideCacheLocator):  # type: ignore[misc]
    """In the user's own cache, where that cannot be written to."""


_OURS = (f"{__name__}.{locator.__name__}" for locator in (Wanted, Beside, AtHome))
LOCATORS = ",".join([*_OURS, "IPythonCacheLocator", "ZipCacheLocator"])
"""As numba's CACHE_LOCATOR_CLASSES wants them; its own for what stands in no file, such as a kernel in a notebook."""
