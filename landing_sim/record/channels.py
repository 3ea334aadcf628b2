"""What a recording plots, and how it is titled, coloured and scaled. Shared by viewers and reports; draws nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from landing_sim.record.log import FlightLog

DEGREES = 57.29577951308232

ERRORS = (  # entity, state, title, factor to the unit shown
    ("errors/x", "x", "range x [m]", 1.0),
    ("errors/y", "y", "lateral y [m]", 1.0),
    ("errors/H", "H", "height H [m]", 1.0),
    ("errors/phi", "phi", "roll [deg]", DEGREES),
    ("errors/theta", "theta", "pitch [deg]", DEGREES),
    ("errors/psi", "psi", "yaw [deg]", DEGREES),
    ("errors/u", "u", "forward speed u [m/s]", 1.0),
    ("errors/wy", "wy", "crosswind [m/s]", 1.0),
)
SERIES = (  # entity, title, ((column, name, factor), ...)
    ("flight/height", "height of the cg [m]", (("true_H_m", "true", 1.0), ("ref_height_m", "reference", 1.0))),
    ("flight/lateral", "lateral offset [m]", (("true_y_m", "true", 1.0), ("ref_y_m", "reference", 1.0))),
    (
        "flight/airspeed",
        "airspeed [m/s]",
        (
            ("true_airspeed_mps", "true", 1.0),
            ("meas_airspeed_mps", "measured", 1.0),
            ("ref_airspeed_mps", "reference", 1.0),
        ),
    ),
    (
        "flight/attitude",
        "attitude [deg]",
        (("true_phi_rad", "roll", DEGREES), ("true_theta_rad", "pitch", DEGREES), ("true_psi_rad", "yaw", DEGREES)),
    ),
    (
        "flight/wind",
        "true wind in R [m/s]",
        (("true_wx_mps", "along", 1.0), ("true_wy_mps", "across", 1.0), ("true_wz_mps", "down", 1.0)),
    ),
    (
        "flight/commands",
        "commands [deg]",
        (
            ("cmd_elevator_rad", "elevator", DEGREES),
            ("cmd_aileron_rad", "aileron", DEGREES),
            ("cmd_rudder_rad", "rudder", DEGREES),
        ),
    ),
    ("flight/throttle", "throttle, brakes", (("cmd_throttle", "throttle", 1.0), ("cmd_brake_left", "brake", 1.0))),
    ("flight/nis", "innovation: NIS per measurement", (("nis_ratio", "NIS", 1.0),)),
)
RANGING = (  # where the runway's size is not known
    (
        "ranging/error",
        "range: error and believed spread [%]",
        (("range_error", "error", 100.0), ("est_spread", "+ 1 sigma", 100.0), ("est_spread", "- 1 sigma", -100.0)),
    ),
    ("ranging/width", "width of the runway [m]", (("est_W_m", "believed", 1.0), ("true_W_m", "true", 1.0))),
    (
        "ranging/observability",
        "observability: d [m/s], how fast nearness shows in the image",
        (("est_d1", "across", 1.0), ("est_d2", "down", 1.0), ("est_dW", "width", 1.0)),
    ),
)
MODE_COLOURS = {
    "acquire": 0x8D99AEFF,
    "hold": 0xB5A7D6FF,
    "capture": 0x4CC9F0FF,
    "glide": 0x4895EFFF,
    "flare": 0xF9A03FFF,
    "decrab": 0xF3722CFF,
    "rollout": 0x43AA8BFF,
    "stopped": 0x577590FF,
    "go_around": 0xE63946FF,
}

SPANS = {
    "errors/x": (-6.0, 6.0),
    "errors/y": (-0.6, 0.6),
    "errors/H": (-0.4, 0.4),
    "errors/phi": (-0.2, 0.2),
    "errors/theta": (-0.2, 0.2),
    "errors/psi": (-0.2, 0.2),
    "errors/u": (-2.0, 2.0),
    "errors/wy": (-2.0, 2.0),
}
"""Spans of the error axes: the transient before the filter has settled would make the rest a flat line."""


def events(log: FlightLog) -> Iterator[tuple[float, str]]:
    """(time [s], what happened), in order."""
    t, x, modes = log["t_s"], log["true_x_m"], log["mode"]
    found: list[tuple[float, str]] = []
    for k in np.flatnonzero(np.concatenate([[True], modes[1:] != modes[:-1]])):
        found.append((float(t[k]), f"phase: {modes[k]} at x = {x[k]:.0f} m, H = {log['true_H_m'][k]:.1f} m"))
    if log["valid"].any():
        first = int(np.argmax(log["valid"]))
        off = abs(log.error("x")[first])
        found.append((float(t[first]), f"runway acquired at x = {x[first]:.0f} m; range off by {off:.1f} m"))
    if "threshold_found" in log and log["threshold_found"].any():
        last = len(t) - 1 - int(np.argmax(log["threshold_found"][::-1]))
        found.append((float(t[last]), f"threshold last seen {-x[last]:.0f} m before it"))
    touchdown = log.touchdown
    if touchdown is not None:
        where = f"x = {touchdown.x:.0f} m, y = {touchdown.y:.2f} m"
        found.append(
            (touchdown.t, f"touchdown at {where}, sink {touchdown.sink_rate:.2f} m/s, {touchdown.airspeed:.1f} m/s")
        )
    yield from sorted(found)
