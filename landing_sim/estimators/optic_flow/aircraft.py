"""Optic flow of the ground ahead as a measurement of an aircraft's motion, beside edges and gyros.

A receptor row looks along d = (cos a, 0, sin a) of the body, a below its x axis. The ground point that it sees, over level
ground H below, turns in body axes at

    omega = q + (u sin a - w cos a) (cos theta cos phi sin a - sin theta cos a) / H,

> 0 towards larger angles; u, w over the ground. With wings level that is q + (V/H) sin(a - theta) sin(a - theta + gamma):
the V/H sin^2 law, less what the descent takes from it. The eye sits in the cg.

Source     Sabiron et al. 2014, eqs. (3)-(5), for 6 degrees of freedom. Departs: theta, q nose up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from landing_sim.estimators.runway_steps import correct_dense, of_index
from landing_sim.estimators.states import PHI, THETA, H, N, Q, U, W
from landing_sim.jit import kernel
from landing_sim.signals import Estimate, Measurement, Sample
from landing_sim.types import Array


@kernel
def aircraft_flow(x: Array, alpha: float, row: Array) -> float:
    """omega [rad/s] at alpha [rad] of the state x (26,), and row (26,) = d omega / dx."""
    ca, sa = math.cos(alpha), math.sin(alpha)
    cph, sph, cth, sth = math.cos(x[PHI]), math.sin(x[PHI]), math.cos(x[THETA]), math.sin(x[THETA])
    across = x[U] * sa - x[W] * ca  # [m/s] of the eye, square to its line of sight
    down = cth * cph * sa - sth * ca  # of the line of sight
    near = 1.0 / x[H]
    row[:] = 0.0
    row[U], row[W] = sa * down * near, -ca * down * near
    row[Q] = 1.0
    row[PHI] = -across * cth * sph * sa * near
    row[THETA] = -across * (sth * cph * sa + cth * ca) * near
    row[H] = -across * down * near * near
    return x[Q] + across * down * near  # type: ignore[no-any-return]


@kernel
def flow_dense(
    x: Array, P: Array, index: np.ndarray, starts: np.ndarray, alpha: float, seen: float, variance: float, gate: float
) -> tuple[Array, Array, float]:
    """x, P after a flow `seen` [rad/s] along alpha, or as they were if it is beyond `gate` sigma; innovation in sigma."""
    Hx = np.empty((1, N))
    nu = np.array([seen - aircraft_flow(x, alpha, Hx[0])])
    Hn = of_index(Hx, index)
    h = Hn[0]
    ratio = nu[0] / math.sqrt(h @ P @ h + variance)
    if not abs(ratio) <= gate:
        return x, P, ratio
    x, P, _, _ = correct_dense(x, P, index, starts, Hn, np.array([variance]), nu, np.ones(1, dtype=np.bool_))
    return x, P, ratio


@dataclass(slots=True)
class FieldFlowFrontEnd:
    """interfaces.FrontEnd of one sensor, mounted at alpha [rad] below the body's x axis as is believed.

    A flow is invalid, and not passed on, where it is slower or faster than the row can time, where the ground is nearer
    than `lowest` [m] (there the runway's edges say more), and where its edge was longer under way than is kept.

    floor [rad/s], share : one sigma of a reading is floor + share |omega|, and besides, for it is a mean over the time T of
        a passage, unsteady T^2 / 24, with unsteady [rad/s^3] the flow's second derivative (rms)
    row : [rad] from the first to the last receptor; oldest [s] of the middle of a passage
    """

    sensor: str
    alpha: float
    floor: float
    share: float
    slowest: float
    fastest: float
    lowest: float
    oldest: float
    row: float = 0.0
    unsteady: float = 0.0

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        if not sample.data.flows:
            return ()
        believed = estimate()
        if not believed.valid or believed["H"] < self.lowest:
            return ()
        out = []
        for seen, t in zip(sample.data.flows, sample.data.times):
            if self.slowest <= abs(seen) <= self.fastest and sample.t_arrival - t <= self.oldest:
                passage = self.row / abs(seen)
                sigma = math.hypot(self.floor + self.share * abs(seen), self.unsteady * passage * passage / 24.0)
                z, R = np.array([self.alpha, seen]), np.array([0.0, sigma * sigma])
                out.append(Measurement("flow", t, sample.t_arrival, z, R))
        return tuple(out)
