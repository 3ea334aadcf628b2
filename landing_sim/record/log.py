"""The columnar log of a flight: one row a control cycle, one column a quantity, its unit in its name.

    true_*  the world       est_*, sd_*  what the filter believes, and its 1-sigma   ref_*, cmd_*  guidance, controller
    meas_*  raw readings    window_*  (n, m) edge windows, padded with -1 or NaN     flag_*  of the estimate

It holds no clock, host or path. parquet.py stores it.
"""

from __future__ import annotations

import functools
import math
from array import array
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np

from landing_sim.signals import (
    CameraSample,
    EdgeSet,
    Estimate,
    Feature,
    Reference,
    Residuals,
    Status,
    Step,
    Touchdown,
)
from landing_sim.types import Array

SCHEMA = 1

UNITS = (
    dict.fromkeys(("u", "v", "w", "vx", "vy", "vz", "wx", "wy", "wz"), "mps")
    | dict.fromkeys(("p", "q", "r", "bp", "bq", "br"), "radps")
    | dict.fromkeys(("phi", "theta", "psi"), "rad")
    | dict.fromkeys(("x", "y", "H", "W", "lx", "ly", "lH"), "m")
)
"""Unit suffix of every name an `Estimate` may carry; another name is logged as it is."""

RIGID = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H")
"""The paper's twelve states: what the world can contradict, so what NEES is taken over."""

_TRUE = (
    *("true_x_m", "true_y_m", "true_z_m", "true_vx_mps", "true_vy_mps", "true_vz_mps"),
    *("true_p_radps", "true_q_radps", "true_r_radps", "true_phi_rad", "true_theta_rad", "true_psi_rad"),
    *("true_wx_mps", "true_wy_mps", "true_wz_mps", "true_airspeed_mps", "true_alpha_rad", "true_beta_rad"),
    *("true_elevator_rad", "true_aileron_rad", "true_rudder_rad", "true_flap", "true_thrust_N"),
    *("true_wheel_left_m", "true_wheel_right_m", "true_wheel_third_m"),
    *("true_ground_left", "true_ground_right", "true_ground_third", "true_load_factor"),
    *("true_camera_x_m", "true_camera_y_m", "true_camera_z_m", "true_pan_rad", "true_tilt_rad"),
)
_COMMAND = (
    *("cmd_elevator_rad", "cmd_aileron_rad", "cmd_rudder_rad", "cmd_throttle", "cmd_flap"),
    *("cmd_brake_left", "cmd_brake_right", "cmd_pan_rad", "cmd_tilt_rad"),
)
_REFERENCE = (
    *("ref_airspeed_mps", "ref_height_m", "ref_climb_rate_mps", "ref_y_m"),
    *("ref_psi_rad", "ref_phi_rad", "ref_theta_ff_rad", "ref_r_ff_radps"),
)
_SENSED = (
    *("meas_p_radps", "meas_q_radps", "meas_r_radps", "meas_airspeed_mps"),
    *("meas_pan_rad", "meas_tilt_rad", "meas_frame"),
)
_UPDATE = ("nis", "nis_dof")
_FIXED = ("t_s", "est_t_s", *_TRUE, *_COMMAND, *_REFERENCE, *_SENSED, *_UPDATE)
_V = _FIXED.index("true_vx_mps")
_NO_GYRO = np.full(3, np.nan)


class LogError(ValueError):
    """A file that is not a log, or steps that do not make one."""


@dataclass(frozen=True, slots=True)
class FlightLog:
    """columns: name -> (n,) or (n, m) array; meta: what JSON can hold (scenario, seed, versions, touchdown, end)."""

    columns: Mapping[str, np.ndarray]
    meta: Mapping[str, Any]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.columns["t_s"])

    @property
    def touchdown(self) -> Touchdown | None:
        found = self.meta.get("touchdown")
        return None if found is None else Touchdown(**found)

    def estimate(self, name: str) -> Array:
        """(n,) what was believed; NaN before the runway was acquired, and where the filter has no such state."""
        column = f"est_{_with_unit(name)}"
        return self.columns[column] if column in self.columns else np.full(len(self), np.nan)

    def sigma(self, name: str) -> Array:
        column = f"sd_{_with_unit(name)}"
        return self.columns[column] if column in self.columns else np.full(len(self), np.nan)

    def truth(self, name: str) -> Array:
        """(n,) the truth of an estimate's name, at the time the estimate is for; NaN where there is none."""
        column = f"true_{_with_unit(name)}"
        if name == "W":
            return np.full(len(self), float(self.meta.get("runway_width_m", np.nan)))
        if column not in self.columns:
            return np.full(len(self), np.nan)
        t, at, values = self.columns["t_s"], self.columns["est_t_s"], self.columns[column]
        return values if np.array_equal(t, at) else np.interp(at, t, values)

    def error(self, name: str) -> Array:
        """(n,) estimate minus truth; angles wrapped to (-pi, pi]."""
        difference = self.estimate(name) - self.truth(name)
        return np.arctan2(np.sin(difference), np.cos(difference)) if name in ("phi", "theta", "psi") else difference


@dataclass(slots=True)
class LogBuilder:
    """Takes down what steps say, but no image: numbers while they are at hand, the rest, which are values, as it is."""

    _rows: array[float] = field(default_factory=lambda: array("d"))  # _FIXED, then R_RB, of one step after the other
    _estimate: list[Estimate] = field(default_factory=list)
    _reference: list[Reference] = field(default_factory=list)
    _edges: list[tuple[int, EdgeSet, Array, Residuals | None]] = field(default_factory=list)

    def add(self, step: Step) -> None:
        """One cycle. Raises LogError if the estimate's names change after the first step."""
        names = step.estimate.names
        if self._estimate and names is not self._estimate[0].names and names != self._estimate[0].names:
            raise LogError(f"the estimate's names changed in flight from {self._estimate[0].names} to {names}")
        gyro, airspeed, pan, tilt, frame = _NO_GYRO, math.nan, math.nan, math.nan, math.nan
        for sample in step.samples:
            data = sample.data
            if sample.sensor == "gyro":
                gyro = data
            elif sample.sensor == "airspeed":
                airspeed = data
            elif isinstance(data, CameraSample):
                pan, tilt, frame = data.pan, data.tilt, data.index
        seen = step.residuals
        for measurement in step.measurements:
            if measurement.geometry is not None:
                self._edges.append((len(self._estimate), measurement.geometry, measurement.z, seen))
        nis, dof = (math.nan, 0.0) if seen is None else (seen.nis, seen.dof)
        now, camera, command, reference = step.truth, step.camera, step.command, step.reference
        self._rows.extend((
            now.t, step.estimate.t, *now.p_RB.tolist(), *now.v_RB_R.tolist(), *now.w_RB_B.tolist(), *now.euler.tolist(),
            *now.wind_R.tolist(), now.airspeed, now.alpha, now.beta, *now.surfaces.tolist(), now.thrust,
            *now.wheels_height.tolist(), *now.on_ground.tolist(), now.load_factor,
            *camera.p_RC.tolist(), camera.pan, camera.tilt,
            command.elevator, command.aileron, command.rudder, command.throttle, command.flap,
            command.brake_left, command.brake_right, command.pan, command.tilt,
            reference.airspeed, reference.height, reference.climb_rate, reference.y,
            reference.psi, reference.phi, reference.theta_ff, reference.r_ff,
            *gyro.tolist(), airspeed, pan, tilt, frame, nis, dof,
            *now.R_RB.ravel().tolist(),
        ))  # fmt: skip
        self._estimate.append(step.estimate)
        self._reference.append(step.reference)

    def finish(
        self,
        *,
        scenario: Mapping[str, Any] | None = None,
        seed: int = 0,
        touchdown: Touchdown | None = None,
        end: str = "",
        runway: Mapping[str, float] | None = None,
        extra: Mapping[str, Any] | None = None,
    ) -> FlightLog:
        """The log of all steps so far.

        end : why the loop stopped, as the mission says ("stopped", "time", "numeric_error", ...)
        runway : true width_m, length_m: what the judge needs to say "off the runway"
        """
        n = len(self._estimate)
        if n == 0:
            raise LogError("no step was logged: the flight ended before its first control cycle")
        rows, names = np.array(self._rows).reshape(n, -1), self._estimate[0].names
        columns: dict[str, np.ndarray] = {name: rows[:, i].copy() for i, name in enumerate(_FIXED)}
        for name in ("true_ground_left", "true_ground_right", "true_ground_third"):
            columns[name] = columns[name] > 0.5
        for name in ("nis_dof", "meas_frame"):
            columns[name] = np.nan_to_num(columns[name], nan=-1.0).astype(np.int64)
        columns["true_H_m"] = -columns["true_z_m"]
        R_RB = rows[:, len(_FIXED) :].copy().reshape(n, 3, 3)
        uvw = np.einsum("nji,nj->ni", R_RB, rows[:, _V : _V + 3])  # R_BR v_R
        for i, name in enumerate(("u", "v", "w")):
            columns[f"true_{name}_mps"] = uvw[:, i]
        columns["true_groundspeed_mps"] = np.hypot(columns["true_vx_mps"], columns["true_vy_mps"])
        columns["mode"] = np.array([reference.mode for reference in self._reference])
        columns["valid"] = np.array([estimate.valid for estimate in self._estimate])
        mean = np.concatenate([estimate.mean for estimate in self._estimate]).reshape(n, -1)
        cov = self._covariances(len(names))
        for i, name in enumerate(names):
            columns[f"est_{_with_unit(name)}"] = np.where(columns["valid"], mean[:, i], np.nan)
            variance = np.where(columns["valid"], cov[:, i, i], np.nan)
            columns[f"sd_{_with_unit(name)}"] = np.sqrt(np.maximum(variance, 0.0))
        extras = [reference.extra for reference in self._reference]
        flags = [estimate.flags for estimate in self._estimate]
        for prefix, told in (("ref", extras), ("flag", flags)):
            for key in sorted(set().union(*told)):
                columns[f"{prefix}_{key}"] = np.array([told_now.get(key, np.nan) for told_now in told], dtype=float)
        for name in [name for name in columns if name.startswith("flag_")]:
            columns[name] = columns[name] == 1.0
        columns |= self._windows(n)
        runway = runway or {}
        meta: dict[str, Any] = {
            "schema": SCHEMA,
            "scenario": dict(scenario or {}),
            "seed": seed,
            "versions": versions(),
            "touchdown": None if touchdown is None else {f: float(getattr(touchdown, f)) for f in Touchdown.__slots__},
            "end": end,
            **{f"runway_{key}": float(value) for key, value in runway.items()},
            **(extra or {}),
        }
        log = FlightLog(columns, meta)
        columns["nees"], columns["nees_dof"] = _nees(log, names, cov)
        return log

    def _covariances(self, m: int) -> Array:
        """(n, m, m), NaN where the estimate has none."""
        nothing = np.full((m, m), np.nan)
        return np.concatenate([nothing if e.cov is None else e.cov for e in self._estimate]).reshape(-1, m, m)

    def _windows(self, n: int) -> dict[str, np.ndarray]:
        m = max((len(z) for _, _, z, _ in self._edges), default=0)
        if m == 0:
            return {}
        feature = np.full((n, m), -1, np.int64)
        status = np.full((n, m), -1, np.int64)
        uv = np.full((n, m, 2), np.nan)
        z = np.full((n, m), np.nan)
        innovation = np.full((n, m), np.nan)
        found = [edges for _, edges, _, _ in self._edges]
        counts = np.array([len(z_k) for _, _, z_k, _ in self._edges])
        row = np.repeat([k for k, _, _, _ in self._edges], counts)
        column = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        # the estimator's verdict, where it is about these windows
        judged = [
            seen if seen is not None and len(seen.status) == len(z_k) else None for _, _, z_k, seen in self._edges
        ]
        nothing = np.full(m, np.nan)
        feature[row, column] = np.concatenate([edges.feature for edges in found])
        uv[row, column] = np.concatenate([edges.centre for edges in found])
        z[row, column] = np.concatenate([z_k for _, _, z_k, _ in self._edges])
        status[row, column] = np.concatenate([e.status if j is None else j.status for e, j in zip(found, judged)])
        innovation[row, column] = np.concatenate(
            [nothing[:count] if j is None else j.innovation for count, j in zip(counts, judged)]
        )
        return {
            "window_feature": feature,
            "window_status": status,
            "window_u_px": uv[:, :, 0],
            "window_v_px": uv[:, :, 1],
            "window_z_px": z,
            "window_innovation_px": innovation,
            "threshold_found": ((feature == Feature.THRESHOLD) & (status == Status.FOUND)).any(axis=1),
        }


def _nees(log: FlightLog, names: tuple[str, ...], cov: Array) -> tuple[Array, np.ndarray]:
    """Squared error normalised by the covariance, over the rigid-body states the filter has; divide by its dof."""
    known = [name for name in RIGID if name in names]
    index = np.array([names.index(name) for name in known], np.int64)
    dof = np.full(len(log), len(index), np.int64)
    nees = np.full(len(log), np.nan)
    if len(index):
        error = np.column_stack([log.error(name) for name in known])
        use = np.flatnonzero(np.isfinite(error).all(axis=1))
        e, P = error[use], cov[np.ix_(use, index, index)]
        try:
            nees[use] = np.einsum("ni,ni->n", e, np.linalg.solve(P, e[:, :, None])[:, :, 0])
        except np.linalg.LinAlgError:  # a state pinned by the filter has no variance: no number for such rows
            for k, e_k, P_k in zip(use, e, P):
                with suppress(np.linalg.LinAlgError):
                    nees[k] = e_k @ np.linalg.solve(P_k, e_k)
    return nees, dof


def _with_unit(name: str) -> str:
    return f"{name}_{UNITS[name]}" if name in UNITS else name


@functools.cache
def versions() -> dict[str, str]:
    """Of the packages whose numbers the results depend on."""
    packages = ("landing-sim", "jsbsim", "numpy", "scipy", "numba", "opencv-python-headless", "control")
    found = {}
    for package in packages:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found
