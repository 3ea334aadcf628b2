"""Figure 5 of Gibert et al. 2015 with our flights: the track and the estimates of both first ranges, as SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from landing_sim.papers import gibert_flown as fl
from landing_sim.papers.drawing import CLAIM, OTHER, Figure, svg
from landing_sim.papers.flights import Flown
from landing_sim.record.log import FlightLog
from landing_sim.types import Array

BLACK, BLUE, RED = "#1d2433", "#2a6fdb", "#d1495b"  # as in the paper's figure 5
COLOURS = (BLUE, RED)
ALIGN = {BLACK: "right", BLUE: "left", RED: "left"}
END = 600.0  # [m] behind the threshold: what the tracks are drawn to


def flown(results: Mapping[Any, Flown]) -> list[Figure]:
    """Raises KeyError if a flight is missing."""
    logs = [results[run].log for run in fl.BOTH]
    return [_tracks(logs), _camera_axes(logs), _errors(logs, results[fl.POINT].log)]


def _tracks(logs: Sequence[FlightLog]) -> Figure:
    def draw(axes: Any) -> None:
        for axis, name in zip(axes, ("y", "H")):
            for log, share, colour, place in zip(logs, fl.NAMES, COLOURS, ((10, 0), (4, 10))):
                seen = log["valid"] & (log["true_x_m"] < END)
                x, value = 1e-3 * log.estimate("x")[seen], log.estimate(name)[seen]
                axis.plot(x, value, color=colour, lw=3.0, alpha=0.75)
                _start(axis, x, value, colour, f"first guess {share}", place)
            for log in logs:
                true = log["true_x_m"] < END
                x, value = 1e-3 * log["true_x_m"][true], log[f"true_{name}_m"][true]
                axis.plot(x, value, color=BLACK, lw=1.3)
            _start(axis, x, value, BLACK, "the aircraft", (-12, -16))
            axis.set(xlabel="distance along the runway x [km]", xlim=(-9.0, 1e-3 * END))
        above, side = axes
        half = 0.5 * logs[0].meta["runway_width_m"]
        above.fill_between([0.0, 1e-3 * END], -half, half, color="#adb5bd", lw=0, zorder=0)
        above.annotate("runway", (1e-3 * END, half), (0, 4), textcoords="offset points", fontsize=8.5, ha="right")
        above.set(title="from above", ylabel="right of the centreline y [m]", ylim=(-50.0, None))
        side.plot([0.0, 1e-3 * END], [0.0, 0.0], color="#adb5bd", lw=8, solid_capstyle="butt", zorder=0)
        side.set(title="from the side", ylabel="height H [m]", ylim=(-50.0, None))

    caption = (
        "Black: flown; blue and red: where each aircraft thinks it is. JSBSim's transport, rendered pixels, a runway of "
        "unknown width, still air. The estimate slides along its ray to the true track; then the aircraft turns in, flies "
        "by it and lands."
    )
    return Figure("figure 5", "Landed with a first range 50 % wrong", svg(draw, 2, 3.9), caption)


def _start(axis: Any, x: Array, y: Array, colour: str, told: str, place: tuple[float, float]) -> None:
    """A dot where a line begins, with what it is; nothing where there is no line."""
    if len(x):
        axis.plot(x[:1], y[:1], "o", color=colour, ms=8)
        axis.annotate(told, (x[0], y[0]), place, textcoords="offset points", color=colour, fontsize=9, ha=ALIGN[colour])


def _camera_axes(logs: Sequence[FlightLog]) -> Figure:
    courses = [fl.course(log) for log in logs]

    def draw(axes: Any) -> None:
        for i, (axis, name) in enumerate(zip(axes, ("x1, right", "x2, down", "x3, ahead"))):
            for c, share, colour in zip(courses, fl.NAMES, COLOURS):
                axis.plot(c.t, c.x_hat[:, i], color=colour, lw=3.0, alpha=0.75, label=f"estimated, {share}")
            for c, told in zip(courses, ("true", None)):
                axis.plot(c.t, c.x[:, i], color=BLACK, lw=1.3, label=told)
            axis.set(xlabel="time since the runway was acquired [s]", title=f"{name} [m]")
        axes[2].legend()

    caption = (
        "The threshold's middle in the aircraft's axes, as the paper draws its point, until it is lost from sight. Both "
        "tracks are black: from the turn on each aircraft flies by its own estimate."
    )
    return Figure("figure 5 in camera axes", "The deviations of both landings", svg(draw, 3, 3.2), caption)


def _errors(logs: Sequence[FlightLog], alone: FlightLog) -> Figure:
    def draw(axes: Any) -> None:
        whole, late = axes
        for axis in axes:
            axis.axhspan(-5.0, 5.0, color=CLAIM, alpha=0.2, lw=0)
            c = fl.course(alone)
            axis.plot(c.t, 100.0 * c.relative, color=OTHER, lw=1.4, label="+50 %, the point's coordinates alone")
            for log, share, colour in zip(logs, fl.NAMES, COLOURS):
                c = fl.course(log)
                axis.plot(c.t, 100.0 * c.relative, color=colour, label=f"{share}, with the runway's width")
                if np.isfinite(settled := fl.settled(log)):
                    axis.axvline(settled, color=colour, ls=":", lw=1.2)
            axis.set(xlabel="time since the runway was acquired [s]", ylabel="range error [%]")
        whole.set(title="green: within 5 %; dotted: from then on for good", ylim=(-60, 80))
        late.set(title="the same, enlarged", ylim=(-11, 11))
        whole.legend()

    times = " and ".join(f"{fl.settled(log):.1f} s ({share})" for share, log in zip(fl.NAMES, logs))
    caption = (
        f"Within 5 % after {times}. Grey: without the runway's growing width the range drifts on the glide path, where the "
        "point hardly moves in the image."
    )
    return Figure("figure 5 as errors", "Range error of the landings", svg(draw, 2, 3.3), caption)
