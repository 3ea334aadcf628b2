"""The columnar log of a flight: one row a control cycle, one column a quantity, its unit in its name.

    true_*  the world       est_*, sd_*  what the filter believes, and its 1-sigma   ref_*, cmd_*  guidance, controller
    meas_*  raw readings    window_*  (n, m) edge windows, padded with -1 or NaN     flag_*  of the estimate

It holds no clock, host or path. parquet.py stores it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np

from landing_sim.signals import CameraSample, EdgeSet, Feature, Residuals, Status, Step, Touchdown
from landing_sim.types import Array

SCHEMA = 1

UNITS = (
    dict.fromkeys(("u", "v", "w", "wx", "wy", "wz"), "mps")
    | dict.fromkeys(("p", "q", "r", "bp", "bq", "br"), "radps")
    | dict.fromkeys(("phi", "theta", "psi"), "rad")
    | dict.fromkeys(("x", "y", "H", "W"), "m")
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
_AT = {name: i for i, name in enumerate(_FIXED)}
_P, _V, _W, _E = _AT["true_x_m"], _AT["true_vx_mps"], _AT["true_p_radps"], _AT["true_phi_rad"]
_A, _S, _G = _AT["true_wx_mps"], _AT["true_elevator_rad"], _AT["true_wheel_left_m"]
_ON, _C, _U, _R = _AT["true_ground_left"], _AT["true_camera_x_m"], _AT["cmd_elevator_rad"], _AT["ref_airspeed_mps"]
_M, _N = _AT["meas_p_radps"], _AT["nis"]


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
    """Collects steps while the simulation runs; a step costs a few microseconds."""

    capacity: int = 1024
    _n: int = 0
    _rows: Array = field(init=False)
    _names: tuple[str, ...] = ()
    _mean: Array = field(init=False)
    _cov: Array = field(init=False)
    _valid: list[bool] = field(default_factory=list)
    _modes: list[str] = field(default_factory=list)
    _extras: list[Mapping[str, float]] = field(default_factory=list)
    _flags: list[Mapping[str, bool]] = field(default_factory=list)
    _rotations: list[np.ndarray] = field(default_factory=list)
    _edges: list[tuple[int, EdgeSet, Array, Residuals | None]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._rows = np.full((self.capacity, len(_FIXED)), np.nan)

    def add(self, step: Step) -> None:
        """One cycle. Raises LogError if the estimate's names change after the first step."""
        k = self._n
        if k == len(self._rows):
            self._grow()
        truth, estimate, command, reference = step.truth, step.estimate, step.command, step.reference
        row = self._rows[k]
        row[0], row[1] = truth.t, estimate.t
        row[_P : _P + 3] = truth.p_RB
        row[_V : _V + 3] = truth.v_RB_R
        row[_W : _W + 3] = truth.w_RB_B
        row[_E : _E + 3] = truth.euler
        row[_A : _A + 3] = truth.wind_R
        row[_A + 3], row[_A + 4], row[_A + 5] = truth.airspeed, truth.alpha, truth.beta
        row[_S : _S + 4] = truth.surfaces
        row[_S + 4] = truth.thrust
        row[_G : _G + 3] = truth.wheels_height
        row[_ON : _ON + 3] = truth.on_ground
        row[_ON + 3] = truth.load_factor
        row[_C : _C + 3] = step.camera.p_RC
        row[_C + 3], row[_C + 4] = step.camera.pan, step.camera.tilt
        row[_U : _U + 5] = command.elevator, command.aileron, command.rudder, command.throttle, command.flap
        row[_U + 5 : _U + 9] = command.brake_left, command.brake_right, command.pan, command.tilt
        row[_R : _R + 4] = reference.airspeed, reference.height, reference.climb_rate, reference.y
        row[_R + 4 : _R + 8] = reference.psi, reference.phi, reference.theta_ff, reference.r_ff
        for sample in step.samples:
            if sample.sensor == "gyro":
                row[_M : _M + 3] = sample.data
            elif sample.sensor == "airspeed":
                row[_M + 3] = sample.data
            elif isinstance(sample.data, CameraSample):
                row[_M + 4 : _M + 7] = sample.data.pan, sample.data.tilt, sample.data.index
        seen = step.residuals
        row[_N], row[_N + 1] = (np.nan, 0.0) if seen is None else (seen.nis, seen.dof)
        if estimate.names != self._names:
            self._start(estimate.names)
        self._mean[k] = estimate.mean
        if estimate.cov is not None:
            self._cov[k] = estimate.cov
        self._valid.append(estimate.valid)
        self._modes.append(reference.mode)
        self._extras.append(reference.extra)
        self._flags.append(estimate.flags)
        self._rotations.append(truth.R_RB)
        for measurement in step.measurements:
            if measurement.geometry is not None:
                self._edges.append((k, measurement.geometry, measurement.z, seen))
        self._n = k + 1

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
        n = self._n
        if n == 0:
            raise LogError("no step was logged: the flight ended before its first control cycle")
        columns: dict[str, np.ndarray] = {name: self._rows[:n, i].copy() for i, name in enumerate(_FIXED)}
        for name in ("true_ground_left", "true_ground_right", "true_ground_third"):
            columns[name] = columns[name] > 0.5
        for name in ("nis_dof", "meas_frame"):
            columns[name] = np.nan_to_num(columns[name], nan=-1.0).astype(np.int64)
        columns["true_H_m"] = -columns["true_z_m"]
        R_RB = np.stack(self._rotations)
        uvw = np.einsum("nji,nj->ni", R_RB, self._rows[:n, _V : _V + 3])  # R_BR v_R
        for i, name in enumerate(("u", "v", "w")):
            columns[f"true_{name}_mps"] = uvw[:, i]
        columns["true_groundspeed_mps"] = np.hypot(columns["true_vx_mps"], columns["true_vy_mps"])
        columns["mode"] = np.array(self._modes)
        columns["valid"] = np.array(self._valid)
        for i, name in enumerate(self._names):
            columns[f"est_{_with_unit(name)}"] = np.where(columns["valid"], self._mean[:n, i], np.nan)
            variance = np.where(columns["valid"], self._cov[:n, i, i], np.nan)
            columns[f"sd_{_with_unit(name)}"] = np.sqrt(np.maximum(variance, 0.0))
        for prefix, rows in (("ref", self._extras), ("flag", self._flags)):
            for key in sorted({key for row in rows for key in row}):
                columns[f"{prefix}_{key}"] = np.array([float(row.get(key, np.nan)) for row in rows])
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
        columns["nees"], columns["nees_dof"] = self._nees(log)
        return log

    def _start(self, names: tuple[str, ...]) -> None:
        if self._names:
            raise LogError(f"the estimate's names changed in flight from {self._names} to {names}")
        self._names = names
        self._mean = np.full((len(self._rows), len(names)), np.nan)
        self._cov = np.full((len(self._rows), len(names), len(names)), np.nan)

    def _grow(self) -> None:
        def doubled(a: Array) -> Array:
            return np.concatenate([a, np.full_like(a, np.nan)])

        self._rows, self._mean, self._cov = doubled(self._rows), doubled(self._mean), doubled(self._cov)

    def _windows(self, n: int) -> dict[str, np.ndarray]:
        m = max((len(z) for _, _, z, _ in self._edges), default=0)
        if m == 0:
            return {}
        feature = np.full((n, m), -1, np.int64)
        status = np.full((n, m), -1, np.int64)
        uv = np.full((n, m, 2), np.nan)
        z = np.full((n, m), np.nan)
        innovation = np.full((n, m), np.nan)
        for k, edges, z_k, seen in self._edges:
            count = len(z_k)
            feature[k, :count], status[k, :count] = edges.feature, edges.status
            uv[k, :count], z[k, :count] = edges.centre, z_k
            if seen is not None and len(seen.status) == count:
                status[k, :count], innovation[k, :count] = seen.status, seen.innovation
        return {
            "window_feature": feature,
            "window_status": status,
            "window_u_px": uv[:, :, 0],
            "window_v_px": uv[:, :, 1],
            "window_z_px": z,
            "window_innovation_px": innovation,
            "threshold_found": ((feature == Feature.THRESHOLD) & (status == Status.FOUND)).any(axis=1),
        }

    def _nees(self, log: FlightLog) -> tuple[Array, np.ndarray]:
        """Squared error normalised by the covariance, over the rigid-body states the filter has; divide by its dof."""
        names = [name for name in RIGID if name in self._names]
        index = [self._names.index(name) for name in names]
        dof = np.full(len(log), len(index), np.int64)
        nees = np.full(len(log), np.nan)
        if index:
            error = np.column_stack([log.error(name) for name in names])
            for k in np.flatnonzero(np.isfinite(error).all(axis=1)):
                P = self._cov[k][np.ix_(index, index)]
                try:
                    nees[k] = error[k] @ np.linalg.solve(P, error[k])
                except np.linalg.LinAlgError:  # a state pinned by the filter has no variance: no number for this row
                    continue
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
