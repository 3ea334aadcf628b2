"""Dickmanns & Schell 1992, "Visual Autonomous Automatic Landing of Airplanes": every number of section 7.

The paper's simulation is repeated as `do128/gust`. Its filter had no wind states and was split into two halves of six;
where a figure is a property of that filter, ours of that kind is flown beside the augmented one. The real flights of
section 7.2 are not ours to repeat: a scripted pilot flies, the filter watches, and readings of a differential GPS and a
radar altimeter with their errors are drawn; such rows are not compared, but say what came out.
"""

from __future__ import annotations

import math

from landing_sim.papers import measures as m
from landing_sim.papers.claims import Claim, Measure, about, at_least, at_most
from landing_sim.papers.flights import Run
from landing_sim.record.judge import captured_after
from landing_sim.record.log import FlightLog

NAME = "dickmanns-1992"
TITLE = "Dickmanns & Schell 1992: Visual Autonomous Automatic Landing of Airplanes"
LEAD = (
    "What the paper claims, and what came out when its landing was flown again: every number of section 7, with the "
    "verdict first. Our values are the errors of the estimate against the simulation's truth, from 1.5 s after the runway "
    "was acquired until touchdown."
)
FIGURES = "The paper's own curves are not at hand as data. Its claimed figures are the dashed green lines."
RUNS = (
    "Each can be flown again, to the same bits, with landing-sim run SCENARIO --set … --seed N; the scripted pilot's are "
    "flown by this report only."
)
SEEDS = range(1, 9)

GUST = tuple(Run("do128/gust", seed=seed) for seed in SEEDS)
SPLIT = tuple(Run("do128/gust", ("filter.kind=split", "filter.factorisation=ud"), seed) for seed in SEEDS)
COARSE = tuple(Run("do128/gust", ("filter.kind=plain", "vision.edge_floor_px=1.0"), seed) for seed in range(1, 5))
PLAIN = tuple(Run("do128/gust", ("filter.kind=plain", "filter.factorisation=ud"), seed) for seed in (1, 2))
LEVEL_GUST = (Run("do128/gust", ("wind.gust.vertical_mps=0",)),)
_STRAIGHT_IN = ("initial.y_m=0", "initial.heading_deg=0", "vision.platform_angle=commanded")
_HALVES = ("filter.kind=split", "filter.factorisation=ud")
LAGGING = tuple(Run("do128/calm", (*_STRAIGHT_IN, *_HALVES, "camera.platform.lag_s=0.06"), seed) for seed in (1, 2, 3))
PROMPT = tuple(Run("do128/calm", (*_STRAIGHT_IN, *_HALVES, "camera.platform.lag_s=0"), seed) for seed in (1, 2, 3))
WIDTH = tuple(
    Run("do128/gust", ("filter.width=separate", f"filter.believed_width_m={width}"), seed)
    for width, seed in ((25, 1), (33, 2), (25, 3), (33, 4))
)
_BY_HAND = ("initial.y_m=-20", "initial.heading_deg=2", "wind.turbulence={severity: light}")
PILOT = tuple(Run("do128/calm", _BY_HAND, seed, pilot=True) for seed in (1, 2, 3))
PILOT_WIDTH = tuple(
    Run("do128/calm", (*_BY_HAND, "filter.width=separate", f"filter.believed_width_m={width}"), seed, pilot=True)
    for width, seed in ((25, 1), (33, 2))
)


def _by_construction(id: str, statement: str, value: float, unit: str, figure: Measure, tolerance: float) -> Claim:
    how = "the true state, from the log; ours by construction"
    return Claim(id, statement, "7.1", value, unit, how, GUST[:1], figure, about(value, tolerance))


def _first(column: str, scale: float = 1.0) -> Measure:
    return m.over(lambda log: scale * float(log[column][0]))


def _gust(column: str, sign: float) -> Measure:
    """What the gust adds at its strike: the jump of the true wind there."""

    def jump(log: FlightLog) -> float:
        behind = log["true_x_m"] > m.GUST_X
        at = int(behind.argmax())
        return float(sign * (log[column][at] - log[column][at - 1])) if behind.any() and at > 0 else math.nan

    return m.over(jump)


def _gust_time(log: FlightLog) -> float:
    """Time constant of the decaying vertical wind, from its values 1 s and 7 s after the strike."""
    t, down, behind = log["t_s"], log["true_wz_mps"], log["true_x_m"] > m.GUST_X
    struck = float(t[behind.argmax()]) if behind.any() else math.inf
    if t[-1] < struck + 7.0:
        return math.nan
    early, late = (float(down[(t >= struck + after).argmax()]) for after in (1.0, 7.0))
    return 6.0 / math.log(early / late) if early * late > 0.0 and early != late else math.nan


# fmt: off
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "range", "distance is estimated within 5 m while the threshold is visible", "7.1", 5.0, "m",
        "largest |range error| from 1.5 s after acquisition until the threshold is lost, at any distance",
        GUST, m.over(m.range_error), at_most(5.0),
    ),
    Claim(
        "threshold-lost", "the threshold is lost from sight at about 120 m", "7.1", 120.0, "m",
        "distance when a window last found it", GUST, m.typical("threshold_lost_m"), about(120.0, 20.0),
        "its corners leave the image at 116 m; ours look at the paint-free strips inside them, which stay in sight longer",
    ),
    Claim(
        "range-predicted", "after the loss of the threshold, range is merely predicted", "7.1", None, "m",
        "largest |range error| from then to touchdown", GUST, m.over(m.range_error_after_loss), None,
        "the paper gives no figure",
    ),
    Claim(
        "height-approach", "altitude within 1 m during approach", "7.1", 1.0, "m",
        "largest |height error| before the threshold", GUST, m.worst("height_approach_m"), at_most(1.0),
    ),
    Claim(
        "height-runway", "altitude to less than half a metre over the runway", "7.1", 0.5, "m",
        "largest |height error| over the runway", GUST, m.worst("height_runway_m"), at_most(0.5),
    ),
    Claim(
        "flare-onset", "a rather large height error at flare onset, from the delay of the tilt loop", "7.1", None, "m",
        "growth of the largest |height error| from the second before to the 3 s after flare onset; straight-in approach, "
        "filter in two halves that takes commanded platform angles for the true ones, platform with 0.06 s lag",
        (*LAGGING, *PROMPT), m.onset_with_lag, at_least(0.3),
        "rather large read as 0.3 m; the lag shows in pitch, not in height; from 0.08 s on the edges are lost instead",
    ),
    Claim(
        "flare-onset-vanishes", "without the delay that error is gone", "7.1 (its cause)", None, "m",
        "the same growth, platform without lag", PROMPT, m.over(m.onset_growth), at_most(0.1),
        "gone read as 0.1 m",
    ),
    Claim(
        "vertical-gust", "the vertical gust is hardly noticeable in the trajectory", "7.1", None, "m",
        "largest height difference on approach between flights with and without it",
        (GUST[0], *LEVEL_GUST), m.vertical_gust_effect, at_most(1.0), "hardly noticeable read as 1 m",
    ),
    Claim(
        "flare-start", "engines are throttled and the flare begins at about 250 m", "7.1", 250.0, "m",
        "distance when the flight phase becomes flare", GUST, m.over(m.flare_range, m.median, "median of"),
        about(250.0, 50.0),
    ),
    Claim(
        "touchdown", "touchdown at about 550 m down the runway", "7.1", 550.0, "m",
        "first main wheel", GUST, m.typical("touchdown_x_m"), about(550.0, 60.0),
    ),
    Claim(
        "touchdown-speed", "slows down towards 43 m/s at touchdown", "7.1", 43.0, "m/s",
        "true airspeed at first contact", GUST, m.typical("touchdown_airspeed_mps"), about(43.0, 1.5),
    ),
    Claim(
        "capture", "within half a kilometre the offset is less than 5 m", "7.1", 500.0, "m",
        "distance travelled along the runway after which |y| < 5 m for good",
        GUST, m.over(lambda log: captured_after(log, 5.0)), at_most(500.0),
    ),
    Claim(
        "heading", "within 0.75 km the heading settles at about 2 deg", "7.1", 2.0, "deg",
        "mean |heading| in the second around 750 m travelled", GUST, m.over(m.heading_settled, m.median, "median of"),
        about(2.0, 0.5),
    ),
    Claim(
        "roll-angle", "roll angles up to 8 deg during the initial manoeuvre", "7.1", 8.0, "deg",
        "largest |roll| before touchdown", GUST, m.typical("peak_roll_deg"), about(8.0, 1.5),
    ),
    Claim(
        "roll-error", "roll error always less than 1 deg", "7.1, fig. 9", 1.0, "deg",
        "largest |roll error|", GUST, m.worst("roll_deg"), at_most(1.0),
    ),
    Claim(
        "yaw-error", "yaw error always less than 1 deg", "7.1, fig. 10", 1.0, "deg",
        "largest |yaw error|", GUST, m.worst("yaw_deg"), at_most(1.0),
    ),
    Claim(
        "lateral-gust", "the gust makes a lateral error of about 3 m for a short time", "7.1, fig. 11", 3.0, "m",
        "largest |lateral error| within 8 s of the gust; filter in two halves, without wind states, as the paper's",
        SPLIT, m.over(m.lateral_in_gust, m.median, "median of"), about(3.0, 1.5),
        "edges are measured to 0.05 px and trusted so: the picture holds the position whatever the filter thinks of wind",
    ),
    Claim(
        "lateral-gust-coarse", "the same, if the filter trusts an edge to one pixel", "7.1, fig. 11", 3.0, "m",
        "largest |lateral error| within 8 s of the gust; twelve states, no wind, edges trusted to 1 px",
        COARSE, m.over(m.lateral_in_gust, m.median, "median of"), about(3.0, 1.5),
        "the mechanism the paper's figure shows; the trust of 1992 is not known",
    ),
    Claim(
        "lateral-gust-augmented", "the same with wind states in the filter", "7.1, fig. 11", 3.0, "m",
        "largest |lateral error| within 8 s of the gust; augmented filter",
        GUST, m.over(m.lateral_in_gust), at_most(3.0), "ours removes the error that the paper reports",
    ),
    Claim(
        "lateral-otherwise", "otherwise less than 1 m", "7.1, fig. 11", 1.0, "m",
        "largest |lateral error| outside the gust; augmented filter", GUST, m.over(m.lateral_otherwise), at_most(1.0),
    ),
    Claim(
        "lateral-otherwise-split", "otherwise less than 1 m, with the paper's kind of filter", "7.1, fig. 11", 1.0, "m",
        "largest |lateral error| outside the gust; filter in two halves",
        SPLIT, m.over(m.lateral_otherwise, m.median, "median of"), at_most(1.0),
    ),
    Claim(
        "width", "a 29 m wide runway is validated to within 1 m", "7.1", 1.0, "m",
        "|width error| of the separate filter when the threshold is lost; told 25 m or 33 m",
        WIDTH, m.over(m.width_error_at_loss), at_most(1.0),
    ),
    Claim(
        "width-mean", "the average width is within 0.4 m of the true one", "7.1", 0.4, "m",
        "|mean of the width estimate from 600 m until the threshold is lost, minus truth|; told 25 m or 33 m",
        WIDTH, m.over(m.width_mean_error), at_most(0.4),
    ),
    Claim(
        "cycle", "real time at 60 ms a cycle (16 Hz)", "4, 8", 60.0, "ms",
        "median onboard work of a cycle", GUST, m.cycle_cost, at_most(60.0),
    ),
    Claim(
        "split-cost", "two halves of six states reduce the computation of each to 12.5 %", "4", 12.5, "%",
        "time of one half over that of the whole twelve-state filter",
        (*SPLIT[:2], *PLAIN), m.split_cost, at_most(12.5),
        "the paper counts n cubed operations on two processors; a filter of this size is no longer bound by them",
    ),
    Claim(
        "distance-gps", "distance: optical against differential GPS", "7.2, fig. 12", None, "m",
        "rms difference on approach", PILOT, m.rms_difference("x", "dgps_x_m"), None,
        "real flight; ours is simulated, with GPS errors assumed",
    ),
    Claim(
        "lateral-gps", "lateral: optical against differential GPS", "7.2, fig. 13", None, "m",
        "rms difference on approach", PILOT, m.rms_difference("y", "dgps_y_m"), None,
        "real flight; ours is simulated, with GPS errors assumed",
    ),
    Claim(
        "lateral-sharpens", "the optical estimate gets better the nearer the runway", "7.2, fig. 13", None, "times",
        "rms lateral error beyond 600 m over that within 300 m", PILOT, m.lateral_sharpens, at_least(1.0),
        "compared with our scripted pilot's approach, against truth",
    ),
    Claim(
        "height-gps", "altitude: optical against differential GPS, which showed errors", "7.2, fig. 14", None, "m",
        "rms difference on approach", PILOT, m.rms_difference("H", "dgps_H_m"), None,
        "real flight; ours is simulated, with GPS errors assumed",
    ),
    Claim(
        "height-radar", "altitude: optical against the radiometric altimeter", "7.2, fig. 14", None, "m",
        "rms difference on approach", PILOT, m.rms_difference("H", "radar_H_m"), None,
        "real flight; ours is simulated, with altimeter errors assumed",
    ),
    Claim(
        "width-flight", "mean width 29.1 m (true 29 m) until 200 m from the threshold", "7.2, fig. 15", 29.1, "m",
        "mean of the width estimate from 600 m until the threshold is lost; scripted pilot, light turbulence; told 25 m "
        "or 33 m", PILOT_WIDTH, m.over(m.width_mean, m.farthest_from(29.0), "farthest of"), about(29.1, 0.4),
        "our scripted pilot's approach; turbulence along the track looks like width to it; the paper's was a real flight",
    ),
    _by_construction("start-range", "starts 950 m in front of the threshold", 950.0, "m", _first("true_x_m", -1.0), 1.0),
    _by_construction("start-height", "starts at about 51 m", 51.0, "m", _first("true_H_m"), 0.5),
    _by_construction("start-speed", "starts at 50 m/s", 50.0, "m/s", _first("true_airspeed_mps"), 0.5),
    _by_construction("start-offset", "starts 85 m beside the centreline", 85.0, "m", _first("true_y_m", -1.0), 0.5),
    _by_construction(
        "start-heading", "starts 15 deg towards the centreline", 15.0, "deg", _first("true_psi_rad", m.DEGREES), 0.2
    ),
    _by_construction("gust-lateral", "gust with 2 m/s across at 650 m", 2.0, "m/s", _gust("true_wy_mps", -1.0), 0.1),
    _by_construction("gust-vertical", "gust with 1 m/s vertical", 1.0, "m/s", _gust("true_wz_mps", -1.0), 0.1),
    _by_construction("gust-time", "the gust decays with 6 s", 6.0, "s", m.over(_gust_time), 0.3),
    Claim(
        "flight-hardware", "the flight hardware (BVV 2, platform, aircraft) works in five days of testing", "7.2, 8",
        None, "", "nothing: a simulation has no such hardware", (), lambda flown: m.NOTHING, None,
        "real flight tests and hardware",
    ),
)
# fmt: on
