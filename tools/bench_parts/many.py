"""Many landings in one process: do they stay as cheap as the first, and does the memory stay?"""

from __future__ import annotations

import gc
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from statistics import median

import numpy as np

from bench_parts.flights import land
from bench_parts.startup import resident_mb
from landing_sim import vehicle as vehicles
from landing_sim.scenario import load


def apart(scenario: str, count: int) -> dict[str, float]:
    """`many` in a process of its own, whose memory nothing else has been in."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        return process.submit(many, scenario, count).result()


def many(scenario: str, count: int) -> dict[str, float]:
    """Land `count` times, seeds 1, 2, ...; CPU a landing is building and flying.

    The single-run figure is the median of seed 1 flown every tenth time between the others, so that a machine that is
    getting slower is not mistaken for a simulator that is.
    """
    wanted = load(scenario)
    vehicle = vehicles.load(wanted.aircraft.model)
    land(wanted, vehicle)  # compiled code and designs are made
    gc.collect()
    cpu, single, memory = [], [], []
    for k in range(count):
        if k % 10 == 0:
            alone = land(wanted, vehicle)
            single.append(alone.setup.cpu + alone.flight.cpu)
            gc.collect()
            memory.append(resident_mb())
            print(f"{scenario}: {k} landings, {memory[-1]:.1f} MB", file=sys.stderr, flush=True)
        flown = land(load(scenario, [f"seed={k + 1}"]), vehicle)
        cpu.append(flown.setup.cpu + flown.flight.cpu)
    gc.collect()
    memory.append(resident_mb())
    settled = memory[len(memory) // 4 :]
    slope = float(np.polyfit(np.arange(len(settled)) * 10.0, settled, 1)[0]) if len(settled) > 2 else float("nan")
    return {
        "landings": float(count),
        "cpu_per_landing_s": float(np.mean(cpu)),
        "single_run_cpu_s": median(single),
        "per_single": float(np.mean(cpu)) / float(np.mean(single)),
        "first_mb": memory[0],
        "last_mb": memory[-1],
        "growth_kb_per_landing": 1024.0 * slope,
    }
