"""Units of values in campaign files: challenge and regulations speak of knots and feet, keys of scenarios of SI."""

from __future__ import annotations

import math

from landing_sim.errors import did_you_mean

FACTORS: dict[str, dict[str, float]] = {
    "mps": {"mps": 1.0, "kt": 1852.0 / 3600.0, "kmh": 1.0 / 3.6, "fps": 0.3048},
    "m": {"m": 1.0, "ft": 0.3048, "km": 1000.0, "nmi": 1852.0},
    "kg": {"kg": 1.0, "t": 1000.0, "lb": 0.45359237},
    "deg": {"deg": 1.0, "rad": math.degrees(1.0), "mrad": math.degrees(1e-3)},
    "dps": {"dps": 1.0, "radps": math.degrees(1.0)},
    "s": {"s": 1.0, "ms": 1e-3},
    "percent": {"percent": 1.0, "fraction": 100.0},
    "K": {"K": 1.0, "degC": 1.0, "degF": 5.0 / 9.0},  # differences of temperature
}
"""What one of each unit is, in the unit at the end of a key."""


def factor(name: str, unit: str | None) -> float:
    """What values given in `unit` are multiplied by to become what `name` ends in, e.g. "wind.crosswind_mps".

    None is the name's own unit. Raises ValueError for a unit that does not fit.
    """
    if unit is None:
        return 1.0
    known = FACTORS.get(name.rpartition("_")[2], {})
    if not known:
        raise ValueError(f"{name!r} ends in no unit that {unit!r} could be turned into: leave `unit` out")
    if unit not in known:
        raise ValueError(f"must be {', '.join(map(repr, known))}, not {unit!r}{did_you_mean(unit, known)}")
    return known[unit]
