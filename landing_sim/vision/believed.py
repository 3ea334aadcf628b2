"""What the onboard side believes about the runway and its camera. Truth may differ; nothing here is read from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.signals import Feature
from landing_sim.types import Array

# Aiming points and touchdown zones of both directions of a 29 m x 1680 m runway, mark pairs as one box: ICAO Annex 14,
# vol. I, 5.2.5 and 5.2.6, with the lateral positions moved inwards to leave 3 m to the edges.
AIMING_AND_TOUCHDOWN = tuple(
    (x0, x0 + dx, -outer, outer)
    for x, dx, outer in ((150.0, 22.5, 8.5), (300.0, 45.0, 11.5), (450.0, 22.5, 8.5), (600.0, 22.5, 8.5))
    for x0 in (x, 1680.0 - dx - x)
)


@dataclass(frozen=True, slots=True)
class ThresholdStripes:
    """Longitudinal stripes behind the threshold: `count` of them, `width` wide and `gap` apart, twice that at the centre.

    Source     ICAO Annex 14, vol. I, 5.2.4: stripes of about 1.80 m with spacings of about 1.80 m, double spacing at
               the centre line, starting 6 m from the threshold, at least 30 m long.
    """

    count: int = 6
    width: float = 1.8  # [m]
    gap: float = 1.8
    start: float = 6.0
    length: float = 30.0

    def __post_init__(self) -> None:
        if self.count < 0 or self.count % 2:
            raise ValueError(f"threshold stripes: count must be even and >= 0 (half on each side), not {self.count}")

    @property
    def outermost(self) -> float:
        """|y| [m] of the outer side of the last stripe; 0 without stripes."""
        half = self.count // 2
        return self.gap + half * self.width + (half - 1) * self.gap if half else 0.0


@dataclass(frozen=True, slots=True)
class TaxiwayMouth:
    """Where a taxiway interrupts a borderline, flares included: x0..x1 [m] on the side of `feature` LEFT or RIGHT."""

    x0: float
    x1: float
    feature: Feature

    def __post_init__(self) -> None:
        if not self.x0 < self.x1:
            raise ValueError(f"taxiway mouth: x0 must be below x1, got {self.x0} and {self.x1}")
        if self.feature not in (Feature.LEFT, Feature.RIGHT):
            raise ValueError("taxiway mouth: it lies on the LEFT or on the RIGHT borderline")


@dataclass(frozen=True, slots=True)
class UnknownLayout:
    """What may be expected of a runway of which nothing is known: everything in widths of the runway, itself a guess.

    A scale that is wrong therefore moves no window. free: strip about the centre line that all of ICAO's layouts leave free
    of stripes, by their double spacing there (3.6 m on 45 and 60 m); beside the borders none does (0.6 m on 30 m). Stripes
    of `coverage` of the width are expected at start..start + stripes (as on 45 m); no borderline is looked for up to
    `clear` behind the threshold, nor beyond `length`, unless less than `ahead` is left of that.

    Source     ICAO Annex 14, vol. I, 5.2.4; runways are 50 to 70 widths long.
    """

    free: float = 0.06
    coverage: float = 0.5
    start: float = 0.13
    stripes: float = 0.67
    clear: float = 1.6
    length: float = 50.0
    ahead: float = 7.0


@dataclass(frozen=True, slots=True)
class RunwayMap:
    """The runway as the onboard side believes it to be.

    width, length [m]; slope [rad] > 0 uphill along x; `paint` are further painted rectangles (x0, x1, y0, y1) [m] that a
    search for a borderline must not reach (the default fits the default size); `brighter`: the runway is brighter than its
    surroundings, which decides the polarity of its edges (the sky is always taken as brighter than the ground);
    paint_contrast: of paint on the surface, over that of the surface beside its surroundings (70 / 55 grey levels).
    """

    width: float = 29.0
    length: float = 1680.0
    slope: float = 0.0
    stripes: ThresholdStripes | UnknownLayout = ThresholdStripes()
    mouths: tuple[TaxiwayMouth, ...] = ()
    paint: tuple[tuple[float, float, float, float], ...] = AIMING_AND_TOUCHDOWN
    brighter: bool = True
    paint_contrast: float = 1.27

    @staticmethod
    def unknown(width: float = 45.0, brighter: bool = True) -> RunwayMap:
        """A level runway of which nothing is known; `width` [m], a guess, is the unit of everything.

        If it is wrong, windows are still placed right by a pose of which x, y and H are as wrong.
        """
        layout = UnknownLayout()
        contrast = 1.27 if brighter else 0.0  # how bright paint is on something dark, nobody knows
        return RunwayMap(width, layout.length * width, 0.0, layout, (), (), brighter, contrast)

    def __post_init__(self) -> None:
        if not (self.width > 0.0 and math.isfinite(self.width)):
            raise ValueError(f"runway map: width must be > 0 m, not {self.width}")
        if not (self.length > 0.0 and math.isfinite(self.length)):
            raise ValueError(f"runway map: length must be > 0 m, not {self.length}")
        if not abs(self.slope) < 0.2:
            raise ValueError(f"runway map: slope is in rad and must be below 0.2, not {self.slope}")
        if isinstance(self.stripes, ThresholdStripes) and 2.0 * self.stripes.outermost >= self.width:
            raise ValueError(
                f"runway map: threshold stripes reach {self.stripes.outermost} m from the centre line, wider than the "
                f"runway ({self.width} m); use fewer stripes"
            )

    def border_paint(self) -> Array:
        """(m, 4) x0, x1 [m], Feature, |y| [m] to which paint reaches on that side."""
        half, rows = 0.5 * self.width, []
        boxes, s = list(self.paint), self.stripes
        if isinstance(s, ThresholdStripes) and s.count:
            boxes.append((s.start, s.start + s.length, -s.outermost, s.outermost))
            far = self.length - s.start
            boxes.append((far - s.length, far, -s.outermost, s.outermost))
        for x0, x1, y0, y1 in boxes:
            if max(-y0, y1) > 0.2 * half:  # the centre line is in nobody's way
                rows.append((x0, x1, float(Feature.LEFT), -y0))
                rows.append((x0, x1, float(Feature.RIGHT), y1))
        return np.array(rows, dtype=float).reshape(-1, 4)

    def row(self) -> Array:
        """(10,) what placing windows needs of the runway: fields LENGTH to UNIT of `layout`."""
        s, contrast = self.stripes, self.paint_contrast
        if isinstance(s, UnknownLayout):
            layout = (s.length, self.slope, math.inf, 0.5 * s.free, s.start, s.stripes, s.coverage * contrast)
            return np.array([*layout, s.clear, s.ahead, 1.0], dtype=float)
        bright = s.count * s.width / self.width * contrast
        inner = s.gap if s.count else 0.0
        return np.array(
            [self.length, self.slope, s.outermost, inner, s.start, s.length, bright, 0.0, 0.0, 0.0], dtype=float
        )

    def mouth_rows(self) -> Array:
        """(m, 3) x0, x1 [m], Feature."""
        return np.array([(m.x0, m.x1, float(m.feature)) for m in self.mouths], dtype=float).reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class BelievedCamera:
    """The camera as the onboard side believes it to be.

    p_BC (3,) [m] lever from the cg, frame B; blur [px] sigma of the optics; noise [grey levels] sigma of a pixel;
    encoder_sigma [rad] of the platform's constant error, which an acquired attitude inherits.
    """

    intrinsics: Intrinsics
    p_BC: tuple[float, float, float] = (3.0, 0.0, -0.3)
    blur: float = 0.7
    noise: float = 4.0
    encoder_sigma: float = math.radians(0.03)

    def __post_init__(self) -> None:
        if not (self.blur > 0.0 and self.noise >= 0.0 and self.encoder_sigma >= 0.0):
            raise ValueError("believed camera: blur must be > 0 px, noise and encoder_sigma >= 0")
