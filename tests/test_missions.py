"""Closed-loop landings on JSBSim with rendered pixels: the promise, and controls that must fail where theory says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import flights
import numpy as np
import pytest
from flights import approach, fly, worst

from landing_sim import runner, scenario, vehicle
from landing_sim.interfaces import Estimator
from landing_sim.missions import runway_landing
from landing_sim.plants.aircraft import JsbsimPlant
from landing_sim.plants.jsbsim import PlantError
from landing_sim.record import parquet
from landing_sim.signals import Estimate

MOUTHS = "runway.taxiways=[{x_m: 60, width_m: 12, side: left, flare_m: 3}, {x_m: 400, side: right}]"
STRAIGHT_IN = ("initial.y_m=0", "initial.heading_deg=0")
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H", "wx", "wy", "wz")


@pytest.mark.parametrize("name", ["calm", "gust", "gust_light", "gust_moderate", "headwind", "tailwind"])
def test_shipped_landings_pass_their_criteria(name: str) -> None:
    flight = fly(f"do128/{name}")
    failed = [c for c in flight.verdict.criteria if not c.passed]
    assert flight.verdict.outcome == "landed", flight.verdict.outcome
    assert not failed, failed


def test_same_seed_same_bytes_and_another_seed_another_flight(tmp_path: Path) -> None:
    first = fly("do128/gust")
    flights.fly.cache_clear()
    second, other = fly("do128/gust"), fly("do128/gust", seed=2)
    for k, flight in enumerate((first, second, other)):
        parquet.write(flight.log, tmp_path / f"{k}.parquet")
    same, again, different = ((tmp_path / f"{k}.parquet").read_bytes() for k in range(3))
    assert same == again
    assert same != different


@pytest.mark.parametrize("kind", ["plain", "split", "augmented"])
def test_all_filters_fly_the_papers_case(kind: str) -> None:
    metrics = fly("do128/gust", f"filter.kind={kind}", "filter.factorisation=ud").verdict.metrics
    assert fly("do128/gust", f"filter.kind={kind}", "filter.factorisation=ud").verdict.outcome == "landed"
    assert metrics["range_far_percent"] < 2.0
    assert metrics["height_approach_m"] < 1.0  # the paper's own figure
    assert metrics["lateral_m"] < 1.0


def test_ud_and_dense_fly_the_same_flight() -> None:
    """The same filter in two factorisations: the flights agree to a millimetre at touchdown."""
    dense, ud = (fly("do128/gust", f"filter.factorisation={f}").log.touchdown for f in ("dense", "ud"))
    assert dense is not None
    assert ud is not None
    assert abs(dense.x - ud.x) < 1e-3
    assert abs(dense.y - ud.y) < 1e-3


def test_constant_process_noise_of_the_paper_flies() -> None:
    """Eqs. (13), (14): coarser than the integral, good enough for the paper's figures in range."""
    flight = fly("do128/gust", "filter.kind=split", "filter.factorisation=ud", "filter.process_noise=constant")
    assert flight.verdict.outcome == "landed"
    assert flight.verdict.metrics["range_far_percent"] < 2.0


def test_mapped_taxiway_mouths_do_not_disturb() -> None:
    with_map = fly("do128/gust", MOUTHS)
    assert with_map.verdict.outcome == "landed"
    assert with_map.verdict.metrics["range_far_percent"] < 0.5
    assert with_map.verdict.metrics["lateral_m"] < 0.3


def test_unmapped_taxiway_mouths_cost_consistency() -> None:
    unknown = MOUTHS.replace("side", "mapped: false, side")
    assert fly("do128/gust", unknown).verdict.metrics["nis"] > 1.5 * fly("do128/gust", MOUTHS).verdict.metrics["nis"]


@pytest.mark.parametrize("slope", [-2.0, 2.0])
def test_sloping_runways_are_landed_on(slope: float) -> None:
    flight = fly("do128/gust", f"runway.slope_percent={slope}")
    assert flight.verdict.outcome == "landed"
    assert flight.verdict.metrics["sink_rate_mps"] < 0.6
    assert 450.0 < flight.verdict.metrics["touchdown_x_m"] < 650.0
    assert flight.verdict.metrics["height_runway_m"] < 0.2


def test_an_approach_that_never_finds_the_runway_climbs_away() -> None:
    """Nothing to be seen (the runway as dark as the grass): no blind flight into the ground."""
    flight = fly("do128/calm", "runway.grey.surface=90", "runway.markings=false", "time.limit_s=20")
    log = flight.log
    assert not log["valid"].any()
    assert flight.log.touchdown is None
    assert log["true_H_m"][-1] > 60.0


@pytest.mark.parametrize(
    ("name", "seed"), [*(("transport/turbulence", seed) for seed in (1, 2, 3)), ("transport/gibert_far", 1)]
)
def test_who_never_sees_the_runway_climbs_away_with_wings_level(name: str, seed: int) -> None:
    """In turbulence, by gyros or an inertial unit and airspeed, until it has flown past where the runway must be."""
    flight = fly(name, "faults=[{sensor: camera, kind: off, start_s: 0}]", "time.limit_s=150", seed=seed)
    log = flight.log
    assert flight.verdict.outcome == "go_around"
    assert not log["valid"].any()
    assert np.degrees(np.abs(log["true_phi_rad"])).max() < 15.0
    assert log["true_H_m"].min() > 200.0 and log["true_H_m"][-1] > 600.0
    assert log["true_airspeed_mps"].min() > 50.0 and log["true_airspeed_mps"].max() < 95.0


def test_a_flight_model_that_gives_up_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: object, command: object, wind_R: object) -> None:
        raise PlantError("the flight model's state is not finite")

    monkeypatch.setattr(JsbsimPlant, "step", fail)
    wanted = scenario.load("do128/calm")
    flight = runner.fly(wanted, vehicle.load(wanted.aircraft.model))
    assert flight.verdict.outcome == "numeric_error"
    assert flight.log.meta["reason"] == "the flight model's state is not finite"


# ------------------------------------------------------------------------------------------------ width


@pytest.mark.parametrize("way", ["state", "separate"])
@pytest.mark.parametrize("believed", [25.0, 33.0])
def test_a_wrong_width_is_found_out(way: str, believed: float) -> None:
    """29 m within 1 m when the threshold is lost; its mean over the last 600 m within 0.4 m. No wind along the track."""
    log = fly("do128/calm", f"filter.width={way}", f"filter.believed_width_m={believed}").log
    error = log.error("W")
    seen = approach(log, -110.0)
    assert abs(error[seen][-1]) < 1.0
    assert abs(error[seen & (log["true_x_m"] > -600.0)].mean()) < 0.4


def test_a_headwind_looks_like_a_wider_runway() -> None:
    """W / W_true = V_air / V_ground: 5 m/s on 50 m/s make 29 m look like 32.2 m to a filter that holds wind for zero."""
    log = fly("do128/headwind", "filter.width=state").log
    found = log.error("W")[approach(log, -110.0)][-1]
    assert found == pytest.approx(29.0 * (50.0 / 45.0 - 1.0), abs=0.6)
    # with the width known, the same filter puts the wind where it belongs
    known = fly("do128/headwind").log
    assert abs(known.error("wx")[approach(known, -110.0)][-1]) < 0.6


# ------------------------------------------------------------------------------------------------ negative controls


def test_without_wind_states_the_gust_becomes_a_lateral_error() -> None:
    """The paper's filter (plain, no wind): with edges trusted to a pixel, more than 1 m in the gust; ours a fifth of it.

    With edges trusted as well as they are measured (0.05 px) the same filter errs by a few decimetres only: then the
    picture holds the position, and what is left is the drift that the controller cannot know of, a metre at touchdown.
    """
    trust = "vision.edge_floor_px=1.0"
    plain, augmented = fly("do128/gust", trust, "filter.kind=plain"), fly("do128/gust", trust)
    assert plain.verdict.metrics["lateral_m"] > 1.0
    assert augmented.verdict.metrics["lateral_m"] < 0.35
    sharp = fly("do128/gust", "filter.kind=plain", "filter.factorisation=ud")
    assert 0.15 < sharp.verdict.metrics["lateral_m"] < 0.6
    assert abs(sharp.verdict.metrics["touchdown_y_m"]) > 0.7
    assert abs(fly("do128/gust").verdict.metrics["touchdown_y_m"]) < 0.2


def test_without_threshold_windows_range_is_lost() -> None:
    blind, seeing = fly("do128/gust", "vision.windows=3L3R2H").log, fly("do128/gust").log
    # borderlines run on for ever: what is known of range is only what was acquired, and dead reckoning
    assert blind.sigma("x")[approach(blind)][-1] > 10.0 * seeing.sigma("x")[approach(seeing)][-1]
    assert worst(blind, "x", approach(blind, -130.0)) > 3.0 * worst(seeing, "x", approach(seeing, -130.0))


def test_edges_grown_by_opencv_cost_range() -> None:
    """cv2's anti-aliased fill moves edges outwards by 0.7 px: more than 20 m of range, and metres across."""
    grown = fly("do128/gust", "camera.renderer=line_aa").log
    assert worst(grown, "x", approach(grown)) > 20.0
    exact = fly("do128/gust").log
    assert worst(exact, "x", approach(exact)) < 5.0


def test_an_image_taken_for_newer_than_it_is_shifts_range_by_its_age() -> None:
    """120 ms at 50 m/s: the aircraft believes itself 6 m behind where it is. Compensated, the shift is gone.

    Measured in the first second, before the loop that flies on stale attitudes departs from its path.
    """
    late = ("camera.latency_s=0.12", "filter.gate_sigma=null", *STRAIGHT_IN)
    naive = fly("do128/calm", "filter.compensate_latency=false", *late).log
    rewound = fly("do128/calm", *late).log
    early = (naive["t_s"] > 0.3) & (naive["t_s"] < 1.5)
    assert np.mean(naive.error("x")[early]) == pytest.approx(-6.0, abs=0.6)
    assert abs(np.mean(rewound.error("x")[approach(rewound)])) < 0.5


def test_compensated_image_age_lands_the_gust_and_uncompensated_does_not() -> None:
    rewound = fly("do128/gust", "camera.latency_s=0.12")
    assert rewound.verdict.outcome == "landed"
    assert rewound.verdict.metrics["range_far_percent"] < 0.5
    naive = fly("do128/gust", "camera.latency_s=0.12", "filter.compensate_latency=false")
    assert not naive.verdict.passed


class Oracle:
    """An estimator in whose place the truth is read: what a perfect estimate would be worth."""

    def __init__(self, inner: Estimator, plant: JsbsimPlant) -> None:
        self.inner, self.plant = inner, plant
        self.init, self.predict, self.update = inner.init, inner.predict, inner.update

    def read(self, memory: Any, t: float | None = None) -> Estimate:
        estimate = self.inner.read(memory, t)
        if t is not None or not estimate.valid:
            return estimate
        now, mean = self.plant.truth(), estimate.mean.copy()
        x, y, z = now.p_RB
        states = (*(now.R_RB.T @ now.v_RB_R), *now.w_RB_B, *now.euler, x, y, -z, *now.wind_R)
        for name, value in zip(STATES, states, strict=True):
            mean[estimate.names.index(name)] = value
        return replace(estimate, mean=mean)


def test_the_hardest_landing_in_turbulence_is_not_the_estimates_doing() -> None:
    """Seed 89 of gust_moderate, the one of 120 that touches down at more than 1.5 m/s: knowing all does not help it."""
    wanted = scenario.load("do128/gust_moderate", ["seed=89"])
    mission = runway_landing.build(wanted, vehicle.load("do128"), 89)
    plant = mission.parts.plant
    mission.parts = replace(mission.parts, estimator=Oracle(mission.parts.estimator, plant))
    end = next(step for step in mission.steps() if plant.touchdown is not None)
    assert end.estimate["wx"] == pytest.approx(end.truth.wind_R[0])
    assert plant.touchdown is not None
    flown = fly("do128/gust_moderate", seed=89).log.touchdown
    assert flown is not None
    assert plant.touchdown.sink_rate > 1.5
    assert flown.sink_rate == pytest.approx(plant.touchdown.sink_rate, abs=0.2)
