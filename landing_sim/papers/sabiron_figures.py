"""Figures of Sabiron et al. 2014, redrawn with our simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from landing_sim.estimators.optic_flow.geometry import outputs
from landing_sim.papers import sabiron_2014 as s
from landing_sim.papers.drawing import CLAIM, ESTIMATED, OTHER, TRUE, Figure, svg
from landing_sim.papers.sabiron_flown_figures import figures as flown_figures
from landing_sim.papers.sabiron_trials import OPEN_LOOP, UNITS, Course, Trial

Results = Mapping[Any, Any]
INK = "#1d2433"
SHOWN = (
    (OPEN_LOOP, OTHER, ":", "open-loop linear"),
    ("LPV observer, published gains", ESTIMATED, "-", "LPV, published gains"),
    ("LPV observer, shipped gains", "#b5179e", "--", "LPV, shipped gains"),
    ("EKF", CLAIM, "-.", "EKF"),
)
LIMITS = {2: (0.5, 5.0), 3: (-9.0, 1.0), 4: (-62.0, -10.0), 0: (0.0, 2000.0), 1: (-1.5, 2.5)}


def figures(results: Results) -> list[Figure]:
    """In the paper's order; `results` from Trial to courses."""
    computed = [_states(results), _rest(results), _outputs(results), _errors(results), _noise(results)]
    return [*computed, *flown_figures(results)]


def _first(results: Results, trial: Trial) -> Course:
    course: Course = results[trial][0]
    return course


def _panel(axis: Any, results: Results, state: int, title: str) -> None:
    course = _first(results, s.SHIPPED_GAINS)
    for name, colour, style, label in SHOWN:
        other = _first(results, s.CLEAN[name])
        axis.plot(other.t, other.X_hat[:, state] * UNITS[state], style, color=colour, lw=1.3, label=label)
    axis.plot(course.t, course.X_ref[:, state] * UNITS[state], "--", color=INK, lw=1.1, label="reference")
    axis.plot(course.t, course.X[:, state] * UNITS[state], color=TRUE, lw=1.8, label="true", zorder=1.5)
    axis.set(xlabel="time [s]", title=title, ylim=LIMITS[state])


def _states(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for axis, state, title in zip(axes, (2, 3, 4), ("ωx [°/s]", "ωz [°/s]", "θ [°]")):
            _panel(axis, results, state, title)
        axes[0].legend(fontsize=7.5)

    caption = (
        "Perfect flows, the published deviations. The LPV observers follow the truth, which leaves the reference, until "
        "the linear model has had its day (about 20 s here); the EKF linearises where it is."
    )
    return Figure("figure 3", "Ventral flow, expansion flow and pitch", svg(draw, 3, 3.5), caption)


def _rest(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for axis, state, title in zip(axes, (0, 1), ("h [m]", "q [°/s]")):
            _panel(axis, results, state, title)
        axes[0].legend(fontsize=7.5)

    caption = "Height is what flow sees least of: it enters only through the known acceleration over it."
    return Figure("figure 4", "Height and pitch rate", svg(draw, 2, 3.3), caption)


def _outputs(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for i, axis in enumerate(axes):
            for name, colour, style, label in SHOWN:
                c = _first(results, s.CLEAN[name])
                y = np.degrees([outputs(X)[i] for X in c.X_hat[::10]])
                axis.plot(c.t[::10], y, style, color=colour, lw=1.3, label=label)
            c = _first(results, s.SHIPPED_GAINS)
            axis.plot(
                c.t[::10],
                np.degrees([outputs(X)[i] for X in c.X_ref[::10]]),
                "--",
                color=INK,
                lw=1.1,
                label="reference",
            )
            axis.plot(
                c.t[::10], np.degrees([outputs(X)[i] for X in c.X[::10]]), color=TRUE, lw=1.8, label="true", zorder=1.5
            )
            axis.set(xlabel="time [s]", title=f"Y{i + 1} [°/s]", ylim=((-6, 6), (-2, 10), (-6, 1))[i])
        axes[1].legend(fontsize=7.5, loc="upper left")

    caption = "The outputs (8) that belong to the estimates, beside the true ones."
    return Figure("figure 4, outputs", "Outputs of the observer", svg(draw, 3, 3.1), caption)


def _errors(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for axis, state, title, span in zip(
            axes, (2, 3, 4), ("ωx error [°/s]", "ωz error [°/s]", "θ error [°]"), (0.15, 0.6, 5.0)
        ):
            for name, colour, style, label in SHOWN:
                c = _first(results, s.CLEAN[name])
                axis.plot(c.t, c.error[:, state], style, color=colour, lw=1.3, label=label)
            axis.set(xlabel="time [s]", title=title, ylim=(-span, span))
        axes[0].legend(fontsize=7.5)

    return Figure("section V", "Errors with perfect flows", svg(draw, 3, 3.1), "Estimate minus truth.")


def _noise(results: Results) -> Figure:
    names = list(s.NOISY)

    def draw(axes: Any) -> None:
        for axis, state, title in zip(axes, (0, 3, 4), ("h [m]", "ωz [°/s]", "θ [°]")):
            for i, (name, colour) in enumerate(zip(names, (ESTIMATED, "#b5179e", CLAIM, TRUE))):
                values = [course.rms(5.0, 20.0)[state] for course in results[s.NOISY[name]]]
                axis.plot([i] * len(values), values, "o", color=colour, ms=5, alpha=0.7)
            labels = ["LPV\npublished", "LPV\nshipped", "EKF", "UKF"]
            axis.set(yscale="log", title=title, xlim=(-0.6, 3.6))
            axis.set_xticks(range(len(names)), labels, fontsize=7.5)

    caption = "Rms from 5 to 20 s with 0.1 °/s of white noise in each flow, six runs each."
    return Figure("section VI", "The comparison the paper leaves to the future", svg(draw, 3, 3.1), caption)
