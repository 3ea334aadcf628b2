"""The runway's width. The image alone shows only ratios: a wider runway, further away, flown at faster, looks the same.

What gives the scale is speed: on a runway believed too wide the aircraft seems to move faster over the ground than the air
data say. That holds without wind along the track; a headwind looks like a wider runway, W / W_true = V_air / V_ground.

Two ways: W as a state of the filter, or a second, scalar filter beside it (`WidthFilter`), as in the paper.

Source     Dickmanns & Schell 1992, section 7.1 ("another Kalman filter for runway width estimation"; it is stopped when
           the threshold is lost). The paper does not give its equations; these are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from landing_sim.estimators import states
from landing_sim.types import Array

SCALED = [states.U, states.V, states.W, states.X, states.Y, states.H]  # what grows with the width, seen in images alone


@dataclass(frozen=True, slots=True)
class WidthFilter:
    """Scalar filter on W: z = W_used V_air / V_ground, from the airspeed reading and the main filter's ground speed.

    correlation : images over which the main filter's error of ground speed lasts, by which its variance is taken larger
    """

    airspeed_sigma: float  # [m/s]
    correlation: float = 15.0

    def update(
        self, W: float, variance: float, airspeed: float, ground: float, ground_variance: float
    ) -> tuple[float, float]:
        """W [m] and its variance after one reading; speeds in m/s."""
        if ground < 10.0:
            return W, variance
        z = W * airspeed / ground
        relative = (self.airspeed_sigma**2 + self.correlation * ground_variance) / ground**2
        gain = variance / (variance + z * z * relative)
        return W + gain * (z - W), (1.0 - gain) * variance


def rescaled(x: Array, factor: float) -> Array:
    """The state seen in a world larger by `factor`: lengths and ground speed grow, what the air data say stays.

    x (26,); the wind along the way takes up the difference in speed.
    """
    out = x.copy()
    out[SCALED] *= factor
    grown = (factor - 1.0) * x[states.U : states.W + 1]
    # along track only, to first order in the (small) attitude
    out[states.WX] += grown[0] * math.cos(x[states.PSI])
    out[states.WY] += grown[0] * math.sin(x[states.PSI])
    return out
