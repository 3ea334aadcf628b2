"""Accuracy against the limit: the posterior Cramer-Rao bound along a flown trajectory, beside the filter's RMS error.

    J_{k+1} = D22 - D21 (J_k + D11)^-1 D12                                          (Tichavsky et al., eq. 21)
    D11 = F' Q^-1 F,  D12 = -F' Q^-1 = D21',  D22 = Q^-1 + H' R^-1 H                 (additive Gaussian noise)

F and H are the filter's own transition and measurement Jacobians, taken at the TRUE state; Q is the filter's process
noise, R what the front end and the data sheets say of a measurement; J_0 is the information of the acquired pose and the
filter's priors. By the matrix inversion lemma the recursion is J_{k+1} = (F J_k^-1 F' + Q)^-1 + H' R^-1 H, and it is
carried on as J^-1, which needs no inverse of Q or of a prior: constant states (biases) and known ones have none. The
expectations over trajectories are left out: it is the bound for flights along the one that was flown.

The bound is that of the filter's model. Aircraft and wind of the simulation are not drawn from Q, so an RMS error can lie
below it (Q allows for more than happened) as well as above (the model is wrong, or R too small): `edge_error` is the RMS
of true edge errors in units of the believed ones, which tells the latter.

Source     P. Tichavsky, C. H. Muravchik, A. Nehorai 1998, "Posterior Cramer-Rao bounds for discrete-time nonlinear
           filtering", IEEE Trans. Signal Processing 46(5).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from bench_parts.baseline import COMPARED, FROM, window
from bench_parts.flights import land
from landing_sim.estimators import states
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.missions.runway_landing import Parts
from landing_sim.scenario import Scenario, load
from landing_sim.signals import Command, EdgeSet, Measurement, Status, Step
from landing_sim.vehicle import Vehicle
from landing_sim.vehicle import load as load_vehicle

Array = np.ndarray
MATCHED = ("believed.aero_sigma=0", "believed.mass_sigma=0")
WORST_BIN = 100.0  # [m]


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
        self._memory = ekf.init(0.0)
        self.edge_errors: list[float] = []  # in units of the believed ones

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
        P = self._memory.P
        if found.any():
            P = measured(P, Hx[found][:, ekf.blocks.index], R)
        self._memory = self._memory._replace(P=P, frames=self._memory.frames + 1)


def one(scenario: Scenario, vehicle: Vehicle) -> tuple[Array, Array, Array, float]:
    """Of one flight: x (n,), errors (n, 3), bounds (n, 3) of range, height, lateral; RMS edge error in believed ones."""
    found: list[Parts] = []
    steps: list[Step] = []
    flight = land(scenario, vehicle, prepare=found.append, watch=steps.append)
    parts = found[0]
    estimator = parts.estimator
    if isinstance(estimator, Rewind) or not isinstance(estimator, RunwayEkf):
        raise ValueError(f"{scenario.name}: the bound is for the runway filter with images that are not late")
    bound = Bound(estimator, scenario.runway.width_m, parts.plant.trimmed, parts.clock.delay * parts.clock.dt)
    rows = [bound.add(step) for step in until_ground(steps)]
    limits = np.full((len(flight.log), 12), np.nan)
    for k, row in enumerate(rows):
        if row is not None:
            limits[k] = row
    use = window(flight.log)
    index = [states.NAMES.index(name) for name in COMPARED.values()]
    errors = np.column_stack([flight.log.error(name) for name in COMPARED.values()])
    rms = float(np.sqrt(np.mean(np.square(bound.edge_errors)))) if bound.edge_errors else math.nan
    return flight.log["true_x_m"][use], errors[use], limits[use][:, index], rms


def until_ground(steps: Sequence[Step]) -> Iterator[Step]:
    for step in steps:
        if step.truth.on_ground.any():
            return
        yield step


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


def compare(flights: Sequence[tuple[Array, Array, Array, float]]) -> dict[str, Any]:
    """RMS over flights and cycles of error and bound, and the worst of their ratios over stretches of 100 m."""
    x, e, b = (np.concatenate([f[i] for f in flights]) for i in range(3))
    out: dict[str, Any] = {"flights": len(flights), "edge_error": float(np.mean([f[3] for f in flights]))}
    bins = np.arange(FROM, 0.0, WORST_BIN)
    for i, name in enumerate(COMPARED):
        rms, limit = rms_of(e[:, i]), rms_of(b[:, i])
        parts = [
            rms_of(e[m, i]) / rms_of(b[m, i])
            for m in ((x >= lo) & (x < lo + WORST_BIN) for lo in bins)
            if m.sum() >= 5 * len(flights)
        ]
        out[name] = {"rms_m": rms, "bound_m": limit, "ratio": rms / limit, "worst_100m": max(parts, default=math.nan)}
    return out


def rms_of(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
