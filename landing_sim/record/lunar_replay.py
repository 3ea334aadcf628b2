"""Recording of a lunar descent: the terrain, the path, the lander with its sensors' lines of sight, what they saw, what was
made of it. Positions are in R; the log brings all but the pictures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.geometry.so3 import from_euler
from landing_sim.record.log import FlightLog
from landing_sim.record.poses import poses
from landing_sim.record.stage import ESTIMATE_COLOUR, TIMELINE, TRUE_COLOUR, mesh, rerun
from landing_sim.record.viewer import ReplayError, start_live_viewer
from landing_sim.types import Array

SIGHT_COLOURS = ((255, 120, 90), (255, 200, 60), (110, 190, 255), (200, 130, 255))
WANTED_COLOUR, COMMAND_COLOUR = (150, 150, 165), (120, 200, 255)
EVERY = 5  # cycles between two lines of sight
IMAGE = "world/camera/image"


@dataclass(frozen=True, slots=True)
class LunarScene:
    """heights and light (rows of y, columns of x) about the target, `cell` [m]; sensors' directions [rad]; the camera's
    width, height and focal length [px].
    """

    heights: np.ndarray
    light: np.ndarray
    cell: float
    angles: tuple[float, ...]
    camera: tuple[int, int, float]
    title: str


class LunarRecorder:
    """Writes one recording: pictures while it is flown, then `close` with the finished log. Raises ReplayError."""

    def __init__(self, path: Path, scene: LunarScene, live: bool = False) -> None:
        rr = rerun()
        self._scene = scene
        self._stream = rr.RecordingStream("landing-sim", recording_id=path.stem)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            if live:
                sinks = rr.GrpcSink(start_live_viewer()), rr.FileSink(str(path))
                self._stream.set_sinks(*sinks, default_blueprint=_blueprint(scene))
            else:
                self._stream.save(path, default_blueprint=_blueprint(scene))
        except ReplayError:
            raise
        except Exception as error:
            raise ReplayError(f"cannot record to {path}: {error}") from error
        self._stream.send_recording_name(scene.title)
        self._draw()

    def picture(self, t: float, pixels: np.ndarray, p_RC: Array, R_CR: Array) -> None:
        """What the camera sees at t [s]: pixels (height, width) uint8."""
        import cv2

        rr = rerun()
        ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 88])
        if not ok:
            raise ReplayError(f"cannot encode an image of shape {pixels.shape}")
        self._stream.set_time(TIMELINE, duration=t)
        self._stream.log("world/camera", rr.Transform3D(translation=p_RC, mat3x3=R_CR.T))
        self._stream.log(IMAGE, rr.EncodedImage(contents=bytes(data), media_type="image/jpeg"))

    def close(self, log: FlightLog) -> None:
        """Everything that does not need pixels; then the file is complete."""
        _record(self._stream, log, self._scene.angles)
        self._stream.flush()
        self._stream.disconnect()

    def _draw(self) -> None:
        rr, stream, scene = rerun(), self._stream, self._scene
        stream.log("world", rr.ViewCoordinates.FRD, static=True)
        rows, columns = scene.heights.shape
        step = max(1, round(10.0 / scene.cell))
        j, i = np.arange(0, rows, step), np.arange(0, columns, step)
        x, y = (i - 0.5 * columns) * scene.cell, (j - 0.5 * rows) * scene.cell
        X, Y = np.meshgrid(x, y)
        vertices = np.stack([X, Y, -scene.heights[::step, ::step]], axis=-1).reshape(-1, 3).astype(np.float32)
        a = (np.arange(len(j) - 1)[:, None] * len(i) + np.arange(len(i) - 1)).ravel()
        triangles = np.concatenate(
            [np.stack([a, a + 1, a + len(i)], 1), np.stack([a + 1, a + len(i) + 1, a + len(i)], 1)]
        )
        corners = np.stack([np.tile(i / columns, len(j)), np.repeat(j / rows, len(i))], axis=1).astype(np.float32)
        texture = np.clip(115.0 * scene.light**0.8, 0, 255).astype(np.uint8)
        stream.log(
            "world/terrain",
            rr.Mesh3D(
                vertex_positions=vertices,
                triangle_indices=triangles.astype(np.uint32),
                vertex_texcoords=corners,
                albedo_texture=np.repeat(texture[:, :, None], 3, axis=2),
            ),
            static=True,
        )  # fmt: skip
        stream.log("world/lander/body", mesh(_lander(), (225, 215, 190)), static=True)
        width, height, f = scene.camera
        pinhole = rr.Pinhole(
            focal_length=f, width=width, height=height, camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=30.0
        )
        stream.log(IMAGE, pinhole, static=True)
        both = rr.SeriesLines(
            colors=[TRUE_COLOUR, ESTIMATE_COLOUR, WANTED_COLOUR], names=["true", "estimated", "wanted"]
        )
        for entity, _ in STATES:
            stream.log(entity, both, static=True)
        for k in range(len(scene.angles)):
            colour = SIGHT_COLOURS[k % len(SIGHT_COLOURS)]
            stream.log(f"flow/{k + 1}/true", rr.SeriesLines(colors=[TRUE_COLOUR], names=["true"]), static=True)
            dots = rr.SeriesPoints(colors=[colour], names=["seen"], marker_sizes=[3.0])
            stream.log(f"flow/{k + 1}/seen", dots, static=True)
        for name in ("throttle", "attitude"):
            stream.log(f"command/{name}", rr.SeriesLines(colors=[COMMAND_COLOUR], names=[name]), static=True)


STATES = (
    ("state/flow_x", "ventral flow ωx [°/s]"),
    ("state/flow_z", "expansion flow ωz [°/s]"),
    ("state/pitch", "pitch, nose up [°]"),
    ("state/height", "height [m]"),
)


def _record(stream: Any, log: FlightLog, angles: tuple[float, ...]) -> None:
    rr, t, deg = rerun(), log["t_s"], math.degrees(1.0)

    def times(which: Any) -> list[Any]:
        return [rr.TimeColumn(TIMELINE, duration=t[which])]

    p = np.column_stack([log["true_x_m"], log["true_y_m"], log["true_z_m"]])
    R_RB = np.stack([from_euler(*e) for e in zip(log["true_phi_rad"], log["true_theta_rad"], log["true_psi_rad"])])
    stream.send_columns("world/lander", times(slice(None)), poses(p, R_RB))
    stream.log("world/path", rr.LineStrips3D([p], colors=TRUE_COLOUR, radii=rr.Radius.ui_points(1.5)), static=True)
    nothing = np.full(len(t), np.nan)
    states = {
        "state/flow_x": (deg * log["true_flow_x"], deg * log["est_flow_x"], deg * log["ref_flow_x"]),
        "state/flow_z": (deg * log["true_flow_z"], deg * log["est_flow_z"], deg * log["ref_flow_z"]),
        "state/pitch": (deg * log["true_theta_rad"], deg * log["est_theta_rad"], deg * log["ref_theta_ff_rad"]),
        "state/height": (log["true_H_m"], log["est_H_m"], nothing),
    }
    flying = log["true_H_m"] > 3.0  # flows of a lander on its legs are no flows
    for entity, columns in states.items():
        stream.send_columns(entity, times(flying), rr.Scalars.columns(scalars=np.column_stack(columns)[flying]))
    for name, column in (("throttle", "cmd_throttle"), ("attitude", "cmd_elevator_rad")):
        stream.send_columns(f"command/{name}", times(slice(None)), rr.Scalars.columns(scalars=log[column]))
    for k, alpha in enumerate(angles, 1):
        a = alpha - log["true_theta_rad"]  # the paper's pitch is nose down
        true = np.sin(a) ** 2 * log["true_flow_x"] + np.sin(a) * np.cos(a) * log["true_flow_z"] + log["true_q_radps"]
        stream.send_columns(f"flow/{k}/true", times(flying), rr.Scalars.columns(scalars=deg * true[flying]))
        seen = log[f"meas_flow_{k}_radps"]
        some = np.isfinite(seen)
        if some.any():
            stream.send_columns(f"flow/{k}/seen", times(some), rr.Scalars.columns(scalars=deg * seen[some]))
        hits = np.column_stack([log[f"sight_{k}_{axis}_m"] for axis in "xyz"])
        look = np.flatnonzero(np.isfinite(hits).all(axis=1))[::EVERY]
        colour = SIGHT_COLOURS[(k - 1) % len(SIGHT_COLOURS)]
        lines = rr.LineStrips3D.columns(strips=np.stack([p[look], hits[look]], axis=1))
        stream.log(f"world/sight/{k}", rr.LineStrips3D.from_fields(colors=[colour], radii=[-1.5]), static=True)
        stream.send_columns(f"world/sight/{k}", times(look), lines)
    modes = log["mode"]
    for n in np.flatnonzero(np.concatenate([[True], modes[1:] != modes[:-1]])):
        stream.set_time(TIMELINE, duration=float(t[n]))
        stream.log("events", rr.TextLog(f"{modes[n]} at {log['true_H_m'][n]:.1f} m"))
    if log.touchdown is not None:
        stream.set_time(TIMELINE, duration=log.touchdown.t)
        touch = log.touchdown
        stream.log(
            "events", rr.TextLog(f"touchdown: {touch.sink_rate:.2f} m/s down, {touch.groundspeed:.2f} m/s along")
        )


def _blueprint(scene: LunarScene) -> Any:
    import rerun.blueprint as rrb

    view = rrb.Spatial3DView(
        origin="world",
        name="terrain, path, and where the motion sensors look",
        background=(0, 0, 0),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(-2600.0, -1700.0, -1900.0), look_target=(-250.0, 0.0, -700.0), eye_up=(0.0, 0.0, -1.0)
        ),
    )
    image = rrb.Spatial2DView(origin=IMAGE, name="along the middle sensor")
    flows = rrb.Vertical(
        *(
            rrb.TimeSeriesView(origin=f"flow/{k + 1}", name=f"sensor at {math.degrees(a):.0f}°: flow [°/s]")
            for k, a in enumerate(scene.angles)
        )
    )
    states = rrb.Grid(*(rrb.TimeSeriesView(origin=e, name=title) for e, title in STATES), grid_columns=2)
    commands = rrb.Vertical(
        rrb.TimeSeriesView(origin="command", name="commands"), rrb.TextLogView(origin="events", name="events")
    )
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(view, image, column_shares=[3, 2]),
            rrb.Horizontal(flows, states, commands, column_shares=[3, 4, 2]),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _lander() -> tuple[np.ndarray, np.ndarray]:
    """A hexagonal body, an engine bell and three legs, ten times as large as life: it is a speck from where one watches."""
    size = 10.0
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []

    def frustum(top: float, bottom: float, r_top: float, r_bottom: float, x: float = 0.0, y: float = 0.0) -> None:
        """Six flat sides about an axis that leans to (x, y) at the bottom; z down."""
        for k in range(6):
            a, b = math.pi * k / 3.0, math.pi * (k + 1) / 3.0
            corners = [
                (r_top, a, top, 0.0),
                (r_top, b, top, 0.0),
                (r_bottom, b, bottom, 1.0),
                (r_bottom, a, bottom, 1.0),
            ]
            start = len(vertices)
            for r, angle, z, lean in corners:
                vertices.append(
                    [size * (r * math.cos(angle) + lean * x), size * (r * math.sin(angle) + lean * y), size * z]
                )
            triangles.extend([(start, start + 1, start + 2), (start, start + 2, start + 3)])

    frustum(-0.9, -0.9, 0.01, 0.9)
    frustum(-0.9, 0.4, 0.9, 1.1)
    frustum(0.4, 0.9, 0.15, 0.45)
    for angle in (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0):
        frustum(0.2, 1.6, 0.08, 0.15, 1.7 * math.cos(angle), 1.7 * math.sin(angle))
    return np.array(vertices, np.float32), np.array(triangles, np.uint32)
