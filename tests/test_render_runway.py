"""The runway's geometry and paint, against figures worked out by hand."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from landing_sim.world.markings import runway_markings, stripe_count
from landing_sim.world.runway import GRASS, PAINT, SURFACE, Greys, Runway, Taxiway


def test_threshold_stripes_of_the_default_runway() -> None:
    """29 m: six stripes of 1.8 m, 1.8 m apart, twice that in the middle: 21.6 m, so 3.7 m stay clean at each edge."""
    stripes = [m for m in Runway().markings if m.kind == "threshold" and m.x0 < 100.0]
    edges = sorted(y for m in stripes for y in (m.y0, m.y1))
    assert edges == pytest.approx([-10.8, -9.0, -7.2, -5.4, -3.6, -1.8, 1.8, 3.6, 5.4, 7.2, 9.0, 10.8])
    assert {(m.x0, m.x1) for m in stripes} == {(6.0, 36.0)}
    assert 14.5 - max(m.y1 for m in stripes) == pytest.approx(3.7)


def test_markings_by_length() -> None:
    near = [m for m in runway_markings(45.0, 1680.0) if m.x1 < 840.0]
    aiming = [m for m in near if m.kind == "aiming_point"]
    assert sorted((m.x0, m.x1, m.y0, m.y1) for m in aiming) == [(300, 345, -15, -9), (300, 345, 9, 15)]
    bars = sorted({m.x0 for m in near if m.kind == "touchdown_zone"})
    assert bars == [150.0, 450.0, 600.0]  # the pair at 300 m gives way to the aiming point
    assert Counter(m.kind for m in runway_markings(45.0, 1680.0))["threshold"] == 24  # twelve at each end


@pytest.mark.parametrize(("width", "count"), [(17.9, 0), (18, 4), (23, 6), (29, 6), (30, 8), (45, 12), (60, 16)])
def test_stripes_by_width(width: float, count: int) -> None:
    assert stripe_count(width) == count


@pytest.mark.parametrize("width", [8.0, 18.0, 23.0, 29.0, 45.0, 80.0])
@pytest.mark.parametrize("length", [50.0, 300.0, 799.0, 1000.0, 1680.0, 4000.0])
def test_paint_stays_on_the_runway_and_apart(width: float, length: float) -> None:
    marks = runway_markings(width, length)
    for m in marks:
        assert 0.0 <= m.x0 < m.x1 <= length
        assert -width / 2 <= m.y0 < m.y1 <= width / 2
    for i, a in enumerate(marks):
        for b in marks[i + 1 :]:
            apart = a.x1 <= b.x0 or b.x1 <= a.x0 or a.y1 <= b.y0 or b.y1 <= a.y0
            assert apart, (a, b)


def test_slope_lifts_the_far_end_and_keeps_the_length() -> None:
    runway = Runway(slope=math.radians(1.0))
    left, far_left, far_right, right = runway.corners()
    assert left == pytest.approx([0.0, -14.5, 0.0])
    assert right == pytest.approx([0.0, 14.5, 0.0])
    assert far_left[2] == pytest.approx(-far_left[0] * math.tan(math.radians(1.0)))
    assert far_left[2] == pytest.approx(-29.32, abs=0.01)
    assert np.linalg.norm(far_right - right) == pytest.approx(1680.0)


def test_quads_run_the_same_way_round_and_are_convex() -> None:
    runway = Runway(taxiways=(Taxiway(300.0, side="left"), Taxiway(600.0), Taxiway(6.0, flare=0.0)), slope=0.01)
    points, material = runway.quads()
    assert points.shape == (len(material), 4, 3)
    assert Counter(material.tolist()) == {GRASS: 1, SURFACE: 6, PAINT: len(runway.markings)}
    for quad in points:
        edges = np.roll(quad, -1, axis=0) - quad
        turns = np.cross(edges, np.roll(edges, -1, axis=0))[:, 2]
        assert np.all(turns > 0.0)


def test_taxiway_mouth_opens_at_45_degrees() -> None:
    taxiway = Taxiway(400.0, width=12.0, flare=10.0, length=80.0)
    assert taxiway.mouth == (384.0, 416.0)
    straight, mouth = Runway(taxiways=(taxiway,)).quads()[0][:2]
    assert straight[:, 1].max() == pytest.approx(14.5 + 80.0)
    assert mouth[2:] == pytest.approx(np.array([[406.0, 24.5, 0.0], [394.0, 24.5, 0.0]]))
    # On the runway's edge, between the inner corners and the outer ones, the mouth is as wide as announced.
    inner, outer = mouth[1], mouth[2]
    at_edge = inner + (14.5 - inner[1]) / (outer[1] - inner[1]) * (outer - inner)
    assert at_edge[0] == pytest.approx(416.0)


def test_bare_runway_has_one_quad() -> None:
    assert len(Runway(painted=False).quads()[0]) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Runway(width=-29.0), "width must be positive"),
        (lambda: Runway(length=math.nan), "length must be positive"),
        (lambda: Runway(slope=0.5), "slope"),
        (lambda: Runway(slope=math.nan), "slope"),
        (lambda: Runway(taxiways=(Taxiway(1679.0),)), "past the runway's end"),
        (lambda: Taxiway(100.0, width=0.0), "width > 0"),
        (lambda: Taxiway(math.inf), "finite"),
        (lambda: Taxiway(100.0, side="up"), "side"),
        (lambda: Greys(paint=300.0), "0..255"),
    ],
)
def test_bad_runways_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
