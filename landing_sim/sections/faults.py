"""What fails, how, and when: the list `faults` of any mission.

Each entry is one fault of one sensor; two entries on a sensor are two faults, the later entry's on what the earlier one
lets through. It begins at a time, where the vehicle truly comes below a height, or where it truly passes a place along the
runway: the scenario may know that, the onboard side does not.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.errors import Location, did_you_mean
from landing_sim.sections.bounds import NotNegative, Positive

Finite = Annotated[float, Field(allow_inf_nan=False)]


class Fault(Section):
    """One fault of one sensor."""

    sensor: str = Field(
        min_length=1, max_length=40, description="what fails, by its name; inertial: the whole inertial unit"
    )
    kind: Literal["off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent"] = Field(
        description="sends nothing; repeats its last reading; nonsense; scale * reading + bias; one sample in `factor`; "
        "late by delay_s; each sample lost with the probability `loss`"
    )
    start_s: NotNegative | None = Field(
        None, description="from this time on; null = from the start, if no place is given"
    )
    below_height_m: Positive | None = Field(
        None, description="from where the cg first is lower than this above the threshold"
    )
    from_x_m: float | None = Field(
        None, description="from where the cg first is beyond this along the runway; before the threshold it is negative"
    )
    end_s: Positive | None = Field(None, description="until this time, with start_s; null = for good")
    for_s: Positive | None = Field(None, description="for so long; null = for good")
    spread: Positive | None = Field(
        None, description="garbage: 1 sigma, in the SI unit of the reading (rad/s, m/s, rad); of a camera null"
    )
    bias: Finite | tuple[Finite, ...] | None = Field(
        None, description="wrong: added, in the SI unit of the reading; one number for all axes, or one each; null = 0"
    )
    scale: float | None = Field(None, ge=-100, le=100, description="wrong: factor on the reading; null = 1")
    factor: int | None = Field(None, ge=2, le=10000, description="slow: one sample in this many comes")
    delay_s: Annotated[float, Field(gt=0, le=10)] | None = Field(None, description="delayed: by this")
    honest_time: bool | None = Field(
        None, description="delayed: false = the time stamp is as late as the sample; null = true, it says how old it is"
    )
    loss: Annotated[float, Field(gt=0, lt=1)] | None = Field(None, description="intermittent: probability of a loss")


_OF: dict[str, tuple[str, ...]] = {
    "garbage": ("spread",),
    "wrong": ("bias", "scale"),
    "slow": ("factor",),
    "delayed": ("delay_s", "honest_time"),
    "intermittent": ("loss",),
}
"""Keys that belong to a kind, the first of which it needs where it stands alone."""
_WHEN = ("start_s", "below_height_m", "from_x_m")


def problems(
    faults: Sequence[Fault], sensors: Collection[str], records: Collection[str] = (), images: Collection[str] = ()
) -> list[tuple[Location, str]]:
    """What does not fit together, by its place in the scenario.

    sensors : names of everything that can fail in this mission
    records : those whose readings are not plain numbers, and can be neither wrong nor garbage
    images : those of which garbage is random pixels, without a spread
    """
    found: list[tuple[Location, str]] = []
    for i, fault in enumerate(faults):

        def wrong(key: str, message: str, i: int = i) -> None:
            found.append((("faults", i, key), message))

        if fault.sensor not in sensors:
            wrong("sensor", f"no sensor {fault.sensor!r} here{did_you_mean(fault.sensor, sensors)}")
        for kind, keys in _OF.items():
            for key in keys:
                if kind != fault.kind and getattr(fault, key) is not None:
                    wrong(key, f"belongs to kind {kind}, not to {fault.kind}")
        _told(fault, fault.sensor in images, wrong)
        if fault.sensor in records and fault.kind in ("garbage", "wrong"):
            wrong("kind", f"the readings of {fault.sensor} are not plain numbers that could be {fault.kind}")
        given = [key for key in _WHEN if getattr(fault, key) is not None]
        for key in given[1:]:
            wrong(key, f"it begins once: leave out this or {given[0]}")
        if fault.end_s is not None:
            if fault.for_s is not None:
                wrong("end_s", "it ends once: leave out this or for_s")
            if given not in ([], ["start_s"]):
                wrong("end_s", f"with {given[0]} give for_s: when it begins is not known beforehand")
            elif fault.end_s <= (fault.start_s or 0.0):
                wrong("end_s", f"is not after start_s = {fault.start_s or 0.0:g}")
    return found


def _told(fault: Fault, image: bool, wrong: Any) -> None:
    """Whether it says all that its kind needs."""
    match fault.kind:
        case "garbage" if image and fault.spread is not None:
            wrong("spread", "random pixels have no spread: leave it out")
        case "garbage" if not image and fault.spread is None:
            wrong("kind", "garbage needs a spread")
        case "wrong" if image:
            wrong("kind", "an image has no bias or scale: falsify calibration, encoders or exposure instead")
        case "wrong" if fault.bias in (None, 0.0) and fault.scale in (None, 1.0):
            wrong("kind", "wrong needs a bias other than 0 or a scale other than 1")
        case "slow" | "delayed" | "intermittent" if getattr(fault, _OF[fault.kind][0]) is None:
            wrong("kind", f"{fault.kind} needs {_OF[fault.kind][0]}")
