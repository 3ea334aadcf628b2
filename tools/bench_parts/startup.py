"""What a user waits for: processes started from nothing, their CPU and wall time, and their peak memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = str(Path(sys.executable).with_name("landing-sim"))


@dataclass(frozen=True, slots=True)
class Process:
    """A process that is over."""

    cpu: float  # [s] user and system
    wall: float  # [s]


def start(arguments: Sequence[str], **environment: str) -> Process:
    """Run to the end. Raises RuntimeError where it does not end well (1 is a landing that missed a criterion)."""
    env = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    with tempfile.TemporaryFile() as complaint:
        begun = time.perf_counter()
        child = subprocess.Popen(arguments, env=env, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=complaint)
        _, status, used = os.wait4(child.pid, 0)
        wall = time.perf_counter() - begun
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode not in (0, 1):
            complaint.seek(0)
            raise RuntimeError(
                f"{' '.join(arguments)} ended with {child.returncode}: {complaint.read().decode()[-500:]}"
            )
    return Process(used.ru_utime + used.ru_stime, wall)


def imports(repeats: int) -> dict[str, float]:
    """CPU seconds of whole processes, interleaved; medians, and their ratio to one that imports numpy."""
    commands = {
        "numpy": (sys.executable, "-c", "import numpy"),
        "landing_sim": (sys.executable, "-c", "import landing_sim"),
        "help": (PROGRAM, "--help"),
        "check": (PROGRAM, "check", "do128/gust"),
    }
    seen: dict[str, list[float]] = {name: [] for name in commands}
    for _ in range(repeats):
        for name, arguments in commands.items():
            seen[name].append(start(arguments, OPENBLAS_NUM_THREADS="1").cpu)
    out = {f"{name}_cpu_s": median(times) for name, times in seen.items()}
    for name in ("landing_sim", "help", "check"):
        out[f"{name}_per_numpy"] = median(a / b for a, b in zip(seen[name], seen["numpy"]))
    return out


def first_results(scenario: str, changes: Sequence[str] = (), cold: bool = True) -> dict[str, float]:
    """Wall and CPU seconds of the command that flies one landing: nothing compiled yet, and all compiled."""
    out: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="landing-sim-bench-") as folder:
        cache = {"NUMBA_CACHE_DIR": str(Path(folder) / "cache")} if cold else {}
        for state in ("cold", "warm") if cold else ("warm",):
            seen = _land(scenario, Path(folder) / state, changes=changes, **cache)
            out |= {f"{state}_wall_s": seen.wall, f"{state}_cpu_s": seen.cpu}
    return out


def peak_memory(scenario: str, changes: Sequence[str] = ()) -> dict[str, float]:
    """[MB] of a process that flies one landing, without and with a recording."""
    out: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="landing-sim-bench-") as folder:
        for name, record in (("peak_mb", False), ("recorded_peak_mb", True)):
            told = Path(folder) / f"{name}.txt"
            start((sys.executable, "-c", PEAK, str(told), *_run(scenario, Path(folder) / name, record, changes)[1:]))
            out[name] = float(told.read_text())
    return out


# The peak that a process reports of itself: its parent's view of it counts what the parent had when it forked.
PEAK = """
import sys
from pathlib import Path
told = sys.argv.pop(1)
from landing_sim import cli
try:
    cli.main()
finally:
    peak = next(l for l in Path("/proc/self/status").read_text().splitlines() if l.startswith("VmHWM"))
    Path(told).write_text(str(float(peak.split()[1]) / 1024.0))
"""


def _land(scenario: str, out: Path, changes: Sequence[str] = (), **environment: str) -> Process:
    return start(_run(scenario, out, False, changes), **environment)


def _run(scenario: str, out: Path, record: bool, changes: Sequence[str]) -> list[str]:
    arguments = [PROGRAM, "run", scenario, "--json", "--out", str(out)] + ([] if record else ["--no-record"])
    for change in changes:
        arguments += ["--set", change]
    return arguments


def resident_mb() -> float:
    """Of this process, now."""
    fields: Mapping[str, str] = dict(
        line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines() if ":" in line
    )
    return float(fields["VmRSS"].split()[0]) / 1024.0
