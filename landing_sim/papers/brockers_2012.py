"""Brockers et al. 2012, "Fully Self-Contained Vision-Aided Navigation and Landing of a Micro Air Vehicle Independent from
External Sensor Inputs": its equations, figures 3, 6, 7, 10 and 11, and every number of section 5.

The paper names neither latency, disturbance, gains nor distances. Latency (150 ms) and gusts (0.23 N) are chosen so that
the flight without fusion comes out as the paper's did: what is evidence is what fusion makes of it, over seeds and places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from landing_sim.campaign.verdict import count_bounds
from landing_sim.papers import brockers_checks as check
from landing_sim.papers import brockers_trials as trials
from landing_sim.papers.brockers_trials import Brief, Heights, Results, Watched, perform
from landing_sim.papers.claims import Claim, Measure, Measured, about, at_least, at_most
from landing_sim.types import Array

__all__ = ["CLAIMS", "FIGURES", "LEAD", "NAME", "RUNS", "TITLE", "perform"]

NAME = "brockers-2012"
TITLE = "Brockers et al. 2012: Fully Self-Contained Vision-Aided Navigation and Landing of a Micro Air Vehicle"
LEAD = (
    "What the paper states, and what came out when its experiments were flown again on JSBSim. Latency, gusts, gains and "
    "distances are not in the paper: those here were chosen before these flights, on other seeds, so that hovering on "
    "visual positions alone is as unsteady as the paper's. What fusion makes of it was then not adjusted."
)
FIGURES = "The paper's own curves are not at hand as data: these are ours, of what it shows."
RUNS = (
    "Every flight is a scenario and can be flown again with landing-sim run. With camera.width_px images are rendered, a "
    "map is made beforehand by a survey flight, and 4 mm of noise is added to what the localisation says; with "
    "localisation.kind=emulated positions are true ones with 4 mm of white noise, 4 mm that wander and a scale 0.3 % off. "
    "Either way they come 150 ± 20 ms late, 2 % of them later still, and the rest of the vehicle is the same."
)
MISS = 0.08  # [m] that a landing may be off


def _computed(figure: Callable[[], float], note: str = "") -> Measure:
    return lambda results: Measured(figure(), note)


def values(flights: Sequence[Brief], name: str) -> Array:
    """(n,) of a figure, NaN where a flight gave none."""
    return np.array([flight.metrics[name] for flight in flights])


def spread_text(found: Array, unit: str, digits: int = 2) -> str:
    """Number, mean and range in words."""
    if not np.isfinite(found).any():
        return "no flight gave a figure"
    low, high = np.nanmin(found), np.nanmax(found)
    return f"{np.isfinite(found).sum()} flights, {low:.{digits}f} to {high:.{digits}f} {unit}"


def _hover(results: Results) -> Measured:
    """[cm] rms; a hover that ended otherwise counts as none at all."""
    found = 100.0 * values(results[0], "hover_rms_m")
    level = 100.0 * np.hypot(values(results[0], "hover_x_rms_m"), values(results[0], "hover_y_rms_m"))
    return Measured(float(np.mean(found)), f"{spread_text(found, 'cm')}; level alone {np.mean(level):.2f} cm")


def _extent(results: Results) -> Measured:
    wide = [200.0 * max(f.metrics["hover_x_rms_m"], f.metrics["hover_y_rms_m"]) for f in results[0]]
    return Measured(float(np.mean(wide)), spread_text(np.array(wide), "cm", 1))


def _ratio(name: str = "hover_rms_m") -> Measure:
    """Of the first flights over the second, seed by seed."""

    def measure(results: Results) -> Measured:
        paired = values(results[0], name) / values(results[1], name)
        return Measured(float(np.mean(paired)), spread_text(paired, "times"))

    return measure


def _wide_ratio(results: Results) -> Measured:
    wide = [np.maximum(values(flights, "hover_x_rms_m"), values(flights, "hover_y_rms_m")) for flights in results]
    paired = wide[0] / wide[1]
    return Measured(float(np.mean(paired)), spread_text(paired, "times"))


def lag(t: Array, seen: Array, true_t: Array, true: Array, longest: float = 0.5) -> float:
    """[s] by which a course seen (n, 3) at t is behind the true one: where the two are nearest."""
    use = (t >= true_t[0] + longest) & np.isfinite(seen).all(axis=1)
    delays = np.arange(-0.05, longest, 0.002)
    off = [np.mean([(np.interp(t[use] - d, true_t, true[:, i]) - seen[use, i]) ** 2 for i in range(2)]) for d in delays]
    return float(delays[int(np.argmin(off))])


def lags(watched: Watched) -> tuple[float, float]:
    """[s] of the fixes as they come, and of the filter's output."""
    hover = watched.t > 12.0
    fix = lag(watched.came, watched.fixes, watched.t, watched.p)
    return fix, lag(watched.t[hover], watched.p_hat[hover], watched.t, watched.p)


def _latency(results: Sequence[Watched]) -> Measured:
    fix, fused = lags(results[0])
    return Measured(100.0 * abs(fused) / fix, f"fixes {1e3 * fix:.0f} ms behind, the filter {1e3 * fused:.0f} ms")


def _rate(results: Sequence[Watched]) -> Measured:
    return Measured(float(1.0 / np.median(np.diff(results[0].taken))))


def _success(results: Results) -> Measured:
    """[%] that landed on the place and within MISS of its middle."""
    flights = [flight for found in results for flight in found]
    miss = values(flights, "miss_m")
    good = np.array([f.outcome == "landed" for f in flights]) & (miss <= MISS)
    bounds = count_bounds(int(good.sum()), len(good))
    ends: dict[str, int] = {}
    for flight in flights:
        ends[flight.outcome] = ends.get(flight.outcome, 0) + 1
    told = ", ".join(f"{count} {name}" for name, count in sorted(ends.items()))
    note = f"{good.sum()} of {len(good)} ({told}); at least {100.0 * bounds.lower:.1f} % with 97.5 % confidence"
    return Measured(100.0 * float(np.mean(good)), note)


def _largest(name: str, factor: float, unit: str) -> Measure:
    def measure(results: Results) -> Measured:
        found = factor * np.concatenate([values(flights, name) for flights in results])
        told = f"median {np.nanmedian(found):.1f} {unit}, {np.isfinite(found).sum()} touchdowns"
        return Measured(float(np.nanmax(found)), told)

    return measure


def _mean(name: str, factor: float, unit: str) -> Measure:
    def measure(results: Results) -> Measured:
        found = factor * values(results[0], name)
        return Measured(float(np.nanmean(found)), spread_text(found, unit))

    return measure


def _across(results: Results) -> Measured:
    """Mean ratio of what the first half of the jobs and the second half were off their way."""
    half = len(results) // 2
    first, second = (
        100.0 * np.concatenate([values(flights, "cross_track_rms_m") for flights in part])
        for part in (results[:half], results[half:])
    )
    note = f"{np.nanmean(first):.1f} cm against {np.nanmean(second):.1f} cm rms"
    return Measured(float(np.nanmean(first) / np.nanmean(second)), note)


def _height(results: Sequence[Heights]) -> Measured:
    agreed = 100.0 * np.array([found.agreed for found in results])
    each = [100.0 * float(np.std(found.height)) for found in results if len(found.height)]
    told = f"{spread_text(agreed, 'cm')}; spread from image to image {np.mean(each):.2f} cm" if each else ""
    return Measured(float(np.mean(agreed)), told or "no image gave a way point")


def _faster(results: Results) -> Measured:
    half = len(results) // 2
    fast, slow = (np.concatenate([values(f, "flight_s") for f in part]) for part in (results[:half], results[half:]))
    shares = fast / slow
    return Measured(float(np.nanmean(shares)), spread_text(shares, "of the slow flight's time"))


# fmt: off
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "eq2", "v' = C (a - b) - g", "eq. 2", 0.0, "m/s²", "acceleration of a body at rest, z down, a the specific force",
        (), _computed(lambda: check.at_rest(-1.0)), at_most(1e-9), "in north-east-down g points along +z: add it",
    ),
    Claim(
        "eq2-used", "the same with + g", "eq. 2", 0.0, "m/s²", "as before",
        (), _computed(lambda: check.at_rest(1.0)), at_most(1e-9), "what is used here",
    ),
    Claim(
        "eq5", "δv' = C δb", "eq. 5", None, "", "largest difference from the derivative of (1) to (3) by differences",
        (), _computed(lambda: check.error_model_error(1.0)), at_most(1e-6),
        "with errors all counted the same way, as (7) counts them, a bias that is too small makes too much of the "
        "acceleration",
    ),
    Claim(
        "eq5-used", "the same with − C δb", "eq. 5", None, "", "as before",
        (), _computed(lambda: check.error_model_error(-1.0)), at_most(1e-6), "what is used here",
    ),
    Claim(
        "rate", "visual positions come at about 15 Hz", "4.2, 5.1", 15.0, "Hz", "fixes a second",
        (trials.WATCHED,), _rate, about(15.0, 1.0),
    ),
    Claim(
        "accuracy", "visual positions are better than 1 cm at 1 m", "3.3", 1.0, "cm",
        "rms distance of fixes from the truth at image time, mean over hovers", (trials.FUSED, trials.UNFUSED),
        _mean("fix_error_rms_m", 100.0, "cm"), at_most(1.0), "0.7 cm of it is noise that was added",
    ),
    Claim(
        "latency", "the filter largely compensates the latency", "3.3, fig. 3", None, "%",
        "lag that remains, of that with which fixes come; the filter beside a hover that it does not fly",
        (trials.WATCHED,), _latency, at_most(20.0),
    ),
    Claim(
        "hover", "hovering on visual positions alone: RMS 9.91 cm", "5.1, fig. 6", 9.91, "cm",
        "rms distance from where it is wanted, three axes, mean over seeds; best gains found for it",
        (trials.UNFUSED, trials.HOVERED["PTAM-only"]), _hover, about(10.5, 2.5),
        "gusts and latency were chosen for this figure",
    ),
    Claim(
        "hover-fused", "with the sensor fusion filter: RMS 3.44 cm", "5.1, fig. 7", 3.44, "cm", "as before",
        (trials.FUSED, trials.HOVERED["fused"]), _hover, at_most(3.5),
        "our gains: at 3.0 rad/s instead of 3.6 it is 3.4 cm",
    ),
    Claim(
        "hover-factor", "fusion reduces the RMS by a factor of 3", "5.1", 3.0, "times", "ratio seed by seed, mean",
        (trials.UNFUSED, trials.FUSED), _ratio(), at_least(2.6),
    ),
    Claim(
        "ellipse", "the hovering ellipse on visual positions alone: ±15 cm", "5.1, fig. 6", 15.0, "cm",
        "two standard deviations of the wider level axis", (trials.UNFUSED,), _extent, about(15.0, 4.0),
    ),
    Claim(
        "ellipse-fused", "with the filter: ±7.5 cm", "5.1, fig. 7", 7.5, "cm", "as before",
        (trials.FUSED,), _extent, at_most(7.5),
    ),
    Claim(
        "ellipse-factor", "fusion reduces the ellipse by a factor of 2", "5.1", 2.0, "times", "ratio seed by seed, mean",
        (trials.UNFUSED, trials.FUSED), _wide_ratio, at_least(2.0),
    ),
    Claim(
        "why-latency", "this is largely due to the reduction of latency", "5.1", None, "times",
        "rms with the filter, fixes taken as if they were new, over the same with latency compensated",
        (trials.UNCOMPENSATED, trials.WITH), _ratio(), at_least(1.5),
    ),
    Claim(
        "why-frequency", "and to the increase of control frequency", "5.1", None, "times",
        "rms with the filter and 20 commands a second over the same with 50", (trials.SELDOM, trials.WITH), _ratio(),
        at_least(1.1), "the firmware's attitude loop is slower than either",
    ),
    Claim(
        "equal-gains", "(no claim) the same gains with and without fusion", "", None, "times",
        "rms without fusion over that with fusion, both with the gains that are best without",
        (trials.WITHOUT, trials.EQUAL), _ratio(), about(1.0, 0.4),
        "fusion pays through the phase margin that it leaves for stiffer gains",
    ),
    Claim(
        "late", "(no claim) 200 ms, one image in twenty 300 ms later still", "", None, "cm", "rms with the filter",
        (trials.LATE,), _hover, at_most(4.5),
    ),
    Claim(
        "lands", "the quadrotor lands on the platform with the filter", "5.2, fig. 10", None, "%",
        "on the platform within 8 cm of its middle; three places", trials.SLOW, _success, at_least(95.0),
        "the landing place is told with 1 cm of bias once it was wholly in view",
    ),
    Claim(
        "lands-seen", "the same on rendered images", "5.2, fig. 10", None, "%", "as before; slow and fast, landing place "
        "found in the images", (*trials.SEEN_SLOW, *trials.SEEN_FAST), _success, at_least(95.0),
    ),
    Claim(
        "height", "the platform's height of 14 cm is approximated with sufficient accuracy", "5.2, fig. 11", 14.0, "cm",
        "mean of what the pool agreed on, first place, rendered images", trials.DETECTED, _height, about(14.0, 1.0),
    ),
    Claim(
        "way-point", "(no claim) the way point", "", None, "cm", "largest distance from the middle, rendered images",
        (*trials.SEEN_SLOW, *trials.SEEN_FAST), _largest("way_point_error_m", 100.0, "cm"), at_most(5.0),
    ),
    Claim(
        "lands-fast", "and in fast flight", "5.2, fig. 10c", None, "%", "as before", trials.FAST, _success, at_least(95.0),
    ),
    Claim(
        "lands-unfused", "it lands for both control inputs", "5.2, fig. 10a", None, "%", "as before, without fusion",
        trials.SLOW_UNFUSED, _success, None, "how often is not said; within 8 cm is our limit, not the paper's",
    ),
    Claim(
        "miss", "(no claim) miss of the middle", "", None, "cm", "largest, slow and fast, fused",
        (*trials.SLOW, *trials.FAST), _largest("miss_m", 100.0, "cm"), at_most(8.0),
    ),
    Claim(
        "time-unfused", "flight time 57 s without fusion", "fig. 10a", 57.0, "s", "take-off to touchdown, mean",
        (trials.SLOW_UNFUSED[0], trials.FLOWN["PTAM-only"]), _mean("flight_s", 1.0, "s"), about(57.0, 8.0),
        "distance (2.1 m) and speeds are ours; the descent waits while it is 12 cm off, which here is often",
    ),
    Claim(
        "time", "47 s with fusion", "fig. 10b", 47.0, "s", "as before", (trials.SLOW[0], trials.FLOWN["fused"]),
        _mean("flight_s", 1.0, "s"), about(47.0, 5.0), "distance and speeds are ours",
    ),
    Claim(
        "time-fast", "18 s in fast flight", "fig. 10c", 18.0, "s", "as before",
        (trials.FAST[0], trials.FLOWN["fused, fast"]), _mean("flight_s", 1.0, "s"), about(18.0, 2.0),
        "distance and speeds are ours",
    ),
    Claim(
        "faster", "(no claim) the fast flight's time", "", 18.0 / 47.0, "of the slow", "share, seed by seed, mean",
        (*trials.FAST, *trials.SLOW), _faster, at_most(0.45),
    ),
    Claim(
        "fluctuations", "smaller trajectory fluctuations with the filter", "5.2, fig. 10a, b", None, "times",
        "rms beside the straight way, without fusion over with", (*trials.SLOW_UNFUSED, *trials.SLOW), _across,
        at_least(2.0),
    ),
    Claim(
        "same-performance", "three times the speed with the same flight performance", "5.2, fig. 10c", 1.0, "times",
        "rms beside the straight way, fast over slow", (*trials.FAST, *trials.SLOW), _across, at_most(1.25),
        "five times the speed here",
    ),
)
