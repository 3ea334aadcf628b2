"""Gibert et al. 2015, "A New Observer for Range Identification in Perspective Vision Systems": section 3's equations,
every statement of sections 4.1 and 4.2, and the appendix.

The example of section 4.1 is repeated as published; of the observers it is compared with, only abstracts could be read, so
where a comparison hangs on their gains it is said. Section 4.2's approach is not published: it is flown on JSBSim from
rendered pixels, and computed as a point mass where noise and observers are to be compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from landing_sim.estimators.ranging.contract import steady_motion
from landing_sim.estimators.ranging.gains import HighGain
from landing_sim.papers import academic_example, flying, point_approach
from landing_sim.papers import gibert_approach as approach
from landing_sim.papers import gibert_checks as check
from landing_sim.papers import gibert_trials as g
from landing_sim.papers.claims import Claim, Job, Measure, Measured, about, at_least, at_most
from landing_sim.papers.courses import Course, rms_between, settling
from landing_sim.papers.flights import Flown, Run

NAME = "gibert-2015"
TITLE = "Gibert et al. 2015: A New Observer for Range Identification in Perspective Vision Systems"
LEAD = (
    "What the paper states, and what came out when its example was computed again and a transport was landed by its "
    "observer from rendered pixels. Range errors are those of x3, the depth. Settled means within 5 % of the true value "
    "for good."
)
FIGURES = "The paper's own curves are not at hand as data: these are ours, of what its figures show."
RUNS = (
    "Flights are scenarios and can be flown again, to the same bits, with landing-sim run SCENARIO --set … --seed N. All "
    "else is made by this report alone. The example is exact; its noise is Gaussian, a share of each measured coordinate, "
    "each sample on its own. Settings as in landing_sim.estimators.ranging, only what is not the default."
)


def perform(job: Job) -> list[Course] | Flown:
    """A course for each seed of a trial or a watch; a flight's log."""
    if isinstance(job, Run):
        return flying.fly(job)
    if isinstance(job, academic_example.Trial):
        return academic_example.run(job)
    assert isinstance(job, point_approach.Watch)
    return point_approach.run(job)


Results = Sequence[list[Course]]


def noise_rms(courses: list[Course]) -> float:
    """[m] median over the seeds of the range error's rms from 3 to 8 s."""
    return float(np.median([rms_between(course, *g.SETTLED) for course in courses]))


def _computed(figure: Callable[[], float], note: str = "") -> Measure:
    return lambda results: Measured(figure(), note)


def _settling(results: Results) -> Measured:
    """The slowest of the first courses."""
    return Measured(max(settling(courses[0]) for courses in results))


def _similar(results: Results) -> Measured:
    times = [settling(courses[0]) for courses in results]
    told = ", ".join(f"{name} {t:.2f} s" for name, t in zip(g.CLEAN, times))
    return Measured(max(times[:3]) / min(times[:3]), f"slowest over fastest of the first three; {told}")


def _tangent(results: Results) -> Measured:
    """How fast the correction alone starts to move the range [m/s], over the first sample."""
    slopes = {}
    for name, courses in zip(g.FIRST, results):
        c = courses[0]
        carried = steady_motion(academic_example.A, academic_example.B, c.t[1])
        slopes[name] = abs((c.x_hat[1] - (carried.R @ c.x_hat[0] + carried.t))[2]) / c.t[1]
    told = ", ".join(f"{name} {slope:.2g} m/s" for name, slope in slopes.items())
    return Measured(slopes["Karagiannis"] / slopes["Gibert"], told)


def _least_noise(results: Results) -> Measured:
    values = {name: noise_rms(courses) for name, courses in zip(g.NOISY, results)}
    told = ", ".join(f"{name} {value:.2g} m" for name, value in values.items())
    rivals = [values[name] for name in ("Dahl", "Jankovic", "Karagiannis", "Chen & Kano", "Dixon")]
    return Measured(values["Gibert"] / min(rivals), told)


def _least_noise_slower(results: Results) -> Measured:
    values = {name: noise_rms(courses) for name, courses in zip(g.NOISY_SLOWER, results)}
    told = ", ".join(f"{name} {value:.2g} m" for name, value in values.items())
    return Measured(values["Gibert"] / min(value for name, value in values.items() if name != "Gibert"), told)


def _noise_ratio(results: Results) -> Measured:
    gibert, other = (noise_rms(courses) for courses in results[:2])
    return Measured(other / gibert, f"Gibert {gibert:.3f} m, the other {other:.3f} m")


def _noise(results: Results) -> Measured:
    values = [rms_between(course, *g.SETTLED) for course in results[0]]
    return Measured(float(np.median(values)), f"median of {len(values)} runs; largest {max(values):.3f} m")


def _tuned(results: Results) -> Measured:
    times = [settling(courses[0]) for courses in results]
    told = ", ".join(f"λ = {scale:g}: {t:.2f} s" for scale, t in zip(g.LAMBDA, times))
    return Measured(times[2] / times[0], told)


_equal = (
    "all at the paper's speed but Chen & Kano's and Dixon's, whose gains are not known: these two are no evidence against "
    "those papers"
)

# fmt: off
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "speed", "ξ = 0.99, ω = 7 correspond to a 5 % response time of 1 s", "4.1", 1.0, "s",
        "time until the range stays within 5 % of its true value; λ = 1, no noise",
        (g.CLEAN["Gibert"],), _settling, about(1.0, 0.1),
        "to 5 % of the initial error it takes 0.63 s; a critically damped pair at 7 rad/s alone takes 0.95 s to 1 %",
    ),
    Claim(
        "speed-lambda", "the same, with the λ that gives it", "4.1", 1.0, "s",
        "as before; λ1 = 2.04", (g.CLEAN_SLOWER["Gibert"],), _settling, about(1.0, 0.05),
        "which λ the paper uses is not printed; small λ is fast, Λ being inverted in (11)",
    ),
    Claim(
        "speed-karagiannis", "this roughly corresponds to λ = 30 in [16]", "4.1", None, "s",
        "settling of Karagiannis & Astolfi's observer with 30; ours of Gibert's is 0.56 s",
        (g.CLEAN["Karagiannis"],), _settling, about(0.56, 0.1),
        "which says that the paper's own curve settles in 0.56 s too: it used λ = 1",
    ),
    Claim(
        "similar", "most observers have similar behaviour except [8]", "4.1, fig. 2", None, "times",
        "how far the settling times of Gibert, Dahl and Karagiannis lie apart, tuned as the paper says",
        tuple(g.CLEAN.values()), _similar, at_most(1.6),
        "similar read as 1.6; the gains of [4] and [8] in the paper are not known, ours make both fast",
    ),
    Claim(
        "tangent", "the error has a non-null tangent at the origin only with [16]", "4.1, fig. 2", None, "times",
        "speed at which the correction sets in over the first 0.1 ms: Karagiannis over Gibert",
        tuple(g.FIRST.values()), _tangent, at_least(20.0),
        "non-null read as 20 times; Dahl's, as reconstructed, is not quite null. The first guess lies on the measured ray, "
        "so image errors start at zero",
    ),
    Claim(
        "noise", "the proposed solution is very robust to noise", "4.1, fig. 3", None, "m",
        "rms range error from 3 to 8 s with 1 % noise; λ = 1", (g.NOISY["Gibert"],), _noise, at_most(0.035),
        "very robust read as 0.035 m, about 1 % of the range",
    ),
    Claim(
        "noise-10", "the same with a sample every 10 ms", "4.1, fig. 3", None, "m",
        "rms range error from 3 to 8 s with 1 % noise; λ = 1", tuple(g.NOISY_10.values()), _noise, at_most(0.1),
        "how often the paper samples is not printed; white noise passes with the root of the period",
    ),
    Claim(
        "noise-best", "more robust to noise than the others", "4.1, 5, fig. 3", None, "times",
        "its rms over that of the best of the others", tuple(g.NOISY.values()), _least_noise, at_most(1.0),
        _equal + ". An EKF, not in the paper, is better still",
    ),
    Claim(
        "noise-dahl", "a similar robustness is obtained with [6]", "4.1, fig. 3", None, "times",
        "rms of Dahl's observer over Gibert's, at equal speed", (g.NOISY["Gibert"], g.NOISY["Dahl"]), _noise_ratio,
        at_most(2.0), "similar read as a factor of two; [6] is our reconstruction",
    ),
    Claim(
        "noise-karagiannis", "not with [16]", "4.1, fig. 3", None, "times",
        "rms of Karagiannis & Astolfi's over Gibert's, at equal speed",
        (g.NOISY["Gibert"], g.NOISY["Karagiannis"]), _noise_ratio, at_least(3.0),
        "noise reaches its 1/x3 directly, which makes spikes in x3",
    ),
    Claim(
        "tuning", "the dynamics of the estimation can easily be tuned", "4.1, 5", None, "times",
        "settling with λ1 = 2.04 over that with 0.5, no noise", tuple(g.LAMBDA.values()), _tuned, at_least(2.0),
        "one number sets it; the poles scale by 4, settling by less since it starts from the same error",
    ),
    Claim(
        "candidate", "taking into account the influence of the design parameters, a good candidate", "4.1", None, "times",
        "rms of Gibert's over that of the best of Dahl, Jankovic and Karagiannis, all tuned to settle in 1 s",
        (*g.NOISY_SLOWER.values(), *g.CLEAN_SLOWER.values(), *g.CLEAN_EQUAL.values()), _least_noise_slower, at_most(1.0),
        "the lead of 0.56 s remains at 1 s",
    ),
    Claim(
        "kappa", "sliding mode may take the place of the high gain", "3.2", None, "s",
        "settling with a super-twisting κ, L = 3 s⁻², smoothed below 0.001; no noise",
        (g.SLIDING,), _settling, at_most(1.0), "it works; the gains are ours",
    ),
    Claim(
        "kappa-noise", "the same with noise, which the paper does not try", "3.2", None, "m",
        "rms range error from 3 to 8 s with 1 % noise", (g.SLIDING_NOISY,), _noise, None,
        "fast, and 17 times as noisy as the high gain",
    ),
    Claim(
        "sampled", "discretisation is left for the future", "5", None, "s",
        "settling of our exact discrete form, a sample every 33 ms, no noise", (g.SAMPLED,), _settling, None,
        "prediction by the matrix exponential, gains with the same poles: sampling leaves no bias",
    ),
    *approach.CLAIMS,
    Claim(
        "eq3", "Ψ has ẏ1 as its second entry, printed ẋ1/x3", "3.1, eq. 3", 0.0, "1/s",
        "largest |ẋ1/x3 − ẏ1| over the example, ẏ1 by differences", (), _computed(check.rate_error_of_print),
        at_most(1e-6), "misprint: ẏ1 = (ẋ1 − y1 ẋ3)/x3 is meant, and used here",
    ),
    Claim(
        "eq5", "|∂Ψ/∂x| vanishes where b1 − b3 y1 does", "3.1, eq. 5", 0.0, "",
        "largest relative difference of (b1 − b3 y1)/x3⁴ from the determinant by differences", (),
        _computed(check.determinant_error), at_most(1e-6), "with ẏ1 as above",
    ),
    Claim(
        "eq5-print", "the same with the Ψ that is printed", "3.1, eqs. 3, 5", 0.38, "m/s",
        "x3⁴ |∂Ψ/∂x| at t = 0 by differences; b1 − b3 y1 is 0.38", (), _computed(check.determinant_of_print),
        about(0.38, 1e-3), "it is b1: (3) as printed and (5) contradict each other",
    ),
    Claim(
        "eq5-sign", "b1 − b3 y1 > 0 is asked for", "3.1, eq. 5", None, "s",
        "settling on the example mirrored left for right, where b1 − b3 y1 < 0", (g.MIRRORED,), _settling,
        about(0.56, 0.03), "enough, not needed: it must not vanish or change its sign, and it may be y2's",
    ),
    Claim(
        "eq5-domain", "(5) holds in the operating domain", "3.1, eq. 5", None, "s",
        "when b1 − b3 y1 first vanishes in the example", (), _computed(check.first_singularity), None,
        "how long the paper's figures run is not printed; we stop at 8 s",
    ),
    Claim(
        "eq13", "K1 = 2ξω, K2 = ω², K3 = α give (s + α)(s² + 2ξωs + ω²)", "3.2, eqs. 6, 13", 0.0, "",
        "largest difference of the coefficients of F − KC, F 3×3", (),
        _computed(lambda: check.polynomial_error(HighGain())), at_most(1e-9),
        "F is printed with four columns; three states need three",
    ),
    Claim(
        "eq17", "ẋ = [ω]× x + v with the camera's velocities", "4.2, eq. 17", 0.0, "m/s",
        "largest difference from the rate of a point 5 km ahead, by differences", (),
        _computed(lambda: check.motion_error(1.0), f"with a minus before both: {check.motion_error(-1.0):.1g} m/s"),
        at_most(1e-3),
        "the print's signs hold for the point's motion as seen from the camera: of the camera's own, ẋ = −[ω]× x − v",
    ),
    Claim(
        "remark2", "deviations in runway axes through R = Rφ Rθ Rψ", "4.2, remark 2", 0.0, "",
        "largest difference from the rotation into body axes, over attitudes", (), _computed(check.rotation_error),
        at_most(1e-12),
    ),
    Claim(
        "eq19", "the heading follows exactly from d_F, roll and pitch", "app., eqs. 18, 19", 0.0, "rad",
        "largest error of (19), |roll| ≤ 35°, d_F along the horizon from where it crosses the image's vertical mid-line",
        (),
        _computed(lambda: check.heading_error(0)), at_most(1e-9), "the vanishing point by projection, not by (18)",
    ),
    Claim(
        "eq19-horizontal", "the same with d_F read as the vanishing point's horizontal distance", "app., fig. 6", 0.0,
        "deg", "largest error of (19)", (), _computed(lambda: math.degrees(check.heading_error(1))), None,
        "figure 6 is not quite clear: its words allow this reading, for which (18) does not hold",
    ),
    Claim(
        "eq19-perpendicular", "the same with d_F from the point of the horizon nearest to the image's centre",
        "app., fig. 6", 0.0, "deg", "largest error of (19)", (),
        _computed(lambda: math.degrees(check.heading_error(2))), None,
        "its words allow this one too; that distance is f tan Δψ / cos θ, without a term in roll",
    ),
)
# fmt: on
