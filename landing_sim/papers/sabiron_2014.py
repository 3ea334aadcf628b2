"""Sabiron et al. 2014, "Backup State Observer Based on Optic Flow Applied to Lunar Landing": its equations, figures 3
and 4, and every statement of sections III to VI.

The reference trajectory and the inertia are not published, and of the terrain only an example: what hangs on them is
said with each claim.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from landing_sim.estimators.optic_flow.geometry import spread
from landing_sim.estimators.optic_flow.lpv_observer import PUBLISHED, SHIPPED
from landing_sim.estimators.optic_flow.reference import reference
from landing_sim.papers import sabiron_checks as check
from landing_sim.papers import sabiron_flown
from landing_sim.papers import sabiron_trials as trials
from landing_sim.papers.claims import Claim, Job, Measure, Measured, about, at_least, at_most
from landing_sim.papers.flights import Flown, Run
from landing_sim.papers.sabiron_trials import OPEN_LOOP, Course, Trial

NAME = "sabiron-2014"
TITLE = "Sabiron et al. 2014: Backup State Observer Based on Optic Flow Applied to Lunar Landing"
LEAD = (
    "What the paper states, and what came out when its simulation was made again. Errors are estimate minus truth. The "
    "published gains are those of section IV.B in the symmetric form of (19); the shipped ones are ours."
)
FIGURES = (
    "The paper's own curves are not at hand as data, nor is its reference trajectory: these are ours, of what it shows."
)
RUNS = (
    "Eq. (2) is flown open loop with the reference's inputs, as the paper does, for 30 s: on our reference the published "
    "deviations lead into the ground at 34 s. Descents over rendered ground are scenarios and can be flown again with "
    "landing-sim run. Flows come every 10 ms; noise, where there is any, is white in each flow."
)

CLEAN = {name: Trial(name) for name in trials.OBSERVERS}
PAPERS_GAINS, SHIPPED_GAINS = CLEAN["LPV observer, published gains"], CLEAN["LPV observer, shipped gains"]
NOISY = {name: replace(trial, noise_dps=0.1, repeats=6) for name, trial in CLEAN.items() if name != OPEN_LOOP}
HALF = replace(SHIPPED_GAINS, share=0.5)
OTHER_SIDE = replace(SHIPPED_GAINS, share=-1.0)
Q_UNKNOWN = {
    name: replace(trial, q_known=False) for name, trial in CLEAN.items() if name in (PAPERS_GAINS.observer, "EKF")
}
HALF_STEP = replace(SHIPPED_GAINS, dt=0.005)

Results = Sequence[list[Course]]
BOUNDS = np.array([math.inf, math.inf, 0.05, 0.12, 1.5])  # [deg/s, deg/s, deg] of omega_x, omega_z, theta: converged


def perform(job: Job) -> list[Course] | Flown:
    """A course for each seed of a trial; a descent's log."""
    if isinstance(job, Run):
        return sabiron_flown.fly(job)
    assert isinstance(job, Trial)
    return trials.run(job)


def _computed(figure: Callable[[], float], note: str = "") -> Measure:
    return lambda results: Measured(figure(), note)


def converged(course: Course) -> float:
    """[s] from when on omega_x, omega_z and theta stay within BOUNDS until 10 s."""
    outside = (np.abs(course.error) > BOUNDS).any(axis=1) & (course.t <= 10.0)
    return float(course.t[np.flatnonzero(outside)[-1] + 1]) if outside.any() else 0.0


def _converged(results: Results) -> Measured:
    course = results[0][0]
    wx, wz, theta = np.abs(course.error[(course.t >= 5.0) & (course.t <= 10.0)]).max(axis=0)[2:]
    return Measured(converged(course), f"from 5 to 10 s within {wx:.3f} °/s, {wz:.3f} °/s, {theta:.2f}°")


def _beats_open_loop(results: Results) -> Measured:
    open_loop, observer = (results[i][0].at(25.0) for i in (0, 1))
    ratios = np.abs(open_loop / observer)[2:]
    told = ", ".join(f"{name} {r:.3g}" for name, r in zip(("ωx", "ωz", "θ"), ratios))
    return Measured(float(ratios[:2].min()), f"{told} times as far off")


def _diverges(results: Results) -> Measured:
    course = results[0][0]
    growth = np.abs(course.at(25.0)[2:4] / course.at(0.0)[2:4])
    return Measured(
        float(growth.min()), f"ωx {growth[0]:.3g}, ωz {growth[1]:.3g} times as far off at 25 s as at the start"
    )


def _rms(state: int, start: float = 5.0, end: float = 20.0) -> Measure:
    def measure(results: Results) -> Measured:
        values = [course.rms(start, end)[state] for course in results[0]]
        text = f"median of {len(values)}; largest {max(values):.3g}" if len(values) > 1 else ""
        return Measured(float(np.median(values)), text)

    return measure


def _noise_table(results: Results) -> Measured:
    told = []
    for name, courses in zip(NOISY, results):
        rms = np.median([course.rms(5.0, 20.0) for course in courses], axis=0)
        told.append(f"{name}: h {rms[0]:.3g} m, q {rms[1]:.3f}, ωx {rms[2]:.3f}, ωz {rms[3]:.3f} °/s, θ {rms[4]:.2f}°")
    ratio = [np.median([course.rms(5.0, 20.0)[4] for course in courses]) for courses in results]
    return Measured(float(ratio[1] / ratio[2]), "; ".join(told))


def _late_rate_error(results: Results) -> Measured:
    return Measured(float(abs(results[0][0].at(25.0)[1])))


def _q_not_found(results: Results) -> Measured:
    published, ekf = (courses[0].at(20.0)[1] for courses in results)
    return Measured(float(abs(published)), f"starts 0.2 °/s off; the EKF's: {abs(ekf):.3f} °/s")


def _height(results: Results) -> Measured:
    errors = np.array([course.rms(5.0, 20.0)[0] for course in results[0]])
    return Measured(float(np.median(errors)), f"rms, median of {len(errors)}; the lander is at 1,596 to 590 m")


def _half_step(results: Results) -> Measured:
    full, half = (courses[0] for courses in results)
    difference = np.abs(full.X_hat - half.X_hat[::2])[:, 2:]
    return Measured(float(100.0 * np.max(difference / np.abs(full.X_hat - full.X)[0, 2:])))


def _late_pitch(results: Results) -> Measured:
    course = results[0][0]
    inside = (course.t >= 10.0) & (course.t <= 25.0)
    return Measured(float(np.abs(course.error[inside, 4]).max()))


def _condition(results: Results) -> Measured:
    return Measured(results[0][0].condition, f"smallest eigenvalue {results[0][0].least:.2g}, h in km")


def _share(results: Results) -> Measured:
    course = results[0][0]
    inside = (course.t >= 5.0) & (course.t <= 25.0)
    wz, theta = np.abs(course.error[inside]).max(axis=0)[3:]
    return Measured(float(wz), f"θ within {theta:.2f}°")


# fmt: off
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "flow", "the flow of a sensor is (5)", "eq. 5", None, "rad/s",
        "largest error from differences of a ground point's direction, along and beside the reference",
        (), _computed(check.flow_error), at_most(1e-8),
    ),
    Claim(
        "fusion", "Y follows from the flows by the inverse of H, as it follows from (6)", "eqs. 6–8", None, "",
        "largest relative error of Y with H = ½ [1, cos 2α, sin 2α]",
        (), _computed(lambda: check.fusion_error("corrected")), at_most(1e-12), "what is used here",
    ),
    Claim(
        "fusion-printed-7", "the same with H = [1, cos 2α, sin 2α]", "eq. 7", None, "",
        "as before", (), _computed(lambda: check.fusion_error("(7)")), at_most(1e-12), "a factor ½ of (5) is lost",
    ),
    Claim(
        "fusion-printed-8", "the same with H = [½, cos 2α, sin 2α]", "eq. 8", None, "",
        "as before", (), _computed(lambda: check.fusion_error("(8)")), at_most(1e-12), "½ belongs to all three columns",
    ),
    Claim(
        "condition", "90°, 120° and 160° satisfy (9)", "V, eq. 9", None, "",
        "left side of (9)", (), _computed(lambda: abs(spread(trials.ANGLES))), at_least(0.1),
        "0 would be singular; largest possible is 2.6",
    ),
    Claim(
        "linear-model", "(10), (13) and (14) linearise (2) and (6)", "eqs. 10–14", None, "",
        "largest difference of A, B, C from central differences, h in km", (),
        _computed(check.jacobian_error), at_most(1e-6),
    ),
    Claim(
        "c2-rate", "Ċ2 is as printed", "IV.B", None, "", "largest difference from C2's differences along the motion",
        (), _computed(check.c2_rate_error), at_most(1e-6),
    ),
    Claim(
        "c2-invertible", "C2 is invertible", "IV.A, lemma 1", None, "°/s", "smallest |ωz*| of our reference",
        (), _computed(lambda: math.degrees(float(np.min(np.abs(reference().table[:, 3]))))), at_least(0.5),
        "det C2 = −2 ωz exactly: singular in hover, nowhere else",
    ),
    Claim(
        "state-equation", "the state equation expands to diag(I2, Ċ2 C2⁻¹ + C2 A C2⁻¹)", "IV.B", None, "m",
        "error of ĥ after 3 s with that block, perfect flows, linear truth",
        (), _computed(lambda: abs(float(check.observer_equations(SHIPPED, 3.0, whole=False, step=1e-4)[0][0]
                                        - check.observer_equations(SHIPPED, 3.0, step=1e-4)[0][0]))),
        at_most(10.0), "M' + M A has more than its block diagonal, and I2 would let ĥ and q̂ grow as eᵗ; (16) is right",
    ),
    Claim(
        "riccati-printed", "S > 0 under (19)", "eqs. 17, 19", None, "s",
        "time until S as printed, with Θ S, loses definiteness; published gains",
        (), _computed(lambda: min(1.0, check.observer_equations(PUBLISHED, 0.05, symmetric=False)[2])), at_least(1.0),
        "Θ S is symmetric only if all of Θ's entries are equal",
    ),
    Claim(
        "riccati", "the same with ½ (Θ S + S Θ)", "eqs. 17, 19", None, "",
        "scaled condition of S over 30 s, published gains", (PAPERS_GAINS,), _condition, at_most(1e20),
        "definite throughout, if only just",
    ),
    Claim(
        "riccati-shipped", "the same, shipped gains", "eqs. 17, 19", None, "",
        "scaled condition of S over 30 s", (SHIPPED_GAINS,), _condition, at_most(1e7),
    ),
    Claim(
        "converges", "ω̂x, ω̂z and θ̂ converge quickly to the true states", "V, fig. 3", None, "s",
        "from when on |ωx| ≤ 0.05 °/s, |ωz| ≤ 0.12 °/s, |θ| ≤ 1.5°; published gains, perfect flows",
        (PAPERS_GAINS,), _converged, at_most(3.0),
        "Δq̂ is read as the deviation that is believed, −0.2 °/s: read as an error of the estimate it is never lost",
    ),
    Claim(
        "converges-shipped", "the same, shipped gains", "V, fig. 3", None, "s", "as before",
        (SHIPPED_GAINS,), _converged, at_most(3.0),
    ),
    Claim(
        "open-loop", "the open-loop linear system would not have sufficed", "V, fig. 3", None, "times",
        "its error over the observer's at 25 s, the lesser of ωx and ωz; shipped gains",
        (CLEAN[OPEN_LOOP], SHIPPED_GAINS), _beats_open_loop, at_least(5.0),
        "in θ the linear model itself is 3° off by then, observer or not",
    ),
    Claim(
        "open-loop-diverges", "it even diverges with ωx and ωz", "V, fig. 3", None, "times",
        "its error at 25 s over that at the start", (CLEAN[OPEN_LOOP],), _diverges, at_least(2.0),
    ),
    Claim(
        "q-perfect", "q̂ − q tends to 0 when the outputs are perfect", "V", 0.0, "°/s",
        "at 25 s, published gains", (PAPERS_GAINS,), _late_rate_error, at_most(0.01),
    ),
    Claim(
        "q-unknown", "the same from a wrong q̂", "V", 0.0, "°/s", "at 20 s, q̂ starting at the reference's; published gains",
        tuple(Q_UNKNOWN.values()), _q_not_found, at_most(0.01),
        "θq = 0.05 forgets q̂'s first value over 20 s, and q enters all three flows alike",
    ),
    Claim(
        "height-published", "a raw estimate of h, slower to converge", "V, fig. 4", None, "m",
        "rms of ĥ − h from 5 to 20 s, 0.1 °/s of noise, published gains",
        (NOISY[PAPERS_GAINS.observer],), _height, at_most(100.0),
        "with θh = 20 1/s on the least visible state; the paper may have ordered Θ or S(0) in another way than it prints",
    ),
    Claim(
        "height", "the same, shipped gains", "V, fig. 4", None, "m",
        "as before", (NOISY[SHIPPED_GAINS.observer],), _height, at_most(40.0),
    ),
    Claim(
        "noise-theta", "robust to measurement noise: θ̂", "abstract", None, "°",
        "rms 5 to 20 s, 0.1 °/s in each flow, shipped gains", (NOISY[SHIPPED_GAINS.observer],), _rms(4), at_most(1.5),
    ),
    Claim(
        "noise-wx", "robust to measurement noise: ω̂x", "abstract", None, "°/s",
        "as before", (NOISY[SHIPPED_GAINS.observer],), _rms(2), at_most(0.08),
    ),
    Claim(
        "noise-wz", "robust to measurement noise: ω̂z", "abstract", None, "°/s",
        "as before", (NOISY[SHIPPED_GAINS.observer],), _rms(3), at_most(0.18),
    ),
    Claim(
        "noise-q", "robust to measurement noise: q̂", "abstract", None, "°/s",
        "as before", (NOISY[SHIPPED_GAINS.observer],), _rms(1), at_most(0.03),
    ),
    Claim(
        "half", "robust to initial uncertainties: half the deviation", "abstract", None, "°/s",
        "largest |ω̂z − ωz| from 5 to 25 s, shipped gains", (HALF,), _share, at_most(0.12),
    ),
    Claim(
        "other-side", "robust to initial uncertainties: the deviation on the other side", "abstract", None, "°/s",
        "as before", (OTHER_SIDE,), _share, at_most(0.5),
        "the linear model's own error: it grows with the square of the deviation",
    ),
    Claim(
        "kalman", "it would be interesting to compare with extended and unscented Kalman filters", "VI", None, "times",
        "θ̂'s rms with the shipped observer over the EKF's, 5 to 20 s, 0.1 °/s of noise", tuple(NOISY.values()),
        _noise_table, None, "the paper leaves it to the future. They linearise where they are, not where they should be",
    ),
    Claim(
        "kalman-perfect", "the same with perfect flows: the extended filter's θ̂", "VI", None, "°",
        "largest |θ̂ − θ| from 10 to 25 s", (CLEAN["EKF"],), _late_pitch, None, "the paper leaves it to the future",
    ),
    Claim(
        "step", "(no claim) the observer is sampled finely enough", "", None, "%",
        "change of ω̂x, ω̂z, θ̂ at half the step, of the first error", (SHIPPED_GAINS, HALF_STEP), _half_step, at_most(2.0),
    ),
    Claim(
        "start", "h0 = 1496 m, ωx0 = 2.18 °/s, ωz0 = −1.72 °/s, θ0 = −53.43°, q0 = −0.92 °/s", "V", None, "",
        "largest difference of our reference's start", (), _computed(
            lambda: float(np.max(np.abs(reference().state(0.0) * trials.UNITS - [1496.0, -0.92, 2.18, -1.72, -53.43])))
        ), about(0.0, 1e-6),
    ),
    *sabiron_flown.CLAIMS,
)
