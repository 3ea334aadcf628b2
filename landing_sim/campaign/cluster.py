"""Workers of a dask cluster instead of processes of ours: `--cluster ADDRESS`, extra `cluster`.

A landing is given out when a worker is free for it, never in advance: a worker that is lost takes one landing with it,
which the scheduler gives to another. One that its workers keep dying of is set aside.
"""

from __future__ import annotations

import itertools
import pickle
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from landing_sim.campaign.machine import caches_warm, compiling, software
from landing_sim.campaign.plan import CampaignError
from landing_sim.campaign.pool import Done, Job, Value
from landing_sim.errors import Mark, Problem

TIMEOUT = 30.0  # [s] for the scheduler to answer and for a first worker
_ELSEWHERE = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
function, job = pickle.load(sys.stdin.buffer)
function(job)
"""
_looked = False  # whether this worker knows its kernels to be on disk


def run(function: Callable[[Job], Value], jobs: Iterable[Job], address: str) -> Iterator[Done[Job, Value]]:
    """As `pool.run`, on the workers of the scheduler at `address`.

    Raises CampaignError where there is no scheduler, no worker, or one with other software or several threads.
    """
    try:
        from distributed import Client, KilledWorker, as_completed, get_worker  # noqa: F401
    except ImportError as error:
        raise _wrong(address, f"dask is missing ({error}): pip install 'landing-sim[cluster]'") from None
    try:
        client = Client(address, timeout=TIMEOUT, set_as_default=False)
        client.wait_for_workers(1, timeout=TIMEOUT)
    except (OSError, ValueError, TimeoutError) as error:
        raise _wrong(address, f"no scheduler with workers there: {error}") from None
    try:
        _check(client, address)
        waiting = iter(jobs)
        flying: dict[Any, Any] = {}

        def submit(count: int) -> list[Any]:
            for job in itertools.islice(waiting, count):
                # the function goes with every job: scattered, it dies with the last worker that happens to hold it
                future = client.submit(_call, function, job, pure=False)
                flying[future.key] = (future, job)
                futures.add(future)
            return list(flying)

        futures = as_completed(loop=client.loop)
        submit(_slots(client))
        while flying:
            future = next(futures)
            _, job = flying.pop(future.key)
            # workers that have come in the meantime are used, those that have gone are not waited for
            submit(max(_slots(client) - len(flying), 0 if flying else 1))
            if future.status == "finished":
                yield Done(job, *future.result())
            elif isinstance(future.exception(), KilledWorker):
                yield Done(job)
            else:
                yield Done(job, error="".join(traceback.format_exception(future.exception())))
    finally:
        client.close()


def _call(function: Callable[[Any], Any], job: Any) -> tuple[Any, str]:
    try:
        _compile_elsewhere(function, job)
        return function(job), ""
    except Exception:
        return None, traceback.format_exc()


def _compile_elsewhere(function: Callable[[Any], Any], job: Any) -> None:
    """Before a worker's first landing: flown by a process of its own where no kernels lie on disk, to be thrown away.

    Compilers leave a process 200 MB larger, and dask keeps the one it has. Workers of one machine wait for each other.
    """
    global _looked
    if _looked:
        return
    with compiling():
        if not caches_warm():
            call = pickle.dumps(sys.path) + pickle.dumps((function, job))
            done = subprocess.run([sys.executable, "-c", _ELSEWHERE], input=call, capture_output=True)
            if done.returncode == 0:  # else this worker compiles, and meets what that one met
                caches_warm(mark=True)
    _looked = True


def _slots(client: Any) -> int:
    return len(client.scheduler_info(n_workers=-1)["workers"])


def _check(client: Any, address: str) -> None:
    for name, worker in client.scheduler_info(n_workers=-1)["workers"].items():
        if worker["nthreads"] != 1:
            raise _wrong(
                address, f"worker {name} has {worker['nthreads']} threads: start it with --nthreads 1, and more of them"
            )
    ours = software()
    for name, theirs in client.run(software).items():
        other = [f"{key} {theirs.get(key)}, not {ours[key]}" for key in ours if theirs.get(key) != ours[key]]
        if other:
            raise _wrong(address, f"worker {name} has {'; '.join(other)}: its landings would be others")


def _wrong(address: str, message: str) -> CampaignError:
    return CampaignError([Problem(Mark(f"--cluster {address}"), (), message)])
