"""Where to look: windows placed by prediction on the borderlines, the threshold and the horizon, and measured there.

Everything is decided from the believed pose, camera and runway. What cannot be looked at is named with a status, never
left out.

Source     Dickmanns & Schell 1992, section 3: ten windows, measurements dropped at taxiways. Departs: search ranges follow
           the predicted covariance; threshold windows sit on ground free of paint and search along the runway's image.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from landing_sim.records import record
from landing_sim.signals import Frame
from landing_sim.types import Array
from landing_sim.vision import layout as col
from landing_sim.vision.believed import BelievedCamera, RunwayMap
from landing_sim.vision.masks import measure
from landing_sim.vision.placement import place, to_look_at
from landing_sim.vision.prediction import jacobian


@dataclass(frozen=True, slots=True)
class Scheme:
    """How many windows look at what, e.g. "3L3R2T2H"; without the T part no threshold is looked for.

    When the threshold is out of view its windows move to the borderlines, left first.
    """

    left: int = 3
    right: int = 3
    threshold: int = 2
    horizon: int = 2

    @staticmethod
    def parse(text: str) -> Scheme:
        """Raises ValueError for anything but nLnR[nT]nH."""
        match = re.fullmatch(r"(\d{1,3})L(\d{1,3})R(?:(\d{1,3})T)?(\d{1,3})H", text)
        if not match:
            raise ValueError(f"window scheme: expected something like '3L3R2T2H' (T may be left out), not {text!r}")
        return Scheme(*(int(n or 0) for n in match.groups()))

    @property
    def counts(self) -> np.ndarray:
        """(4,) int64 by signals.Feature."""
        return np.array([self.left, self.right, self.threshold, self.horizon], dtype=np.int64)


@dataclass(frozen=True, slots=True)
class SearchConfig:
    """How windows are laid out.

    mask [px] length of the masks, odd; search ranges [px] are `sigmas` times the predicted uncertainty within bounds;
    extra_sigma [px] uncertainty that the covariance does not know of; separation [px] from other edges of the scene;
    clear_of_paint: sigma of the blur between a border's mask and paint (2.5: an edge is pulled by 0.005 px; 0: half a
    pixel, by up to 0.1 px).
    """

    mask: int = 9
    sigmas: float = 3.5
    search_min: int = 4
    search_max: int = 20
    extra_sigma: float = 0.5
    clear_of_paint: float = 2.5
    separation: float = 8.0

    def __post_init__(self) -> None:
        if self.mask < 3 or self.mask % 2 == 0:
            raise ValueError(f"window search: the mask's length must be odd and >= 3 px, not {self.mask}")
        if not 1 <= self.search_min <= self.search_max <= 200:
            raise ValueError(
                f"window search: need 1 <= search_min <= search_max <= 200, got {self.search_min}, {self.search_max}"
            )
        if not (self.sigmas > 0.0 and self.extra_sigma >= 0.0 and self.separation >= 0.0):
            raise ValueError("window search: sigmas must be > 0, extra_sigma and separation >= 0")


@dataclass(frozen=True, slots=True)
class EdgeConfig:
    """When an edge counts as one.

    min_contrast [grey levels], and min_snr times its own standard deviation; doubtful if another edge in the window has
    more than `ambiguity` of it; floor [px] standard deviation of what the model of an edge leaves out.
    """

    min_contrast: float = 4.0
    min_snr: float = 4.0
    ambiguity: float = 0.6
    floor: float = 0.01


@record
class Windows:
    """Windows as placed: rows of F (n, 12) and I (n, 11), see `layout`, all of size width x height [px]."""

    F: Array
    I: np.ndarray
    width: int
    height: int

    @property
    def feature(self) -> np.ndarray:
        return self.I[:, col.FEATURE].copy()

    @property
    def status(self) -> np.ndarray:
        """(n,) int64 Status; FOUND where there is something to look at."""
        return self.I[:, col.STATUS].copy()

    @property
    def centre(self) -> Array:
        """(n, 2) [px] on the predicted line; NaN where not placed."""
        return self.F[:, col.CENTRE : col.CENTRE + 2].copy()

    @property
    def direction(self) -> Array:
        """(n, 2) unit vectors towards the side that is brighter if the runway is brighter than its surroundings."""
        return self.F[:, col.DIRECTION : col.DIRECTION + 2].copy()

    @property
    def half(self) -> np.ndarray:
        """(n,) int64: masks average 2 half + 1 pixels."""
        return self.I[:, col.HALF].copy()

    @property
    def corner(self) -> np.ndarray:
        """(n, 2) int64 u, v of the top-left pixels."""
        return self.I[:, col.CORNER : col.CORNER + 2].copy()


class WindowPlanner:
    """Lays out the windows of a frame and measures them: the believed runway and camera, made ready once."""

    __slots__ = (
        "_frame", "_lens", "_lever", "_mouths", "_noise", "_paint", "_polarity", "_rule", "_runway",
        "camera", "runway",
    )  # fmt: skip

    def __init__(
        self,
        runway: RunwayMap,
        camera: BelievedCamera,
        search: SearchConfig | None = None,
        edges: EdgeConfig | None = None,
    ) -> None:
        s, e, k = search or SearchConfig(), edges or EdgeConfig(), camera.intrinsics
        self.runway, self.camera = runway, camera
        self._lever: Array = np.array(camera.p_BC, dtype=float)
        self._lens: Array = np.array([k.f, k.cx, k.cy], dtype=float)
        self._frame: Array = np.array([k.width, k.height], dtype=float)
        self._runway: Array = runway.row()
        self._paint, self._mouths = runway.border_paint(), runway.mouth_rows()
        self._rule: Array = np.array(
            [s.mask, s.sigmas, s.search_min, s.search_max, s.extra_sigma, s.separation, camera.blur, s.clear_of_paint],
            float,
        )
        sign = 1.0 if runway.brighter else -1.0
        self._polarity: Array = np.array([sign, sign, sign, 1.0])
        self._noise: Array = np.array([camera.blur, camera.noise, e.min_contrast, e.min_snr, e.ambiguity, e.floor])

    def place(self, sight: Array, cov: Array, counts: np.ndarray) -> Windows:
        """sight (9,), cov (9, 9): see `prediction`; counts (4,) int64 windows by Feature."""
        F, I, width, height = place(
            sight,
            cov,
            self._lever,
            self._lens,
            self._frame,
            self._runway,
            self._paint,
            self._mouths,
            counts,
            self._rule,
        )
        return Windows(F, I, width, height)

    def predict(self, feature: np.ndarray, centre: Array, direction: Array, sight: Array) -> tuple[Array, Array]:
        """Displacements h (n,) [px] from the centres, and their derivatives (n, 9) by the sight."""
        return jacobian(  # type: ignore[no-any-return]
            feature, centre, direction, sight, self._lever, self._lens, self.runway.slope
        )

    def measure(self, frame: Frame, windows: Windows) -> tuple[Array, Array, Array, np.ndarray]:
        """z [px] along direction from the centre, variance [px^2], contrast [grey levels], status: all (n,).

        NaN where not found. Windows whose status is not FOUND are not looked at.
        """
        look, corners, looked = to_look_at(windows.I)
        images = frame.windows(corners, windows.width, windows.height, looked)
        return measure(images, look, windows.F, windows.I, self._polarity, self._noise)  # type: ignore[no-any-return]
