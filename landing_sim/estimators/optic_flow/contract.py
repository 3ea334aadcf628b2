"""What every flow observer takes and gives, so that one can stand for another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from landing_sim.types import Array


@dataclass(frozen=True, slots=True)
class FlowState:
    """X (5,) = [h, q, omega_x, omega_z, theta] in SI, and P (5, 5) with h in km: the spread of its error."""

    t: float
    X: Array
    P: Array
    used: bool = True  # whether the latest look was believed


@dataclass(frozen=True, slots=True)
class Push:
    """What drives the lander, held over a step: commands over the mass that they have left."""

    a: float  # [m/s^2] u_th/m
    spin: float  # [rad/s^2] (R/I) u_theta


class FlowObserver(Protocol):
    """Frozen settings and pure functions; the state is a value."""

    def start(self, t: float, X: Array) -> FlowState:
        """At time t [s] of the reference, believing X (5,)."""

    def predict(self, state: FlowState, push: Push, dt: float) -> FlowState: ...

    def look(self, state: FlowState, alpha: float, flow: float, sigma: float) -> FlowState:
        """One sensor at alpha [rad] says `flow` [rad/s], give or take sigma."""
