"""What could keep landing-sim from working on this machine, looked at one by one."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path


def report(say: Callable[[str], None]) -> bool:
    """Say what is found, a line each; True if nothing is broken."""
    good = True
    for name, check in CHECKS:
        try:
            found, fine = check(), True
        except Exception as error:  # whatever goes wrong here is a finding
            found, fine = f"{type(error).__name__}: {error}", False
        good &= fine
        say(f"{'ok  ' if fine else 'FAIL'}  {name:14}{found}")
    say("nothing is broken" if good else "something is broken: see FAIL above")
    return good


def _python() -> str:
    if sys.version_info < (3, 11):  # noqa: UP036
        raise RuntimeError(f"{platform.python_version()} is too old: 3.11 or newer is needed")
    return f"{platform.python_version()} at {sys.executable} on {platform.system()} {platform.machine()}"


def requirements() -> Iterator[str]:
    """Names of the packages that landing-sim needs to run."""
    for line in metadata.requires("landing-sim") or []:
        if "extra ==" not in line:
            yield re.split(r"[<>=!~;\[ ]", line, maxsplit=1)[0]


def _packages() -> str:
    missing = []
    found = []
    for name in requirements():
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            missing.append(name)
    if missing:
        raise RuntimeError(f"not installed: {', '.join(missing)}")
    return ", ".join(found)


def _data() -> str:
    from landing_sim import paths, scenario, vehicle

    for name in paths.scenario_names():
        scenario.load(name)
    for name in paths.aircraft_names():
        vehicle.load(name)
    return f"{len(paths.scenario_names())} scenarios, {len(paths.aircraft_names())} aircraft, all valid"


def _jsbsim() -> str:
    from landing_sim import paths
    from landing_sim.plants.jsbsim import FlightModel

    loaded = [
        f"{name} {FlightModel(paths.aircraft_folder(name), 0.005).mass:.0f} kg" for name in paths.aircraft_names()
    ]
    return f"flight models load: {', '.join(loaded)}"


def _opencv() -> str:
    import cv2
    import numpy as np

    image = np.zeros((16, 16), np.uint8)
    cv2.fillConvexPoly(image, np.array([[2, 2], [12, 2], [12, 12], [2, 12]], np.int32), 255)
    if image[7, 7] != 255:
        raise RuntimeError("a filled polygon is empty")
    return f"{cv2.__version__} draws"


def _numba() -> str:
    import numba

    from landing_sim.geometry import so3

    folder = Path(so3.from_euler._cache.cache_path)  # type: ignore[attr-defined]
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
    return f"{numba.__version__}; compiled code is kept in {folder}"


def _viewer() -> str:
    if importlib.util.find_spec("rerun") is None:
        raise RuntimeError("rerun is not installed: recordings can neither be written nor shown")
    display = sys.platform in ("darwin", "win32") or any(os.environ.get(v) for v in ("DISPLAY", "WAYLAND_DISPLAY"))
    where = "in a window, or in a browser with --web" if display else "no display here: `replay --web` uses a browser"
    return f"rerun {metadata.version('rerun-sdk')}; {where}"


CHECKS: tuple[tuple[str, Callable[[], str]], ...] = (
    ("python", _python),
    ("packages", _packages),
    ("data", _data),
    ("jsbsim", _jsbsim),
    ("opencv", _opencv),
    ("numba", _numba),
    ("viewer", _viewer),
)
