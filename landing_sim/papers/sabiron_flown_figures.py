"""Figures of the descents over rendered ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from landing_sim.papers import sabiron_flown as flown
from landing_sim.papers.drawing import CLAIM, ESTIMATED, OTHER, TRUE, Figure, svg

Results = Mapping[Any, Any]
DEG = np.degrees(1.0)


def figures(results: Results) -> list[Figure]:
    """`results` from Run to Flown."""
    return [_readings(results), _estimates(results), _closed(results)]


def _readings(results: Results) -> Figure:
    log = results[flown.WATCHED[0]].log

    def draw(axes: Any) -> None:
        for k, (axis, alpha) in enumerate(zip(axes, flown.ANGLES), 1):
            axis.axhspan(-0.5, 0.5, color="#e9ecf2", lw=0, zorder=0)
            axis.plot(
                log["t_s"], DEG * flown.true_flow(log, float(alpha)), color=TRUE, lw=1.6, label="true, flat ground"
            )
            seen = DEG * log[f"meas_flow_{k}_radps"]
            axis.plot(log["t_s"], seen, "o", color=ESTIMATED, ms=3, label="said by the sensor")
            axis.set(xlabel="time [s]", title=f"sensor at {DEG * alpha:.0f}° [°/s]")
        axes[0].legend(fontsize=7.5)

    caption = (
        "Three rows of six photoreceptors over rendered relief, open loop, terrain 1. Below 0.5 °/s (grey) a sensor says "
        "nothing: what the observer lives on is what it gets, when it comes."
    )
    return Figure("figure 4, measured outputs", "What the motion sensors say", svg(draw, 3, 3.1), caption)


def _estimates(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for runs, colour, name in ((flown.WATCHED, ESTIMATED, "LPV"), (flown.WATCHED_EKF, CLAIM, "EKF")):
            for n, run in enumerate(runs):
                log = results[run].log
                t = log["t_s"]
                errors = (
                    log["est_flow_x"] - log["true_flow_x"],
                    log["est_flow_z"] - log["true_flow_z"],
                    log.error("theta"),
                )
                for axis, error in zip(axes, errors):
                    axis.plot(t, DEG * error, color=colour, lw=0.9, alpha=0.8, label=name if n == 0 else None)
        for axis, title, span in zip(axes, ("ωx error [°/s]", "ωz error [°/s]", "θ error [°]"), (0.6, 0.6, 6.0)):
            axis.axhline(0.0, color=OTHER, lw=0.8)
            axis.set(xlabel="time [s]", title=title, ylim=(-span, span))
        axes[0].legend(fontsize=8)

    caption = "Estimate minus truth from the sensors' words alone, six terrains each, the published first guess."
    return Figure("section V, images", "Errors with image-based measurements", svg(draw, 3, 3.1), caption)


def _closed(results: Results) -> Figure:
    def draw(axes: Any) -> None:
        for (name, runs), colour in zip(flown.CLOSED.items(), (CLAIM, ESTIMATED)):
            for n, run in enumerate(runs):
                log = results[run].log
                label = name if n == 0 else None
                shown = log["true_H_m"] > 1.0
                h = log["true_H_m"][shown]
                for axis, values in zip(
                    axes, (log["true_vz_mps"], np.abs(log["true_vx_mps"]), DEG * log["true_theta_rad"])
                ):
                    axis.plot(h, values[shown], color=colour, lw=1.0, alpha=0.8, label=label)
        for axis, title, limit in zip(axes, ("down [m/s]", "along [m/s]", "pitch, nose up [°]"), (2.0, 1.0, None)):
            axis.set(xscale="log", xlabel="height [m]", title=title, xlim=(2000.0, 1.5))
            if limit is not None:
                axis.axhline(limit, color=OTHER, ls="--", lw=1.0)
                axis.set(yscale="log", ylim=(0.01, 100.0))
            else:
                axis.set(ylim=(-30.0, 65.0))
        axes[0].legend(fontsize=8)

    caption = (
        "Guidance and control on estimated flows and pitch alone, gyro and accelerometers dead, over six terrains. Dashed: "
        "what a soft landing allows at the ground (a foot touches with the centre of gravity at 1.6 m)."
    )
    return Figure("section VI, the next step", "The loop closed", svg(draw, 3, 3.3), caption)
