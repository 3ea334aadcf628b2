"""What a frame shows as image lines, compiled: every ground quadrilateral is four of them, the horizon a cone.

A quadrilateral seen from C is the cone of rays inside four planes through C, so in the image it is the intersection of
four half-planes {l . (u, v, 1) > 0}, l = K^-T (P_i x P_i+1), wherever its corners lie: in view, far outside, or behind
the camera. Homogeneous clipping is thus exact without a near plane, and no coordinate is ever clamped.

Lines are stored in table units: TABLE_HALF at the edge, 0 and 2 TABLE_HALF at -+ CUT sigma of the optics' blur.
"""

from __future__ import annotations

import math

import numpy as np

from landing_sim.geometry.runway_image import horizon_dip
from landing_sim.jit import kernel, uncounted
from landing_sim.types import Array

CUT = 4.0  # [sigma] half width of an edge's profile
TABLE_HALF = 512
TABLE_SIZE = 2 * TABLE_HALF
FAR = 1 << 20  # [px] outside every image
CULL_MARGIN = 64.0  # [px] around the image outside which a quadrilateral is dropped


def edge_table() -> Array:
    """(TABLE_SIZE + 1, 2) fraction of a blurred half-plane that lies beyond its edge, 1 at -CUT sigma .. 0 at +CUT, and
    the step from there to the next."""
    x = np.linspace(-CUT, CUT, TABLE_SIZE + 1)
    table = np.array([0.5 * math.erfc(v / math.sqrt(2.0)) for v in x])
    table[0], table[-1] = 1.0, 0.0
    return np.column_stack([table, np.diff(table, append=0.0)])


@kernel
def project(
    points: Array,
    material: np.ndarray,
    p_RC: Array,
    R_CR: Array,
    camera: Array,
    lines: Array,
    seen: np.ndarray,
    horizon: Array,
) -> int:
    """Project quadrilaterals `points` (m, 4, 3) [m], frame R, into image lines.

    camera (6,): f, cx, cy [px], width, height, blur sigma [px].
    Fills
        lines (m, 4, 4) in table units; last, room for the weight of the corner between this edge and the next
        seen (m, 5) material of each, then the first and last column and row that it may touch
        horizon (5,) gradient and offset of the z component (frame R) of the ray (x, y, 1) of pixel (u, v), sine of the
        dip, bound of the gradient of `render_kernels._dip_function`
    Returns the number of quadrilaterals kept: those in front of the camera, near the image and seen from above.
    """
    f, cx, cy = camera[0], camera[1], camera[2]
    units = TABLE_HALF / (CUT * camera[5])
    pad = CUT * camera[5]
    left, right = -(cx + CULL_MARGIN) / f, (camera[3] - cx + CULL_MARGIN) / f
    top, bottom = -(cy + CULL_MARGIN) / f, (camera[4] - cy + CULL_MARGIN) / f
    q = np.empty((4, 3))
    count = 0
    for m in range(points.shape[0]):
        out_left = out_right = out_top = out_bottom = True
        for i in range(4):
            x = points[m, i, 0] - p_RC[0]
            y = points[m, i, 1] - p_RC[1]
            z = points[m, i, 2] - p_RC[2]
            for j in range(3):
                q[i, j] = R_CR[j, 0] * x + R_CR[j, 1] * y + R_CR[j, 2] * z
            out_left &= q[i, 0] < left * q[i, 2]
            out_right &= q[i, 0] > right * q[i, 2]
            out_top &= q[i, 1] < top * q[i, 2]
            out_bottom &= q[i, 1] > bottom * q[i, 2]
        if out_left or out_right or out_top or out_bottom:
            continue
        above = True
        for i in range(4):
            k = (i + 1) & 3
            dx, dy, dz = q[k, 0] - q[i, 0], q[k, 1] - q[i, 1], q[k, 2] - q[i, 2]
            n0 = q[i, 1] * dz - q[i, 2] * dy
            n1 = q[i, 2] * dx - q[i, 0] * dz
            n2 = q[i, 0] * dy - q[i, 1] * dx
            if i == 0:
                above = n0 * q[2, 0] + n1 * q[2, 1] + n2 * q[2, 2] > 0.0
                if not above:
                    break
            a, b = n0 / f, n1 / f
            c = n2 - a * cx - b * cy
            scale = units / max(math.sqrt(a * a + b * b), 1e-12 * abs(c) + 1e-300)
            lines[count, i, 0] = a * scale
            lines[count, i, 1] = b * scale
            lines[count, i, 2] = c * scale + TABLE_HALF
        if above:
            lines[count, 0, 3] = math.nan  # asked for by few: see `fill_corners`
            seen[count, 0] = material[m]
            seen[count, 1] = seen[count, 3] = -FAR
            seen[count, 2] = seen[count, 4] = FAR
            if min(q[0, 2], q[1, 2], q[2, 2], q[3, 2]) > 0.0:
                for j in range(2):
                    centre = cy if j else cx
                    least, most = 1.0 * FAR, -1.0 * FAR
                    for i in range(4):
                        at = f * q[i, j] / q[i, 2] + centre
                        least, most = min(least, at), max(most, at)
                    seen[count, 2 * j + 1] = math.ceil(max(least - pad, -1.0 * FAR))
                    seen[count, 2 * j + 2] = math.floor(min(most + pad, 1.0 * FAR))
            count += 1
    horizon[0] = R_CR[0, 2] / f
    horizon[1] = R_CR[1, 2] / f
    horizon[2] = R_CR[2, 2] - horizon[0] * cx - horizon[1] * cy
    horizon[3] = math.sin(horizon_dip(-p_RC[2]))
    horizon[4] = (math.hypot(R_CR[0, 2], R_CR[1, 2]) + horizon[3]) / f
    return count


@uncounted
def fill_corners(line: Array, units: float) -> None:
    """Fill in the weights of the corners between each edge and the next: line[:, 3], NaN until somebody draws them."""
    for i in range(4):
        k = (i + 1) & 3
        dot = line[i, 0] * line[k, 0] + line[i, 1] * line[k, 1]
        line[i, 3] = 2.0 / math.pi * math.asin(min(max(dot / (units * units), -1.0), 1.0))
