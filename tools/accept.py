"""Acceptance runs: many seeds, the figures that the project promises, result files that are checked in.

usage: tools/accept [NAME ...]     without a name: all, each to tests/acceptance/NAME.json

A result holds the commit, the seeds, the distribution of every metric over the flights (median, 95th percentile of the
magnitude, largest) and each promise with its verdict. Exit status 1 if a promise is not kept.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "tests" / "acceptance"


@dataclass(frozen=True, slots=True)
class Promise:
    """`statistic` ("p95", "p5", "min", "max", "mean", "median", "rms", "share") of a metric within [low, high]."""

    metric: str
    statistic: str
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True, slots=True)
class Campaign:
    """The same scenario over many seeds."""

    scenario: str
    promises: tuple[Promise, ...]
    seeds: Sequence[int] = range(1, 41)
    changes: tuple[str, ...] = ()
    places: tuple[tuple[str, ...], ...] = ((),)  # more changes: every seed is flown in each of these places


def box(metric: str, low: float, high: float) -> tuple[Promise, Promise]:
    return Promise(metric, "p5", low), Promise(metric, "p95", -math.inf, high)


LANDED = Promise("landed", "share", 1.0)
WEATHER = (
    LANDED,
    Promise("touchdown_y_m", "max", high=3.0),
    Promise("sink_rate_mps", "p95", high=1.5),
    Promise("sink_rate_mps", "max", high=1.5),
    Promise("touchdown_x_m", "min", low=250.0),
    Promise("touchdown_x_m", "max", high=900.0),
)
GUST = (
    LANDED,
    Promise("range_m", "p95", high=5.0),
    Promise("range_far_percent", "p95", high=2.0),
    Promise("height_approach_m", "p95", high=0.6),
    Promise("height_runway_m", "p95", high=0.2),
    Promise("lateral_m", "p95", high=1.0),
    Promise("roll_deg", "p95", high=0.3),
    Promise("yaw_deg", "p95", high=0.3),
    Promise("captured_after_m", "p95", high=520.0),
    Promise("peak_roll_deg", "p95", high=10.5),
    *box("touchdown_x_m", 490.0, 610.0),
    Promise("touchdown_y_m", "p95", high=0.5),
    Promise("sink_rate_mps", "p95", high=0.6),
    *box("touchdown_airspeed_mps", 41.5, 44.5),
)
WIDTH = (LANDED, Promise("width_at_loss_m", "max", high=1.0), Promise("width_mean_m", "mean", high=0.4))
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz")
CONSISTENT = (
    Promise("nees", "mean", 0.5, 2.0),
    *(Promise(f"nees_{name}", "mean", 0.5, 2.0) for name in STATES),
    Promise("nis", "mean", 0.7, 1.3),
)

UNKNOWN = (
    LANDED,
    Promise("range_1km_percent", "p95", high=2.0),
    Promise("threshold_lateral_error_m", "p95", high=1.0),
    Promise("threshold_height_error_m", "p95", high=1.0),
    Promise("threshold_y_m", "p95", high=2.0),
    Promise("threshold_above_m", "p95", high=2.5),
    *box("touchdown_x_m", 250.0, 550.0),
    Promise("touchdown_y_m", "p95", high=3.0),
    Promise("sink_rate_mps", "p95", high=1.5),
    Promise("touchdown_bank_deg", "p95", high=3.0),
)
INTERCEPT = (LANDED, Promise("range_settled_s", "p95", high=16.0))
GLIDE = (
    LANDED,
    Promise("range_10s_percent", "rms", high=15.0),
    Promise("range_20s_percent", "rms", high=4.0),
    Promise("range_30s_percent", "rms", high=2.0),
    Promise("range_60s_percent", "rms", high=0.5),
)
ALONE = (Promise("safe", "share", 0.95),)  # without inertial unit: a safe landing or a go-around
ALONE_LANDS = (*ALONE, Promise("landed", "share", 0.7))
FOUND = (
    Promise("landed", "share", 0.95),
    Promise("landed", "lower95"),
    Promise("miss_m", "p95", high=0.08),
    Promise("miss_m", "max", high=0.08),
    Promise("way_point_error_m", "max", high=0.05),
    Promise("platform_height_error_m", "max", high=0.01),
)
HOVER = (Promise("hover_rms_m", "mean", high=0.035), Promise("hover_p99_m", "mean"))
UNFUSED = (Promise("hover_rms_m", "mean", 0.08, 0.13), Promise("hover_p99_m", "mean"))
SEEN = ("time.step_s=0.002", "camera.width_px=320")
PLACES = (
    ("scene.seed=1", "scene.boxes=[{x_m: 2.1, y_m: 0.2, yaw_deg: 20}]"),
    ("scene.seed=2", "scene.boxes=[{x_m: 1.9, y_m: -0.3, yaw_deg: -35}]"),
    ("scene.seed=3", "scene.boxes=[{x_m: 2.3, height_m: 0.2}]"),
)
WAY = (*SEEN, "path.goal_x_m=2.6", "path.climb_mps=0.2")
STILL = ("wind.turbulence=null",)
ON_GLIDE = ("initial.y_m=0", "initial.height_m=270.4", "initial.heading_deg=0", "observer.outputs=width")
EFFECTS = {
    "crosswind": ("wind.crosswind_mps=5.14",),
    "misaligned": ("camera.platform.encoder_bias_deg=0.2",),
    "velocity_bias": ("sensors.inertial.velocity_bias_mps=[0.5, 0.5, 0.5]",),
}
CAMPAIGNS: dict[str, Campaign] = {
    "gust": Campaign("do128/gust", GUST),
    "calm": Campaign("do128/calm", WEATHER),
    "gust_light": Campaign("do128/gust_light", WEATHER),
    "gust_moderate": Campaign("do128/gust_moderate", WEATHER, range(1, 121)),
    "headwind": Campaign("do128/headwind", WEATHER),
    "tailwind": Campaign("do128/tailwind", WEATHER),
    "consistency": Campaign("do128/gust", CONSISTENT, range(1001, 1061)),
    "plain": Campaign("do128/gust", (LANDED,), changes=("filter.kind=plain",)),
    "split": Campaign("do128/gust", (LANDED,), changes=("filter.kind=split", "filter.factorisation=ud")),
    "width_25": Campaign(
        "do128/calm", WIDTH, range(1, 21), ("filter.width=state", "filter.believed_width_m=25")
    ),
    "width_33": Campaign(
        "do128/calm", WIDTH, range(1, 21), ("filter.width=state", "filter.believed_width_m=33")
    ),
    "unknown_far": Campaign("transport/gibert_far", UNKNOWN, range(1, 31)),
    "unknown_near": Campaign("transport/gibert_near", UNKNOWN, range(1, 31)),
    "unknown_ekf": Campaign("transport/ekf", UNKNOWN, range(1, 31)),
    **{f"unknown_{name}": Campaign("transport/gibert_far", UNKNOWN, range(1, 31), changes)
       for name, changes in EFFECTS.items()},
    "intercept_far": Campaign("transport/gibert_far", INTERCEPT, range(1, 11), STILL),
    "intercept_near": Campaign("transport/gibert_near", INTERCEPT, range(1, 11), STILL),
    "intercept_ekf_far": Campaign("transport/ekf", INTERCEPT, range(1, 11), STILL),
    "intercept_ekf_near": Campaign("transport/ekf", INTERCEPT, range(1, 11), (*STILL, "observer.first_range_m=2500")),
    "glide_far": Campaign("transport/gibert_far", GLIDE, range(1, 11), (*STILL, *ON_GLIDE)),
    "glide_near": Campaign("transport/gibert_near", GLIDE, range(1, 11), (*STILL, *ON_GLIDE)),
    "transport_4d": Campaign("transport/turbulence", (LANDED,), range(1, 13)),
    "do128_alone_600": Campaign("do128/inertial_off", ALONE_LANDS, range(1, 31)),
    "do128_alone_200": Campaign("do128/inertial_off", ALONE_LANDS, range(1, 31), ("faults.0.from_x_m=-200",)),
    "do128_alone_flare": Campaign(
        "do128/inertial_off", ALONE, range(1, 31), ("faults=[{sensor: inertial, kind: off, below_height_m: 10}]",)
    ),
    "transport_alone_600": Campaign("transport/inertial_off", ALONE_LANDS, range(1, 31)),
    "transport_alone_200": Campaign("transport/inertial_off", ALONE_LANDS, range(1, 31), ("faults.0.from_x_m=-200",)),
    "transport_alone_flare": Campaign(
        "transport/inertial_off", ALONE, range(1, 31), ("faults=[{sensor: inertial, kind: off, below_height_m: 12}]",)
    ),
    "quadrotor_hover": Campaign("quadrotor/hover", HOVER, range(501, 509), (*SEEN, "time.limit_s=66")),
    "quadrotor_hover_unfused": Campaign("quadrotor/hover_unfused", UNFUSED, range(501, 509), (*SEEN, "time.limit_s=66")),
    "quadrotor_fast": Campaign("quadrotor/land_fast", FOUND, range(501, 518), WAY, PLACES),
    "quadrotor_slow": Campaign("quadrotor/land", FOUND, range(501, 518), WAY, PLACES),
    "quadrotor_unfused": Campaign("quadrotor/land_unfused", FOUND[1:2], range(501, 505), WAY, PLACES),
    "do128_unknown": Campaign("do128/gibert", UNKNOWN[:6], range(1, 31)),
}  # fmt: skip


def fly(job: tuple[str, tuple[str, ...], int]) -> dict[str, float]:
    """Metrics of one flight."""
    from landing_sim import runner, scenario, vehicle
    from landing_sim.record import judge

    name, changes, seed = job
    wanted = scenario.load(name, [*changes, f"seed={seed}"])
    if wanted.mission != "runway_landing":
        verdict = runner.fly(wanted, None).verdict
        return {**verdict.metrics, "landed": float(verdict.outcome == "landed")}
    flight = runner.fly(wanted, vehicle.load(wanted.aircraft.model))
    metrics = dict(flight.verdict.metrics)
    metrics["landed"] = float(flight.verdict.outcome == "landed")
    log = flight.log
    metrics |= backup(log, flight.verdict.outcome, metrics)
    found = judge.consistency(log)
    metrics |= {f"nees_{name}": found[name] for name in STATES if name in found}
    if "est_W_m" in log:
        seen = judge.threshold_in_view(log) & log["valid"]
        far = seen & (log["true_x_m"] > -600.0)
        error = log.error("W")
        metrics["width_at_loss_m"] = float(abs(error[seen][-1]))
        metrics["width_mean_m"] = float(abs(np.mean(error[far])))
    return metrics | ranging(log)


def backup(log: Any, outcome: str, metrics: dict[str, float]) -> dict[str, float]:
    """Whether it ended safely; rms errors in the air from the death of the inertial unit on, 0 where it lived."""
    inside = 250.0 <= metrics["touchdown_x_m"] <= 900.0 and abs(metrics["touchdown_y_m"]) <= 5.0
    safe = outcome == "go_around" or (outcome == "landed" and inside and metrics["sink_rate_mps"] <= 2.0)
    found = {"safe": float(safe)}
    if "flag_inertial" not in log:
        return found
    end = math.inf if log.touchdown is None else log.touchdown.t
    dead = ~log["flag_inertial"] & log["valid"] & (log["t_s"] < end)
    for name, unit, factor in (("q", "dps", 57.2957795), ("theta", "deg", 57.2957795), ("H", "m", 1.0)):
        error = factor * log.error(name)[dead]
        found[f"alone_{name}_{unit}"] = float(np.sqrt(np.mean(error**2))) if len(error) else 0.0
    return found


def ranging(log: Any) -> dict[str, float]:
    """When the range's error came below 5 % for good, up to 800 m before the threshold, and what it was until then."""
    known, t, x = log["valid"], log["t_s"], log["true_x_m"]
    off = 100.0 * np.abs(log.error("x")) / np.maximum(np.abs(log.truth("x")), 1.0)
    since = t - t[np.argmax(known)]
    wrong = np.flatnonzero(known & (off > 5.0) & (x < -800.0))
    found = {f"range_{s}s_percent": float(np.interp(s, since[known], off[known])) for s in (10, 20, 30, 60)}
    return found | {"range_settled_s": float(since[wrong[-1]]) if len(wrong) else 0.0}


def statistic(values: np.ndarray, name: str) -> float:
    """Of the flights that have the figure: one that never touches down has no place of touchdown, and is not landed."""
    if np.isfinite(values).any():
        values = values[np.isfinite(values)]
    magnitude = np.abs(values)
    match name:
        case "p95":
            return float(np.percentile(magnitude, 95.0))
        case "p5":
            return float(np.percentile(magnitude, 5.0))
        case "min":
            return float(magnitude.min())
        case "max":
            return float(magnitude.max())
        case "median":
            return float(np.median(magnitude))
        case "rms":
            return float(np.sqrt(np.mean(values**2)))
        case "mean" | "share":
            return float(values.mean())
        case "lower95":
            from landing_sim.campaign.verdict import count_bounds

            return 1.0 - count_bounds(int((values == 0.0).sum()), len(values)).upper
    raise ValueError(name)


def run(name: str, pool: ProcessPoolExecutor) -> bool:
    campaign = CAMPAIGNS[name]
    jobs = [
        (campaign.scenario, (*campaign.changes, *place), seed) for place in campaign.places for seed in campaign.seeds
    ]
    flights = list(pool.map(fly, jobs))
    columns = {key: np.array([f[key] for f in flights]) for key in flights[0]}
    kept = []
    for p in campaign.promises:
        value = statistic(columns[p.metric], p.statistic)
        kept.append({"metric": p.metric, "statistic": p.statistic, "low": finite(p.low), "high": finite(p.high),
                     "value": finite(value), "kept": bool(p.low <= value <= p.high)})  # fmt: skip
    result: dict[str, Any] = {
        "name": name,
        "scenario": campaign.scenario,
        "changes": list(campaign.changes),
        "places": [list(place) for place in campaign.places],
        "seeds": [campaign.seeds[0], campaign.seeds[-1]],
        "flights": len(flights),
        "commit": commit(),
        "promises": kept,
        "metrics": {
            key: {s: finite(statistic(values, s)) for s in ("median", "p95", "max")}
            for key, values in columns.items()
            if np.isfinite(values).all()
        },
    }
    OUT.mkdir(exist_ok=True)
    (OUT / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n")
    print(f"\n{name}: {len(flights)} flights of {campaign.scenario} {' '.join(campaign.changes)}")
    for k in kept:
        bounds = f"[{'' if k['low'] is None else k['low']} .. {'' if k['high'] is None else k['high']}]"
        print(
            f"  {'kept  ' if k['kept'] else 'BROKEN'} {k['metric']:24s} {k['statistic']:6s} {k['value']!s:22.8} {bounds}"
        )
    return all(k["kept"] for k in kept)


def finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def commit() -> str:
    head = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    changed = subprocess.run(
        ["git", "status", "--porcelain", "landing_sim", "aircraft", "scenarios"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    return head.stdout.strip() + ("+changes" if changed.stdout.strip() else "")


def main(names: Sequence[str]) -> int:
    unknown = [name for name in names if name not in CAMPAIGNS]
    if unknown:
        print(f"no acceptance run called {', '.join(unknown)}; there are: {', '.join(CAMPAIGNS)}", file=sys.stderr)
        return 2
    with ProcessPoolExecutor(2) as pool:
        kept = [run(name, pool) for name in names or CAMPAIGNS]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
