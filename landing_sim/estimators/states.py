"""Layout of the aircraft filters' state: twelve of the paper, then what a filter may add.

u v w inertial velocity in body axes [m/s]; p q r [rad/s]; phi theta psi [rad]; x y H of the cg in R [m]; wx wy wz wind in
R [m/s]; cX cZ cm what the believed coefficients of axial force, normal force and pitching moment lack; bp bq br gyro bias
[rad/s]; epan etilt encoder bias of the camera platform [rad]; jpan jtilt the encoders' noise in the latest reading [rad],
which shifts all edges of an image together; W runway width [m].
The mean always has all of them; a filter's covariance covers those it estimates.
"""

from __future__ import annotations

NAMES = (
    *("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H"),
    *("wx", "wy", "wz", "cX", "cZ", "cm", "bp", "bq", "br", "epan", "etilt", "jpan", "jtilt", "W"),
)
N = len(NAMES)
U, V, W, P, Q, R, PHI, THETA, PSI, X, Y, H = range(12)
WX, WY, WZ, CX, CZ, CM, BP, BQ, BR, EPAN, ETILT, JPAN, JTILT, WIDTH = range(12, N)

PAPER = tuple(range(12))
LONGITUDINAL = (U, W, Q, THETA, X, H)  # Dickmanns & Schell 1992, eq. (2a)
LATERAL = (V, P, R, PHI, PSI, Y)  # eq. (3a)
WIND = (WX, WY, WZ)
OFFSET = (CX, CZ, CM)
DRIVING = CM + 1  # states up to here move the aircraft
GYRO_BIAS = (BP, BQ, BR)
ENCODER = (EPAN, ETILT, JPAN, JTILT)
