"""Section 4.2 of Gibert et al. 2015 flown: JSBSim's transport, rendered pixels, the observer's estimate in the loop.

The paper's approach is guided by truth and its point is seen without noise; here whatever is estimated flies the aircraft,
from 5 km to standstill. What is ranged is the middle of a threshold whose width nobody told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from landing_sim.geometry.so3 import from_euler
from landing_sim.papers.claims import Measured
from landing_sim.papers.courses import Course, settling
from landing_sim.papers.flights import Flown, Run
from landing_sim.papers.point_approach import CAMERA_FROM_BODY
from landing_sim.record.judge import measure, outcome, threshold_in_view
from landing_sim.record.log import FlightLog
from landing_sim.types import Array

STILL_AIR = ("wind.turbulence=null",)
NEAR = Run("transport/gibert_near", STILL_AIR)
FAR = Run("transport/gibert_far", STILL_AIR)
POINT = Run("transport/gibert_far", (*STILL_AIR, "observer.outputs=point"))
BOTH = (NEAR, FAR)
NAMES = ("−50 %", "+50 %")
LATE = 30.0  # [s] from which on the range is to be right


def course(log: FlightLog) -> Course:
    """The threshold's middle in the aircraft's axes (right, down, ahead), from acquisition until it is lost from sight.

    Times count from acquisition. Empty if the runway was never acquired.
    """
    seen = log["valid"] & threshold_in_view(log)
    pose = ("x", "y", "H", "phi", "theta", "psi")
    t = log["est_t_s"][seen]
    return Course(
        t - t[0] if len(t) else t,
        _ahead(*(log.truth(name)[seen] for name in pose)),
        _ahead(*(log.estimate(name)[seen] for name in pose)),
        np.column_stack([log.estimate(name)[seen] for name in ("d1", "d2")]),
        np.zeros(len(t), int),
    )


def _ahead(x: Array, y: Array, H: Array, phi: Array, theta: Array, psi: Array) -> Array:
    """(n, 3) [m] the origin of the runway's axes as the aircraft has it."""
    ways = np.column_stack([-x, -y, H])
    found = [CAMERA_FROM_BODY @ from_euler(*angles).T @ way for way, *angles in zip(ways, phi, theta, psi)]
    return np.array(found).reshape(-1, 3)


def acquired(log: FlightLog) -> float:
    """[s] when the runway was acquired."""
    return float(log["t_s"][np.argmax(log["valid"])]) if log["valid"].any() else math.nan


def trusted(log: FlightLog) -> float:
    """[s] after acquisition when the range was first believed, and so steered by; NaN if it never was."""
    believed = log["flag_range_valid"]
    return float(log["t_s"][np.argmax(believed)]) - acquired(log) if believed.any() else math.nan


def settled(log: FlightLog) -> float:
    """[s] after acquisition when the range was within 5 % for good; NaN if it never was."""
    c = course(log)
    return settling(c) if len(c.t) else math.nan


# ---------------------------------------------------------------------------------------------------- measures

Flights = Sequence[Flown]


def converges(flown: Flights) -> Measured:
    """The slower of the two."""
    told = []
    for name, f in zip(NAMES, flown):
        touched = f.log.touchdown
        left = math.nan if touched is None else touched.t - acquired(f.log)
        told.append(f"{name}: {settled(f.log):.1f} s, steered by from {trusted(f.log):.1f} s, touchdown {left:.0f} s")
    return Measured(_largest([settled(f.log) for f in flown]), "; ".join(told))


def range_at_1km(flown: Flights) -> Measured:
    return _worst(flown, [measure(f.log)["range_1km_percent"] for f in flown], "%")


def at_threshold(flown: Flights) -> Measured:
    """The estimate's larger error of lateral and height there."""
    names = ("threshold_lateral_error_m", "threshold_height_error_m")
    found = [[measure(f.log)[name] for name in names] for f in flown]
    told = "; ".join(f"{name}: {y:.2f} m lateral, {H:.2f} m in height" for name, (y, H) in zip(NAMES, found))
    return Measured(_largest([value for pair in found for value in pair]), told)


def lands(flown: Flights) -> Measured:
    """How many of them do."""
    told = "; ".join(f"{name}: {_landing(f.log)}" for name, f in zip(NAMES, flown))
    return Measured(float(sum(outcome(f.log) == "landed" for f in flown)), told)


def tracks_apart(flown: Flights) -> Measured:
    """[m] largest distance between the two flown tracks at the same distance, and that over the threshold."""
    tracks = []
    for f in flown:
        x = f.log["true_x_m"]
        tracks.append([x] + [f.log[name] for name in ("true_y_m", "true_H_m")])
    first, last = (pick(track[0][end] for track in tracks) for pick, end in ((max, 0), (min, -1)))
    if last < 0.0:
        return Measured(math.nan, "not both came as far as the threshold")
    where = np.append(np.arange(first, 0.0, 10.0), 0.0)
    across = [np.column_stack([np.interp(where, x, v) for v in values]) for x, *values in tracks]
    apart = np.linalg.norm(across[0] - across[1], axis=1)
    return Measured(
        float(apart.max()), f"that {-where[apart.argmax()]:.0f} m before the threshold; {apart[-1]:.2g} m over it"
    )


def late_error(flown: Flights) -> Measured:
    """[%] the largest range error after LATE, of one flight."""
    c, how = course(flown[0].log), _landing(flown[0].log)
    late = 100.0 * np.abs(c.relative[c.t >= LATE])
    return Measured(float(late.max()) if len(late) else math.nan, how)


def _landing(log: FlightLog) -> str:
    touched, how = log.touchdown, outcome(log).replace("_", " ")
    if touched is None:
        return how
    return (
        f"{how}, {touched.x:.0f} m beyond the threshold, {abs(touched.y):.1f} m off, {touched.sink_rate:.1f} m/s sink"
    )


def _worst(flown: Flights, values: list[float], unit: str) -> Measured:
    told = ", ".join(f"{name}: {value:.2g} {unit}" for name, value in zip(NAMES, values))
    return Measured(_largest(values), told)


def _largest(values: Sequence[float]) -> float:
    """NaN if any is."""
    return float(np.max(values))
