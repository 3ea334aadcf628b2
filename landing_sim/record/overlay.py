"""What is drawn over a camera image: windows, edges measured in them, and the runway where the filter believes it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.runway_image import image_line, plane_normal
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.signals import CameraSample, EdgeSet, Estimate, Feature, Sample, Status
from landing_sim.types import Array

NEAR = 2.0  # [m] in front of the camera, where edges are cut off
HALF_EDGE = 7.0  # [px] half the drawn length of a measured edge

Colour = tuple[int, int, int]
Ends = tuple[tuple[float, float], tuple[float, float]]  # [px]
FEATURE_COLOURS: dict[Feature, Colour] = {
    Feature.LEFT: (64, 200, 255),
    Feature.RIGHT: (255, 176, 32),
    Feature.THRESHOLD: (255, 72, 176),
    Feature.HORIZON: (120, 240, 120),
}
STATUS_COLOURS: dict[Status, Colour] = {
    Status.FOUND: (255, 255, 255),
    Status.OUT_OF_VIEW: (110, 110, 110),
    Status.NO_CONTRAST: (200, 160, 60),
    Status.AMBIGUOUS: (220, 120, 40),
    Status.DROPPED_BY_MAP: (150, 90, 220),
    Status.TOO_SHORT: (160, 160, 110),
    Status.REJECTED: (240, 40, 40),
}


@dataclass(frozen=True, slots=True)
class Segments:
    """Line segments in the image: ends (n, 2, 2) [px], one feature each."""

    ends: Array
    feature: np.ndarray


@dataclass(frozen=True, slots=True)
class BelievedCamera:
    """What the drawing needs to know of the onboard side: its camera, where it sits, and the runway."""

    intrinsics: Intrinsics
    lever_B: Array  # (3,) [m] camera from the cg, frame B
    width: float  # [m] of the runway
    length: float
    slope: float  # [rad] > 0 uphill


def predicted_edges(estimate: Estimate, pan: float, tilt: float, camera: BelievedCamera) -> Segments:
    """Runway outline and horizon as the estimate and the encoder angles [rad] put them into the image.

    A part that is behind the camera or outside the image is cut away; an edge wholly outside is left out.
    """
    R_RB = from_euler(estimate["phi"], estimate["theta"], estimate["psi"])
    R_CR = camera_from_body(pan, tilt) @ R_RB.T
    p_RC = np.array([estimate["x"], estimate["y"], -estimate["H"]]) + R_RB @ camera.lever_B
    half, k = 0.5 * estimate.get("W", camera.width), camera.intrinsics
    x, z = camera.length * math.cos(camera.slope), -camera.length * math.sin(camera.slope)
    corners = np.array([[0.0, -half, 0.0], [0.0, half, 0.0], [x, -half, z], [x, half, z]])
    near_left, near_right, far_left, far_right = ((corners - p_RC) @ R_CR.T).tolist()
    azimuth = math.atan2(R_CR[2, 1], R_CR[2, 0])
    normal = plane_normal(int(Feature.HORIZON), p_RC, 2.0 * half, camera.slope, azimuth)
    edges = (
        (Feature.LEFT, _into_image(near_left, far_left, k)),
        (Feature.RIGHT, _into_image(near_right, far_right, k)),
        (Feature.THRESHOLD, _into_image(near_left, near_right, k)),
        (Feature.HORIZON, _across_image(image_line(normal, R_CR, k.f, k.cx, k.cy).tolist(), k)),
    )
    seen = [(feature, ends) for feature, ends in edges if ends is not None]
    return Segments(
        np.array([ends for _, ends in seen]).reshape(-1, 2, 2), np.array([feature for feature, _ in seen], np.int64)
    )


def joined(sets: Sequence[EdgeSet]) -> EdgeSet:
    """The windows of several images as one set; its angles mean nothing."""
    feature, centre, direction, status = (
        np.concatenate(column) for column in zip(*((s.feature, s.centre, s.direction, s.status) for s in sets))
    )
    return EdgeSet(feature, centre, direction, status, pan=np.nan, tilt=np.nan)


def found(edges: EdgeSet, z: Array) -> np.ndarray:
    """(n,) bool: where an edge was measured, whatever the estimator made of it."""
    return np.isfinite(z) & ((edges.status == Status.FOUND) | (edges.status == Status.REJECTED))


def measured_edges(edges: EdgeSet, z: Array) -> Segments:
    """A short piece of edge, square to the search direction, where each window found one."""
    use = found(edges, z)
    at = edges.centre[use] + z[use, None] * edges.direction[use]
    along = np.column_stack([-edges.direction[use, 1], edges.direction[use, 0]])
    return Segments(np.stack([at - HALF_EDGE * along, at + HALF_EDGE * along], axis=1), edges.feature[use])


def window_boxes(edges: EdgeSet, half_search: float = 20.0, half_width: float = HALF_EDGE) -> Array:
    """(n, 5, 2) [px] closed outlines of the windows, elongated along the search direction."""
    along = edges.direction * half_search
    across = np.column_stack([-edges.direction[:, 1], edges.direction[:, 0]]) * half_width
    c = edges.centre
    return np.stack(
        [c - along - across, c + along - across, c + along + across, c - along + across, c - along - across], 1
    )


def packed(colours: Mapping[Feature, Colour] | Mapping[Status, Colour]) -> np.ndarray:
    """(n,) uint32 0xRRGGBBAA, opaque, to be looked up by Feature or Status."""
    in_order = (colour for _, colour in sorted(colours.items()))
    return np.array([int.from_bytes(bytes((*colour, 255)), "big") for colour in in_order], np.uint32)


def camera_sample(samples: tuple[Sample, ...]) -> tuple[float, CameraSample] | None:
    """The image among a cycle's samples, if there is one, and when it was exposed [s]."""
    return next(((sample.t_valid, sample.data) for sample in samples if isinstance(sample.data, CameraSample)), None)


def _into_image(a: Sequence[float], b: Sequence[float], k: Intrinsics) -> Ends | None:
    """The visible part of the segment from a to b, both in frame C; None if there is none."""
    if a[2] < NEAR and b[2] < NEAR:
        return None
    if a[2] < NEAR or b[2] < NEAR:
        s = (NEAR - a[2]) / (b[2] - a[2])
        cut = [p + s * (q - p) for p, q in zip(a, b)]
        a, b = (cut, b) if a[2] < NEAR else (a, cut)
    start, stop = ((k.cx + k.f * p[0] / p[2], k.cy + k.f * p[1] / p[2]) for p in (a, b))
    return _clip(start, stop, k)


def _across_image(l: Sequence[float], k: Intrinsics) -> Ends | None:
    """Where a line crosses the image."""
    if abs(l[1]) >= abs(l[0]):
        a, b = ((u, -(l[2] + l[0] * u) / l[1]) for u in (-0.5, k.width - 0.5))
    else:
        a, b = ((-(l[2] + l[1] * v) / l[0], v) for v in (-0.5, k.height - 0.5))
    return _clip(a, b, k)


def _clip(a: tuple[float, float], b: tuple[float, float], k: Intrinsics) -> Ends | None:
    """Liang-Barsky: the part of a-b inside the image; None if there is none."""
    (u, v), du, dv = a, b[0] - a[0], b[1] - a[1]
    enter, leave = 0.0, 1.0
    bounds = ((-du, u + 0.5), (du, k.width - 0.5 - u), (-dv, v + 0.5), (dv, k.height - 0.5 - v))
    for step, room in bounds:
        if step == 0.0:
            if room < 0.0:
                return None
        elif step < 0.0:
            enter = max(enter, room / step)
        else:
            leave = min(leave, room / step)
    return ((u + enter * du, v + enter * dv), (u + leave * du, v + leave * dv)) if enter < leave else None
