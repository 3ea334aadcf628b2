"""What became of a flight: outcome, touchdown, errors of the estimate, criteria. Pure functions of a `FlightLog`.

Errors are JSBSim's truth against the estimate, of the cg, from 1.5 s after the runway was acquired until touchdown;
x and sink at touchdown are the first main wheel's, y is that of the middle between the main wheels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from landing_sim.record.log import RIGID, FlightLog
from landing_sim.types import Array

Outcome = Literal[
    "landed", "go_around", "crash", "off_runway", "timeout", "numeric_error", "hovered", "off_platform", "refused"
]
"""The last three are a quadrotor's: stayed where it was meant to, landed elsewhere, found no landing place."""

SETTLING = 1.5  # [s] after acquisition, before errors count
FAR = 500.0  # [m] beyond which range is judged in percent
CRASH_SINK = 3.05  # [m/s] 10 ft/s: the landing gear's limit descent velocity, 14 CFR 23.473
CRASH_BANK = math.radians(15.0)  # the wing tip is near the ground
SLOW = 10.0  # [m/s] "rollout to below 10 m/s"


@dataclass(frozen=True, slots=True)
class Limit:
    """Bounds of one metric of `measure`, both included."""

    metric: str
    low: float | None = None
    high: float | None = None
    source: str = ""


@dataclass(frozen=True, slots=True)
class Criterion:
    """A limit and the value that met it or not."""

    name: str
    value: float
    limit: float | tuple[float, float]
    passed: bool
    source: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a flight."""

    outcome: Outcome
    metrics: Mapping[str, float]
    errors: Mapping[str, Mapping[str, Any]]
    criteria: tuple[Criterion, ...]

    @property
    def passed(self) -> bool:
        return self.outcome in ("landed", "hovered") and all(criterion.passed for criterion in self.criteria)


def judge(log: FlightLog, limits: Iterable[Limit] = ()) -> Verdict:
    """Raises KeyError if a limit names no metric of `measure`, ValueError if it has no bound."""
    metrics = measure(log)
    return Verdict(outcome(log), metrics, errors(log), tuple(_criterion(limit, metrics) for limit in limits))


def outcome(log: FlightLog) -> Outcome:
    """How the flight ended, from the log alone."""
    touchdown = log.touchdown
    believed = [log[name][log["valid"]] for name in log.columns if name.startswith("est_")]
    position = np.column_stack([log["true_x_m"], log["true_y_m"], log["true_H_m"]])
    if log.meta.get("end") == "numeric_error" or not all(np.isfinite(a).all() for a in (position, *believed)):
        return "numeric_error"
    if log.meta.get("end") == "crash":
        return "crash"
    if touchdown is None:
        wheels = np.column_stack([log["true_wheel_left_m"], log["true_wheel_right_m"], log["true_wheel_third_m"]])
        if wheels.min() < -1.0:
            return "crash"
        return "go_around" if str(log["mode"][-1]) == "go_around" else "timeout"
    if touchdown.sink_rate > CRASH_SINK or abs(touchdown.bank) > CRASH_BANK:
        return "crash"
    length = float(log.meta.get("runway_length_m", math.inf))
    half = 0.5 * float(log.meta.get("runway_width_m", math.inf))
    if not (0.0 <= touchdown.x <= length and abs(touchdown.y) <= half):
        return "off_runway"
    rolled = _after_touchdown(log)
    if (np.abs(log["true_y_m"][rolled]) > half).any() or (log["true_x_m"][rolled] > length).any():
        return "off_runway"
    if str(log["mode"][-1]) == "go_around":
        return "go_around"
    return "landed" if log["true_groundspeed_mps"][-1] < SLOW else "timeout"


def counted(log: FlightLog) -> np.ndarray:
    """(n,) bool: the cycles whose errors count, from SETTLING after acquisition to touchdown."""
    t, valid = log["est_t_s"], log["valid"]
    if not valid.any():
        return np.zeros(len(log), bool)
    touchdown = log.touchdown
    end = math.inf if touchdown is None else touchdown.t
    return valid & (t >= t[np.argmax(valid)] + SETTLING) & (t < end)


def threshold_in_view(log: FlightLog) -> np.ndarray:
    """(n,) bool: up to the last cycle in which a window found the threshold."""
    if "threshold_found" not in log or not log["threshold_found"].any():
        return np.zeros(len(log), bool)
    last = len(log) - 1 - np.argmax(log["threshold_found"][::-1])
    return np.arange(len(log)) <= last


def errors(log: FlightLog) -> dict[str, dict[str, Any]]:
    """Largest and rms error of each signal over the part of the flight where it is judged; None where there is none."""
    count, seen, x = counted(log), threshold_in_view(log), log.truth("x")
    near, over = x > -FAR, x >= 0.0
    x_error, H_error, degrees = log.error("x"), log.error("H"), math.degrees(1.0)
    table: dict[str, tuple[Array, np.ndarray, str]] = {
        "range": (x_error, seen & near & ~over, "m"),
        "range_far": (100.0 * x_error / np.maximum(np.abs(x), 1.0), seen & ~near, "%"),
        "height_approach": (H_error, ~over, "m"),
        "height_runway": (H_error, over, "m"),
        "lateral": (log.error("y"), np.ones_like(over), "m"),
        "roll": (degrees * log.error("phi"), np.ones_like(over), "deg"),
        "pitch": (degrees * log.error("theta"), np.ones_like(over), "deg"),
        "yaw": (degrees * log.error("psi"), np.ones_like(over), "deg"),
        "airspeed": (_airspeed(log) - log.truth("airspeed_mps"), np.ones_like(over), "m/s"),
        "speed_forward": (log.error("u"), np.ones_like(over), "m/s"),
        "wind_along": (log.error("wx"), np.ones_like(over), "m/s"),
        "wind_across": (log.error("wy"), np.ones_like(over), "m/s"),
        "wind_down": (log.error("wz"), np.ones_like(over), "m/s"),
        "width": (log.error("W"), np.ones_like(over), "m"),
    }
    found: dict[str, dict[str, Any]] = {}
    for name, (error, where, unit) in table.items():
        values = error[count & where]
        values = values[np.isfinite(values)]
        if len(values):
            found[name] = {"max": float(np.abs(values).max()), "rms": float(np.sqrt(np.mean(values**2))), "unit": unit}
    return found


def measure(log: FlightLog) -> dict[str, float]:
    """Every figure that is judged or counted, NaN where the flight gives none. Errors are the largest magnitudes."""
    nan, touchdown, degrees = math.nan, log.touchdown, math.degrees(1.0)
    found = errors(log)
    suffix = {"m": "m", "deg": "deg", "m/s": "mps", "%": "percent"}
    metrics = {f"{name}_{suffix[unit]}": nan for name, unit in _SIGNALS.items()}
    metrics |= {f"{name}_{suffix[error['unit']]}": error["max"] for name, error in found.items()}
    airborne = ~_after_touchdown(log)
    rolled = _after_touchdown(log)
    metrics |= {
        "captured_after_m": captured_after(log, 5.0),
        "peak_roll_deg": float(degrees * np.abs(log["true_phi_rad"][airborne]).max(initial=0.0)),
        "touchdown_x_m": nan if touchdown is None else touchdown.x,
        "touchdown_y_m": nan if touchdown is None else touchdown.y,
        "sink_rate_mps": nan if touchdown is None else touchdown.sink_rate,
        "touchdown_airspeed_mps": nan if touchdown is None else touchdown.airspeed,
        "touchdown_bank_deg": nan if touchdown is None else degrees * touchdown.bank,
        "rollout_y_m": float(np.abs(log["true_y_m"][rolled]).max()) if rolled.any() else nan,
        "final_groundspeed_mps": nan if touchdown is None else float(log["true_groundspeed_mps"][-1]),
        "threshold_lost_m": _threshold_lost(log),
        **at_threshold(log),
        **{name: value for name, value in consistency(log).items() if name in ("nees", "nis")},
    }
    return metrics


def consistency(log: FlightLog) -> dict[str, float]:
    """Mean squared errors over the variances claimed, 1 if the filter knows what it does not know.

    "nees" per state over the rigid-body states together (with their correlations), "nis" per measurement, and one
    value for each state alone.
    """
    count = counted(log)

    def mean(values: Array, dof: np.ndarray | int) -> float:
        use = count & np.isfinite(values) & (np.asarray(dof) > 0)
        return float(np.sum(values[use]) / np.sum(np.broadcast_to(dof, values.shape)[use])) if use.any() else math.nan

    found = {"nees": mean(log["nees"], log["nees_dof"]), "nis": mean(log["nis"], log["nis_dof"])}
    for name in (*RIGID, "wx", "wy", "wz", "W"):
        sigma = log.sigma(name)
        if np.isfinite(sigma).any():
            with np.errstate(divide="ignore", invalid="ignore"):
                found[name] = mean((log.error(name) / sigma) ** 2, 1)
    return found


def touchdown_json(log: FlightLog) -> dict[str, float] | None:
    """The touchdown in degrees, as `run --json` prints it; None if there was none."""
    touchdown, degrees = log.touchdown, math.degrees(1.0)
    if touchdown is None:
        return None
    return {
        "x_m": touchdown.x,
        "y_m": touchdown.y,
        "time_s": touchdown.t,
        "sink_rate_mps": touchdown.sink_rate,
        "airspeed_mps": touchdown.airspeed,
        "groundspeed_mps": touchdown.groundspeed,
        "pitch_deg": degrees * touchdown.pitch,
        "bank_deg": degrees * touchdown.bank,
        "heading_error_deg": degrees * touchdown.heading_error,
        "sideslip_deg": degrees * touchdown.sideslip,
    }


def to_json(
    log: FlightLog, verdict: Verdict, *, scenario: str, wall_s: float, files: Mapping[str, str]
) -> dict[str, Any]:
    """The object that `run --json` prints. Values that do not exist are null: JSON knows no NaN."""
    sim_s = float(log["t_s"][-1] - log["t_s"][0])
    return {
        "scenario": scenario,
        "seed": log.meta["seed"],
        "outcome": verdict.outcome,
        "touchdown": touchdown_json(log),
        "errors": {name: dict(error) for name, error in verdict.errors.items()},
        "criteria": [
            {
                "name": c.name,
                "value": c.value if math.isfinite(c.value) else None,
                "limit": list(c.limit) if isinstance(c.limit, tuple) else c.limit,
                "passed": c.passed,
                "source": c.source,
            }
            for c in verdict.criteria
        ],
        "passed": verdict.passed,
        "timing": {"sim_s": sim_s, "wall_s": wall_s, "realtime_factor": sim_s / wall_s if wall_s > 0.0 else None},
        "files": dict(files),
    }


_SIGNALS = {
    "range": "m",
    "range_far": "%",
    "height_approach": "m",
    "height_runway": "m",
    "lateral": "m",
    "roll": "deg",
    "pitch": "deg",
    "yaw": "deg",
    "airspeed": "m/s",
    "speed_forward": "m/s",
    "wind_along": "m/s",
    "wind_across": "m/s",
    "wind_down": "m/s",
    "width": "m",
}


def _criterion(limit: Limit, metrics: Mapping[str, float]) -> Criterion:
    """A metric that does not exist (NaN) does not pass: what was not measured was not shown."""
    value, low, high = metrics[limit.metric], limit.low, limit.high
    passed = math.isfinite(value) and (low is None or value >= low) and (high is None or value <= high)
    if low is not None and high is not None:
        return Criterion(limit.metric, value, (low, high), passed, limit.source)
    bound = high if high is not None else low
    if bound is None:
        raise ValueError(f"the limit on {limit.metric} has neither a lower nor an upper bound")
    return Criterion(limit.metric, value, bound, passed, limit.source)


def captured_after(log: FlightLog, below: float) -> float:
    """[m] travelled along the runway when |y| became less than `below` for good; NaN if it had not by touchdown."""
    airborne = ~_after_touchdown(log)
    x, y = log["true_x_m"][airborne], log["true_y_m"][airborne]
    off = np.flatnonzero(np.abs(y) >= below)
    if len(off) == 0:
        return 0.0
    return float(x[off[-1] + 1] - x[0]) if off[-1] + 1 < len(x) else math.nan


def at_threshold(log: FlightLog) -> dict[str, float]:
    """The estimate's errors and what was flown where a system is handed over: over the threshold, and 1 km before it.

    "threshold_y_m", "threshold_above_m": of the cg against the centreline and against the path that guidance asked for.
    """
    airborne = ~_after_touchdown(log) & log["valid"]
    x = log["true_x_m"][airborne]

    def at(where: float, values: Array) -> float:
        inside = len(x) > 1 and x[0] <= where <= x[-1]
        return float(np.interp(where, x, values[airborne])) if inside else math.nan

    with np.errstate(divide="ignore", invalid="ignore"):
        slope = log["ref_climb_rate_mps"] / log["true_groundspeed_mps"]
    wanted = log["ref_height_m"] - slope * log.error("x")
    return {
        "range_1km_percent": at(-1000.0, np.abs(log.error("x")) / 10.0),
        "threshold_lateral_error_m": at(0.0, np.abs(log.error("y"))),
        "threshold_height_error_m": at(0.0, np.abs(log.error("H"))),
        "threshold_y_m": at(0.0, log["true_y_m"]),
        "threshold_above_m": at(0.0, log["true_H_m"] - wanted),
    }


def _after_touchdown(log: FlightLog) -> np.ndarray:
    touchdown = log.touchdown
    return np.zeros(len(log), bool) if touchdown is None else log["t_s"] >= touchdown.t


def _airspeed(log: FlightLog) -> Array:
    """(n,) [m/s] |velocity - wind| as the filter believes; a filter without wind states believes in still air."""
    uvw = np.column_stack([log.estimate(name) for name in ("u", "v", "w")])
    wind = np.nan_to_num(np.column_stack([log.estimate(name) for name in ("wx", "wy", "wz")]))
    phi, theta, psi = (log.estimate(name) for name in ("phi", "theta", "psi"))
    cps, sps, cth, sth, cph, sph = np.cos(psi), np.sin(psi), np.cos(theta), np.sin(theta), np.cos(phi), np.sin(phi)
    x1, y1, z1 = cps * wind[:, 0] + sps * wind[:, 1], -sps * wind[:, 0] + cps * wind[:, 1], wind[:, 2]
    x2, z2 = cth * x1 - sth * z1, sth * x1 + cth * z1
    air = np.column_stack([x2, cph * y1 + sph * z2, -sph * y1 + cph * z2])
    return np.linalg.norm(uvw - air, axis=1)


def _threshold_lost(log: FlightLog) -> float:
    seen = threshold_in_view(log)
    return float(-log["true_x_m"][seen][-1]) if seen.any() and not seen.all() else math.nan
