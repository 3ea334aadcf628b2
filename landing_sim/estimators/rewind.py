"""Late measurements applied when they were valid: rewind, update, replay.

An image is old when it has been processed. `Rewind` keeps the estimator's memory at every step of the last `horizon`
seconds together with what came in; a measurement with an earlier t_valid is applied to the memory of that time and all
later inputs are replayed. Since an estimator's memory is a value, keeping the past is keeping references.

Source     Brockers et al. 2012, section 3.3 (buffered inertial data, re-integrated).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from landing_sim.interfaces import Estimator
from landing_sim.signals import Command, Estimate, Measurement

EPS = 1e-9  # [s] two times closer than this are the same


class Entry(NamedTuple):
    """One input and the memory after it: a prediction (command) or an update (measurement)."""

    t: float
    after: Any
    command: Command | None = None
    measurement: Measurement | None = None


class Rewind:
    """An estimator that takes late measurements (interfaces.Estimator). Memory: a tuple of entries, oldest first."""

    def __init__(self, estimator: Estimator, horizon: float) -> None:
        self.estimator = estimator
        self.horizon = horizon

    def init(self, t: float) -> tuple[Entry, ...]:
        return (Entry(t, self.estimator.init(t)),)

    def predict(self, memory: tuple[Entry, ...], command: Command, t: float) -> tuple[Entry, ...]:
        last = memory[-1]
        if t <= last.t + EPS:
            return memory
        memory = (*memory, Entry(t, self.estimator.predict(last.after, command, t), command=command))
        first = 0
        while first + 1 < len(memory) and memory[first + 1].t <= t - self.horizon:
            first += 1
        return memory[first:]

    def update(self, memory: tuple[Entry, ...], measurement: Measurement) -> tuple[Entry, ...]:
        """Raises ValueError for a measurement older than the horizon: silence would be a lost measurement."""
        t = measurement.t_valid
        if t < memory[0].t - EPS:
            age, reach = memory[-1].t - t, memory[-1].t - memory[0].t
            raise ValueError(f"a measurement {age:.3f} s old reaches back further than the {reach:.3f} s kept")
        split = len(memory)
        while memory[split - 1].t > t + EPS:
            split -= 1
        past, later = list(memory[:split]), memory[split:]
        if later and past[-1].t < t - EPS:  # between two predictions: stop on the way
            command = later[0].command
            assert command is not None  # time only moves by predictions
            past.append(Entry(t, self.estimator.predict(past[-1].after, command, t), command=command))
        past.append(Entry(past[-1].t, self.estimator.update(past[-1].after, measurement), measurement=measurement))
        for entry in later:
            before = past[-1].after
            if entry.command is not None:
                after = self.estimator.predict(before, entry.command, entry.t)
            else:
                assert entry.measurement is not None
                after = self.estimator.update(before, entry.measurement)
            past.append(Entry(entry.t, after, entry.command, entry.measurement))
        return tuple(past)

    def read(self, memory: tuple[Entry, ...], t: float | None = None) -> Estimate:
        """Now, or as known at time t (the last entry not after t, predicted on to t)."""
        if t is None or t >= memory[-1].t - EPS:
            return self.estimator.read(memory[-1].after)
        i = len(memory) - 1
        while i > 0 and memory[i].t > t + EPS:
            i -= 1
        at = memory[i].after
        command = memory[i + 1].command
        if memory[i].t < t - EPS and command is not None:
            at = self.estimator.predict(at, command, t)
        return self.estimator.read(at)
