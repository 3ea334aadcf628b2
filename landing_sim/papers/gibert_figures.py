"""Figures 2, 3 and 5 of Gibert et al. 2015 with our curves, and what they leave out, as SVG. Same results, same bytes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from landing_sim.papers import gibert_checks as check
from landing_sim.papers import gibert_trials as g
from landing_sim.papers.courses import settling
from landing_sim.papers.drawing import CLAIM, OTHER, Figure, svg
from landing_sim.papers.gibert_2015 import noise_rms
from landing_sim.papers.gibert_flown_figures import BLACK, BLUE, RED, flown

COLOURS = {
    "Gibert": "#d1495b",
    "Dahl": "#2a6f97",
    "two outputs": "#7b5ea7",
    "EKF": "#3a9d5d",
    "Jankovic": "#e09f3e",
    "Karagiannis": "#6c757d",
    "Chen & Kano": "#9c6644",
    "Dixon": "#17a2a2",
}
Results = Mapping[Any, Any]  # a list of Courses of a trial or a watch, what was Flown of a run


def figures(results: Results) -> list[Figure]:
    """Every figure. Raises KeyError if a result is missing."""
    return [
        _without_noise(results),
        _with_noise(results),
        _speed_and_noise(results),
        *flown(results),
        _landing(results),
        _observability(results),
        _heading(),
    ]


def _without_noise(results: Results) -> Figure:
    first = {name: results[trial][0] for name, trial in g.CLEAN.items()}

    def draw(axes: Any) -> None:
        whole, start = axes
        for axis in axes:
            course = first["Gibert"]
            axis.plot(course.t, course.x[:, 2], color=BLACK, lw=2.2, label="true")
            for name, course in first.items():
                axis.plot(course.t, course.x_hat[:, 2], color=COLOURS[name], lw=1.6, label=name)
            axis.set(xlabel="time [s]", ylabel="range x3 [m]", ylim=(0.9, 3.4))
        whole.set(title="2  the whole run", xlim=(0, 8), ylim=(0.9, 6.0))
        whole.legend(ncols=2)
        start.fill_between(course.t, 0.95 * course.x[:, 2], 1.05 * course.x[:, 2], color=CLAIM, alpha=0.2, lw=0)
        settled = settling(first["Gibert"])
        start.axvline(settled, color=COLOURS["Gibert"], ls=":", lw=1.2)
        start.axvline(1.0, color=CLAIM, ls="--", lw=1.2)
        start.annotate(f"ours {settled:.2f} s", (settled, 1.0), (4, 0), textcoords="offset points", fontsize=8.5)
        start.annotate("paper: 1 s", (1.0, 1.0), (4, 0), textcoords="offset points", fontsize=8.5, color=CLAIM)
        start.set(title="the start; green: within 5 %", xlim=(0, 1.4))

    caption = (
        "Tuned as the paper says, no noise. Gibert's observer settles in 0.56 s, not in 1 s. Chen & Kano's and Dixon's "
        "gains are not known."
    )
    return Figure("figure 2", "Range from a wrong start, no noise", svg(draw, 2, 3.4), caption)


def _with_noise(results: Results) -> Figure:
    shown = ("Karagiannis", "Dixon", "Chen & Kano", "Jankovic", "Dahl", "Gibert")

    def draw(axes: Any) -> None:
        curves, bars = axes
        for name in shown:
            course = results[g.NOISY[name]][0]
            curves.plot(course.t, course.x_hat[:, 2], color=COLOURS[name], lw=1.0, label=name)
        curves.plot(course.t, course.x[:, 2], color=BLACK, lw=1.2, label="true")
        curves.set(
            title="3  every 1 ms, one seed", xlabel="time [s]", ylabel="range x3 [m]", xlim=(0, 8), ylim=(0.5, 8.0)
        )
        curves.legend(ncols=2, loc="upper left")
        order = sorted(g.NOISY, key=lambda name: noise_rms(results[g.NOISY[name]]), reverse=True)
        for i, name in enumerate(order):
            fine, coarse = (noise_rms(results[trials[name]]) for trials in (g.NOISY, g.NOISY_10))
            bars.plot([fine, coarse], [i, i], color=COLOURS[name], lw=1.2, alpha=0.5)
            bars.plot(fine, i, "o", color=COLOURS[name], ms=7)
            bars.plot(coarse, i, "o", mfc="white", color=COLOURS[name], ms=7)
            bars.annotate(f"{fine:.2g}", (fine, i), (0, 7), textcoords="offset points", fontsize=8, ha="center")
        bars.set_yticks(range(len(order)), order)
        bars.set(
            xscale="log",
            xlabel="rms error from 3 to 8 s [m]",
            title=f"median of {g.SEEDS} seeds: ● 1 ms, ○ 10 ms",
            ylim=(-0.6, len(order) - 0.3),
        )

    caption = (
        "1 % noise, all at Gibert's speed but Chen & Kano, Dixon and the EKF. Karagiannis & Astolfi's range is the inverse "
        "of a nearness that the noise reaches directly: it spikes. Two outputs, Jankovic & Ghosh and EKF are not in the "
        "paper's comparison."
    )
    return Figure("figure 3", "The same with 1 % noise", svg(draw, 2, 3.7), caption)


def _speed_and_noise(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for name in g.SLOWER:
            pairs = [
                (settling(results[clean[name]][0]), noise_rms(results[noisy[name]]))
                for clean, noisy in ((g.CLEAN_EQUAL, g.NOISY), (g.CLEAN_SLOWER, g.NOISY_SLOWER))
            ]
            axes.plot(*zip(*pairs), "o-", color=COLOURS[name], label=name)
        axes.set(
            yscale="log",
            xlabel="settles to 5 % after [s], no noise",
            ylabel="rms error with noise [m]",
            xlim=(0.45, 1.15),
        )
        axes.legend(ncols=2)

    caption = (
        "Whoever is allowed 1 s instead of 0.56 s has a third of the noise; who is ahead stays ahead. A tuning chooses a "
        "place on its line, so observers compare only at equal speed."
    )
    return Figure("section 4.1", "Speed is paid for in noise", svg(draw, 1, 2.9), caption)


def _landing(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for i, (axis, name) in enumerate(zip(axes, ("x1, right", "x2, down", "x3, ahead"))):
            for jobs, style, width in ((g.RAW_NOISY, ":", 1.2), (g.BOTH, "-", 1.5)):
                for job, colour, share in zip(jobs, (BLUE, RED), ("−50 %", "+50 %")):
                    c = results[job][0]
                    told = f"{'one output' if style == ':' else 'two outputs'}, {share}"
                    axis.plot(c.t, c.x_hat[:, i], style, color=colour, lw=width, label=told)
            c = results[g.BOTH[0]][0]
            axis.plot(c.t, c.x[:, i], color=BLACK, lw=1.2, label="true")
            low, high = float(c.x[:, i].min()), float(c.x[:, i].max())
            spread = high - low
            axis.set(xlabel="time [s]", title=f"{name} [m]", ylim=(low - 0.35 * spread, high + 0.65 * spread))
            axis.axvspan(30.0, c.t[-1], color="#e9ecf2", lw=0, zorder=0)
        axes[2].legend(fontsize=7.5)
        axes[0].annotate(
            "on the glide path", (31.0, axes[0].get_ylim()[0]), (0, 5), textcoords="offset points", fontsize=8.5
        )

    caption = (
        "A point mass guided by truth: the aim point from 5 km, 300 m beside and 50 m above, half a pixel of noise. "
        "Dotted: the paper's observer, which divides by d1 and breaks on the glide path. Full: both outputs weighed, dead "
        "reckoning where neither moves."
    )
    return Figure("figure 5 without pixels", "The approach computed, not flown", svg(draw, 3, 3.5), caption)


def _observability(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        moving, error = axes
        c = results[g.BOTH[0]][0]
        moving.plot(c.t, c.d[:, 0], color=COLOURS["Gibert"], label="d1 = b1 − b3 y1")
        moving.plot(c.t, c.d[:, 1], color=COLOURS["Dahl"], label="d2 = b2 − b3 y2")
        moving.axhline(0.0, color=OTHER, lw=1)
        moving.axvspan(30.0, c.t[-1], color="#e9ecf2", lw=0, zorder=0)
        moving.set(
            xlabel="time [s]", ylabel="[m/s]", title="what makes the aim point move in the image", ylim=(-12, 26)
        )
        moving.legend()
        shown = (
            (g.RAW_NOISY[1], COLOURS["Gibert"], ":", "one output, as published"),
            (g.BOTH[1], COLOURS["two outputs"], "-", "two outputs"),
            (g.EKF[1], COLOURS["EKF"], "-", "EKF"),
            (g.AIM_ON_GLIDE, COLOURS["two outputs"], "--", "on the glide path throughout: two outputs"),
            (g.WIDTH_ON_GLIDE[1], COLOURS["EKF"], "--", "on the glide path throughout: EKF with width"),
        )
        for job, colour, style, told in shown:
            c = results[job][0]
            error.plot(c.t, 100.0 * c.relative, style, color=colour, lw=1.4, label=told)
        error.set(xlabel="time [s]", ylabel="range error [%]", title="first range + 50 %", ylim=(-100, 120))
        error.legend(fontsize=8, loc="lower right")

    caption = (
        "Grey: on the glide path, where the aircraft flies straight at the aim point. There it stands still in the image, "
        "whoever looks; the runway's growing angular width is what is left."
    )
    return Figure("section 4.2", "What can be seen, and when", svg(draw, 2, 3.4), caption)


def _heading() -> Figure:
    rolls = np.linspace(-35.0, 35.0, 71)
    theta, heading = math.radians(5.0), math.radians(-3.0)

    def draw(axes: Any) -> None:
        for reading, colour in zip(range(3), ("#3a9d5d", "#e09f3e", "#d1495b")):
            found = []
            for roll in np.radians(rolls):
                d_F = check.feature(reading, float(roll), theta, heading)
                found.append(math.degrees(check.runway_heading(d_F, float(roll), theta)))
            axes.plot(rolls, found, color=colour, label=f"d_F {check.READINGS[reading]}")
        axes.axhline(3.0, color=BLACK, lw=1, ls="--", label="true: 3°")
        axes.set(xlabel="roll [deg]", ylabel="Δψ by (19) [deg]", ylim=(-1.0, 9.0))
        axes.legend(loc="upper center", ncols=2)

    caption = "Pitch 5°. Equation (19) is exact for one reading of figure 6's words, and for that at any roll."
    return Figure("figure 6", "Three readings of d_F", svg(draw, 1, 2.9), caption)
