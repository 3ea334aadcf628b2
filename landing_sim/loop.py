"""The closed loop: the only one.

Time is counted in whole steps of the plant. Once a cycle the sensors look, what has arrived is estimated from, guidance
and controller decide, and their command acts after the computing delay; in between the plant steps through the wind.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from landing_sim.interfaces import Controller, Estimator, FrontEnd, Guidance, Plant, Sensor, World
from landing_sim.signals import Command, Estimate, Measurement, Sample, Step


@dataclass(frozen=True, slots=True)
class Clock:
    """Whole numbers of plant steps. Raises ValueError where a period is not one."""

    dt: float  # [s] plant step
    cycle: int  # steps per control cycle
    delay: int  # steps from a command's computation to its effect

    @staticmethod
    def of(dt: float, cycle_s: float, delay_s: float) -> Clock:
        return Clock(dt, whole_steps(cycle_s, dt), whole_steps(delay_s, dt))


def whole_steps(period: float, dt: float) -> int:
    """How many steps of dt make `period`; ValueError if that is not a whole number."""
    n = round(period / dt)
    if abs(n * dt - period) > 1e-9:
        raise ValueError(f"a period of {period} s is not a whole number of {dt} s steps")
    return n


def take_in(
    estimator: Estimator, memory: Any, front_ends: Mapping[str, FrontEnd], samples: Iterable[Sample]
) -> tuple[Any, tuple[Measurement, ...]]:
    """Turn samples into measurements, each where the estimate of its time says, and update with them.

    Samples of a sensor that no front end is for are left alone: references that only the log wants.
    """
    measured: list[Measurement] = []
    for sample in samples:
        front_end = front_ends.get(sample.sensor)
        if front_end is None:
            continue
        for measurement in front_end.process(sample, partial(estimator.read, memory, sample.t_valid)):
            memory = estimator.update(memory, measurement)
            measured.append(measurement)
    return memory, tuple(measured)


def simulate(
    clock: Clock,
    plant: Plant,
    world: World,
    sensors: Sequence[Sensor],
    front_ends: Mapping[str, FrontEnd],
    estimator: Estimator,
    guidance: Guidance,
    controller: Controller,
    trim: Command,
) -> Iterator[Step]:
    """Fly; yields one Step a control cycle, for ever: whoever listens decides when it is over.

    `sensors` are read in the order given; ValueError if a period is not a whole number of control cycles. `front_ends`
    maps a sensor's name to what turns its samples into measurements.
    `trim` acts until the first command does. Nothing but samples crosses from the truth to the onboard side.
    """
    periods = [whole_steps(sensor.period, clock.dt) for sensor in sensors]
    for sensor, period in zip(sensors, periods):
        if period % clock.cycle:
            raise ValueError(f"sensor {sensor.name!r}: a period of {sensor.period} s is not a whole number of cycles")
    truth = plant.reset()
    tick, dt = 0, clock.dt
    blow, fly, place = world.wind, plant.step, plant.fast_truth
    memory = estimator.init(0.0)
    guidance_memory, controller_memory = guidance.init(), controller.init()
    acting = trim
    pending: deque[tuple[int, Command]] = deque()
    in_flight: list[Sample] = []
    last_seen = None  # the residuals of an image are passed on once

    while True:
        t = tick * dt
        camera = plant.camera()

        # what the sensors see now, and what has reached the computer by now
        for sensor, period in zip(sensors, periods):
            if tick % period == 0:
                sample = sensor.sense(truth, camera)
                if sample is not None:
                    in_flight.append(sample)
        now = t + 1e-9
        arrived = tuple([s for s in in_flight if s.t_arrival <= now])
        if arrived:
            in_flight = [s for s in in_flight if s.t_arrival > now]

        # the onboard side
        memory = estimator.predict(memory, acting, t)
        memory, measured = take_in(estimator, memory, front_ends, arrived)
        estimate = estimator.read(memory)
        guidance_memory, reference = guidance.step(guidance_memory, estimate)
        controller_memory, command = controller.step(controller_memory, estimate, reference)
        pending.append((tick + clock.delay, command))

        seen = None if estimate.residuals is last_seen else estimate.residuals
        last_seen = estimate.residuals
        yield Step(
            truth,
            camera,
            arrived,
            measured,
            estimate,
            reference,
            command,
            seen,
        )

        # the world moves on
        due: float = pending[0][0]
        for _ in range(clock.cycle):
            if due <= tick:
                memory = estimator.predict(memory, acting, tick * dt)
                acting = pending.popleft()[1]
                due = pending[0][0] if pending else math.inf
            fly(acting, blow(tick * dt, *place()))
            tick += 1
        truth = plant.truth()


def estimate_offline(
    clock: Clock,
    steps: Iterable[Step],
    front_ends: Mapping[str, FrontEnd],
    estimator: Estimator,
    trim: Command,
) -> Iterator[Estimate]:
    """Run an estimator over a flight that somebody else flew: the filter open loop. One Estimate a Step.

    It gets the samples in their order of arrival and the commands when they acted, nothing else of the Steps.
    """
    memory = estimator.init(0.0)
    acting = trim
    pending: deque[tuple[float, Command]] = deque()
    for step in steps:
        t = step.truth.t
        while pending and pending[0][0] <= t + 1e-9:
            memory = estimator.predict(memory, acting, pending[0][0])
            acting = pending.popleft()[1]
        memory = estimator.predict(memory, acting, t)
        memory, _ = take_in(estimator, memory, front_ends, step.samples)
        yield estimator.read(memory)
        pending.append((t + clock.delay * clock.dt, step.command))
