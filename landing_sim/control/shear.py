"""What a reported wind lets one expect at another height: it falls with the logarithm of the height over the ground.

Source     MIL-F-8785C (1980), section 3.7.3.2, z0 = 0.15 ft. Towers report the wind at 33 ft. The true wind's laws are in
           world/shear.py, which nothing on board may import: the air may follow another, or none.
"""

from __future__ import annotations

import math

REPORTED_AT, ROUGHNESS = 10.06, 0.0457  # [m]
_LOWEST, _HIGHEST = 1.0, 300.0  # [m] where the law is taken to hold
_PER_LOG = 1.0 / math.log(REPORTED_AT / ROUGHNESS)


def expected_share(height: float) -> tuple[float, float]:
    """Wind at `height` [m] over that reported, and its derivative [1/m]: ln(h/z0) / ln(h_ref/z0)."""
    h = min(max(height, _LOWEST), _HIGHEST)
    return math.log(h / ROUGHNESS) * _PER_LOG, _PER_LOG / h if h == height else 0.0
