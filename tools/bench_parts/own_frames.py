"""Frames as the afternoon's user would draw them: cv2's anti-aliased polygons, a Gaussian blur, normal noise.

cv2.fillConvexPoly draws the outline of what it fills as well: edges lie some 0.7 px outside. Nobody notices in an
afternoon, so nothing is done about it here; what it does to the estimate is said beside the figures.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from landing_sim.missions import truth
from landing_sim.scenario import Scenario
from landing_sim.world.runway import GRASS, SKY

NEAR = 1.0  # [m] polygons are cut off there
SHIFT = 4  # fractional bits of cv2's corners
Array = np.ndarray


def artist(scenario: Scenario) -> Callable[[Array, Array], np.ndarray]:
    """What draws the scenario's frame seen from p_RC (3,) [m] with R_CR (3, 3)."""
    c, runway = scenario.camera, truth.runway(scenario)
    points, material = runway.quads()
    greys = np.rint(runway.greys.palette)
    f, cx, cy = c.focal_px, (c.width_px - 1) / 2, (c.height_px - 1) / 2
    rng = np.random.default_rng(scenario.seed)
    blur, noise = c.blur_px, c.noise_dn

    def fill(image: Array, corners: Array, grey: float) -> None:
        """A convex polygon of corners (n, 3) in C."""
        inside = corners[:, 2] >= NEAR
        if not inside.any():
            return
        if not inside.all():
            kept = []
            for a, b in zip(corners, np.roll(corners, -1, axis=0)):
                if a[2] >= NEAR:
                    kept.append(a)
                if (a[2] >= NEAR) != (b[2] >= NEAR):
                    kept.append(a + (NEAR - a[2]) / (b[2] - a[2]) * (b - a))
            corners = np.array(kept)
        uv = np.array([cx, cy]) + f * corners[:, :2] / corners[:, 2:]
        if (uv.max(axis=0) < -2.0).any() or (uv.min(axis=0) > np.array([c.width_px, c.height_px]) + 1.0).any():
            return
        cv2.fillConvexPoly(image, _fixed(uv), grey, cv2.LINE_AA, SHIFT)

    def draw(p_RC: Array, R_CR: Array) -> np.ndarray:
        image = np.full((c.height_px, c.width_px), int(greys[SKY]), np.uint8)
        # a flat Earth, the camera upright: its horizon from the left side of the image to the right
        down = R_CR[:, 2]
        left, right = (cy - (f * down[2] + (u - cx) * down[0]) / down[1] for u in (0, c.width_px))
        ground = np.array([[0, left], [c.width_px, right], [c.width_px, c.height_px], [0, c.height_px]])
        cv2.fillConvexPoly(image, _fixed(ground), float(greys[GRASS]), cv2.LINE_AA, SHIFT)
        for quad, m in zip((points - p_RC) @ R_CR.T, material):
            fill(image, quad, float(greys[m]))
        smooth = cv2.GaussianBlur(image, (0, 0), blur).astype(np.float32)
        smooth += noise * rng.standard_normal(smooth.shape, dtype=np.float32)
        return np.clip(np.rint(smooth), 0, 255).astype(np.uint8)

    return draw


def _fixed(uv: Array) -> np.ndarray:
    """(n, 2) pixels as cv2's fixed-point corners."""
    return np.rint(uv * (1 << SHIFT)).astype(np.int32)
