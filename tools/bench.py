#!/usr/bin/env python
"""What a pixel-in-the-loop landing costs, in units of JSBSim alone flying it.

usage: tools/bench.py [--json] [--repeats N] [--aircraft NAME] [--many N] [--bound SEEDS] ...     see --help

Everything is measured in one run, interleaved, so that a machine that is now fast and now slow is so for all alike:
ratios are taken within a repeat, against the mean of bare flights just before and just after, in CPU time. What bare
means is said in bench_parts/flights.py. Run it from the project's environment: .venv/bin/python tools/bench.py.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):  # before numpy, as landing-sim does
    os.environ.setdefault(_threads, "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(1, str(Path(__file__).resolve().parents[1]))

from bench_parts import baseline, bound, many, report, startup, where  # noqa: E402
from bench_parts.flights import Cost, Tape, fly_bare, fly_plant, land, load_bare, same, tape  # noqa: E402

from landing_sim import scenario as scenarios  # noqa: E402
from landing_sim import vehicle as vehicles  # noqa: E402
from landing_sim.scenario import Scenario  # noqa: E402
from landing_sim.vehicle import Vehicle  # noqa: E402

SCENARIO = {"do128": "do128/gust", "transport": "transport/calm"}
RECORDED = {
    "do128": ("camera.width_px=640", "camera.height_px=480", "record.frames_hz=10"),
    "transport": ("camera.width_px=640", "camera.height_px=480", "record.frames_hz=10"),
}
"""640 x 480 frames at 10 Hz, cut out of the middle of the scenario's own."""

FOLDED = "median", "min", "max"
SKIPPED = ("where", "memory", "baseline", "first", "cold")


def spread(values: Sequence[float], name: str) -> dict[str, float]:
    return {f"{name}_{how}": f(values) for how, f in zip(FOLDED, (median, min, max))}


class Bench:
    """One aircraft's flights: made ready once, then flown repeat by repeat."""

    def __init__(self, name: str, changes: Sequence[str]) -> None:
        self.name, self.changes = name, changes
        self.scenario, self.craft = self._load(())
        self.framed, _ = self._load(RECORDED[name])
        self.tape: Tape = tape(self.scenario, self.craft)
        self.landing = land(self.scenario, self.craft)
        if not same(self.landing.log, land(self.scenario, self.craft).log):
            raise RuntimeError(f"{self.scenario.name}: two flights of the same seed differ")
        self.rows: list[dict[str, float]] = []
        self.framed_outcome = ""

    def _load(self, changes: Sequence[str]) -> tuple[Scenario, Vehicle]:
        wanted = scenarios.load(SCENARIO[self.name], [*changes, *self.changes])
        return wanted, vehicles.load(wanted.aircraft.model)

    def repeat(self, folder: Path) -> dict[str, float]:
        """One of each, bare flights between."""
        s, v = self.scenario, self.craft
        bares: list[Cost] = []

        def bare() -> Cost:
            bares.append(fly_bare(s, v, self.tape))
            return (
                Cost(*(0.5 * sum(pair) for pair in zip(*((b.cpu, b.wall) for b in bares[-2:]))))
                if bares[1:]
                else bares[0]
            )

        steps = self.tape.steps
        bare()
        closed = land(s, v)
        around_closed = bare()
        framed = land(self.framed, v, folder / "framed.rrd")
        self.framed_outcome = framed.outcome
        around_framed = bare()
        own = land(s, v, folder / "own.rrd")
        around_own = bare()
        plant = fly_plant(s, v, self.tape)
        around_plant = bare()
        runs = fly_bare(s, v, self.tape, thin=True)
        load = load_bare(s, v)
        framed_steps = round(framed.seconds / s.time.step_s)
        mean = Cost(*(sum(x) / len(bares) for x in zip(*((b.cpu, b.wall) for b in bares))))
        row = {
            "ratio": closed.flight.cpu / around_closed.cpu,
            "wall_ratio": closed.flight.wall / around_closed.wall,
            "recorded_ratio": framed.flight.cpu / framed_steps / (around_framed.cpu / steps),
            "own_recorded_ratio": own.flight.cpu / around_own.cpu,
            "plant_ratio": plant.cpu / around_plant.cpu,
            "landing_ratio": (closed.setup.cpu + closed.flight.cpu) / (load.cpu + around_closed.cpu),
            "bare_step_us": 1e6 * mean.cpu / steps,
            "bare_run_us": 1e6 * runs.cpu / steps,
            "plant_step_us": 1e6 * plant.cpu / steps,
            "closed_step_us": 1e6 * closed.flight.cpu / steps,
            "setup_ms": 1e3 * closed.setup.cpu,
            "bare_load_ms": 1e3 * load.cpu,
            # in units of a bare step just then: machine's speed cancels
            "added_us": 1e6 * (closed.flight.cpu / around_closed.cpu - plant.cpu / around_plant.cpu)
            * mean.cpu / closed.frames,
            "realtime": closed.seconds / (closed.setup.wall + closed.flight.wall),
            "realtime_cpu": closed.seconds / (closed.setup.cpu + closed.flight.cpu),
            "per_minute": 60.0 / (closed.setup.cpu + closed.flight.cpu),
            "closed_cpu_s": closed.flight.cpu,
            "bare_cpu_s": min(b.cpu for b in bares),
            "recorded_hz": framed.recorded / framed.seconds,
            "recorded_frames": float(framed.recorded),
        }  # fmt: skip
        self.rows.append(row)
        return row

    def figures(self, unit_us: Sequence[float]) -> dict[str, Any]:
        """unit_us: bare step of the Do 128 [us], repeat by repeat."""

        def column(name: str) -> list[float]:
            return [row[name] for row in self.rows]

        added = [row["added_us"] / unit for row, unit in zip(self.rows, unit_us)]
        return {
            **spread(column("ratio"), "ratio"),
            **spread(column("recorded_ratio"), "recorded_ratio"),
            **spread(column("own_recorded_ratio"), "own_recorded_ratio"),
            **spread(column("plant_ratio"), "plant_ratio"),
            **spread(column("landing_ratio"), "landing_ratio"),
            "ratio_of_best": min(column("closed_cpu_s")) / min(column("bare_cpu_s")),
            "wall_ratio_median": median(column("wall_ratio")),
            "bare_step_us": median(column("bare_step_us")),
            "bare_run_us": median(column("bare_run_us")),
            "plant_step_us": median(column("plant_step_us")),
            "closed_step_us": median(column("closed_step_us")),
            "added_steps_per_frame": median(added),
            "added_steps_per_frame_min": min(added),
            "added_steps_per_frame_max": max(added),
            "added_us_per_frame": median(column("added_us")),
            "realtime_factor": median(column("realtime")),
            "realtime_factor_cpu": median(column("realtime_cpu")),
            "landings_per_core_minute": median(column("per_minute")),
            "setup_ms": median(column("setup_ms")),
            "bare_load_ms": median(column("bare_load_ms")),
            "recorded_frames_per_s": median(column("recorded_hz")),
            "frames": self.landing.frames,
            "steps": self.tape.steps,
            "seconds": self.landing.seconds,
            "outcome": self.landing.outcome,
            "recorded_outcome": self.framed_outcome,
            "repeats": len(self.rows),
        }

    def where(self, repeats: int) -> dict[str, dict[str, float]]:
        """Median over flights of each part's time; share of their sum."""
        flights = [where.parts_of(self.scenario, self.craft) for _ in range(repeats)]
        middle = {
            name: {key: median(f.get(name, {key: 0.0})[key] for f in flights) for key in ("seconds", "calls")}
            for name in flights[0]
        }
        total = sum(part["seconds"] for part in middle.values())
        return {
            name: {
                "ms": 1e3 * part["seconds"],
                "share": part["seconds"] / total,
                "calls": part["calls"],
                "us_per_call": 1e6 * part["seconds"] / max(part["calls"], 1.0),
            }
            for name, part in sorted(middle.items(), key=lambda item: -item[1]["seconds"])
        }


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one object on stdout and nothing else there")
    parser.add_argument("--repeats", type=int, default=9, help="interleaved repeats (default 9)")
    parser.add_argument("--aircraft", action="append", choices=sorted(SCENARIO), help="this one only; may be repeated")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="change both scenarios")
    parser.add_argument("--many", type=int, default=0, metavar="N", help="also land N times in this process (200)")
    parser.add_argument("--bound", type=int, default=0, metavar="SEEDS", help="also the Cramer-Rao bound (20 seeds)")
    parser.add_argument("--skip", action="append", default=[], choices=SKIPPED, help="leave a part out; cold: flying a "
                        "first landing with nothing compiled")  # fmt: skip
    wanted = parser.parse_args(arguments)
    if wanted.repeats < 1 or wanted.many < 0 or wanted.bound < 0:
        parser.error("--repeats must be at least 1, --many and --bound not negative")
    return wanted


def measure(wanted: argparse.Namespace, say: Callable[[str], None]) -> dict[str, Any]:
    names = [name for name in SCENARIO if not wanted.aircraft or name in wanted.aircraft]
    benches = {}
    for name in names:
        say(f"{name}: {SCENARIO[name]}, taping the flight")
        benches[name] = Bench(name, wanted.set)
    # added steps are counted in steps of the Do 128 whatever flies
    unit = benches["do128"] if "do128" in benches else Bench("do128", wanted.set)
    units: list[float] = []
    with tempfile.TemporaryDirectory(prefix="landing-sim-bench-") as folder:
        for bench in benches.values():  # once unmeasured: the recorder's imports and first use
            bench.repeat(Path(folder))
            bench.rows.clear()
        for k in range(wanted.repeats):
            for name, bench in benches.items():
                row = bench.repeat(Path(folder))
                say(f"repeat {k + 1}, {name}: closed {row['ratio']:.2f}, recorded {row['recorded_ratio']:.2f} x bare")
            units.append(
                unit.rows[-1]["bare_step_us"] if unit.rows
                else 1e6 * fly_bare(unit.scenario, unit.craft, unit.tape).cpu / unit.tape.steps
            )  # fmt: skip
    out: dict[str, Any] = {}
    for name, bench in benches.items():
        figures = out[name] = bench.figures(units)
        if "where" not in wanted.skip:
            say(f"{name}: where the time goes")
            figures["where"] = bench.where(min(wanted.repeats, 5))
        if "memory" not in wanted.skip:
            say(f"{name}: memory")
            figures |= startup.peak_memory(SCENARIO[name], wanted.set)
        if "baseline" not in wanted.skip:
            say(f"{name}: the baseline of an afternoon")
            figures["baseline"] = baseline.beside(*bench._load(RECORDED[name]), say)
        if wanted.bound:
            figures["bound"] = bound.beside(SCENARIO[name], wanted.set, wanted.bound, say)
        if wanted.many:
            figures["many"] = many.apart(SCENARIO[name], wanted.many)
    say("start-up")
    out["imports"] = startup.imports(wanted.repeats)
    for name in names if "first" not in wanted.skip else ():
        first = startup.first_results(SCENARIO[name], wanted.set, cold="cold" not in wanted.skip)
        out["imports"] |= {f"first_landing_{name}_{key}": value for key, value in first.items()}
    return out


def finite(value: Any) -> Any:
    """JSON has no NaN."""
    if isinstance(value, dict):
        return {key: finite(v) for key, v in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def main(arguments: Sequence[str] | None = None) -> int:
    wanted = parse(arguments)

    def say(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    found = measure(wanted, say)
    print(json.dumps(finite(found), allow_nan=False) if wanted.json else report.text(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
