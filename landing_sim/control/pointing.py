"""Where the camera platform has to point: at a direction of R, whatever the aircraft's attitude."""

from __future__ import annotations

import math


def look_along(
    phi: float, theta: float, psi: float, azimuth: float = 0.0, elevation: float = 0.0
) -> tuple[float, float]:
    """pan, tilt [rad] that put the optical axis along a direction fixed in R.

    With so3.camera_from_body the optical axis is (cos tilt cos pan, cos tilt sin pan, -sin tilt) in B, so that
    pan = atan2(d_y, d_x), tilt = -asin(d_z) for the wanted direction d in B. The default is the vanishing point of the
    runway's borderlines, at which the paper's platform was fixated.

    Parameters
    ----------
    phi, theta, psi : attitude in R [rad]
    azimuth : [rad] in R, > 0 to the right
    elevation : [rad] > 0 above the horizontal

    Source     Dickmanns & Schell 1992, section 3 (fixation).
    """
    ce = math.cos(elevation)
    x, y, z = ce * math.cos(azimuth - psi), ce * math.sin(azimuth - psi), -math.sin(elevation)
    cth, sth = math.cos(theta), math.sin(theta)
    cph, sph = math.cos(phi), math.sin(phi)
    forward, down = cth * x - sth * z, sth * x + cth * z
    right, down = cph * y + sph * down, -sph * y + cph * down
    return math.atan2(right, forward), -math.asin(max(-1.0, min(1.0, down)))
