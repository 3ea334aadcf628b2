"""Takes a flight's log down while it is flown, and makes its columns when it is over."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from landing_sim.record.log import RIGID, SCHEMA, FlightLog, LogError, versions, with_unit
from landing_sim.signals import CameraSample, EdgeSet, Feature, Residuals, Status, Step, Touchdown
from landing_sim.types import Array

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


def _doubles() -> array[float]:
    return array("d")


def _integers() -> array[int]:
    return array("q")


@dataclass(slots=True)
class LogBuilder:
    """Takes down what steps say, but no image, and keeps none of their arrays: numbers are copied while at hand."""

    _rows: array[float] = field(default_factory=_doubles)  # _FIXED, valid, R_RB of one step after the other
    _mean: array[float] = field(default_factory=_doubles)
    _cov: array[float] = field(default_factory=_doubles)  # entries `_kept` of each covariance
    _names: tuple[str, ...] = ()
    _kept: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    _flags: list[Mapping[str, bool]] = field(default_factory=list)
    _modes: list[str] = field(default_factory=list)
    _extras: list[Mapping[str, float]] = field(default_factory=list)
    _looks: list[tuple[int, int]] = field(default_factory=list)  # row and number of the windows of an image
    _feature: array[int] = field(default_factory=_integers)  # of one window after the other
    _status: array[int] = field(default_factory=_integers)
    _uv: array[float] = field(default_factory=_doubles)
    _z: array[float] = field(default_factory=_doubles)
    _innovation: array[float] = field(default_factory=_doubles)

    def add(self, step: Step) -> None:
        """One cycle. Raises LogError if the estimate's names change after the first step."""
        estimate, names = step.estimate, step.estimate.names
        if not self._modes:
            self._names, self._kept = names, _kept(names)
        elif names is not self._names and names != self._names:
            raise LogError(f"the estimate's names changed in flight from {self._names} to {names}")
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
                self._look(measurement.geometry, measurement.z, seen)
        nis, dof = (math.nan, 0.0) if seen is None else (seen.nis, seen.dof)
        now, camera, command, reference = step.truth, step.camera, step.command, step.reference
        self._rows.extend((
            now.t, estimate.t, *now.p_RB.tolist(), *now.v_RB_R.tolist(), *now.w_RB_B.tolist(), *now.euler.tolist(),
            *now.wind_R.tolist(), now.airspeed, now.alpha, now.beta, *now.surfaces.tolist(), now.thrust,
            *now.wheels_height.tolist(), *now.on_ground.tolist(), now.load_factor,
            *camera.p_RC.tolist(), camera.pan, camera.tilt,
            command.elevator, command.aileron, command.rudder, command.throttle, command.flap,
            command.brake_left, command.brake_right, command.pan, command.tilt,
            reference.airspeed, reference.height, reference.climb_rate, reference.y,
            reference.psi, reference.phi, reference.theta_ff, reference.r_ff,
            *gyro.tolist(), airspeed, pan, tilt, frame, nis, dof,
            estimate.valid, *now.R_RB.ravel().tolist(),
        ))  # fmt: skip
        self._mean.frombytes(estimate.mean.tobytes())
        told = np.full(len(self._kept), np.nan) if estimate.cov is None else estimate.cov.take(self._kept)
        self._cov.frombytes(told.tobytes())
        self._flags.append(estimate.flags)
        self._modes.append(reference.mode)
        self._extras.append(reference.extra)

    def _look(self, edges: EdgeSet, z: Array, seen: Residuals | None) -> None:
        """The windows of one image, with the estimator's verdict where it is about these."""
        judged = seen if seen is not None and len(seen.status) == len(z) else None
        self._looks.append((len(self._modes), len(z)))
        self._feature.frombytes(edges.feature.tobytes())
        self._status.frombytes((edges.status if judged is None else judged.status).tobytes())
        self._uv.frombytes(edges.centre.tobytes())
        self._z.frombytes(z.tobytes())
        innovation = np.full(len(z), np.nan) if judged is None else judged.innovation
        self._innovation.frombytes(innovation.tobytes())

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
        n, names = len(self._modes), self._names
        if n == 0:
            raise LogError("no step was logged: the flight ended before its first control cycle")
        rows = np.frombuffer(self._rows).reshape(n, -1)
        columns: dict[str, np.ndarray] = {name: rows[:, i].copy() for i, name in enumerate(_FIXED)}
        for name in ("true_ground_left", "true_ground_right", "true_ground_third"):
            columns[name] = columns[name] > 0.5
        for name in ("nis_dof", "meas_frame"):
            columns[name] = np.nan_to_num(columns[name], nan=-1.0).astype(np.int64)
        columns["true_H_m"] = -columns["true_z_m"]
        R_RB = rows[:, len(_FIXED) + 1 :].copy().reshape(n, 3, 3)
        uvw = np.einsum("nji,nj->ni", R_RB, rows[:, _V : _V + 3])  # R_BR v_R
        for i, name in enumerate(("u", "v", "w")):
            columns[f"true_{name}_mps"] = uvw[:, i]
        columns["true_groundspeed_mps"] = np.hypot(columns["true_vx_mps"], columns["true_vy_mps"])
        columns["mode"] = np.array(self._modes)
        columns["valid"] = rows[:, len(_FIXED)] > 0.5
        mean = np.frombuffer(self._mean).reshape(n, -1)
        cov = np.frombuffer(self._cov).reshape(n, -1)
        for i, name in enumerate(names):
            columns[f"est_{with_unit(name)}"] = np.where(columns["valid"], mean[:, i], np.nan)
            variance = np.where(columns["valid"], cov[:, i], np.nan)
            columns[f"sd_{with_unit(name)}"] = np.sqrt(np.maximum(variance, 0.0))
        told: Sequence[Mapping[str, float]]
        for prefix, told in (("ref", self._extras), ("flag", self._flags)):
            for key in sorted(set().union(*told)):
                values = array("d", [told_now.get(key, math.nan) for told_now in told])
                columns[f"{prefix}_{key}"] = np.array(values)
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
        columns["nees"], columns["nees_dof"] = _nees(log, names, cov[:, len(names) :])
        return log

    def _windows(self, n: int) -> dict[str, np.ndarray]:
        counts = np.array([count for _, count in self._looks], np.int64)
        m = counts.max(initial=0)
        if m == 0:
            return {}
        row = np.repeat([k for k, _ in self._looks], counts)
        at = row * m + np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)  # in a flat (n, m)

        def spread(values: np.ndarray, missing: float) -> np.ndarray:
            """(n, m, ...) with the windows' values where there are some."""
            out = np.full((n * m, *values.shape[1:]), missing, values.dtype)
            out[at] = values
            return out.reshape(n, m, *values.shape[1:])

        feature = spread(np.frombuffer(self._feature, np.int64), -1)
        status = spread(np.frombuffer(self._status, np.int64), -1)
        uv = spread(np.frombuffer(self._uv).reshape(-1, 2), np.nan)
        return {
            "window_feature": feature,
            "window_status": status,
            "window_u_px": uv[:, :, 0],
            "window_v_px": uv[:, :, 1],
            "window_z_px": spread(np.frombuffer(self._z), np.nan),
            "window_innovation_px": spread(np.frombuffer(self._innovation), np.nan),
            "threshold_found": ((feature == Feature.THRESHOLD) & (status == Status.FOUND)).any(axis=1),
        }


def _rigid(names: tuple[str, ...]) -> list[str]:
    return [name for name in RIGID if name in names]


def _kept(names: tuple[str, ...]) -> np.ndarray:
    """What is kept of a flattened covariance: the variances of all names, then the block of the rigid-body states."""
    rows = np.array([names.index(name) for name in _rigid(names)], np.int64)
    return np.concatenate([np.arange(len(names)) * (len(names) + 1), (rows[:, None] * len(names) + rows).ravel()])


def _nees(log: FlightLog, names: tuple[str, ...], cov: Array) -> tuple[Array, np.ndarray]:
    """Squared error normalised by the covariance cov (n, m m), over the m rigid-body states; divide by its dof."""
    known = _rigid(names)
    m = len(known)
    dof = np.full(len(log), m, np.int64)
    nees = np.full(len(log), np.nan)
    if m:
        error = np.column_stack([log.error(name) for name in known])
        use = np.flatnonzero(np.isfinite(error).all(axis=1))
        e, P = error[use], cov[use].reshape(-1, m, m)
        try:
            nees[use] = np.einsum("ni,ni->n", e, np.linalg.solve(P, e[:, :, None])[:, :, 0])
        except np.linalg.LinAlgError:  # a state pinned by the filter has no variance: no number for such rows
            for k, e_k, P_k in zip(use, e, P):
                with suppress(np.linalg.LinAlgError):
                    nees[k] = e_k @ np.linalg.solve(P_k, e_k)
    return nees, dof
