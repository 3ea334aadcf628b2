"""Correction terms kappa: how strongly an observer believes what it measures."""

from __future__ import annotations

import math
from dataclasses import dataclass

from landing_sim.jit import kernel


@dataclass(frozen=True, slots=True)
class HighGain:
    """kappa = Lambda^-1 K (y - C(x_hat)), eqs. (11)-(13), with K1 = 2 xi omega, K2 = omega^2, K3 = alpha.

    Small lambda is fast: the poles are omega / lambda1 and alpha / lambda2.
    """

    xi: float = 0.99
    omega: float = 7.0  # [rad/s]
    alpha: float = 1.0  # [1/s]
    lambda1: float = 1.0
    lambda2: float = 1.0

    def continuous(self) -> tuple[float, float, float]:
        """Of y_output [1/s], of y_output' [1/s^2] and of the other output [1/s]."""
        k1, k2 = 2.0 * self.xi * self.omega / self.lambda1, (self.omega / self.lambda1) ** 2
        return k1, k2, self.alpha / self.lambda2

    def discrete(self, dt: float) -> tuple[float, float, float]:
        """The same poles, exactly, for an observer that predicts over dt [s] and then corrects: -, 1/s, -."""
        l1, l2 = pole_pair(self.xi, self.omega / self.lambda1, dt)
        return l1, l2, 1.0 - math.exp(-self.alpha / self.lambda2 * dt)


@dataclass(frozen=True, slots=True)
class SuperTwisting:
    """Sliding mode: 1.5 sqrt(L |e|) sgn(e) on y_output, 1.1 L sgn(e) on its derivative, alpha e on the other output.

    It is the differentiator of order 1; what the observer does not model of y_output'' must stay below L.
    Across |e| < layer, sgn(e) is e / layer: measured in samples, the true sign is a relay with a delay, which chatters.

    Source     Levant 2003, eq. (6), with its gains; named as an alternative in Gibert et al. 2015, section 3.2.
    """

    L: float = 1.0  # [1/s^2]
    alpha: float = 1.0  # [1/s]
    layer: float = 1e-3


@kernel
def pole_pair(xi: float, omega: float, dt: float) -> tuple[float, float]:
    """l1, l2 [1/s] with which y += l1 e, rate += l2 e after an exact prediction have the poles of xi, omega sampled at dt.

    For xi = 1 and p = exp(-omega dt): l1 = 1 - p^2, l2 = (1 - p)^2 / dt.
    """
    decay = math.exp(-xi * omega * dt)
    spread = omega * math.sqrt(abs(xi * xi - 1.0)) * dt
    total = 2.0 * decay * (math.cos(spread) if xi < 1.0 else math.cosh(spread))
    return 1.0 - decay * decay, (1.0 + decay * decay - total) / dt
