"""Worker processes on this machine. Whatever is killed, nothing is lost, and what kills its worker twice is set aside.

Not a `ProcessPoolExecutor`: that one loses every job in flight when one worker dies, and does not say whose fault it was.
Here each worker has a pipe of its own, so the job that its process died of is known and the others fly on.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection
from typing import Any, Generic, Literal, TypeVar

Job = TypeVar("Job")
Value = TypeVar("Value")
Method = Literal["forkserver", "spawn", "fork"]

MAX_KILLS = 2  # workers that one job may take with it
MAX_STILLBORN = 3  # workers in a row that die before they can work
_WAKE = 1.0  # [s] after which an idle worker looks whether its parent lives


class PoolError(RuntimeError):
    """Workers cannot be started."""


@dataclass(frozen=True, slots=True)
class Done(Generic[Job, Value]):
    """What became of a job: a value, or what it raised, or neither: it was set aside."""

    job: Job
    value: Value | None = None
    error: str = ""  # traceback


class _Worker:
    """A process, the pipe to it, and what it is at."""

    __slots__ = ("job", "pipe", "process", "ready")

    def __init__(self, context: Any, function: Callable[[Any], Any]) -> None:
        self.pipe, theirs = context.Pipe()
        fork = context.get_start_method() == "fork"
        self.process = context.Process(target=_work, args=(theirs, function, fork), daemon=True)
        self.process.start()
        theirs.close()  # or the end of the process would not end the pipe
        self.ready = False
        self.job: tuple[Any] | None = None

    def stop(self) -> None:
        self.process.terminate()
        self.process.join(2.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        self.pipe.close()


def run(
    function: Callable[[Job], Value],
    jobs: Iterable[Job],
    workers: int,
    method: Method = "forkserver",
    first_alone: bool = False,
    preload: Iterable[str] = (),
) -> Iterator[Done[Job, Value]]:
    """Results as they come, in any order.

    function : importable, as pickle wants it; runs in the workers
    method : how processes are started
    first_alone : one worker until the first result is there: it fills caches on disk that others, started then, share
    preload : modules that forkserver workers find loaded

    Closing the iterator (or an interrupt inside it) ends the workers. Raises PoolError.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context(method)
    if method == "forkserver":
        context.set_forkserver_preload(["__main__", *preload])
    waiting, kills = deque(jobs), dict[Any, int]()
    crew: list[_Worker] = []
    stillborn = 0
    try:
        while waiting or any(worker.job is not None for worker in crew):
            wanted = min(1 if first_alone else workers, len(waiting) + sum(w.job is not None for w in crew))
            while len(crew) < wanted:
                crew.append(_Worker(context, function))
            for worker in crew:
                if worker.ready and worker.job is None and waiting:
                    _send(worker, waiting.popleft())
            for pipe in connection.wait([worker.pipe for worker in crew]):
                worker = next(w for w in crew if w.pipe is pipe)
                try:
                    answer = worker.pipe.recv()
                except (EOFError, OSError):
                    crew.remove(worker)
                    worker.stop()
                    stillborn = 0 if worker.ready else stillborn + 1
                    if stillborn >= MAX_STILLBORN:
                        raise PoolError(
                            f"workers end before they can work (exit code {worker.process.exitcode}): see above, and "
                            "`landing-sim doctor`"
                        ) from None
                    if worker.job is not None:
                        (job,) = worker.job
                        kills[job] = kills.get(job, 0) + 1
                        if kills[job] >= MAX_KILLS:
                            yield Done(job)
                        else:
                            waiting.append(job)
                    continue
                if not worker.ready:
                    worker.ready, stillborn = True, 0
                    continue
                (job,), worker.job = worker.job, None  # type: ignore[misc]
                if first_alone:  # compilers leave it 200 MB larger than who finds their work done
                    crew.remove(worker)
                    worker.stop()
                    first_alone = False
                yield Done(job, *answer)
    finally:
        for worker in crew:
            worker.process.terminate()
        for worker in crew:
            worker.stop()


def _send(worker: _Worker, job: Any) -> None:
    worker.job = (job,)
    with suppress(OSError):  # it has just died: reading from it will tell
        worker.pipe.send(job)


def _work(pipe: connection.Connection, function: Callable[[Any], Any], fork: bool) -> None:
    """The life of a worker: jobs from its pipe until its parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    assert parent is not None
    forked_by = os.getppid()
    pipe.send(None)
    while True:
        # A forked worker holds its siblings' end of that sentinel open, too: only its parent's number tells.
        if parent.sentinel in connection.wait([pipe, parent.sentinel], _WAKE) or (fork and os.getppid() != forked_by):
            return
        if not pipe.poll():
            continue
        try:
            job = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer: tuple[Any, str] = (function(job), "")
        except Exception:
            answer = (None, traceback.format_exc())
        try:
            pipe.send(answer)
        except OSError:
            return
