"""Accuracy against the limit: the posterior Cramer-Rao bound along a flown trajectory, beside the filter's RMS error.

    J_{k+1} = D22 - D21 (J_k + D11)^-1 D12                                          (Tichavsky et al., eq. 21)
    D11 = F' Q^-1 F,  D12 = -F' Q^-1 = D21',  D22 = Q^-1 + H' R^-1 H                 (additive Gaussian noise)

F and H are the filter's own transition and measurement Jacobians, taken at the TRUE state; Q is the filter's process
noise, R what the front end and the data sheets say of a measurement; J_0 is the information of the acquired pose and the
filter's priors. By the matrix inversion lemma the recursion is J_{k+1} = (F J_k^-1 F' + Q)^-1 + H' R^-1 H, and it is
carried on as J^-1, which needs no inverse of Q or of a prior: constant states (biases) and known ones have none. The
expectations over trajectories are left out: it is the bound for flights along the one that was flown.

The bound is that of the filter's model. Aircraft and wind of the simulation are not drawn from Q, so an RMS error can lie
below it (Q allows for more than happened) as well as above (the model is wrong, or R is not what the edges' errors are).
Two figures tell of R: `edge_error` is the RMS of true edge errors in units of the believed ones; `edge_lasting` is the same
of their means over windows of one feature in SECOND images, times the square root of how many there are. Both are 1 where
errors are as large as believed and independent from window to window and image to image, as the bound takes them to be.
What is painted beside a border pulls its edge the same way image after image: a fiftieth of a pixel hardly shows in
`edge_error`, where noise is thrice that, but it stays where noise is averaged out, and it then makes most of the ratio.

The recursion begins with the filter's own prior: the covariance it gives to the acquired pose and to what it does not know
then, wind and offsets of the believed aircraft among it. "Matched" draws no errors into the believed aircraft and tells the
filter so. JSBSim's aircraft is still not built as the believed one: what is left of the offsets is held to be none.

Source     P. Tichavsky, C. H. Muravchik, A. Nehorai 1998, "Posterior Cramer-Rao bounds for discrete-time nonlinear
           filtering", IEEE Trans. Signal Processing 46(5).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench_parts.baseline import COMPARED, FROM, window
from bench_parts.flights import land
from landing_sim.estimators import states
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.missions.runway_landing import RunwayParts
from landing_sim.scenario import Scenario, load
from landing_sim.signals import Command, EdgeSet, Measurement, Status, Step
from landing_sim.vehicle import Vehicle
from landing_sim.vehicle import load as load_vehicle

Array = np.ndarray
MATCHED = ("believed.aero_sigma=0", "believed.mass_sigma=0")
WORST_BIN = 100.0  # [m]
SECOND = 16  # images of 60 ms


def measured(P: Array, H: Array, R: Array) -> Array:
    """(P^-1 + H' R^-1 H)^-1 with variances R (m,), for a P that may hold states which are known."""
    PH = P @ H.T
    return P - PH @ np.linalg.solve(H @ PH + np.diag(R), PH.T)


def true_state(step: Step, width: float) -> Array:
    """Layout of `states`; errors of sensors and of the believed aircraft are left at zero, where Jacobians do not feel
    them (pan and tilt are given as they truly were)."""
    truth, x = step.truth, np.zeros(states.N)
    x[:3] = truth.R_RB.T @ truth.v_RB_R
    x[3:6], x[6:9] = truth.w_RB_B, truth.euler
    x[9:12] = truth.p_RB * (1.0, 1.0, -1.0)
    x[list(states.WIND)], x[states.WIDTH] = truth.wind_R, width
    return x


class Bound:
    """The recursion along a flight, fed step by step with what the filter was fed with.

    Transition, process noise and inertial updates are the filter's own steps, taken from the true state; a Kalman
    covariance at the true state is the inverse of the information.
    """

    def __init__(self, ekf: RunwayEkf, width: float, trim: Command, delay: float) -> None:
        if ekf.config.factorisation != "dense" or len(ekf.blocks.starts) > 2 or ekf.config.width == "separate":
            raise ValueError("the bound is taken along a dense filter in one piece: the others approximate it")
        self._ekf, self._width, self._delay = ekf, width, delay
        self._acting, self._pending = trim, deque[tuple[float, Command]]()
        self._memory, self._images = ekf.init(0.0), 0
        self.edge_errors: list[float] = []  # in units of the believed ones
        self.edge_groups: list[tuple[int, int]] = []  # of each, the second it was seen in and its feature

    def add(self, step: Step) -> Array | None:
        """(12,) standard deviations of the paper's states that no unbiased filter can beat; None before the start."""
        ekf, t = self._ekf, step.truth.t
        while self._pending and self._pending[0][0] <= t + 1e-9:
            self._memory = ekf.predict(self._memory, self._acting, self._pending[0][0])
            self._acting = self._pending.popleft()[1]
        self._memory = ekf.predict(self._memory, self._acting, t)
        x = true_state(step, self._width)
        for m in step.measurements:
            if self._memory.valid:
                self._memory = self._memory._replace(x=x)
            if m.kind == "edges" and m.geometry is not None:
                self._edges(step, m, m.geometry, x)
            elif m.kind != "pose" or not self._memory.valid:
                self._memory = ekf.update(self._memory, m)
        self._pending.append((t + self._delay, step.command))
        if not self._memory.valid:
            return None
        self._memory = self._memory._replace(x=x)
        return np.sqrt(np.diag(self._memory.P)[:12])

    def _edges(self, step: Step, m: Measurement, seen: EdgeSet, x: Array) -> None:
        ekf, found = self._ekf, seen.status == Status.FOUND
        h, Hx = np.empty(len(m.z)), np.empty((len(m.z), states.N))
        edge_model(
            x, seen.feature, seen.centre, seen.direction, step.camera.pan, step.camera.tilt,
            ekf._lever, ekf._focal, ekf._slope, h, Hx,
        )  # fmt: skip
        R = (m.R + ekf._extra_R)[found]
        self.edge_errors += list((m.z - h)[found] / np.sqrt(R))
        self.edge_groups += [(self._images // SECOND, int(feature)) for feature in seen.feature[found]]
        self._images += 1
        P = self._memory.P
        if found.any():
            P = measured(P, Hx[found][:, ekf.blocks.index], R)
        self._memory = self._memory._replace(P=P, frames=self._memory.frames + 1)


@dataclass(frozen=True, slots=True)
class Flight:
    """Errors of one flight beside their bounds, where they are compared; edge errors from the start to there."""

    x: Array  # (n,) [m]
    errors: Array  # (n, 3) [m] of range, height, lateral
    bounds: Array  # (n, 3) [m]
    edge_error: float  # RMS in believed ones
    edge_lasting: float


def one(scenario: Scenario, vehicle: Vehicle) -> Flight:
    """Fly it. Raises ValueError if the estimator is not one that the bound is for, or nothing is left to compare."""
    found: list[RunwayParts] = []
    steps: list[Step] = []
    flight = land(scenario, vehicle, prepare=found.append, watch=steps.append)
    parts = found[0]
    estimator = parts.estimator
    if isinstance(estimator, Rewind) or not isinstance(estimator, RunwayEkf):
        raise ValueError(f"{scenario.name}: the bound is for the runway filter with images that are not late")
    use = window(flight.log)
    if not use.any():
        raise ValueError(f"{scenario.name}: the runway was not acquired before the threshold was lost")
    bound = Bound(estimator, scenario.runway.width_m, parts.plant.trimmed, parts.clock.delay * parts.clock.dt)
    limits = np.full((len(flight.log), 12), np.nan)
    for k in range(int(np.flatnonzero(use)[-1]) + 1):
        row = bound.add(steps[k])
        if row is not None:
            limits[k] = row
    index = [states.NAMES.index(name) for name in COMPARED.values()]
    errors = np.column_stack([flight.log.error(name) for name in COMPARED.values()])
    return Flight(
        flight.log["true_x_m"][use],
        errors[use],
        limits[use][:, index],
        rms_of(np.array(bound.edge_errors)),
        lasting(bound.edge_errors, bound.edge_groups),
    )


def lasting(errors: Sequence[float], groups: Sequence[Hashable]) -> float:
    """RMS of the errors' means within their groups, each times the square root of its size: 1 for independent errors of
    variance 1."""
    sums: dict[Hashable, list[float]] = {}
    for error, group in zip(errors, groups, strict=True):
        sums.setdefault(group, []).append(error)
    return rms_of(np.array([sum(members) / math.sqrt(len(members)) for members in sums.values()]))


def beside(
    scenario: str, changes: Sequence[str], seeds: int, say: Callable[[str], None] = lambda line: None
) -> dict[str, Any]:
    """RMS error over seeds against the bound, for the augmented and the paper's twelve-state filter, with the aircraft
    as believed (matched) and believed wrongly (as the scenario has it)."""
    out: dict[str, Any] = {}
    for kind in ("augmented", "plain"):
        for world, believed in (("matched", MATCHED), ("mismatched", ())):
            wanted = [*changes, *believed, f"filter.kind={kind}"]
            flights = []
            for seed in range(1, seeds + 1):
                s = load(scenario, [*wanted, f"seed={seed}"])
                flights.append(one(s, load_vehicle(s.aircraft.model)))
            figures = out.setdefault(kind, {})[world] = compare(flights)
            say(f"{scenario} {kind}, {world}: " + ", ".join(f"{n} {figures[n]['ratio']:.2f}" for n in COMPARED))
    return out


def compare(flights: Sequence[Flight]) -> dict[str, Any]:
    """RMS over flights and cycles of error and bound, their ratio with its standard error, and the worst ratio over
    stretches of 100 m. Errors of one flight hang together: the standard error is from leaving out one flight at a time."""
    x = np.concatenate([f.x for f in flights])
    e, b = (np.concatenate(parts) for parts in ([f.errors for f in flights], [f.bounds for f in flights]))
    out: dict[str, Any] = {
        "flights": len(flights),
        "edge_error": float(np.mean([f.edge_error for f in flights])),
        "edge_lasting": float(np.mean([f.edge_lasting for f in flights])),
    }
    bins = np.arange(FROM, 0.0, WORST_BIN)
    for i, name in enumerate(COMPARED):
        rms, limit = rms_of(e[:, i]), rms_of(b[:, i])
        parts = [
            rms_of(e[m, i]) / rms_of(b[m, i])
            for m in ((x >= lo) & (x < lo + WORST_BIN) for lo in bins)
            if m.sum() >= 5 * len(flights)
        ]
        out[name] = {
            "rms_m": rms,
            "bound_m": limit,
            "ratio": rms / limit,
            "ratio_se": standard_error([f.errors[:, i] for f in flights], [f.bounds[:, i] for f in flights]),
            "worst_100m": max(parts, default=math.nan),
        }
    return out


def standard_error(errors: Sequence[Array], bounds: Sequence[Array]) -> float:
    """Of the ratio of their RMS over all flights, by the jackknife; NaN of a single flight."""
    n = len(errors)
    if n < 2:
        return math.nan
    squares = np.array([[np.sum(e**2), np.sum(b**2)] for e, b in zip(errors, bounds, strict=True)])
    left = squares.sum(axis=0) - squares
    ratios = np.sqrt(left[:, 0] / left[:, 1])
    return float(np.sqrt((n - 1) / n * np.sum((ratios - ratios.mean()) ** 2)))


def rms_of(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
