"""Recording of a quadrotor's flight: the place, the paths, the vehicle, what its camera saw and what was made of it.

Features are coloured by the plane they are on and the way point is green, as in Brockers et al. 2012, fig. 4. Positions are
in R; the log brings all but the pictures.
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
from landing_sim.record.stage import BAND_COLOUR, ESTIMATE_COLOUR, TIMELINE, TRUE_COLOUR, mesh, rerun
from landing_sim.record.viewer import ReplayError, start_live_viewer
from landing_sim.types import Array

WANTED_COLOUR, PLACE_COLOUR, FIX_COLOUR = (235, 80, 80), (60, 255, 90), (120, 170, 255)
OTHER_COLOUR = (120, 150, 255)
PLANES = np.array([(150, 150, 150), (70, 130, 255), (200, 70, 255)], np.uint8)
"""Colours of features: on nothing known, on the ground, on something raised."""
IMAGE = "camera/image"
AXES = (("x", "ahead x [m]"), ("y", "right y [m]"), ("H", "height H [m]"))
EVERY = 4  # cycles between two poses
SPAN = (-6.0, 6.0)  # [cm] of the errors' axes


@dataclass(frozen=True, slots=True)
class Place:
    """What stands still: a picture from straight above (n, n) uint8, rows of x, columns of y, of area x from, to, y from,
    to [m]; tops, the corners (4, 3) [m] of every box's top in R; what the flight is called.
    """

    above: np.ndarray
    area: tuple[float, float, float, float]
    tops: tuple[Array, ...]
    title: str


@dataclass(frozen=True, slots=True)
class Sight:
    """What was seen in an image: features uv (n, 2) [px], their places X (n, 3) [m] in R and planes (n,), an index into
    PLANES; way point (2,) [px], None while there is none.
    """

    uv: Array
    X: Array
    plane: np.ndarray
    way_point: Array | None = None


class QuadrotorRecorder:
    """Writes one recording: pictures while it is flown, then `close` with the finished log. Raises ReplayError."""

    def __init__(self, path: Path, place: Place, live: bool = False) -> None:
        rr = rerun()
        self._stream = rr.RecordingStream("landing-sim", recording_id=path.stem)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            if live:
                sinks = rr.GrpcSink(start_live_viewer()), rr.FileSink(str(path))
                self._stream.set_sinks(*sinks, default_blueprint=_blueprint(place))
            else:
                self._stream.save(path, default_blueprint=_blueprint(place))
        except ReplayError:
            raise
        except Exception as error:
            raise ReplayError(f"cannot record to {path}: {error}") from error
        self._stream.send_recording_name(place.title)
        self._draw(place)

    def picture(self, t: float, pixels: np.ndarray, sight: Sight | None = None) -> None:
        """An image (height, width) uint8 taken at t [s], and what was seen in it; None where nothing was."""
        import cv2

        rr, stream = rerun(), self._stream
        ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 85])
        if not ok:
            raise ReplayError(f"cannot encode an image of shape {pixels.shape}")
        stream.set_time(TIMELINE, duration=t)
        stream.log(IMAGE, rr.EncodedImage(contents=bytes(data), media_type="image/jpeg"))
        if sight is None:
            for entity in (f"{IMAGE}/features", f"{IMAGE}/way_point", "world/features"):
                stream.log(entity, rr.Clear(recursive=False))
            return
        colours = PLANES[sight.plane]
        stream.log(f"{IMAGE}/features", rr.Points2D(sight.uv, colors=colours, radii=rr.Radius.ui_points(2.5)))
        stream.log("world/features", rr.Points3D(sight.X, colors=colours, radii=rr.Radius.ui_points(2.0)))
        if sight.way_point is None:
            stream.log(f"{IMAGE}/way_point", rr.Clear(recursive=False))
        else:
            u, v = sight.way_point.tolist()
            r = 0.03 * pixels.shape[1]
            cross = [[(u - r, v), (u + r, v)], [(u, v - r), (u, v + r)]]
            stream.log(
                f"{IMAGE}/way_point", rr.LineStrips2D(cross, colors=PLACE_COLOUR, radii=rr.Radius.ui_points(1.5))
            )

    def close(self, log: FlightLog, other: FlightLog | None = None) -> None:
        """Everything that does not need pixels, and the path of another flight; then the file is complete."""
        _record(self._stream, log)
        if other is not None:
            path = np.column_stack([other["true_x_m"], other["true_y_m"], other["true_z_m"]])
            strip = rerun().LineStrips3D([path], colors=OTHER_COLOUR, radii=rerun().Radius.ui_points(1.5))
            self._stream.log("world/path/other", strip, static=True)
        self._stream.flush()
        self._stream.disconnect()

    def _draw(self, place: Place) -> None:
        rr, stream = rerun(), self._stream
        stream.log("world", rr.ViewCoordinates.FRD, static=True)
        x0, x1, y0, y1 = place.area
        rows, columns = place.above.shape

        def textured(entity: str, corners: Array) -> None:
            """A patch that shows its part of the picture from above."""
            row, column = rows * (corners[:, 0] - x0) / (x1 - x0), columns * (corners[:, 1] - y0) / (y1 - y0)
            i, j = max(0, int(row.min())), max(0, int(column.min()))
            part = place.above[i : math.ceil(row.max()) + 1, j : math.ceil(column.max()) + 1]
            uv = np.stack([(column - j) / part.shape[1], (row - i) / part.shape[0]], axis=1)
            stream.log(
                entity,
                rr.Mesh3D(
                    vertex_positions=corners.astype(np.float32),
                    triangle_indices=np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
                    vertex_texcoords=uv.astype(np.float32),
                    albedo_texture=np.repeat(part[:, :, None], 3, axis=2),
                ),
                static=True,
            )

        textured("world/ground", np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)]))
        for k, top in enumerate(place.tops):
            textured(f"world/box/{k}/top", top)
            foot = top * [1.0, 1.0, 0.0]
            vertices = np.vstack([top, foot]).astype(np.float32)
            around = [(i, (i + 1) % 4) for i in range(4)]
            sides = np.array([t for i, j in around for t in ((i, j, j + 4), (i, j + 4, i + 4))], np.uint32)
            stream.log(f"world/box/{k}/sides", mesh((vertices, sides), (120, 105, 90)), static=True)
        stream.log("world/vehicle/body", mesh(_quadrotor(), (240, 240, 245)), static=True)
        stream.log("world/believed", rr.TransformAxes3D(0.25), static=True)
        for axis, _ in AXES:
            lines = rr.SeriesLines(
                colors=[WANTED_COLOUR, TRUE_COLOUR, ESTIMATE_COLOUR], names=["wanted", "true", "estimated"]
            )
            stream.log(f"position/{axis}", lines, static=True)
            bands = rr.SeriesLines(
                colors=[ESTIMATE_COLOUR, BAND_COLOUR, BAND_COLOUR],
                names=["error", "+3 sigma", "-3 sigma"],
                widths=[2.0, 1.0, 1.0],
            )
            stream.log(f"error/{axis}", bands, static=True)
        dots = rr.SeriesPoints(colors=[FIX_COLOUR], names=["age"], marker_sizes=[2.0])
        stream.log("fixes/age", dots, static=True)
        dots = rr.SeriesPoints(colors=[PLACE_COLOUR], names=["height"], marker_sizes=[3.0])
        stream.log("place/height", dots, static=True)


def _record(stream: Any, log: FlightLog) -> None:
    rr, t = rerun(), log["t_s"]

    def times(which: Any) -> list[Any]:
        return [rr.TimeColumn(TIMELINE, duration=t[which])]

    def line(entity: str, points: Array, colour: tuple[int, int, int], radius: float) -> None:
        strip = rr.LineStrips3D([points], colors=colour, radii=rr.Radius.ui_points(radius))
        stream.log(f"world/path/{entity}", strip, static=True)

    p = np.column_stack([log["true_x_m"], log["true_y_m"], log["true_z_m"]])
    some = slice(None, None, EVERY)
    R_RB = [from_euler(*e) for e in zip(log["true_phi_rad"], log["true_theta_rad"], log["true_psi_rad"])][some]
    columns = poses(p[some], R_RB)
    stream.send_columns("world/vehicle", times(some), columns)
    flying = ~np.isin(log["mode"], ("wait", "cut"))
    wanted = np.column_stack([log["ref_x"], log["ref_y_m"], -log["ref_height_m"]])
    believed = np.column_stack([log.estimate("x"), log.estimate("y"), -log.estimate("H")])
    known = np.flatnonzero(np.isfinite(believed).all(axis=1))[some]
    line("true", p, TRUE_COLOUR, 1.8)
    if flying.any():
        line("wanted", wanted[flying], WANTED_COLOUR, 1.0)
    if len(known) > 1:
        line("estimated", believed[known], ESTIMATE_COLOUR, 1.2)
        R_said = [from_euler(*(log.estimate(a)[k] for a in ("phi", "theta", "psi"))) for k in known]
        columns = poses(believed[known], R_said)
        stream.send_columns("world/believed", times(known), columns)
    for i, (axis, _) in enumerate(AXES):
        sign = -1.0 if axis == "H" else 1.0
        asked = np.where(flying, wanted[:, i], np.nan)
        three = sign * np.column_stack([asked, p[:, i], believed[:, i]])
        stream.send_columns(f"position/{axis}", times(some), rr.Scalars.columns(scalars=three[some]))
        error, sigma = 100.0 * log.error(axis), 300.0 * log.sigma(axis)
        off = np.column_stack([error, sigma, -sigma])
        stream.send_columns(f"error/{axis}", times(known), rr.Scalars.columns(scalars=off[known]))
    fixed = np.flatnonzero(np.isfinite(log["fix_t_s"]))
    if len(fixed):
        age = 1000.0 * (t - log["fix_t_s"])[fixed]
        stream.send_columns("fixes/age", times(fixed), rr.Scalars.columns(scalars=age))
    found = np.flatnonzero(np.isfinite(log["place_z_m"]))
    if len(found):
        heights = -100.0 * log["place_z_m"][found]
        stream.send_columns("place/height", times(found), rr.Scalars.columns(scalars=heights))
        at = [float(log[f"place_{a}_m"][found[-1]]) for a in "xyz"]
        mark = [
            [(at[0] - 0.1, at[1], at[2]), (at[0] + 0.1, at[1], at[2])],
            [(at[0], at[1] - 0.1, at[2]), (at[0], at[1] + 0.1, at[2])],
        ]
        stream.set_time(TIMELINE, duration=float(t[found[0]]))
        stream.log("world/way_point", rr.LineStrips3D(mark, colors=PLACE_COLOUR, radii=rr.Radius.ui_points(2.5)))
    _events(stream, log, found)


def _events(stream: Any, log: FlightLog, found: np.ndarray) -> None:
    rr, t, modes = rerun(), log["t_s"], log["mode"]
    said = [
        (float(t[n]), f"{modes[n]} at {log['true_H_m'][n]:.2f} m")
        for n in np.flatnonzero(np.concatenate([[True], modes[1:] != modes[:-1]]))
    ]
    if len(found):
        n = found[0]
        where = (
            f"x {log['place_x_m'][n]:.2f} m, y {log['place_y_m'][n]:+.2f} m, {-100.0 * log['place_z_m'][n]:.1f} cm high"
        )
        said.append((float(t[n]), f"landing place at {where}"))
    touch = log.touchdown
    if touch is not None:
        said.append((touch.t, f"touchdown at x {touch.x:.2f} m, y {touch.y:+.2f} m, {touch.sink_rate:.2f} m/s down"))
    for when, text in sorted(said):
        stream.set_time(TIMELINE, duration=when)
        stream.log("events", rr.TextLog(text))


def _blueprint(place: Place) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    always = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    whole = rrb.TimeAxis(view_range=always)

    def plot(entity: str, name: str, span: tuple[float, float] | None = None) -> Any:
        axis = None if span is None else rrb.ScalarAxis(range=span)
        legend = rrb.PlotLegend(visible=False)  # the colours are those of the paths
        return rrb.TimeSeriesView(origin=entity, name=name, axis_x=whole, axis_y=axis, plot_legend=legend)

    tops = np.vstack([np.zeros((1, 3)), *(top[:, :3] for top in place.tops[:1])])
    middle = 0.5 * (tops.min(axis=0) + tops.max(axis=0))
    target = (float(middle[0]), float(middle[1]), -0.5)
    view = rrb.Spatial3DView(
        origin="world",
        name="true path (green), estimated (orange), wanted (red), features",
        background=(24, 26, 32),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(target[0] - 1.9, target[1] - 1.7, -2.0), look_target=target, eye_up=(0.0, 0.0, -1.0)
        ),
    )
    image = rrb.Spatial2DView(
        origin=IMAGE, name="camera: features on ground (blue), raised (purple); way point (green)"
    )
    positions = rrb.Vertical(*(plot(f"position/{axis}", name) for axis, name in AXES))
    errors = rrb.Vertical(*(plot(f"error/{axis}", f"error {axis} [cm], 3 sigma", SPAN) for axis, _ in AXES))
    rest = [plot("fixes/age", "age of a fix when it comes [ms]"), rrb.TextLogView(origin="events", name="events")]
    if place.tops:
        rest.insert(0, plot("place/height", "height of the landing place [cm]"))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(view, image, column_shares=[3, 2]),
            rrb.Horizontal(positions, errors, rrb.Vertical(*rest), column_shares=[3, 3, 2]),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _quadrotor() -> tuple[np.ndarray, np.ndarray]:
    """A body, four arms with rotor discs, four legs, as large as life, frame B."""
    vertices: list[tuple[float, float, float]] = []
    triangles: list[tuple[int, int, int]] = []

    def slab(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> None:
        start = len(vertices)
        vertices.extend((x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1))
        for a, b, c, d in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)):
            triangles.extend([(start + a, start + b, start + c), (start + a, start + c, start + d)])

    slab(-0.06, 0.06, -0.06, 0.06, -0.03, 0.05)
    slab(-0.21, 0.21, -0.01, 0.01, -0.01, 0.01)
    slab(-0.01, 0.01, -0.21, 0.21, -0.01, 0.01)
    for x, y in ((0.21, 0.0), (0.0, 0.21), (-0.21, 0.0), (0.0, -0.21)):
        start = len(vertices)
        ring = [(x + 0.12 * math.cos(a), y + 0.12 * math.sin(a), -0.03) for a in np.arange(16) * math.pi / 8.0]
        vertices.extend([(x, y, -0.03), *ring])
        triangles.extend((start, start + 1 + k, start + 1 + (k + 1) % 16) for k in range(16))
    for x in (-0.12, 0.12):
        for y in (-0.12, 0.12):
            slab(min(x, 0.4 * x), max(x, 0.4 * x), y - 0.004, y + 0.004, 0.04, 0.05)
            slab(x - 0.006, x + 0.006, y - 0.006, y + 0.006, 0.04, 0.12)
    return np.array(vertices, np.float32), np.array(triangles, np.uint32)
