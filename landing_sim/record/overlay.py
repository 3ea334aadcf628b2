"""What is drawn over a camera image: windows, edges measured in them, and the runway where the filter believes it is."""

from __future__ import annotations

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
    half = 0.5 * estimate.get("W", camera.width)
    far = np.array([camera.length * np.cos(camera.slope), 0.0, -camera.length * np.sin(camera.slope)])
    left, right = np.array([0.0, -half, 0.0]), np.array([0.0, half, 0.0])
    ends, features = [], []
    for feature, a, b in (
        (Feature.LEFT, left, left + far),
        (Feature.RIGHT, right, right + far),
        (Feature.THRESHOLD, left, right),
    ):
        cut = _into_image(R_CR @ (a - p_RC), R_CR @ (b - p_RC), camera.intrinsics)
        if cut is not None:
            ends.append(cut)
            features.append(feature)
    azimuth = float(np.arctan2(R_CR[2, 1], R_CR[2, 0]))
    normal = plane_normal(int(Feature.HORIZON), p_RC, 2.0 * half, camera.slope, azimuth)
    k = camera.intrinsics
    horizon = _across_image(image_line(normal, R_CR, k.f, k.cx, k.cy), k)
    if horizon is not None:
        ends.append(horizon)
        features.append(Feature.HORIZON)
    return Segments(np.array(ends).reshape(-1, 2, 2), np.array(features, np.int64))


def measured_edges(edges: EdgeSet, z: Array) -> Segments:
    """A short piece of edge, square to the search direction, where each window found one."""
    found = np.isfinite(z) & np.isin(edges.status, (Status.FOUND, Status.REJECTED))
    at = edges.centre[found] + z[found, None] * edges.direction[found]
    along = np.column_stack([-edges.direction[found, 1], edges.direction[found, 0]])
    return Segments(np.stack([at - HALF_EDGE * along, at + HALF_EDGE * along], axis=1), edges.feature[found])


def window_boxes(edges: EdgeSet, half_search: float = 20.0, half_width: float = HALF_EDGE) -> Array:
    """(n, 5, 2) [px] closed outlines of the windows, elongated along the search direction."""
    along = edges.direction * half_search
    across = np.column_stack([-edges.direction[:, 1], edges.direction[:, 0]]) * half_width
    c = edges.centre
    return np.stack(
        [c - along - across, c + along - across, c + along + across, c - along + across, c - along - across], 1
    )


def camera_sample(samples: tuple[Sample, ...]) -> tuple[float, CameraSample] | None:
    """The image among a cycle's samples, if there is one, and when it was exposed [s]."""
    return next(((sample.t_valid, sample.data) for sample in samples if isinstance(sample.data, CameraSample)), None)


def _into_image(a: Array, b: Array, k: Intrinsics) -> Array | None:
    """(2, 2) the visible part of the segment from a to b, both in frame C; None if there is none."""
    if a[2] < NEAR and b[2] < NEAR:
        return None
    if a[2] < NEAR or b[2] < NEAR:
        cut = a + (NEAR - a[2]) / (b[2] - a[2]) * (b - a)
        a, b = (cut, b) if a[2] < NEAR else (a, cut)
    start, stop = ((k.cx + k.f * p[0] / p[2], k.cy + k.f * p[1] / p[2]) for p in (a, b))
    return _clip(start, stop, k)


def _across_image(l: Array, k: Intrinsics) -> Array | None:
    """(2, 2) where a line crosses the image."""
    if abs(l[1]) >= abs(l[0]):
        a, b = ((u, -(l[2] + l[0] * u) / l[1]) for u in (-0.5, k.width - 0.5))
    else:
        a, b = ((-(l[2] + l[1] * v) / l[0], v) for v in (-0.5, k.height - 0.5))
    return _clip(a, b, k)


def _clip(a: tuple[float, float], b: tuple[float, float], k: Intrinsics) -> Array | None:
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
    return np.array([[u + enter * du, v + enter * dv], [u + leave * du, v + leave * dv]]) if enter < leave else None
