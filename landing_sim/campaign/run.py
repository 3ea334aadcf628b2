"""Fly what a campaign's folder lacks: the same command begins it, goes on with it, and finds nothing left to do."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from landing_sim.campaign import pool
from landing_sim.campaign.landing import Landing, land
from landing_sim.campaign.machine import caches_warm
from landing_sim.campaign.plan import Plan
from landing_sim.campaign.store import AGAIN, Store

PRELOAD = ("landing_sim.campaign.landing",)


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a campaign stands."""

    runs: int  # wanted in all
    done: int  # of them
    here: int  # of them flown by this command
    latest: Landing


def fly(
    plan: Plan,
    folder: Path,
    workers: int | None = None,
    cluster: str | None = None,
    method: pool.Method = "forkserver",
    watch: Callable[[Progress], None] | None = None,
    job: Callable[[Plan, int], Landing] = land,
) -> list[int]:
    """Fly every landing that `folder` has no row of; the runs that were set aside.

    workers : processes on this machine; None = one for each core
    cluster : address of a dask scheduler whose workers fly instead
    method : how processes are started
    watch : told of every landing
    job : what a worker does; importable

    Raises CampaignError where the folder cannot be used, PoolError or ClusterError where there are no workers.
    """
    aside = []
    count = workers or _cores()
    where = {"workers": count, "engine": method} if cluster is None else {"workers": None, "engine": "dask"}
    with Store(folder, plan, plan.figures()) as store:
        missing = store.missing(plan.campaign.runs)
        if not missing:
            return []
        with store.session(**where):
            for here, landing in enumerate(_landings(plan, missing, count, cluster, method, job), 1):
                store.add(landing)
                if landing.outcome in AGAIN:
                    aside.append(landing.run)
                if watch is not None:
                    done = plan.campaign.runs - len(missing) + here
                    watch(Progress(plan.campaign.runs, done, here, landing))
    return sorted(aside)


def _landings(
    plan: Plan,
    runs: list[int],
    workers: int,
    cluster: str | None,
    method: pool.Method,
    job: Callable[[Plan, int], Landing],
) -> Iterator[Landing]:
    function = functools.partial(job, plan)
    done: Iterator[pool.Done[int, Landing]]
    if cluster is None:
        warm = caches_warm()
        done = pool.run(function, runs, workers, method, not warm, PRELOAD)
    else:
        from landing_sim.campaign.cluster import run as run_on

        warm = True
        done = run_on(function, runs, cluster)
    for answer in done:
        if answer.value is not None:
            if not warm:
                warm = caches_warm(mark=True) or True
            yield answer.value
        elif answer.error:
            yield Landing(answer.job, "error", answer.error)
        else:
            yield Landing(answer.job, "worker_killed", f"its worker died {pool.MAX_KILLS} times")


def evaluate(
    plan: Plan,
    function: Callable[[Plan, Any], Any],
    jobs: list[Any],
    workers: int | None = None,
    method: pool.Method = "forkserver",
) -> Iterator[pool.Done[Any, Any]]:
    """Anything else that flies landings of a campaign, such as a rare-event method, on the same workers."""
    yield from pool.run(
        functools.partial(function, plan), jobs, workers or _cores(), method, not caches_warm(), PRELOAD
    )


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


__all__ = ["Progress", "evaluate", "fly"]
