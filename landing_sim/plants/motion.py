"""What JSBSim says, as positions and velocities in R with the wheels' heights and reactions: one kernel a step.

A body's state is one (15, 3) array, a vector a row, so that a copy of it is all that truth needs.
"""

from __future__ import annotations

import math

from landing_sim.geometry.so3 import camera_from_body, fill_from_euler, fill_to_euler
from landing_sim.jit import kernel, uncounted
from landing_sim.plants.jsbsim import FT, LBF
from landing_sim.plants.wheels import heights, reactions
from landing_sim.types import Array

FAR_AWAY = 50e3  # [m] where a level plane is no longer the Earth

# rows of a body
P, V, W, UVW = 0, 1, 2, 3  # p_RB [m], v_RB_R [m/s], w_RB_B [rad/s], v_RB_B [m/s]; B's origin is the nominal cg
R_RB, R_RN = 4, 7  # three rows each
FORCE, MOMENT = 10, 11  # [lbf], [lbf ft] of the wheels on the body, body axes
WHEELS = 12  # [m] heights of the first three contacts
EULER, WIND = 13, 14  # [rad], [m/s]: of `look` only
ROWS = 15

# rows of a site: where the runway is, and what does not change in flight
ORIGIN_E, R_RE = 0, 1  # [m] threshold; three rows
OFFSET_B = 4  # [m] of the actual cg from the nominal one
SITE_ROWS = 5


@uncounted
def settle(
    x: float, y: float, z: float, lat: float, lon: float, altitude: float, phi: float, theta: float, psi: float,
    u: float, v: float, w: float, airspeed: float, p: float, q: float, r: float,
    brake_left: float, brake_right: float, slope: float, dt: float, site: Array, p_B: Array, values: Array,
    height: Array, bristle: Array, body: Array,
) -> tuple[float, float, float, float, float, float, bool]:  # fmt: skip
    """Fill `body` (ROWS, 3) from JSBSim's own figures, and work out what the ground does to its wheels.

    x y z : [ft] of the actual cg, Earth-centred; lat, lon [rad] geodetic; altitude [ft] above the ellipsoid
    phi theta psi : [rad] from local north-east-down
    u v w : [ft/s] over the ground, p q r [rad/s], body axes; airspeed [ft/s]
    site : (SITE_ROWS, 3); slope, p_B, values, height, bristle : see `wheels`

    Returns x, y, H [m] of the actual cg in R, the airspeed [m/s], the elevation [ft] of the runway's surface below it, the
    least height [m] of a contact, and whether all of JSBSim's figures are finite and the runway is near.
    """
    sp, cp, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    dx, dy, dz = x * FT - site[ORIGIN_E, 0], y * FT - site[ORIGIN_E, 1], z * FT - site[ORIGIN_E, 2]
    for i in range(3):
        a, b, c = site[R_RE + i, 0], site[R_RE + i, 1], site[R_RE + i, 2]
        body[P, i] = a * dx + b * dy + c * dz
        body[R_RN + i, 0] = -a * sp * cl - b * sp * sl + c * cp
        body[R_RN + i, 1] = -a * sl + b * cl
        body[R_RN + i, 2] = -a * cp * cl - b * cp * sl - c * sp
    up_x, up_z = -body[R_RN, 2], -body[R_RN + 2, 2]
    s, c = math.sin(slope), math.cos(slope)
    at_x, at_y, down = body[P, 0], body[P, 1], body[P, 2]
    elevation = altitude * FT - (-s * at_x - c * down) / (-s * up_x - c * up_z)

    # from the actual to the nominal cg
    R = body[R_RB : R_RB + 3]
    fill_from_euler(phi, theta, psi, R)
    ox, oy, oz = site[OFFSET_B, 0], site[OFFSET_B, 1], site[OFFSET_B, 2]
    body[W, 0], body[W, 1], body[W, 2] = p, q, r
    body[UVW, 0] = u * FT - (q * oz - r * oy)
    body[UVW, 1] = v * FT - (r * ox - p * oz)
    body[UVW, 2] = w * FT - (p * oy - q * ox)
    for j in range(3):
        a, b, c = R[0, j], R[1, j], R[2, j]  # of R_NB, which becomes R_RB column by column
        for i in range(3):
            R[i, j] = body[R_RN + i, 0] * a + body[R_RN + i, 1] * b + body[R_RN + i, 2] * c
    for i in range(3):
        a, b, c = R[i, 0], R[i, 1], R[i, 2]
        body[P, i] -= a * ox + b * oy + c * oz
        body[V, i] = a * body[UVW, 0] + b * body[UVW, 1] + c * body[UVW, 2]

    least = heights(body[P], R, slope, p_B, height)
    for i in range(3):
        body[WHEELS, i] = height[i]
    if least < 0.0:
        reactions(
            R, body[V], body[W], slope, brake_left, brake_right, dt, p_B, values, height, bristle,
            body[FORCE : MOMENT + 1],
        )  # fmt: skip
        for i in range(3):
            body[FORCE, i] /= LBF
            body[MOMENT, i] /= LBF * FT
    finite = math.isfinite(x + y + z + phi + theta + psi + u + v + w + airspeed + p + q + r)
    sound = finite and abs(at_x) + abs(down) <= FAR_AWAY
    return at_x, at_y, -down, airspeed * FT, elevation / FT, least, sound


@uncounted
def into_N(body: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector in R as north, east, down where the body is."""
    return (
        body[R_RN, 0] * x + body[R_RN + 1, 0] * y + body[R_RN + 2, 0] * z,
        body[R_RN, 1] * x + body[R_RN + 1, 1] * y + body[R_RN + 2, 1] * z,
        body[R_RN, 2] * x + body[R_RN + 1, 2] * y + body[R_RN + 2, 2] * z,
    )


@uncounted
def look(body: Array, north: float, east: float, down: float) -> None:
    """Fill the rows that only a look at the truth needs: Euler angles of B in R, and the wind given in N [m/s]."""
    fill_to_euler(body[R_RB : R_RB + 3], body[EULER])
    for i in range(3):
        body[WIND, i] = body[R_RN + i, 0] * north + body[R_RN + i, 1] * east + body[R_RN + i, 2] * down


@kernel
def camera_pose(body: Array, p_BC: Array, pan: float, tilt: float, out: Array) -> None:
    """p_RC [m] and R_CR of a camera at p_BC (3,) [m] on a platform turned by pan, tilt [rad], into out (4, 3)."""
    R_CB = camera_from_body(pan, tilt)
    for i in range(3):
        a, b, c = body[R_RB + i, 0], body[R_RB + i, 1], body[R_RB + i, 2]
        out[0, i] = body[P, i] + (a * p_BC[0] + b * p_BC[1] + c * p_BC[2])
        for j in range(3):
            out[1 + j, i] = R_CB[j, 0] * a + R_CB[j, 1] * b + R_CB[j, 2] * c
