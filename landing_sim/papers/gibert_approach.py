"""Section 4.2 of Gibert et al. 2015: its statements on an airliner's approach, flown with pixels and computed without."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from landing_sim.papers import gibert_flown as flown
from landing_sim.papers import gibert_trials as g
from landing_sim.papers.claims import Claim, Measure, Measured, at_least, at_most
from landing_sim.papers.courses import Course, settling

Results = Sequence[list[Course]]


def _converges(results: Results) -> Measured:
    """The slowest over all courses, watched for 30 s, where the glide path has been reached."""
    times = np.array([settling(course, until=30.0) for courses in results for course in courses])
    last = float(results[0][0].t[-1])
    if not np.isfinite(times).all():
        return Measured(math.nan, f"{int((~np.isfinite(times)).sum())} of {len(times)} have not settled after 30 s")
    halves = [np.median([settling(c, until=30.0) for c in courses]) for courses in results]
    told = ", ".join(f"× {share:g}: {t:.1f} s" for share, t in zip(g.SHARES, halves))
    return Measured(float(times.max()), f"slowest of {len(times)}; {told}; the approach is watched for {last:.0f} s")


def _error_at(t: float, of: Callable[[Any], Any] = np.max) -> Measure:
    def measured(results: Results) -> Measured:
        values = np.array([100.0 * abs(c.relative[np.searchsorted(c.t, t - 1e-9)]) for cs in results for c in cs])
        return Measured(float(of(values)), f"of {len(values)} runs" if len(values) > 1 else "")

    return measured


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


# fmt: off
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "flown", "an error of ±50 % is gone fast enough compared with the time to landing", "4.2, fig. 5", None, "s",
        "slower settling of two landings on JSBSim, from rendered pixels; point and angular width of the runway, ω = 0.5",
        flown.BOTH, flown.converges, at_most(30.0),
        "fast enough read as 30 s. Still air, images 0.16 s old when they arrive; the runway's width is not known on board",
    ),
    Claim(
        "flown-zero", "the estimation error converges to zero", "4.2", 0.0, "%",
        "larger |range error| of the two landings 1 km before the threshold", flown.BOTH, flown.range_at_1km,
        at_most(1.0), "zero read as 1 %",
    ),
    Claim(
        "flown-good", "a good estimation with a time-varying motion of the camera", "4.2", None, "m",
        "largest |lateral error| and |height error| of the estimate over the threshold, two landings", flown.BOTH,
        flown.at_threshold, at_most(1.0), "the paper gives no figure; good read as 1 m",
    ),
    Claim(
        "flown-lands", "the estimated deviations feed the guidance law", "4.2, remark 2", None, "of 2",
        "how many of the two land on the runway and stop on it, flown by the estimate alone", flown.BOTH, flown.lands,
        at_least(2.0), "the paper says so of visual servoing and leaves it: its own approach is guided by truth",
    ),
    Claim(
        "flown-track", "the trajectory is independent of the estimation", "4.2, remark 2", None, "m",
        "largest distance between the tracks of the two landings at the same x", flown.BOTH, flown.tracks_apart, None,
        "the paper's is, ours cannot be: until the range may be trusted both hold their track and path, then each steers "
        "by its own estimate. The paper prints neither trajectory, gains nor figures to lay beside ours",
    ),
    Claim(
        "flown-point", "and by the point's two coordinates alone, as the paper has it", "4.2, fig. 5", None, "%",
        "largest |range error| from 30 s after acquisition until the threshold is lost, first range + 50 %",
        (flown.POINT,), flown.late_error, at_most(5.0),
        "in our form, which does not divide by d1 and so survives. The threshold is not far from where the aircraft is "
        "bound for: on the glide path d1 = 0 and d2 is small",
    ),
    Claim(
        "approach", "an error of ±50 % is gone fast enough, computed without pixels", "4.2, fig. 5", None, "s",
        "slowest settling of the paper's observer on a point mass's approach, no noise; ω = 0.5 rad/s",
        g.RAW, _converges, at_most(30.0),
        "the paper gives neither gains nor trajectory; fast enough read as 30 s of the 68 s flown. Ours passes d1 = 0 at "
        "2 s, where one step moves the range by 70 %",
    ),
    Claim(
        "approach-noise", "the same with half a pixel of noise", "4.2, fig. 5", None, "s",
        "slowest settling of the paper's observer, 0.33 mrad", g.RAW_NOISY, _converges, at_most(30.0),
        "on the glide path d1 = 0: dividing by it, noise becomes range without bound",
    ),
    Claim(
        "approach-both", "the other output may be chosen as well: both, weighed by what they show", "3.1, remark 1", None,
        "s", "slowest settling on the approach, half a pixel of noise; the form that fades where neither moves", g.BOTH,
        _converges, None, "ours; it starts as slowly, and survives the glide path",
    ),
    Claim(
        "approach-ekf", "(not in the paper) an extended Kalman filter on the approach", "–", None, "s",
        "slowest settling, half a pixel of noise", g.EKF, _converges, None, "ours, told the noise",
    ),
    Claim(
        "zero", "the estimation error converges to zero, computed without pixels", "4.2", 0.0, "%",
        "largest |range error| of the paper's observer after 60 s, 850 m before the aim point; no noise",
        g.RAW, _error_at(60.0), at_most(1.0), "zero read as 1 %",
    ),
    Claim(
        "zero-noise", "the same with half a pixel of noise", "4.2", 0.0, "%",
        "largest |range error| at 60 s of both outputs weighed: the paper's own does not survive until then",
        g.BOTH, _error_at(60.0), at_most(1.0),
        "on the glide path the aim point does not move in the image (d1 = d2 = 0): what is left of the error stays in "
        "metres and grows in percent",
    ),
    Claim(
        "glide", "(not in the paper) begun on the glide path", "–", None, "%",
        "rms range error after 30 s, first range + 50 %, both outputs", (g.AIM_ON_GLIDE,), _error_at(30.0, _rms), None,
        "nothing that looks at the aim point alone can find its range: 50 % of 5000 m has become 87 % of 2900 m",
    ),
    Claim(
        "glide-width", "(not in the paper) the same, with the runway's angular width", "–", None, "%",
        "rms range error after 30 s, first range ± 50 %; the width itself is not known",
        g.WIDTH_ON_GLIDE, _error_at(30.0, _rms), None, "ours: what is left to see on the glide path grows",
    ),
)
# fmt: on
