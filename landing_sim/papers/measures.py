"""Figures of a landing that the claims of a paper are about: each from the log of one flight, or of several."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from landing_sim.papers.claims import Measure, Measured
from landing_sim.papers.flights import Flown
from landing_sim.record.judge import counted, measure, threshold_in_view
from landing_sim.record.log import FlightLog
from landing_sim.types import Array

ONSET, GUST_X = -250.0, -650.0  # [m] where the paper's flare begins and its gust strikes
GUST_LASTS = 8.0  # [s] "for a short time": a bit more than the gust's time constant
DEGREES = math.degrees(1.0)


def median(values: Array) -> float:
    return float(np.median(values))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan


def farthest_from(value: float) -> Callable[[Array], float]:
    return lambda values: float(values[np.argmax(np.abs(values - value))])


NOTHING = Measured(math.nan)


def worst(metric: str) -> Measure:
    """The largest over the flights; the note tells the median."""
    return over(lambda log: measure(log)[metric])


def typical(metric: str) -> Measure:
    return over(lambda log: measure(log)[metric], of=median, told="median of")


def over(
    figure: Callable[[FlightLog], float],
    of: Callable[[Array], float] = lambda values: float(np.max(values)),
    told: str = "largest of",
) -> Measure:
    """One figure of each flight, brought together by `of`; the note tells how they spread."""

    def measured(flown: Sequence[Flown]) -> Measured:
        values = np.array([figure(f.log) for f in flown])
        if not np.isfinite(values).all():
            failed = int((~np.isfinite(values)).sum())
            return Measured(math.nan, f"{failed} of {len(values)} flights ended before it could be measured")
        spread = f"{np.min(values):.3g} … {np.max(values):.3g}, median {median(values):.3g}"
        return Measured(of(values), f"{told} {len(values)} flights ({spread})" if len(values) > 1 else "one flight")

    return measured


def largest(values: Array, where: np.ndarray) -> float:
    """The largest magnitude there; NaN if there is nothing."""
    chosen = values[where & np.isfinite(values)]
    return float(np.abs(chosen).max()) if len(chosen) else math.nan


# ------------------------------------------------------------------------------------------- figures of one flight


def range_error(log: FlightLog) -> float:
    return largest(log.error("x"), counted(log) & threshold_in_view(log) & (log.truth("x") < 0.0))


def range_error_after_loss(log: FlightLog) -> float:
    return largest(log.error("x"), counted(log) & ~threshold_in_view(log))


def in_gust(log: FlightLog) -> np.ndarray:
    t, x = log["t_s"], log["true_x_m"]
    struck = t[np.argmax(x > GUST_X)] if (x > GUST_X).any() else math.inf
    return (t >= struck) & (t < struck + GUST_LASTS)


def lateral_in_gust(log: FlightLog) -> float:
    return largest(log.error("y"), counted(log) & in_gust(log))


def lateral_otherwise(log: FlightLog) -> float:
    return largest(log.error("y"), counted(log) & ~in_gust(log))


def onset_growth(log: FlightLog, name: str = "H") -> float:
    """How much larger |error| gets in the 3 s after the beginning of the flare than in the second before."""
    t, start, error = log["t_s"], flare_time(log), log.error(name)
    return largest(error, (t > start) & (t < start + 3.0)) - largest(error, (t > start - 1.0) & (t <= start))


def flare_time(log: FlightLog) -> float:
    flaring = log["mode"] == "flare"
    return float(log["t_s"][np.argmax(flaring)]) if flaring.any() else math.nan


def flare_range(log: FlightLog) -> float:
    flaring = log["mode"] == "flare"
    return float(-log["true_x_m"][np.argmax(flaring)]) if flaring.any() else math.nan


def heading_settled(log: FlightLog) -> float:
    """Mean heading relative to the runway over the second around 750 m travelled [deg]."""
    travelled = log["true_x_m"] - log["true_x_m"][0]
    if travelled[-1] < 750.0:
        return math.nan
    t = log["t_s"]
    at = t[np.argmax(travelled >= 750.0)]
    return float(DEGREES * np.mean(np.abs(log["true_psi_rad"][np.abs(t - at) <= 0.5])))


def until_width_is_fixed(log: FlightLog) -> np.ndarray:
    """From 600 m, when a wrong first belief has been forgotten, until the threshold was lost."""
    return counted(log) & threshold_in_view(log) & (log.truth("x") > -600.0)


def width_error_at_loss(log: FlightLog) -> float:
    use = np.flatnonzero(until_width_is_fixed(log))
    return float(abs(log.error("W")[use[-1]])) if len(use) else math.nan


def width_mean(log: FlightLog) -> float:
    use = until_width_is_fixed(log)
    return float(np.mean(log.estimate("W")[use])) if use.any() else math.nan


def width_mean_error(log: FlightLog) -> float:
    return abs(width_mean(log) - float(log.meta["runway_width_m"]))


def vertical_gust_effect(flown: Sequence[Flown]) -> Measured:
    """How far the flights with and without the vertical gust are apart in height, place by place on approach."""
    with_gust, without = (f.log for f in flown)
    x = np.arange(GUST_X, ONSET, 5.0)
    heights = [np.interp(x, log["true_x_m"], log["true_H_m"]) for log in (with_gust, without)]
    return Measured(float(np.max(np.abs(heights[0] - heights[1]))), "same seed, with and without the vertical gust")


def onset_with_lag(flown: Sequence[Flown]) -> Measured:
    """Of the first half of the flights, with the lag; the note holds the second half, without, and pitch."""
    half = len(flown) // 2
    H, theta = (
        [[onset_growth(f.log, name) for f in part] for part in (flown[:half], flown[half:])] for name in ("H", "theta")
    )
    pitch = [DEGREES * float(np.median(part)) for part in theta]
    text = (
        f"without lag {np.median(H[1]):.3f} m; pitch error grows by {pitch[0]:.3f} deg, without lag {pitch[1]:.3f} deg"
    )
    return Measured(float(np.median(H[0])), text)


def cycle_cost(flown: Sequence[Flown]) -> Measured:
    value = float(np.median([f.cycle_ms for f in flown]))
    return Measured(value, "vision, filter, guidance and control on one core of this machine; drawing excluded")


def split_cost(flown: Sequence[Flown]) -> Measured:
    """Work of the split filter for each half, in percent of the full one's."""
    half = len(flown) // 2
    split, whole = (float(np.median([f.estimator_ms for f in part])) for part in (flown[:half], flown[half:]))
    text = f"filter of two halves {split:.3f} ms, whole filter {whole:.3f} ms a cycle"
    return Measured(100.0 * 0.5 * split / whole, text)


def lateral_sharpens(flown: Sequence[Flown]) -> Measured:
    """rms lateral error beyond 600 m over that within 300 m of the threshold."""
    far, near = [], []
    for f in flown:
        error, x, use = f.log.error("y"), f.log["true_x_m"], counted(f.log)
        far.append(rms(error[use & (x < -600.0)]))
        near.append(rms(error[use & (x > -300.0) & (x < 0.0)]))
    text = f"rms {np.median(far):.3f} m beyond 600 m, {np.median(near):.3f} m within 300 m"
    return Measured(float(np.median(far) / np.median(near)), text)


def optical_minus(log: FlightLog, name: str, column: str) -> Array:
    """Estimate minus a reference system's reading, where that has one."""
    return log.estimate(name) - log[column]


def rms_difference(name: str, column: str) -> Measure:
    """The rms difference between an estimate and a reference system's readings on approach."""

    def of_flight(log: FlightLog) -> float:
        difference = optical_minus(log, name, column)
        use = counted(log) & np.isfinite(difference) & (log.truth("x") < 0.0)
        return rms(difference[use])

    return over(of_flight, of=median, told="median of")
