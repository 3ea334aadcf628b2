"""Figures 8 to 15 of Dickmanns & Schell 1992 redrawn with our flights, as SVG. Same flights, same bytes.

The paper's curves are not at hand as data: its claimed figures are drawn as reference lines instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from landing_sim.papers import dickmanns_1992 as paper
from landing_sim.papers import measures as m
from landing_sim.papers.drawing import BAND, CLAIM, ESTIMATED, OTHER, TRUE, Figure, svg
from landing_sim.papers.flights import Flown, Run
from landing_sim.record.judge import counted
from landing_sim.record.log import FlightLog
from landing_sim.types import Array

DISTANCE = "distance to the threshold x [m]"


def figures(flown: Mapping[Run, Flown]) -> list[Figure]:
    """Every figure. Raises KeyError if a flight is missing."""
    gust, split, pilot = (flown[runs[0]].log for runs in (paper.GUST, paper.SPLIT, paper.PILOT))
    return [
        _trajectory(gust),
        _angle(gust, "9", "Roll angle", "phi", m.DEGREES, "deg", 1.0, 8.0),
        _angle(gust, "10", "Yaw angle", "psi", m.DEGREES, "deg", 1.0, 2.0),
        _lateral(gust, split),
        _range_and_height(gust, flown),
        _against_gps(pilot, "12", "Distance to the runway, flown by hand", "x", "dgps_x_m"),
        _against_gps(pilot, "13", "Lateral offset, flown by hand", "y", "dgps_y_m"),
        _altitude(pilot),
        _width([flown[run].log for run in paper.PILOT_WIDTH]),
    ]


def _trajectory(log: FlightLog) -> Figure:
    def draw(axes: Any) -> None:
        top, side = axes
        x = log["true_x_m"]
        half, length = 0.5 * log.meta["runway_width_m"], log.meta["runway_length_m"]
        top.fill_between([0.0, length], -half, half, color="#ced4da", lw=0)
        top.plot(x, log["true_y_m"], color=TRUE, label="flown")
        top.plot(log.truth("x"), log.estimate("y"), color=ESTIMATED, ls="--", lw=1.0, label="estimated")
        top.axvline(m.GUST_X, color=OTHER, ls=":", lw=1)
        top.annotate("gust", (m.GUST_X, -80.0), (4, 0), textcoords="offset points", color="#5c677d", fontsize=8.5)
        top.set(xlabel=DISTANCE, ylabel="y [m]", title="from above", xlim=(-1000, 900))
        top.invert_yaxis()
        top.legend(loc="lower right")
        side.plot([0.0, length], [0.0, 0.0], color="#adb5bd", lw=4, solid_capstyle="butt")
        side.plot(x, log["true_H_m"], color=TRUE)
        side.plot(log.truth("x"), log.estimate("H"), color=ESTIMATED, ls="--", lw=1.0)
        for where, text in ((-250.0, "flare\n−250 m"), (550.0, "touchdown\n550 m")):
            side.axvline(where, color=CLAIM, ls="--", lw=1)
            side.annotate(text, (where, 38.0), (4, 0), textcoords="offset points", color=CLAIM, fontsize=8.5)
        side.set(xlabel=DISTANCE, ylabel="height H [m]", title="from the side", xlim=(-1000, 900), ylim=(-2, 55))

    caption = (
        "The offset of 85 m is flown off in one turn to the runway and back; the glide of about 3 degrees rounds out "
        "exponentially. Green: where the paper begins its flare and touches down."
    )
    return Figure("figure 8", "Trajectory", svg(draw, 2), caption)


def _angle(
    log: FlightLog, number: str, title: str, name: str, factor: float, unit: str, claim: float, level: float
) -> Figure:
    x, use = log["true_x_m"], counted(log)
    error, sigma = factor * log.error(name), factor * log.sigma(name)

    def draw(axes: Any) -> None:
        both, difference = axes
        air = x < _end(log)
        both.plot(x[air], factor * log.truth(name)[air], color=TRUE, label="simulated")
        both.plot(x[use], factor * log.estimate(name)[use], color=ESTIMATED, ls="--", lw=1.0, label="estimated")
        for sign in (-1.0, 1.0):
            both.axhline(
                sign * level, color=CLAIM, ls="--", lw=1, label=f"paper: about {level:g} {unit}" if sign > 0 else None
            )
        both.set(xlabel=DISTANCE, ylabel=f"{title.lower()} [{unit}]", title=f"{number}a  estimated and simulated")
        both.legend()
        _errors(difference, x[use], error[use], sigma[use], claim, unit)
        difference.set(title=f"{number}b  difference")

    largest = m.largest(error, use)
    caption = (
        f"Largest difference {largest:.2g} {unit} where the paper stays within {claim:g} {unit}; the band is the filter's "
        "own 3-sigma."
    )
    return Figure(f"figure {number}", title, svg(draw, 2), caption)


def _lateral(gust: FlightLog, split: FlightLog) -> Figure:
    def draw(axes: Any) -> None:
        both, difference = axes
        use, air = counted(gust), gust["true_x_m"] < _end(gust)
        both.plot(gust["true_x_m"][air], gust["true_y_m"][air], color=TRUE, label="simulated")
        both.plot(gust["true_x_m"][use], gust.estimate("y")[use], color=ESTIMATED, ls="--", lw=1.0, label="estimated")
        both.axvline(-450.0, color=CLAIM, ls="--", lw=1, label="paper: |y| < 5 m from here")
        both.set(xlabel=DISTANCE, ylabel="lateral offset y [m]", title="11a  estimated and simulated")
        both.legend()
        _errors(difference, gust["true_x_m"][use], gust.error("y")[use], gust.sigma("y")[use], 1.0, "m")
        s = counted(split)
        difference.plot(
            split["true_x_m"][s], split.error("y")[s], color=OTHER, label="filter of two halves, no wind states"
        )
        difference.axvline(m.GUST_X, color=OTHER, ls=":", lw=1)
        difference.set(title="11b  difference")
        difference.legend()

    ours, theirs = m.lateral_in_gust(gust), m.lateral_in_gust(split)
    caption = (
        f"In the gust the paper's error grew to about 3 m. A filter of its kind gives {theirs:.2g} m here, one that "
        f"estimates the wind {ours:.2g} m."
    )
    return Figure("figure 11", "Lateral offset", svg(draw, 2), caption)


def _range_and_height(gust: FlightLog, flown: Mapping[Run, Flown]) -> Figure:
    lagging, prompt = flown[paper.LAGGING[0]].log, flown[paper.PROMPT[0]].log

    def draw(axes: Any) -> None:
        distance, height = axes
        use = counted(gust)
        _errors(distance, gust["true_x_m"][use], gust.error("x")[use], gust.sigma("x")[use], 5.0, "m")
        distance.axvline(-120.0, color=OTHER, ls=":", lw=1)
        distance.set(title="range error; dotted: threshold lost (paper)", ylim=(-12, 12))
        for log, colour, text in (
            (lagging, OTHER, "straight in, angles as commanded, lag 0.06 s"),
            (prompt, TRUE, "the same, without lag"),
            (gust, ESTIMATED, "the paper's case, angles from encoders"),
        ):
            u = counted(log)
            height.plot(log["true_x_m"][u], log.error("H")[u], color=colour, lw=1.2, label=text)
        for sign in (-1.0, 1.0):
            height.plot([-950, 0], [sign, sign], color=CLAIM, ls="--", lw=1)
            height.plot([0, 550], [0.5 * sign, 0.5 * sign], color=CLAIM, ls="--", lw=1)
        height.axvline(-250.0, color=OTHER, ls=":", lw=1)
        height.set(xlabel=DISTANCE, ylabel="height error [m]", title="height error; dotted: flare begins (paper)")
        height.legend(loc="lower left")

    caption = (
        "Text of section 7.1, drawn: range within 5 m until the threshold is lost, then only predicted (the band opens). "
        "On the right a platform lag that the filter does not know of: at flare onset it shows in pitch, not in height."
    )
    return Figure("section 7.1", "Range and height errors", svg(draw, 2), caption)


def _against_gps(log: FlightLog, number: str, title: str, name: str, column: str) -> Figure:
    x, use = log["true_x_m"], counted(log) & (log["true_x_m"] < 0.0)
    read = np.isfinite(log[column]) & (x < 0.0)
    difference = m.optical_minus(log, name, column)

    def draw(axes: Any) -> None:
        both, apart = axes
        both.plot(x[use], log.estimate(name)[use], color=ESTIMATED, label="optical")
        both.plot(x[read], log[column][read], "o", ms=3, color=TRUE, label="differential GPS (simulated)")
        both.set(xlabel=DISTANCE, ylabel=f"{name} [m]", title=f"{number}a  optical and GPS")
        both.legend()
        apart.axhline(0.0, color="#adb5bd", lw=1)
        apart.plot(x[read & use], difference[read & use], "o-", ms=3, lw=0.8, color=ESTIMATED, label="optical − GPS")
        apart.plot(x[use], log.error(name)[use], color=TRUE, lw=1.0, label="optical − truth")
        apart.set(xlabel=DISTANCE, ylabel="[m]", title=f"{number}b  difference")
        apart.legend()

    caption = (
        "A scripted pilot flies in light turbulence; the filter only watches. What lies between the two curves on the "
        "right is the GPS' own error, which a real flight cannot show."
    )
    return Figure(f"figure {number}", title, svg(draw, 2), caption)


def _altitude(log: FlightLog) -> Figure:
    x, use = log["true_x_m"], counted(log) & (log["true_x_m"] < 0.0)
    read = np.isfinite(log["dgps_H_m"]) & (x < 0.0)

    def draw(axes: Any) -> None:
        both, apart = axes
        for axis, of in ((both, 0.0), (apart, log["true_H_m"])):
            axis.plot(x[use], (log["radar_H_m"] - of)[use], color=OTHER, lw=0.8, label="radar altimeter (simulated)")
            axis.plot(
                x[read], (log["dgps_H_m"] - of)[read], "o", ms=3, color=TRUE, label="differential GPS (simulated)"
            )
            axis.plot(x[use], (log.estimate("H") - of)[use], color=ESTIMATED, label="optical")
        both.set(xlabel=DISTANCE, ylabel="altitude [m]", title="14  optical, GPS, radiometric")
        apart.set(xlabel=DISTANCE, ylabel="[m]", title="each minus truth")
        both.legend()

    caption = "As in the paper, GPS is the worst of the three in altitude, and the radar altimeter is the judge."
    return Figure("figure 14", "Altitude, flown by hand", svg(draw, 2), caption)


def _width(logs: list[FlightLog]) -> Figure:
    def draw(axes: Any) -> None:
        for log, colour in zip(logs, (ESTIMATED, TRUE)):
            use = counted(log) & (log["true_x_m"] < -120.0)
            x, width, sigma = log["true_x_m"][use], log.estimate("W")[use], 3.0 * log.sigma("W")[use]
            told = log.meta["scenario"]["filter"]["believed_width_m"]
            axes.fill_between(x, width - sigma, width + sigma, color=colour, alpha=0.15, lw=0)
            axes.plot(x, width, color=colour, label=f"told {told:g} m; mean {m.width_mean(log):.2f} m")
        axes.axhline(29.0, color="#5c677d", lw=1, label="true 29 m")
        axes.axhline(29.1, color=CLAIM, ls="--", lw=1, label="paper: mean 29.1 m")
        axes.set(xlabel=DISTANCE, ylabel="runway width [m]", ylim=(22, 36))
        axes.legend(ncols=2)

    caption = (
        "The separate width filter, started 4 m off either way, on the approaches flown by hand; the band is 3-sigma."
    )
    return Figure("figure 15", "Estimated runway width", svg(draw, 1), caption)


def _errors(axes: Any, x: Array, error: Array, sigma: Array, claim: float, unit: str) -> None:
    axes.fill_between(x, -3.0 * sigma, 3.0 * sigma, color=BAND, lw=0, label="3 sigma")
    axes.plot(x, error, color=ESTIMATED, lw=1.2)
    for sign in (-1.0, 1.0):
        axes.axhline(sign * claim, color=CLAIM, ls="--", lw=1, label=f"paper: {claim:g} {unit}" if sign > 0 else None)
    axes.set(xlabel=DISTANCE, ylabel=f"error [{unit}]", ylim=(-1.6 * claim, 1.6 * claim))
    axes.legend(loc="upper right")
    largest = m.largest(error, np.ones(len(error), bool))
    if largest < 0.2 * claim:
        zoom = axes.inset_axes((0.1, 0.07, 0.88, 0.25))
        zoom.fill_between(x, -3.0 * sigma, 3.0 * sigma, color=BAND, lw=0)
        zoom.plot(x, error, color=ESTIMATED, lw=0.9)
        span = 1.2 * max(largest, 3.0 * float(np.median(sigma)))
        zoom.set(ylim=(-span, span), xticklabels=[])
        zoom.tick_params(labelsize=7.5, length=2)
        zoom.set_title("enlarged", fontsize=8, color="#5c677d", pad=2)


def _end(log: FlightLog) -> float:
    touchdown = log.touchdown
    return float(log["true_x_m"].max()) if touchdown is None else touchdown.x
