"""Painted runway markings as rectangles: where ICAO Annex 14 puts them for a runway of given width and length.

Source     ICAO Annex 14, volume I, section 5.2: threshold stripes by width, aiming point and touchdown-zone bars by
           landing distance, centreline. Departs: no designation characters; the landing distance is the runway's
           length (no displaced threshold); lateral positions shrink so that a narrow runway keeps a clean margin.
"""

from __future__ import annotations

from dataclasses import dataclass

STRIPE_LENGTH, STRIPE_WIDTH, STRIPE_START = 30.0, 1.8, 6.0  # [m] threshold stripes; gaps as wide as the stripes
STRIPES_BY_WIDTH = ((60.0, 16), (45.0, 12), (30.0, 8), (23.0, 6), (18.0, 4))  # runway width from [m], stripes

# Landing distance from [m]: start from the threshold, length, width of each block, gap between their inner edges [m].
AIMING_POINT = (
    (2400.0, 400.0, 45.0, 6.0, 18.0),
    (1200.0, 300.0, 45.0, 6.0, 18.0),
    (800.0, 250.0, 30.0, 6.0, 9.0),
    (0.0, 150.0, 30.0, 4.0, 6.0),
)
TOUCHDOWN_PAIRS = ((2400.0, 6), (1500.0, 4), (1200.0, 3), (900.0, 2), (0.0, 1))  # landing distance from [m], pairs
TOUCHDOWN_LENGTH, TOUCHDOWN_WIDTH, TOUCHDOWN_SPACING = 22.5, 3.0, 150.0
TOUCHDOWN_CLEAR_OF_AIMING_POINT = 50.0  # a pair nearer than this to the aiming point is left out

CENTRELINE_START, CENTRELINE_DASH, CENTRELINE_GAP, CENTRELINE_WIDTH = 69.0, 30.0, 20.0, 0.45
CLEAN_MARGIN = 3.0  # [m] from the runway's edge kept free of aiming point and touchdown-zone marks


@dataclass(frozen=True, slots=True)
class Marking:
    """A white rectangle on the surface: x along the runway from the threshold, y to the right of its centreline [m]."""

    kind: str  # "threshold", "centreline", "aiming_point", "touchdown_zone"
    x0: float
    x1: float
    y0: float
    y1: float


def stripe_count(width: float) -> int:
    """Number of threshold stripes on a runway `width` [m] wide; 0 if it is too narrow for four."""
    return next((n for least, n in STRIPES_BY_WIDTH if width >= least), 0)


def runway_markings(width: float, length: float) -> tuple[Marking, ...]:
    """All markings of a runway [m], both ends; those of an end that would pass mid-length are left out."""
    near = [*_threshold(width), *_aiming_point(width, length), *_touchdown_zone(width, length)]
    near = [m for m in near if m.x1 <= 0.5 * length]
    far = [Marking(m.kind, length - m.x1, length - m.x0, -m.y1, -m.y0) for m in near]
    return (*near, *far, *_centreline(length))


def _both_sides(kind: str, x0: float, x1: float, inner: float, outer: float) -> list[Marking]:
    return [Marking(kind, x0, x1, -outer, -inner), Marking(kind, x0, x1, inner, outer)]


def _threshold(width: float) -> list[Marking]:
    x0, x1 = STRIPE_START, STRIPE_START + STRIPE_LENGTH
    out = []
    for k in range(stripe_count(width) // 2):
        inner = STRIPE_WIDTH * (1 + 2 * k)  # the middle gap is double
        out += _both_sides("threshold", x0, x1, inner, inner + STRIPE_WIDTH)
    return out


def _inner_edge(width: float, length: float, block: float) -> float:
    """Distance of a mark's inner edge from the centreline: the aiming point's, less where the runway is narrow."""
    gap = next(gap for least, _, _, _, gap in AIMING_POINT if length >= least)
    return min(0.5 * gap, 0.5 * width - CLEAN_MARGIN - block)


def _aiming_point(width: float, length: float) -> list[Marking]:
    start, extent, block = next((s, e, b) for least, s, e, b, _ in AIMING_POINT if length >= least)
    inner = _inner_edge(width, length, block)
    return _both_sides("aiming_point", start, start + extent, inner, inner + block) if inner > 0.0 else []


def _touchdown_zone(width: float, length: float) -> list[Marking]:
    start, extent = next((s, e) for least, s, e, _, _ in AIMING_POINT if length >= least)
    pairs = next(n for least, n in TOUCHDOWN_PAIRS if length >= least)
    inner = _inner_edge(width, length, 6.0)
    clear = TOUCHDOWN_CLEAR_OF_AIMING_POINT
    out = []
    for k in range(1, pairs + 1):
        x = k * TOUCHDOWN_SPACING
        if inner > 0.0 and not start - clear < x < start + extent + clear:
            out += _both_sides("touchdown_zone", x, x + TOUCHDOWN_LENGTH, inner, inner + TOUCHDOWN_WIDTH)
    return out


def _centreline(length: float) -> list[Marking]:
    out = []
    x, half = CENTRELINE_START, 0.5 * CENTRELINE_WIDTH
    while x + CENTRELINE_DASH <= length - CENTRELINE_START:
        out.append(Marking("centreline", x, x + CENTRELINE_DASH, -half, half))
        x += CENTRELINE_DASH + CENTRELINE_GAP
    return out
