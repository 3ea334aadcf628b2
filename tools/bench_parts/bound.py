"""Accuracy against the limit: the posterior Cramer-Rao bound along a flown trajectory, beside the filter's RMS error.

    J_{k+1} = D22 - D21 (J_k + D11)^-1 D12                                          (Tichavsky et al., eq. 21)
    D11 = F' Q^-1 F,  D12 = -F' Q^-1 = D21',  D22 = Q^-1 + H' R^-1 H                 (additive Gaussian noise)

F and H are the filter's own transition and measurement Jacobians, taken at the TRUE state; Q is the filter's process
noise, R what the front end and the data sheets say of a measurement; J_0 is the information of the acquired pose and the
filter's priors. By the matrix inversion lemma the recursion is J_{k+1} = (F J_k^-1 F' + Q)^-1 + H' R^-1 H, which needs no
inverse of Q: constant states (biases) have none. The expectations over trajectories are left out: it is the bound for
flights along the one that was flown.

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
from landing_sim.estimators import kalman, states
from landing_sim.estimators.aircraft_model import downwash, propagate, thrust
from landing_sim.estimators.edge_model import edge_model
from landing_sim.estimators.inertial_model import airspeed_model, gyro_model
from landing_sim.estimators.rewind import Rewind
from landing_sim.estimators.runway_ekf import RunwayEkf
from landing_sim.missions.runway_landing import Parts
from landing_sim.scenario import Scenario, load
from landing_sim.signals import Command, Measurement, Status, Step
from landing_sim.vehicle import Vehicle
from landing_sim.vehicle import load as load_vehicle

Array = np.ndarray
MATCHED = ("believed.aero_sigma=0", "believed.mass_sigma=0")
WORST_BIN = 100.0  # [m]


def predicted(J: Array, F: Array, Q: Array) -> Array:
    """Information after a transition, before its measurements: (F J^-1 F' + Q)^-1."""
    return np.linalg.inv(F @ np.linalg.inv(J) @ F.T + Q)


def measured(J: Array, H: Array, R: Array) -> Array:
    """Information with measurements of variances R (m,)."""
    return J + (H.T / R) @ H


def true_state(step: Step, width: float) -> Array:
    """(23,) layout of `states`; the sensors' errors are left at zero: only pan and tilt need them, see `_edges`."""
    truth, x = step.truth, np.zeros(states.N)
    x[:3] = truth.R_RB.T @ truth.v_RB_R
    x[3:6], x[6:9] = truth.w_RB_B, truth.euler
    x[9:12] = truth.p_RB * (1.0, 1.0, -1.0)
    x[12:15], x[states.WIDTH] = truth.wind_R, width
    return x


class Bound:
    """The recursion along a flight, fed step by step with what the filter was fed with."""

    def __init__(self, ekf: RunwayEkf, width: float, trim: Command, delay: float) -> None:
        self._ekf, self._width, self._delay = ekf, width, delay
        self._acting, self._pending = trim, deque[tuple[float, Command]]()
        self._t, self._x, self._shadow = 0.0, np.zeros(states.N), np.zeros(6)
        self._frames = 0
        self.P: Array | None = None
        self.edge_errors: list[float] = []  # in units of the believed ones

    def add(self, step: Step) -> Array | None:
        """(12,) standard deviations of the paper's states that no unbiased filter can beat; None before the start."""
        t, x = step.truth.t, true_state(step, self._width)
        while self._pending and self._pending[0][0] <= t + 1e-9:
            self._predict(self._pending[0][0])
            self._acting = self._pending.popleft()[1]
        self._predict(t)
        self._x = x
        for m in step.measurements:
            self._update(step, m)
        self._pending.append((t + self._delay, step.command))
        return None if self.P is None else np.sqrt(np.diag(self.P)[:12])

    def _predict(self, t: float) -> None:
        dt, ekf, c = t - self._t, self._ekf, self._acting
        if dt <= 1e-12:
            return
        self._t = t
        if self.P is None:
            return
        u, Phi15 = np.array([c.elevator, c.aileron, c.rudder, c.throttle, c.flap]), np.empty((15, 15))
        propagate(self._x, self._shadow, u, ekf._par, False, dt, Phi15)
        F = kalman.expand(Phi15, ekf.blocks.index, ekf._keep)
        phase = "start" if self._frames < ekf.config.start_frames else "air"
        self.P = F @ self.P @ F.T + ekf._process_noise(F, dt, phase)

    def _update(self, step: Step, m: Measurement) -> None:
        ekf = self._ekf
        if m.kind == "pose" and self.P is None:
            self.P = step.estimate.cov
            c, x = self._acting, self._x
            steady = thrust(c.throttle, step.truth.airspeed, ekf._par)
            eps = downwash(x, math.atan2(x[2], x[0]), c.flap, ekf._par)
            self._shadow = np.array([c.elevator, c.aileron, c.rudder, c.flap, steady, eps])
        elif self.P is None:
            return
        elif m.kind == "gyro":
            self._take(gyro_model(self._x, m.z)[1], m.R)
        elif m.kind == "airspeed":
            self._take(airspeed_model(self._x, m.z[0])[1], m.R)
        elif m.kind == "edges" and m.geometry is not None:
            self._frames += 1
            g, found = m.geometry, m.geometry.status == Status.FOUND
            h, Hx = np.empty(len(m.z)), np.empty((len(m.z), states.N))
            edge_model(self._x, g.feature, g.centre, g.direction, step.camera.pan, step.camera.tilt, ekf._lever,
                       ekf._focal, ekf._slope, h, Hx)  # fmt: skip
            R = (m.R + ekf._extra_R)[found]
            self.edge_errors += list((m.z - h)[found] / np.sqrt(R))
            self._take(Hx[found], R)

    def _take(self, Hx: Array, R: Array) -> None:
        if self.P is not None and len(R):
            self.P = np.linalg.inv(measured(np.linalg.inv(self.P), Hx[:, self._ekf.blocks.index], R))


def one(scenario: Scenario, vehicle: Vehicle) -> tuple[Array, Array, Array, float]:
    """Of one flight: x (n,), errors (n, 3), bounds (n, 3) of range, height, lateral; RMS edge error in believed ones."""
    found: list[Parts] = []
    rows: list[Array] = []
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
