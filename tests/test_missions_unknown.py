"""Closed-loop landings on a runway of which nothing is known: ranged by motion, with late images."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fly

CALM = "wind.turbulence=null"


@pytest.mark.parametrize("name", ["transport/gibert_far", "transport/gibert_near", "transport/ekf", "do128/gibert"])
def test_the_unknown_runway_is_landed_on(name: str) -> None:
    flight = fly(name, CALM)
    failed = [c for c in flight.verdict.criteria if not c.passed]
    assert flight.verdict.outcome == "landed", flight.verdict.outcome
    assert not failed, failed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["transport/gibert_far", "transport/gibert_near"])
def test_a_range_that_is_not_valid_steers_nothing(name: str) -> None:
    """Wings level and straight on until the range is within its trust; the flag says so; then it turns."""
    log = fly(name, CALM).log
    waiting = (log["mode"] == "hold") & log["valid"]
    assert waiting.any()
    assert not log["flag_range_valid"][waiting].any()
    assert np.degrees(np.abs(log["true_phi_rad"][waiting])).max() < 2.0
    assert np.abs(log["true_y_m"][waiting] - np.interp(
        log["t_s"][waiting], log["t_s"][waiting][[0, -1]], log["true_y_m"][waiting][[0, -1]])).max() < 3.0  # fmt: skip
    after = log["flag_range_valid"]
    assert log["est_spread"][after][0] <= 0.105  # at the image's time within 0.1, carried over its age since
    turned = np.degrees(np.abs(log["true_phi_rad"][~waiting & (log["true_x_m"] < -1500.0)])).max()
    assert turned > 5.0


@pytest.mark.slow
def test_the_true_size_is_not_used() -> None:
    """A runway two thirds as wide is found to be that wide, from the same first guess of the range."""
    for width in (45.0, 30.0):
        log = fly("transport/gibert_far", CALM, f"runway.width_m={width}").log
        airborne = log["valid"] & (log["true_x_m"] > -300.0) & (log["true_x_m"] < 0.0)
        assert np.abs(log["est_W_m"][airborne] - width).max() < 0.02 * width


@pytest.mark.slow
def test_uncompensated_latency_costs_what_compensation_saves() -> None:
    """160 ms old images taken for new ones: the range from the bearings is off while the aircraft turns."""

    def off(*changes: str) -> float:
        log = fly("transport/gibert_far", CALM, *changes).log
        seen = log["valid"] & (log["true_x_m"] < -1000.0) & (log["t_s"] > 18.0)
        return float(np.abs(log.error("x")[seen] / log.truth("x")[seen]).max())

    assert off() < 0.5 * off("filter.compensate_latency=false")


@pytest.mark.slow
def test_the_aim_points_bearing_alone_does_not_land() -> None:
    """On the glide d1 = d2 = 0: the range is never valid, nothing is steered by it, the approach is given up."""
    flight = fly("transport/gibert_far", CALM, "observer.outputs=point", "initial.y_m=0", "initial.height_m=270.4",
                 "initial.heading_deg=0")  # fmt: skip
    assert flight.verdict.outcome == "go_around"
    assert not flight.log["flag_range_valid"].any()
    assert np.abs(flight.log["est_d1"][flight.log["valid"]]).max() < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_roll_and_pitch_may_come_from_the_horizon(seed: int) -> None:
    flight = fly("transport/gibert_far", CALM, "observer.attitude=horizon", f"seed={seed}")
    assert flight.verdict.outcome == "landed"
    assert flight.verdict.metrics["range_1km_percent"] < 2.0
    assert flight.verdict.metrics["threshold_height_error_m"] < 1.0
