"""Figures of Brockers et al. 2012 with our curves, and how landings ended, as SVG. Same results, same bytes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from landing_sim.papers import brockers_2012 as paper
from landing_sim.papers import brockers_trials as trials
from landing_sim.papers.drawing import BAND, CLAIM, ESTIMATED, OTHER, TRUE, Figure, svg
from landing_sim.record.log import FlightLog

Results = Mapping[Any, Any]  # from Flights, Run, Beside to a list of Briefs, what was Flown, Watched
COLOURS = {"PTAM-only": OTHER, "fused": TRUE, "fused, fast": ESTIMATED}
HOVER_FROM = 11.0  # [s]


def figures(results: Results) -> list[Figure]:
    """Every figure. Raises KeyError if a result is missing."""
    return [
        _latency(results),
        _hover(results, "PTAM-only", "figure 6", 15.0, trials.UNFUSED),
        _hover(results, "fused", "figure 7", 7.5, trials.FUSED),
        _why(results),
        _trajectories(results),
        _heights(results),
        _landings(results),
    ]


def _latency(results: Results) -> Figure:
    w = results[trials.WATCHED]
    start, end = 20.0, 30.0

    def draw(axes: Any) -> None:
        for axis, i in zip(axes, (0, 1)):
            use, said = (w.t >= start) & (w.t <= end), (w.came >= start) & (w.came <= end)
            axis.plot(w.t[use], 100.0 * w.p[use, i], color=CLAIM, lw=3.0, alpha=0.5, label="true")
            axis.plot(w.t[use], 100.0 * w.p_hat[use, i], color=TRUE, lw=1.2, label="filter")
            axis.plot(w.came[said], 100.0 * w.fixes[said, i], ".", color=ESTIMATED, ms=4, label="fix when it came")
            axis.plot(
                w.taken[said], 100.0 * w.fixes[said, i], ".", color=OTHER, ms=4, label="the same when it was taken"
            )
            axis.set(xlabel="time [s]", ylabel=f"{'xy'[i]} [cm]", xlim=(start, end))
        axes[0].legend(ncols=2)

    fix, fused = paper.lags(w)
    caption = (
        "A hover flown on visual positions alone, and what the filter made of the same readings. Fixes come "
        f"{1e3 * fix:.0f} ms late, the filter's output {1e3 * fused:.0f} ms."
    )
    return Figure("figure 3", "Latency with and without the filter", svg(draw, 2), caption)


def _hover(results: Results, name: str, place: str, extent: float, many: trials.Flights) -> Figure:
    log = results[trials.HOVERED[name]].log
    use = log["t_s"] >= HOVER_FROM
    pairs = (("true_x_m", "ref_x"), ("true_y_m", "ref_y_m"), ("true_H_m", "ref_height_m"))
    x, y, z = (100.0 * (log[true] - log[wanted])[use] for true, wanted in pairs)

    def draw(axes: Any) -> None:
        above, course = axes
        above.add_patch(_circle(extent))
        above.plot(y, x, color=COLOURS[name], lw=0.8)
        above.set(
            xlabel="y [cm]", ylabel="x [cm]", xlim=(-30, 30), ylim=(-30, 30), aspect="equal", title="a  from above"
        )
        for values, colour, label in zip((x, y, z), (TRUE, ESTIMATED, CLAIM), ("x", "y", "height")):
            course.plot(log["t_s"][use], values, color=colour, lw=1.0, label=label)
        course.set(xlabel="time [s]", ylabel="off [cm]", ylim=(-30, 30), title="b")
        course.legend(ncols=3)

    rms = 100.0 * paper.values(results[many], "hover_rms_m")
    caption = (
        f"Distance from the wanted position in one of {len(rms)} flights (seed {many.of[0]}); rms of the {len(rms)}: "
        f"{np.mean(rms):.2f} cm ({rms.min():.2f} to {rms.max():.2f}). Shaded: the paper's ±{extent:g} cm."
    )
    title = "Hover on visual positions alone" if name == "PTAM-only" else "Hover with the sensor fusion filter"
    return Figure(place, title, svg(draw, 2, 3.6), caption)


def _circle(extent: float) -> Any:
    from matplotlib.patches import Circle

    return Circle((0.0, 0.0), extent, color=BAND, lw=0)


def _why(results: Results) -> Figure:
    rows = (
        ("visual positions alone", trials.WITHOUT),
        ("fused, the same gains", trials.EQUAL),
        ("fused, latency not compensated", trials.UNCOMPENSATED),
        ("fused, 200 ms with spikes", trials.LATE),
        ("fused, 20 commands a second", trials.SELDOM),
        ("fused", trials.WITH),
    )

    def draw(axis: Any) -> None:
        for k, (_, job) in enumerate(reversed(rows)):
            rms = 100.0 * paper.values(results[job], "hover_rms_m")
            axis.plot(rms, np.full(len(rms), k), "o", color=TRUE, ms=4, alpha=0.6)
            axis.plot(np.mean(rms), k, "|", color=ESTIMATED, ms=18, mew=2.0)
        for limit in (9.91, 3.44):
            axis.axvline(limit, color=CLAIM, ls="--", lw=1.2)
        axis.set(
            xlabel="rms [cm]", yticks=range(len(rows)), yticklabels=[name for name, _ in reversed(rows)], xscale="log"
        )
        axis.minorticks_off()
        axis.set(xticks=[2, 3, 5, 10, 20, 30], xticklabels=["2", "3", "5", "10", "20", "30"])

    caption = "Each dot is a seed, the bar their mean; dashed: the paper's 9.91 and 3.44 cm. Emulated localisation."
    return Figure("section 5.1", "What the steadiness comes from", svg(draw, 1, 2.9), caption)


def _trajectories(results: Results) -> Figure:
    logs = {name: results[run].log for name, run in trials.FLOWN.items()}

    def side(axes: Any) -> None:
        for axis, (name, log) in zip(axes, logs.items()):
            _ground(axis)
            axis.plot(log["true_x_m"], log["true_H_m"], color=COLOURS[name], lw=1.3)
            axis.set(xlabel="x [m]", ylabel="height [m]", ylim=(0.0, 1.4), title=f"{name}: {_time(log):.0f} s")

    def above(axes: Any) -> None:
        for axis, (name, log) in zip(axes, logs.items()):
            axis.plot(log["ref_x"], log["ref_y_m"], color=CLAIM, lw=2.5, alpha=0.4, label="wanted")
            axis.plot(log["true_x_m"], log["true_y_m"], color=COLOURS[name], lw=1.0, label="flown")
            axis.set(xlabel="x [m]", ylabel="y [m]", ylim=(0.6, -0.4))
        axes[0].legend()

    caption = (
        "One flight each of the first place, from the side and from above: PTAM-only, fused, fused and fast. The paper's "
        "took 57, 47 and 18 s."
    )
    return Figure("figure 10", "Trajectories of landings", svg(side, 3, 2.7) + svg(above, 3, 2.7), caption)


def _ground(axis: Any) -> None:
    """The paper's box where it stands in the first place, seen from the side."""
    axis.fill_between([2.1 - 0.36, 2.1 + 0.36], 0.0, 0.14, color=OTHER, alpha=0.5, lw=0)


def _time(log: FlightLog) -> float:
    """[s] from take-off to touchdown; NaN without either."""
    flying = np.flatnonzero(log["mode"] == "take_off")
    touch = log.touchdown
    return float("nan") if touch is None or not len(flying) else touch.t - float(log["t_s"][flying[0]])


def _heights(results: Results) -> Figure:
    def draw(axis: Any) -> None:
        for k, job in enumerate(trials.DETECTED):
            found: trials.Heights = results[job]
            if len(found.t):
                since = found.t - found.t[0]
                axis.plot(
                    since,
                    100.0 * found.height,
                    "o",
                    ms=3,
                    alpha=0.7,
                    label=f"seed {job.seed}",
                    color=(TRUE, ESTIMATED, OTHER)[k],
                )
                axis.plot(
                    found.agreed_at - found.t[0], 100.0 * found.agreed, "*", ms=11, color=(TRUE, ESTIMATED, OTHER)[k]
                )
        axis.axhline(100.0 * found.true, color=CLAIM, ls="--", lw=1.2, label="true")
        axis.set(xlabel="time since the first way point [s]", ylabel="height [cm]")
        axis.legend(ncols=4)

    caption = (
        "Height of the platform in every image that gave a way point, rendered images; the star is the mean that the pool "
        "had when it agreed."
    )
    return Figure("figure 11", "Estimated height of the landing platform", svg(draw, 1, 2.9), caption)


def _landings(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        sets: Sequence[tuple[str, tuple[trials.Flights, ...]]] = (
            ("PTAM-only", trials.SLOW_UNFUSED),
            ("fused", trials.SLOW),
            ("fused, fast", trials.FAST),
        )
        for name, jobs in sets:
            flights = [flight for job in jobs for flight in results[job]]
            miss = np.sort(100.0 * np.nan_to_num(paper.values(flights, "miss_m"), nan=np.inf))
            axes[0].step(miss, np.arange(1, len(miss) + 1) / len(miss), where="post", color=COLOURS[name], label=name)
            took = paper.values(flights, "flight_s")
            axes[1].plot(
                took, 100.0 * paper.values(flights, "cross_track_rms_m"), "o", ms=4, alpha=0.7, color=COLOURS[name]
            )
        axes[0].axvline(100.0 * paper.MISS, color=CLAIM, ls="--", lw=1.2)
        axes[0].set(xlabel="miss of the middle [cm]", ylabel="share of flights", xlim=(0, 25), ylim=(0, 1))
        axes[0].legend(loc="lower right")
        axes[1].set(xlabel="flight time [s]", ylabel="beside the way, rms [cm]", xlim=(0, None), ylim=(0, None))

    count = sum(len(job.of) for job in trials.SLOW)
    caption = f"{count} landings of each kind on three places, seeds that nothing was tuned on. Dashed: 8 cm."
    return Figure("section 5.2", "Landings", svg(draw, 2), caption)
