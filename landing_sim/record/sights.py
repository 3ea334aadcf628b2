"""Motion sensors in logs and recordings of aircraft: where each looks on the ground, and the flow that it saw.

meas_flow_1_radps  the latest flow of a cycle, NaN where there was none      sight_1_x_m, _y_m, _z_m  where it looks, in R
true_flow_1_radps  what it is by geometry: signals of the row's middle, over level ground
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from landing_sim.geometry.so3 import from_euler
from landing_sim.record.log import FlightLog
from landing_sim.record.stage import TIMELINE, TRUE_COLOUR, rerun
from landing_sim.signals import Step
from landing_sim.types import Array

COLOURS = ((255, 99, 71), (255, 215, 0), (64, 224, 208), (238, 130, 238))
LOWEST = 20.0  # [m] of the cg: flows below run off every scale


class Sights:
    """Takes down what the sensors flow_1 ... say, each step; `into` puts it into the finished log.

    angles : (n,) [rad] below the body's forward axis, where they truly look
    """

    def __init__(self, angles: Sequence[float]) -> None:
        self._angles = tuple(angles)
        self._names = [f"flow_{i + 1}" for i in range(len(angles))]
        self._rows: list[list[tuple[float, float, float, float]]] = []

    def add(self, step: Step) -> None:
        said = {s.sensor: s.data for s in step.samples if s.sensor in self._names}
        nothing = (math.nan,) * 4
        row = []
        for name in self._names:
            seen = said.get(name)
            row.append(nothing if seen is None else (seen.flows[-1] if seen.flows else math.nan, *seen.hit))
        self._rows.append(row)

    def into(self, log: FlightLog) -> None:
        columns = log.columns
        assert isinstance(columns, dict)
        told = np.array(self._rows).reshape(len(self._rows), len(self._names), 4)
        for i, name in enumerate(self._names):
            columns[f"meas_{name}_radps"] = told[:, i, 0]
            for k, axis in enumerate("xyz"):
                columns[f"sight_{i + 1}_{axis}_m"] = told[:, i, 1 + k]
            columns[f"true_{name}_radps"] = _true(log, self._angles[i])


def _true(log: FlightLog, alpha: float) -> Array:
    """(n,) [rad/s] q + (u sin a - w cos a) d_z / H along d = (cos a, 0, sin a) of the body; NaN near the ground."""
    sa, ca = math.sin(alpha), math.cos(alpha)
    sth, cth, cph = np.sin(log["true_theta_rad"]), np.cos(log["true_theta_rad"]), np.cos(log["true_phi_rad"])
    H = np.where(log["true_H_m"] > LOWEST, log["true_H_m"], np.nan)
    flow = (log["true_u_mps"] * sa - log["true_w_mps"] * ca) * (cth * cph * sa - sth * ca) / H
    return np.asarray(log["true_q_radps"] + flow)


def entities(log: FlightLog) -> list[int]:
    """Numbers, from 1, of the sensors that a log knows."""
    return [k for k in range(1, 9) if f"meas_flow_{k}_radps" in log]


def record_sights(stream: Any, log: FlightLog) -> None:
    """Lines of sight on the ground and signals, into an open recording; nothing of a flight without such sensors."""
    known = entities(log)
    if not known:
        return
    rr, t, degrees = rerun(), log["t_s"], math.degrees(1.0)
    p = np.column_stack([log["true_x_m"], log["true_y_m"], log["true_z_m"]])
    R_RB = [from_euler(*e) for e in zip(log["true_phi_rad"], log["true_theta_rad"], log["true_psi_rad"])]
    for k in known:
        colour, name = COLOURS[(k - 1) % len(COLOURS)], f"flow/{k}"
        hit = np.column_stack([log[f"sight_{k}_{axis}_m"] for axis in "xyz"])
        looks = np.isfinite(hit).all(axis=1)
        # drawn in the body's frame, under the aircraft's own transform
        ends = np.array([R.T @ (h - at) for R, h, at in zip(R_RB, hit, p)])[looks]
        strips = np.stack([np.zeros_like(ends), ends], axis=1).astype(np.float32)
        entity = f"world/aircraft/looks/{k}"
        if looks.any():
            stream.log(entity, rr.LineStrips3D.from_fields(colors=colour, radii=rr.Radius.ui_points(1.0)), static=True)
            times = [rr.TimeColumn(TIMELINE, duration=t[looks])]
            stream.send_columns(entity, times, rr.LineStrips3D.columns(strips=strips))
        stream.log(f"{name}/true", rr.SeriesLines(colors=[TRUE_COLOUR], names=["true"]), static=True)
        dots = rr.SeriesPoints(colors=[colour], names=["seen"], marker_sizes=[3.0])
        stream.log(f"{name}/seen", dots, static=True)
        for word, column in (("true", f"true_flow_{k}_radps"), ("seen", f"meas_flow_{k}_radps")):
            values = degrees * log[column]
            some = np.isfinite(values)
            if some.any():
                times = [rr.TimeColumn(TIMELINE, duration=t[some])]
                stream.send_columns(f"{name}/{word}", times, rr.Scalars.columns(scalars=values[some]))


def views(rrb: Any, angles: Sequence[float]) -> Any:
    """A tab of the blueprint, made with the package `rrb`: a plot a sensor, looking at angles (n,) [rad]."""
    plots = (
        rrb.TimeSeriesView(origin=f"flow/{k}", name=f"sensor {math.degrees(a):.0f}° down: flow [°/s]")
        for k, a in enumerate(angles, 1)
    )
    return rrb.Horizontal(*plots, name="optic flow")
