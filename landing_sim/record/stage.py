"""The stage of a recording: what stands still in it, how its lines look, and how the viewer lays it out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from landing_sim.record import overlay, shapes
from landing_sim.record.channels import ERRORS, MODE_COLOURS, RANGING, SERIES, SPANS
from landing_sim.record.viewer import ReplayError

if TYPE_CHECKING:
    import rerun as rr

TIMELINE = "time"
SIGHT = 30.0  # [m]
TRUE_COLOUR, ESTIMATE_COLOUR, BAND_COLOUR = (60, 220, 120), (255, 170, 40), (150, 150, 165)
IMAGE = "world/camera/image"


@dataclass(frozen=True, slots=True)
class Scene:
    """What stands still in a recording. The camera is the believed one: predicted edges are the filter's."""

    camera: overlay.BelievedCamera
    width: float  # [m] of the true runway
    length: float
    slope: float = 0.0  # [rad]
    span: float = 15.6  # [m] of the aircraft
    fuselage: float = 11.4
    markings: bool = True
    title: str = "landing-sim"
    start: tuple[float, float, float] = (-950.0, -85.0, -51.0)  # [m] p_RB at t = 0: where the watching eye begins
    ranged: bool = False  # the runway's size is not known on board
    looks: tuple[float, ...] = ()  # [rad] below the body's forward axis, of its optic-flow sensors


def draw(stream: rr.RecordingStream, scene: Scene) -> None:
    """Runway, aircraft and camera, and how lines and series are to look."""
    rr = rerun()
    k = scene.camera.intrinsics
    stream.log("world", rr.ViewCoordinates.FRD, static=True)
    for entity in ("world/aircraft", "world/camera", IMAGE):
        stream.log(entity, rr.TransformAxes3D(0.0), static=True)
    half, length, slope = 0.5 * scene.width, scene.length, scene.slope
    flat = [
        ("grass", shapes.grass(scene.width, length, slope), (118, 148, 96)),
        ("runway", [shapes.rectangle(0.0, length, -half, half, 0.0, slope)], (110, 112, 120)),
    ]
    if scene.markings:
        flat.append(("markings", shapes.markings(scene.width, length, slope, 0.6), (240, 240, 240)))
    for name, polygons, colour in flat:
        stream.log(f"world/{name}", mesh(shapes.polygons(polygons), colour), static=True)
    body = shapes.aircraft(scene.span, scene.fuselage)
    stream.log("world/aircraft/body", mesh(body, (235, 238, 245)), static=True)
    # The viewer's eye keeps a distance that suits the size of what it follows: specks that make it stand back.
    specks = rr.Points3D([(-SIGHT, 0.0, 0.0), (SIGHT, 0.0, 0.0)], radii=0.01, colors=(235, 238, 245))
    stream.log("world/aircraft/sight", specks, static=True)
    pinhole = rr.Pinhole(
        image_from_camera=k.K,
        width=k.width,
        height=k.height,
        camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=60.0,
        color=(255, 255, 255, 90),
    )
    stream.log(IMAGE, pinhole, static=True)
    stream.log(IMAGE, rr.EncodedImage.from_fields(media_type="image/jpeg"), static=True)
    for drawn, order, radius in (("predicted", 10.0, 0.8), ("windows", 20.0, 0.5), ("measured", 30.0, 1.2)):
        stream.log(f"{IMAGE}/{drawn}", rr.LineStrips2D.from_fields(draw_order=order, radii=radius), static=True)
    stream.log(f"{IMAGE}/measured", rr.LineStrips2D.from_fields(colors=(255, 255, 0)), static=True)
    for entity, *_ in ERRORS:
        names = ["error", "+3 sigma", "-3 sigma"]
        style = rr.SeriesLines(colors=[ESTIMATE_COLOUR, BAND_COLOUR, BAND_COLOUR], names=names, widths=[2.0, 1.0, 1.0])
        stream.log(entity, style, static=True)
    for entity, _, series in SERIES + RANGING * scene.ranged:
        stream.log(entity, rr.SeriesLines(names=[name for _, name, _ in series]), static=True)
    labels = list(MODE_COLOURS)
    modes = rr.StateConfiguration(values=labels, labels=labels, colors=[MODE_COLOURS[m] for m in labels])
    stream.log("flight/phase", modes, static=True)


def blueprint(scene: Scene) -> Any:
    """How the viewer lays it all out."""
    import rerun as rr
    import rerun.blueprint as rrb

    from landing_sim.record import sights

    # the whole flight, also where it is longer than the half minute either way that the viewer would show of it
    always = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    whole = rrb.TimeAxis(view_range=always)

    def plot(entity: str, title: str, span: tuple[float, float] | None = None) -> Any:
        axis = None if span is None else rrb.ScalarAxis(range=span)
        return rrb.TimeSeriesView(
            origin=entity, name=title, axis_x=whole, axis_y=axis, plot_legend=rrb.PlotLegend(visible=span is None)
        )

    x, y, z = scene.start
    chase = rrb.Spatial3DView(
        origin="world",
        name="runway, true path (green) and estimated path (orange)",
        background=(150, 178, 205),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(x - 90.0, y - 35.0, z - 24.0),
            look_target=(x, y, z),
            eye_up=(0.0, 0.0, -1.0),
            tracking_entity="world/aircraft/sight",
        ),
    )
    image = rrb.Spatial2DView(origin=IMAGE, name="camera: windows (white), measured (yellow), predicted edges")
    errors = rrb.Grid(
        *(plot(e, title, SPANS.get(e)) for e, _, title, _ in ERRORS), grid_columns=4, name="errors and 3 sigma"
    )
    flight = rrb.Grid(*(plot(e, title) for e, title, _ in SERIES), grid_columns=4, name="flight and commands")
    ranging = rrb.Horizontal(*(plot(e, title) for e, title, _ in RANGING), name="range of an unknown runway")
    phases = rrb.Vertical(
        rrb.StateTimelineView(origin="flight/phase", name="phase"),
        rrb.TextLogView(origin="flight/events", name="events"),
        name="phases and events",
    )
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(chase, image, column_shares=[3, 2]),
            rrb.Tabs(
                *([ranging] * scene.ranged),
                errors,
                flight,
                phases,
                *([sights.views(rrb, scene.looks)] if scene.looks else []),
                active_tab=0,
            ),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def mesh(shape: shapes.Mesh, colour: overlay.Colour) -> Any:
    """A shape as the viewer takes it, with flat faces."""
    vertices, triangles = shape
    return rerun().Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_normals=shapes.normals(shape),
        albedo_factor=colour,
    )


def rerun() -> Any:
    """The package. Raises ReplayError where it is missing."""
    try:
        import rerun as package
    except ImportError as error:
        raise ReplayError(
            f"rerun is missing ({error}): pip install 'rerun-sdk>=0.41,<0.42', or run with --no-record"
        ) from error
    return package
