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


def predicted_edges(
    estimates: Sequence[Estimate], angles: Sequence[tuple[float, float]], camera: BelievedCamera
) -> tuple[Segments, np.ndarray]:
    """Runway outline and horizon as estimates and encoder angles (pan, tilt) [rad] put them into as many images (n).

    A part that is behind the camera or outside the image is cut away; an edge wholly outside is left out. Returns the
    segments of all images one after the other, and how many each has (n,).
    """
    n, k = len(estimates), camera.intrinsics
    R_CR, p_RC, width, horizon = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(n), np.empty((n, 3))
    for i, (e, (pan, tilt)) in enumerate(zip(estimates, angles, strict=True)):
        R_RB = from_euler(e["phi"], e["theta"], e["psi"])
        R_CR[i] = camera_from_body(pan, tilt) @ R_RB.T
        p_RC[i] = (e["x"], e["y"], -e["H"]) + R_RB @ camera.lever_B
        width[i] = e.get("W", camera.width)
        azimuth = math.atan2(R_CR[i, 2, 1], R_CR[i, 2, 0])
        normal = plane_normal(int(Feature.HORIZON), p_RC[i], width[i], camera.slope, azimuth)
        horizon[i] = image_line(normal, R_CR[i], k.f, k.cx, k.cy)
    far = (camera.length * math.cos(camera.slope), 0.0, -camera.length * math.sin(camera.slope))
    left = np.outer(width, (0.0, -0.5, 0.0))
    corners = np.stack([left, -left, left + far, far - left], axis=1)
    near_left, near_right, far_left, far_right = ((corners - p_RC[:, None]) @ R_CR.swapaxes(1, 2)).swapaxes(0, 1)
    sides = ((near_left, far_left), (near_right, far_right), (near_left, near_right))
    sides_uv, in_front = _into_image(np.stack([np.stack(ends, axis=1) for ends in sides], axis=1), k)
    ends, inside = _clip(np.concatenate([sides_uv, _across_image(horizon, k)[:, None]], axis=1), k)
    inside[:, :3] &= in_front
    features = np.broadcast_to([Feature.LEFT, Feature.RIGHT, Feature.THRESHOLD, Feature.HORIZON], inside.shape)
    return Segments(ends[inside], features[inside]), inside.sum(axis=1)


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


def _into_image(ends: Array, k: Intrinsics) -> tuple[Array, np.ndarray]:
    """Images (..., 2, 2) of segments (..., 2, 3) in frame C, cut off NEAR; False where nothing is farther than that."""
    a, b = ends[..., 0, :], ends[..., 1, :]
    behind = ends[..., 2] < NEAR
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = a + ((NEAR - a[..., 2]) / (b[..., 2] - a[..., 2]))[..., None] * (b - a)
        seen = np.where(behind[..., None], cut[..., None, :], ends)
        return np.array([k.cx, k.cy]) + k.f * seen[..., :2] / seen[..., 2:], ~(behind[..., 0] & behind[..., 1])


def _across_image(l: Array, k: Intrinsics) -> Array:
    """(n, 2, 2) where lines (n, 3) cross the image's left and right border, or the upper and lower one if steep."""
    a, b, c = l.T[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = np.array([-0.5, k.width - 0.5]), np.array([-0.5, k.height - 0.5])
        level = np.stack(np.broadcast_arrays(u, -(c + a * u) / b), axis=-1)
        steep = np.stack(np.broadcast_arrays(-(c + b * v) / a, v), axis=-1)
    return np.where((abs(b) >= abs(a))[..., None], level, steep)


def _clip(ends: Array, k: Intrinsics) -> tuple[Array, np.ndarray]:
    """Liang-Barsky: the parts of segments (..., 2, 2) inside the image; False where there is none."""
    a, way = ends[..., 0, :], ends[..., 1, :] - ends[..., 0, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.stack([(-0.5 - a) / way, (np.array([k.width, k.height]) - 0.5 - a) / way])
        enter, leave = np.maximum(t.min(axis=0).max(axis=-1), 0.0), np.minimum(t.max(axis=0).min(axis=-1), 1.0)
        return np.stack([a + enter[..., None] * way, a + leave[..., None] * way], axis=-2), enter < leave
