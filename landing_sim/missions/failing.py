"""The scenario's faults on a mission's sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from landing_sim.interfaces import NoiseStream, Sensor
from landing_sim.sections import faults as wanted
from landing_sim.sensors.faults import (
    Delayed,
    Fault,
    Faulty,
    Garbage,
    Intermittent,
    Off,
    Slow,
    Stuck,
    Wrong,
)
from landing_sim.sensors.struck import Onset, Struck


def with_faults(
    sensors: Sequence[Sensor],
    faults: Sequence[wanted.Fault],
    noise: Callable[[str], NoiseStream],
    units: Mapping[str, tuple[str, ...]] | None = None,
) -> tuple[Sensor, ...]:
    """The sensors in their order, those that fail wrapped.

    noise : stream of a named component
    units : names that stand for several sensors of one box, which fail together, such as "inertial"

    Raises ValueError for a fault of a sensor that is not there, or that makes no sense for it.
    """
    out = list(sensors)
    for i, fault in enumerate(faults):
        failing = (units or {}).get(fault.sensor, (fault.sensor,))
        hit = [k for k, sensor in enumerate(out) if sensor.name in failing]
        if not hit:
            raise ValueError(f"no sensor {fault.sensor!r} can fail: there are {', '.join(s.name for s in sensors)}")
        for k in hit:
            out[k] = _failing(out[k], fault, noise(f"fault {i} {out[k].name}"))
    return tuple(out)


def _failing(sensor: Sensor, fault: wanted.Fault, noise: NoiseStream) -> Sensor:
    kind = _kind(fault)
    if fault.below_height_m is None and fault.from_x_m is None:
        return Faulty(sensor, kind, noise)
    never = Onset()
    onset = Onset(
        never.below if fault.below_height_m is None else fault.below_height_m,
        never.beyond if fault.from_x_m is None else fault.from_x_m,
        never.lasts if fault.for_s is None else fault.for_s,
    )
    return Struck(sensor, kind, onset, noise)


def _kind(fault: wanted.Fault) -> Fault:
    """As sensors/faults.py has it, by its times; of one that begins at a place they do not count."""
    start = fault.start_s or 0.0
    lasts = float("inf") if fault.for_s is None else start + fault.for_s
    times = start, lasts if fault.end_s is None else fault.end_s
    match fault.kind:
        case "off":
            return Off(*times)
        case "stuck":
            return Stuck(*times)
        case "garbage":
            return Garbage(fault.spread, *times)
        case "wrong":
            return Wrong(fault.bias or 0.0, 1.0 if fault.scale is None else fault.scale, *times)
        case "slow":
            return Slow(fault.factor or 0, *times)
        case "delayed":
            return Delayed(fault.delay_s or 0.0, fault.honest_time is not False, *times)
        case "intermittent":
            return Intermittent(fault.loss or 0.0, *times)
