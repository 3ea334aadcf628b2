"""Recordings for the rerun viewer; the stage they play on is stage.py. rerun is imported only when it is used.

What is seen: the runway, the true and the estimated path and the aircraft with its camera in 3-D; the camera image with
windows, measured and predicted edges; every error with its 3-sigma band; commands; flight phases and events.
Positions are in R, local to the threshold: the viewer's float32 would lose them in geocentric coordinates.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.record import overlay, shapes
from landing_sim.record.channels import ERRORS, RANGING, SERIES, events
from landing_sim.record.log import FlightLog
from landing_sim.record.poses import poses
from landing_sim.record.sights import record_sights
from landing_sim.record.stage import (
    ESTIMATE_COLOUR,
    IMAGE,
    TIMELINE,
    TRUE_COLOUR,
    Scene,
    blueprint,
    draw,
    mesh,
    rerun,
)
from landing_sim.record.viewer import ReplayError, open_viewer, start_live_viewer
from landing_sim.signals import Estimate, Measurement, Residuals, Step

if TYPE_CHECKING:
    import rerun as rr

__all__ = ["Recorder", "ReplayError", "Scene", "events", "open_viewer", "record_log"]

OTHER_COLOUR = (120, 150, 255)
TOGETHER = 256  # images sent at once
FEATURES, STATUSES = overlay.packed(overlay.FEATURE_COLOURS), overlay.packed(overlay.STATUS_COLOURS)


@dataclass(frozen=True, slots=True)
class _Shot:
    """An image and what is drawn over it, until it is sent."""

    t: float  # [s]
    jpeg: bytes
    estimate: Estimate  # of the time when it was exposed
    angles: tuple[float, float]  # [rad] what the platform's encoders said then: pan, tilt
    edges: Measurement | None
    residuals: Residuals | None


class Recorder:
    """Writes one recording: `add` each step as it is flown, then `close` with the finished log.

    Parameters
    ----------
    path : the .rrd file
    frames_hz : camera images a second; 0 = none. An image is rendered only if it is recorded.
    live : also show the flight in a viewer while it lasts

    Raises ReplayError if the file cannot be written, or if there is no viewer for a live view.
    """

    def __init__(self, path: Path, scene: Scene, frames_hz: float = 8.0, live: bool = False) -> None:
        rr = rerun()
        self._scene = scene
        self._period = 1.0 / frames_hz if frames_hz > 0.0 else np.inf
        self._next_frame = -np.inf
        self._live = live
        self._past: deque[Estimate] = deque(maxlen=64)
        self._shots: list[_Shot] = []
        self._stream = rr.RecordingStream("landing-sim", recording_id=path.stem)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            if live:
                sinks = rr.GrpcSink(start_live_viewer()), rr.FileSink(str(path))
                self._stream.set_sinks(*sinks, default_blueprint=blueprint(scene))
            else:
                self._stream.save(path, default_blueprint=blueprint(scene))
        except ReplayError:
            raise
        except Exception as error:
            raise ReplayError(f"cannot record to {path}: {error}") from error
        self._stream.send_recording_name(scene.title)
        draw(self._stream, scene)

    def add(self, step: Step) -> None:
        """The camera image of this step, if it is time for one, with what was seen in it."""
        self._past.append(step.estimate)
        image = overlay.camera_sample(step.samples)
        if image is None or step.truth.t < self._next_frame - 1e-9:
            return
        exposed, sample = image
        # from when it was due, not from when an image came: the rate is kept on average
        due = self._next_frame if self._next_frame > step.truth.t - self._period else step.truth.t
        self._next_frame = due + self._period
        past = reversed(self._past)  # an image may be old when it arrives
        then = next((estimate for estimate in past if estimate.t <= exposed + 1e-9), self._past[0])
        edges = next((m for m in step.measurements if m.geometry is not None), None)
        jpeg, angles = _jpeg(sample.frame.full()), (sample.pan, sample.tilt)
        self._shots.append(_Shot(step.truth.t, jpeg, then, angles, edges, step.residuals))
        if self._live or len(self._shots) == TOGETHER:
            self._send()
        if self._live:
            self._follow(step)

    def close(self, log: FlightLog, other: FlightLog | None = None) -> None:
        """Everything that does not need pixels, from the log; then the file is complete.

        other : another flight to be seen beside this one: its path, its aircraft as a ghost, its series
        """
        self._send()
        record_log(self._stream, log)
        record_sights(self._stream, log)
        if other is not None:
            body = shapes.aircraft(self._scene.span, self._scene.fuselage)
            self._stream.log("world/other/body", mesh(body, OTHER_COLOUR), static=True)
            record_other(self._stream, other)
        self._stream.flush()
        self._stream.disconnect()

    def _send(self) -> None:
        """Images and what is drawn over them, in columns: a call a column costs as much as a call an image."""
        shots, self._shots = self._shots, []
        rr = rerun()

        def send(entity: str, which: Sequence[_Shot], columns: Any) -> None:
            self._stream.send_columns(
                entity, [rr.TimeColumn(TIMELINE, duration=np.array([s.t for s in which]))], columns
            )

        def strips(entity: str, which: Sequence[_Shot], counts: Any, ends: np.ndarray, **colours: np.ndarray) -> None:
            columns = rr.LineStrips2D.columns(strips=ends.astype(np.float32), **colours)
            send(f"{IMAGE}/{entity}", which, columns.partition(counts))

        if shots:
            send(IMAGE, shots, rr.EncodedImage.columns(blob=[s.jpeg for s in shots]))
        known = [s for s in shots if s.estimate.valid]
        if known:
            camera = self._scene.camera
            lines, drawn = overlay.predicted_edges([s.estimate for s in known], [s.angles for s in known], camera)
            strips("predicted", known, drawn, lines.ends, colors=FEATURES[lines.feature])
        looked = [(s, s.edges, s.edges.geometry) for s in shots if s.edges is not None and s.edges.geometry is not None]
        if looked:
            which, counts = [s for s, _, _ in looked], [len(edges.z) for _, edges, _ in looked]
            windows, z = overlay.joined([g for _, _, g in looked]), np.concatenate([edges.z for _, edges, _ in looked])
            judged = np.concatenate([
                s.residuals.status if s.residuals is not None and len(s.residuals.status) == len(g.status) else g.status
                for s, _, g in looked
            ])  # fmt: skip
            strips("windows", which, counts, overlay.window_boxes(windows), colors=STATUSES[judged])
            image = np.repeat(np.arange(len(which)), counts)[overlay.found(windows, z)]
            found = np.bincount(image, minlength=len(which))
            strips("measured", which, found, overlay.measured_edges(windows, z).ends)

    def _follow(self, step: Step) -> None:
        rr, truth, stream = rerun(), step.truth, self._stream
        stream.log("world/aircraft", rr.Transform3D(translation=truth.p_RB, mat3x3=truth.R_RB))
        stream.log("world/camera", rr.Transform3D(translation=step.camera.p_RC, mat3x3=step.camera.R_CR.T))
        if step.estimate.valid:
            true = {"x": truth.p_RB[0], "y": truth.p_RB[1], "H": -truth.p_RB[2]} | dict(
                zip(("phi", "theta", "psi"), truth.euler)
            )
            for entity, name, _, factor in ERRORS[:6]:
                stream.log(entity, rr.Scalars([factor * (step.estimate[name] - float(true[name]))]))


def record_log(stream: rr.RecordingStream, log: FlightLog) -> None:
    """Paths, poses, series and events of a finished flight into an open recording."""
    rr = rerun()
    t = log["t_s"]

    def times(which: Any) -> list[Any]:
        return [rr.TimeColumn(TIMELINE, duration=t[which])]

    everything = slice(None)
    p = np.column_stack([log["true_x_m"], log["true_y_m"], log["true_z_m"]])
    R_RB = [from_euler(*e) for e in zip(log["true_phi_rad"], log["true_theta_rad"], log["true_psi_rad"])]
    p_camera = np.column_stack([log["true_camera_x_m"], log["true_camera_y_m"], log["true_camera_z_m"]])
    R_CB = [camera_from_body(pan, tilt) for pan, tilt in zip(log["true_pan_rad"], log["true_tilt_rad"])]
    R_RC = np.stack(R_RB) @ np.stack(R_CB).swapaxes(1, 2)
    for entity, position, rotations in (("world/aircraft", p, R_RB), ("world/camera", p_camera, R_RC)):
        stream.send_columns(entity, times(everything), poses(position, rotations))
    stream.log("world/path/true", rr.LineStrips3D([p], colors=TRUE_COLOUR, radii=rr.Radius.ui_points(1.5)), static=True)
    ground = np.column_stack([p[:, :2], np.full(len(p), -0.6)])
    stream.log(
        "world/path/ground",
        rr.LineStrips3D([ground], colors=(20, 30, 20, 120), radii=rr.Radius.ui_points(1.0)),
        static=True,
    )
    known = log["valid"]
    believed = np.column_stack([log.estimate("x"), log.estimate("y"), -log.estimate("H")])[known]
    if len(believed) > 1:
        path = rr.LineStrips3D([believed], colors=ESTIMATE_COLOUR, radii=rr.Radius.ui_points(1.2))
        stream.log("world/path/estimated", path, static=True)
    for entity, name, _, factor in ERRORS:
        error, sigma = factor * log.error(name), factor * log.sigma(name)
        use = np.isfinite(error)
        if use.any():
            band = np.column_stack([error, 3.0 * sigma, -3.0 * sigma])[use]
            stream.send_columns(entity, times(use), rr.Scalars.columns(scalars=band))
    nis_ratio = np.where(log["nis_dof"] > 0, log["nis"] / np.maximum(log["nis_dof"], 1), np.nan)
    derived = {"nis_ratio": nis_ratio, "true_W_m": log.truth("W")}
    if "est_spread" in log:
        derived["range_error"] = log.error("x") / np.minimum(log.truth("x"), -30.0)
    for entity, _, series in SERIES + RANGING * ("est_spread" in log):
        values = np.column_stack([factor * (derived[c] if c in derived else log[c]) for c, _, factor in series])
        some = np.isfinite(values).any(axis=1)
        if some.any():
            stream.send_columns(entity, times(some), rr.Scalars.columns(scalars=values[some]))
    modes = log["mode"]
    changes = np.flatnonzero(np.concatenate([[True], modes[1:] != modes[:-1]]))
    for k in changes:
        stream.set_time(TIMELINE, duration=float(t[k]))
        stream.log("flight/phase", rr.StateChange(state=str(modes[k])))
    for when, text in events(log):
        stream.set_time(TIMELINE, duration=when)
        stream.log("flight/events", rr.TextLog(text, level=rr.TextLogLevel.INFO))


def record_other(stream: rr.RecordingStream, log: FlightLog) -> None:
    """Path, pose and series of a flight that another one is compared with; its series stand beside that one's."""
    rr = rerun()
    times = [rr.TimeColumn(TIMELINE, duration=log["t_s"])]
    p = np.column_stack([log["true_x_m"], log["true_y_m"], log["true_z_m"]])
    R_RB = [from_euler(*e) for e in zip(log["true_phi_rad"], log["true_theta_rad"], log["true_psi_rad"])]
    stream.send_columns("world/other", times, poses(p, R_RB))
    path = rr.LineStrips3D([p], colors=OTHER_COLOUR, radii=rr.Radius.ui_points(1.5))
    stream.log("world/path/other", path, static=True)
    for entity, _, series in SERIES:
        shown = [(column, name, factor) for column, name, factor in series if column.startswith("true_")]
        if shown:
            names = [f"{name}, other" for _, name, _ in shown]
            stream.log(f"{entity}/other", rr.SeriesLines(names=names), static=True)
            values = np.column_stack([factor * log[column] for column, _, factor in shown])
            stream.send_columns(f"{entity}/other", times, rr.Scalars.columns(scalars=values))


def _jpeg(pixels: np.ndarray) -> bytes:
    import cv2

    ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 60])
    if not ok:
        raise ReplayError(f"cannot encode an image of shape {pixels.shape}")
    return bytes(data)
