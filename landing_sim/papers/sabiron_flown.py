"""Section V with images, and the step that section VI announces: descents on JSBSim over rendered ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from landing_sim import scenario
from landing_sim.missions import lunar_flight
from landing_sim.papers.claims import Claim, Measure, Measured, at_least, at_most
from landing_sim.papers.flights import Flown, Run
from landing_sim.record.log import FlightLog
from landing_sim.sections.lunar import LunarScenario
from landing_sim.types import Array

TERRAINS = 6
ANGLES = np.radians([90.0, 120.0, 160.0])
WATCHED = tuple(Run("lunar/open_loop", ("time.limit_s=21.0",), seed) for seed in range(1, TERRAINS + 1))
WATCHED_EKF = tuple(
    Run("lunar/open_loop", ("time.limit_s=21.0", "filter.kind=ekf"), seed) for seed in range(1, TERRAINS + 1)
)
CLOSED = {
    name: tuple(Run("lunar/published", changes, seed) for seed in range(1, TERRAINS + 1))
    for name, changes in (("EKF", ()), ("LPV observer", ("filter.kind=lpv",)))
}


def fly(run: Run) -> Flown:
    """One descent. Raises ScenarioError if the run's changes do not fit its scenario."""
    wanted: object = scenario.load(run.scenario, [*run.changes, f"seed={run.seed}"])
    assert isinstance(wanted, LunarScenario)
    return Flown(lunar_flight.fly(wanted).log)


def errors(log: FlightLog, start: float = 5.0, end: float = 20.0) -> Array:
    """(5,) rms of h [m], q, omega_x, omega_z [deg/s], theta [deg]."""
    inside = (log["t_s"] >= start) & (log["t_s"] <= end)
    flows = [log[f"est_{name}"] - log[f"true_{name}"] for name in ("flow_x", "flow_z")]
    all_of = np.array([log.error("H"), log.error("q"), *flows, log.error("theta")])[:, inside]
    return np.asarray(np.sqrt(np.mean(all_of**2, axis=1)) * [1.0, *[math.degrees(1.0)] * 4])


def true_flow(log: FlightLog, alpha: float) -> Array:
    """(n,) [rad/s] of a sensor over flat ground (5)."""
    a = alpha - log["true_theta_rad"]
    s, c = np.sin(a), np.cos(a)
    return np.asarray(s * s * log["true_flow_x"] + s * c * log["true_flow_z"] + log["true_q_radps"])


def _median_error(state: int) -> Measure:
    def measure(results: Sequence[Flown]) -> Measured:
        values = [errors(flown.log)[state] for flown in results]
        return Measured(float(np.median(values)), f"median of {len(values)} terrains; largest {max(values):.3g}")

    return measure


def _q_ratio(results: Sequence[Flown]) -> Measured:
    values = np.median([errors(flown.log) for flown in results], axis=0)
    told = f"rms from 5 to 20 s of q̂ {values[1]:.3f} °/s; θ̂ {values[4]:.2f}°"
    return Measured(float(values[1]), told)


def relative(log: FlightLog) -> Array:
    """Relative errors of all readings whose true flow is 1 to 5 deg/s."""
    found = []
    for k, alpha in enumerate(ANGLES, 1):
        true, seen = true_flow(log, float(alpha)), log[f"meas_flow_{k}_radps"]
        use = np.isfinite(seen) & (np.abs(true) >= math.radians(1.0)) & (np.abs(true) <= math.radians(5.0))
        found.append(seen[use] / true[use] - 1.0)
    return np.concatenate(found)


def _readings(results: Sequence[Flown]) -> Measured:
    all_of = np.concatenate([relative(flown.log) for flown in results])
    middle = float(np.median(all_of))
    spread = 1.4826 * float(np.median(np.abs(all_of - middle)))
    outliers = float(np.mean(np.abs(all_of) > 0.3))
    told = f"{len(all_of)} readings on relief; spread {100 * spread:.1f} %, outliers {100 * outliers:.1f} %"
    return Measured(100.0 * abs(middle), told)


def landed(log: FlightLog) -> bool:
    """At most 2 m/s down, 1 m/s along and 10 deg of tilt when a foot touches."""
    touch = log.touchdown
    tilt = 90.0 if touch is None else math.degrees(math.hypot(touch.pitch, touch.bank))
    return touch is not None and touch.sink_rate <= 2.0 and touch.groundspeed <= 1.0 and tilt <= 10.0


def _landings(results: Sequence[Flown]) -> Measured:
    good = [landed(flown.log) for flown in results]
    touches = [flown.log.touchdown for flown in results]
    sinks = ", ".join("–" if touch is None else f"{touch.sink_rate:.2f}" for touch in touches)
    return Measured(100.0 * float(np.mean(good)), f"{sum(good)} of {len(good)}; sink rates {sinks} m/s")


# fmt: off
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "sensor", "six photoreceptors make it possible to compute very low velocities", "V", None, "%",
        "bias of readings at 1 to 5 °/s, descents over rendered relief", WATCHED, _readings, at_most(2.0),
        "on flat ground under the same light it is 0.2 %",
    ),
    Claim(
        "images-theta", "the estimates are very near the actual states with image-based measurements: θ̂", "V, VI",
        None, "°",
        "rms 5 to 20 s, LPV observer updated by single readings", WATCHED, _median_error(4), at_most(2.5),
        "rendered ground instead of PANGU's; Θ for looks of a few a second",
    ),
    Claim(
        "images-wx", "the same: ω̂x", "V, VI", None, "°/s", "as before", WATCHED, _median_error(2), at_most(0.35),
    ),
    Claim(
        "images-wz", "the same: ω̂z", "V, VI", None, "°/s", "as before", WATCHED, _median_error(3), at_most(0.25),
    ),
    Claim(
        "images-h", "the same: ĥ", "V, VI", None, "m", "as before", WATCHED, _median_error(0), at_most(60.0),
    ),
    Claim(
        "images-ekf", "the same with an extended Kalman filter: θ̂", "VI", None, "°", "as before, EKF", WATCHED_EKF,
        _median_error(4), at_most(2.5),
    ),
    Claim(
        "images-q", "q̂ seems more sensitive to image-based measurements", "V", None, "°/s",
        "rms of q̂ 5 to 20 s", WATCHED, _q_ratio, at_least(0.012),
        "with perfect flows it is 0.006 °/s: more sensitive, yes, but no worse than the rest",
    ),
    Claim(
        "closed", "the next step: control laws that take ωx, ωz and θ to bring the lander safely to the ground", "VI",
        None, "%", "soft landings (2 m/s, 1 m/s, 10°) from the published deviations, EKF", CLOSED["EKF"], _landings,
        at_least(90.0),
    ),
    Claim(
        "closed-lpv", "the same on the paper's observer", "VI", None, "%", "as before, LPV", CLOSED["LPV observer"],
        _landings, at_least(90.0), "linear about a reference that the first seconds' wrong pitch leads away from",
    ),
)
