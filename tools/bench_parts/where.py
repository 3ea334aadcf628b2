"""Where the time goes: one flight with a stop watch on every part, its own cost taken off.

The stop watch reads wall time, since reading CPU time is a call into the kernel and as dear as many a part. What the
machine did meanwhile for others is taken off by the flight's CPU time as a whole: every part by the same factor.

Each part is charged for itself alone: rendering a window while the front end looks at it is the renderer's.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

from bench_parts.flights import land
from landing_sim.missions import runway_landing
from landing_sim.missions.runway_landing import RunwayParts
from landing_sim.record.builder import LogBuilder
from landing_sim.scenario import Scenario
from landing_sim.sensors.render import RenderedFrame
from landing_sim.vehicle import Vehicle

LOOP = "loop and judge"


@dataclass(slots=True)
class StopWatch:
    """Exclusive times of nested parts."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    calls: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    clock: Callable[[], float] = time.perf_counter
    _stack: list[str] = field(default_factory=lambda: [LOOP])
    _since: float = 0.0

    def start(self) -> None:
        self._stack[:] = [LOOP]
        self._since = self.clock()

    def on(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """`function`, charged to `name`."""
        seconds, calls, stack, clock = self.seconds, self.calls, self._stack, self.clock

        def timed(*arguments: Any, **options: Any) -> Any:
            now = clock()
            seconds[stack[-1]] += now - self._since
            stack.append(name)
            self._since = clock()
            try:
                return function(*arguments, **options)
            finally:
                now = clock()
                seconds[name] += now - self._since
                calls[name] += 1
                stack.pop()
                self._since = clock()

        return timed

    def stop(self) -> None:
        self.seconds[self._stack[-1]] += self.clock() - self._since

    @staticmethod
    def own_cost(calls: int = 20000) -> float:
        """[s] that a charged call costs beyond the time it charges: what a plain call would not."""
        watch = StopWatch()
        nothing = watch.on("x", lambda a, b: None)
        watch.start()
        for _ in range(calls):
            nothing(1, 2)
        watch.stop()
        plain = time.perf_counter()
        for _ in range(calls):
            pass
        plain = time.perf_counter() - plain
        return max(0.0, (watch.seconds["x"] + watch.seconds[LOOP] - plain) / calls)


@contextmanager
def _patched(owner: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


def parts_of(scenario: Scenario, vehicle: Vehicle) -> dict[str, dict[str, float]]:
    """name -> seconds and calls of one flight, the stop watch's own cost taken off."""
    watch = StopWatch()

    def charge(owner: Any, method: str, name: str) -> None:
        setattr(owner, method, watch.on(name, getattr(owner, method)))

    def prepare(parts: RunwayParts) -> None:
        charge(parts.plant, "step", "plant: step")
        for method in ("truth", "camera"):
            charge(parts.plant, method, "plant: truth, camera pose")
        reset = parts.plant.reset

        def resetting() -> Any:
            truth = reset()
            watch.seconds.clear()
            watch.calls.clear()
            watch.start()
            return truth

        parts.plant.reset = resetting  # type: ignore[method-assign]

    # parts without a __dict__ are charged at their class while the flight lasts
    builder = LogBuilder()
    with _everything(watch, scenario, vehicle):
        flight = land(scenario, vehicle, prepare=prepare, builder=builder).flight
    watch.stop()
    own, awake = watch.own_cost(), flight.cpu / flight.wall
    return {
        name: {"seconds": awake * max(0.0, seconds - own * watch.calls[name]), "calls": float(watch.calls[name])}
        for name, seconds in watch.seconds.items()
    }


@contextmanager
def _everything(watch: StopWatch, scenario: Scenario, vehicle: Vehicle) -> Iterator[None]:
    parts = runway_landing.build(scenario, vehicle, scenario.seed).parts
    wanted: list[tuple[type, str, str]] = [
        (type(parts.world), "wind", "wind"),
        (RenderedFrame, "windows", "render windows"),
        (type(parts.guidance), "step", "guidance"),
        (type(parts.controller), "step", "controller"),
        (LogBuilder, "add", "log: add"),
        (LogBuilder, "finish", "log: finish"),
        *((type(parts.estimator), m, f"estimator: {m}") for m in ("predict", "update", "read")),
        *((type(s), "sense", "sensors: camera" if s.name == "camera" else "sensors: other") for s in parts.sensors),
        *(
            (type(f), "process", "front end" if name == "camera" else "readings")
            for name, f in parts.front_ends.items()
        ),
    ]
    with ExitStack() as stack:
        for owner, method, name in dict.fromkeys(wanted):
            stack.enter_context(_patched(owner, method, watch.on(name, getattr(owner, method))))
        yield
