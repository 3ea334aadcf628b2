"""The camera's pictures: lazy frames of the runway, rendered where they are looked at, the same pixels always.

A frame keeps the poses it was exposed at, never the plant, so it may be looked at later, recorded, or made again from
its recorded pose, index and key. `exact` frames have each edge where geometry puts it (`render_kernels`); `line_aa` and
`line_8` are OpenCV's own drawing, whose edges lie 0.5-0.7 px outside: controls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.sensors import render_cv2
from landing_sim.sensors.render_kernels import TILE
from landing_sim.sensors.render_lines import edge_table, project
from landing_sim.sensors.render_noise import develop_frame, developed, gaussian_quantiles
from landing_sim.sensors.render_windows import shade_windows
from landing_sim.signals import CameraTruth
from landing_sim.types import Array
from landing_sim.world.runway import GRASS, SKY, Runway

RENDERERS = ("exact", "line_aa", "line_8")
SUB_EXPOSURES = 4  # instants averaged into one frame when the shutter is not instantaneous


@dataclass(frozen=True, slots=True)
class Optics:
    """Lens and sensor. Raises ValueError for values no camera has."""

    blur: float = 0.7  # [px] sigma of the image of a point, the pixel's own aperture included
    noise: float = 4.0  # [grey levels] sigma, independent in every pixel and frame
    gain: float = 1.0  # grey = gain * scene + offset
    offset: float = 0.0
    exposure: float = 0.0  # [s] shutter time, centred on the frame's time stamp
    renderer: str = "exact"

    def __post_init__(self) -> None:
        values = (self.blur, self.noise, self.gain, self.offset, self.exposure)
        if not all(map(math.isfinite, values)) or self.noise < 0.0 or self.gain <= 0.0 or self.exposure < 0.0:
            raise ValueError(f"optics must be finite with noise >= 0, gain > 0, exposure >= 0; got {self}")
        if not 0.3 <= self.blur <= 20.0:
            raise ValueError(f"optical blur must be 0.3..20 px (a pixel's own aperture is 0.3), got {self.blur}")
        if self.renderer not in RENDERERS:
            raise ValueError(f"renderer must be one of {', '.join(RENDERERS)}; got {self.renderer!r}")
        if self.renderer != "exact" and self.exposure > 0.0:
            raise ValueError(f"renderer {self.renderer!r} has no motion blur: set exposure to 0")


@cache
def _edge_table() -> Array:
    return edge_table()


class Renderer:
    """One camera looking at one runway: everything about its pictures that does not change.

    Parameters
    ----------
    intrinsics, runway, optics : the true ones
    key : 64-bit key of the pixel noise, from `Noise.key()`
    """

    __slots__ = (
        "camera",
        "greys",
        "intrinsics",
        "key",
        "lens",
        "material",
        "optics",
        "palette",
        "points",
        "quantiles",
        "table",
        "tiles",
    )

    def __init__(self, intrinsics: Intrinsics, runway: Runway, optics: Optics, key: int) -> None:
        c = intrinsics
        if min(c.width, c.height) < 1 or max(c.width, c.height) > 16384 or not (math.isfinite(c.f) and c.f > 0.0):
            raise ValueError(f"camera needs 1..16384 pixels a side and a positive focal length, got {c}")
        self.intrinsics, self.optics = intrinsics, optics
        self.points, self.material = runway.quads()
        self.palette = runway.greys.palette
        self.camera = np.array([c.f, c.cx, c.cy, c.width, c.height, optics.blur])
        self.lens = np.array([optics.gain, optics.offset, optics.noise])
        self.key = np.uint64(key)
        columns, rows = np.meshgrid(np.arange(0, c.width, TILE[0]), np.arange(0, c.height, TILE[1]))
        self.tiles = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.int64)
        self.table, self.quantiles = _edge_table(), gaussian_quantiles()
        self.greys = developed(tuple(self.palette.tolist()), optics.gain, optics.offset, optics.noise)

    def frame(
        self, p_RC: Array, R_CR: Array, index: int, v_RC_R: Array | None = None, w_RC_C: Array | None = None
    ) -> RenderedFrame:
        """Frame number `index` exposed at a pose.

        v_RC_R (3,) [m/s] and w_RC_C (3,) [rad/s], the camera's own motion, are needed if exposure > 0 and unused if
        not. Raises ValueError for a pose that is not finite, or a missing motion.
        """
        # One sum is finite only if every term is; a dozen floats are added sooner than numpy has begun.
        if not math.isfinite(sum(p_RC.tolist()) + sum(R_CR.ravel().tolist())):
            raise ValueError(f"camera pose is not finite: p_RC {p_RC}, R_CR {R_CR.tolist()}")
        if self.optics.exposure == 0.0:
            return RenderedFrame(self, ((p_RC.copy(), R_CR.copy()),), index)
        if v_RC_R is None or w_RC_C is None:
            raise ValueError("exposure > 0 needs the camera's velocity and angular rate")
        from scipy.spatial.transform import Rotation

        instants = self.optics.exposure * ((np.arange(SUB_EXPOSURES) + 0.5) / SUB_EXPOSURES - 0.5)
        poses = [(p_RC + v_RC_R * dt, Rotation.from_rotvec(-w_RC_C * dt).as_matrix() @ R_CR) for dt in instants]
        return RenderedFrame(self, tuple(poses), index)


class RenderedFrame:
    """An image computed where it is looked at (signals.Frame)."""

    __slots__ = ("_image", "_scene", "height", "index", "poses", "renderer", "width")

    def __init__(self, renderer: Renderer, poses: tuple[tuple[Array, Array], ...], index: int) -> None:
        self.renderer, self.poses, self.index = renderer, poses, index
        self.width, self.height = renderer.intrinsics.width, renderer.intrinsics.height
        self._scene: tuple[Array, np.ndarray, np.ndarray, Array] | None = None
        self._image: np.ndarray | None = None

    def window(self, u0: int, v0: int, width: int, height: int) -> np.ndarray:
        """(height, width) uint8; raises ValueError if the window leaves the frame."""
        return self.windows(np.array([[u0, v0]], dtype=np.int64), width, height)[0]

    def windows(self, corners: np.ndarray, width: int, height: int, looked: np.ndarray | None = None) -> np.ndarray:
        """(n, height, width) uint8 for n corners (n, 2) int64 [u0, v0]; ValueError if one leaves the frame.

        looked (n, 4): see signals.Frame; only these pixels are made.
        """
        n = len(corners)
        if self.renderer.optics.renderer == "exact":
            flat = np.empty((n * height, width), np.uint8)
            inside = self._shade(flat, corners, width, height, looked)
            out = flat.reshape(n, height, width)
        else:
            image = np.lib.stride_tricks.sliding_window_view(self.full(), (height, width))
            u, v = corners.T
            inside = bool(np.all((u >= 0) & (v >= 0) & (u < image.shape[1]) & (v < image.shape[0])))
            out = image[v, u] if inside else image[:0, 0]
        if not inside:
            frame = f"{self.width}x{self.height}"
            raise ValueError(f"windows of {width}x{height} at {corners.tolist()} do not all lie in the {frame} frame")
        return out

    def full(self) -> np.ndarray:
        """(height, width) uint8, the same pixels as the windows. Kept once made; do not write to it."""
        if self._image is None:
            self._image = self._full()
            self._image.flags.writeable = False
        return self._image

    def _full(self) -> np.ndarray:
        r = self.renderer
        if r.optics.renderer == "exact":
            out = np.empty((self.height, self.width), np.uint8)
            self._shade(out, r.tiles, *TILE, whole=True)
            return out
        lines, seen, counts, horizon = self._project()
        count, greys = int(counts[0]), np.rint(r.palette).astype(np.int64)
        image = np.full((self.height, self.width), greys[SKY], dtype=np.uint8)
        render_cv2.paint(
            image,
            lines[0],
            count,
            greys[seen[0, :count, 0]],
            int(greys[GRASS]),
            horizon[0],
            self.poses[0][1],
            r.camera,
            antialias=r.optics.renderer == "line_aa",
        )
        blurred = render_cv2.blur(image, r.optics.blur)
        return develop_frame(blurred, r.lens, r.quantiles, r.key, self.index)  # type: ignore[no-any-return]

    def _shade(
        self,
        out: np.ndarray,
        corners: np.ndarray,
        width: int,
        height: int,
        looked: np.ndarray | None = None,
        whole: bool = False,
    ) -> bool:
        r = self.renderer
        scene = self._project()
        if looked is None:
            looked = np.empty((0, 4), dtype=np.int64)
        return shade_windows(  # type: ignore[no-any-return]
            out, corners, width, height, looked, whole, *scene, r.camera, r.palette, r.lens, r.table, r.quantiles, r.greys,
            r.key, self.index,
        )  # fmt: skip

    def _project(self) -> tuple[Array, np.ndarray, np.ndarray, Array]:
        if self._scene is None:
            r, n = self.renderer, len(self.poses)
            m = len(r.points)
            lines, seen = np.empty((n, m, 4, 4)), np.empty((n, m, 5), np.int64)
            counts, horizon = np.empty(n, np.int64), np.empty((n, 5))
            for k, (p_RC, R_CR) in enumerate(self.poses):
                counts[k] = project(r.points, r.material, p_RC, R_CR, r.camera, lines[k], seen[k], horizon[k])
            self._scene = lines, seen, counts, horizon
        return self._scene


def render_frame(
    pose: CameraTruth,
    intrinsics: Intrinsics,
    runway: Runway | None = None,
    optics: Optics | None = None,
    key: int = 0,
    index: int = 0,
) -> RenderedFrame:
    """A frame on its own, seen from `pose`: for tests, pictures and recordings rendered again."""
    renderer = Renderer(intrinsics, runway or Runway(), optics or Optics(), key)
    return renderer.frame(pose.p_RC, pose.R_CR, index)
