"""What campaigns disperse beyond what scenarios had: warm air, glide angle, a line that is off; a start in strong wind."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flights import fly

from landing_sim import paths, scenario, vehicle
from landing_sim.control.offset import OffsetGuidance
from landing_sim.missions import onboard, truth
from landing_sim.plants.jsbsim import FlightModel
from landing_sim.signals import Estimate, Reference

CROSSWIND = (
    *("time.limit_s=6", "initial.heading_deg=null", "wind.crosswind_mps=12.9"),
    *("wind.profile={law: certification}", "believed.wind_reported=true"),
)


SHEAR = ("wind.profile={law: certification}", "believed.wind_reported=true", "wind.turbulence=null")


@pytest.mark.parametrize("headwind", [-5.14, 10.29, 15.43])
def test_touchdown_does_not_follow_a_headwind_that_falls_in_the_flare(headwind: float) -> None:
    """10 kt of tailwind to 30 kt of headwind at 33 ft, of which a sixth is gone between flare and touchdown."""
    still, windy = (fly("transport/calm", *SHEAR, f"wind.headwind_mps={w}").log.touchdown for w in (0.0, headwind))
    assert still is not None
    assert windy is not None
    assert abs(windy.x - still.x) < 40.0
    assert windy.sink_rate < 1.0


@pytest.mark.parametrize(("warmer", "height"), [(0.0, 0.0), (40.0, 2804.0), (-69.0, -305.0)])
def test_the_crew_knows_the_density_that_the_aircraft_flies_in(warmer: float, height: float) -> None:
    model = FlightModel(paths.aircraft_folder("transport"), 0.005, temperature_offset=warmer)
    model.place((0.9, 0.0, height), np.zeros(3), np.array([70.0, 0.0, 0.0]))
    density = model.get("atmosphere/rho-slugs_ft3") * 515.378818
    assert onboard._density(height, warmer) == pytest.approx(density, rel=3e-4)


def test_gains_are_planned_for_the_airs_density() -> None:
    sea = scenario.load("transport/calm")
    assert onboard.density_altitude(sea) == 0.0
    hot = scenario.load("transport/calm", ["runway.elevation_m=1000", "atmosphere.temperature_offset_K=30"])
    altitude = onboard.density_altitude(hot)
    assert altitude > 1800.0
    assert onboard._density(altitude, 0.0) == pytest.approx(onboard._density(1000.0, 30.0), rel=1e-12)


def test_the_glide_angle_is_the_scenarios() -> None:
    wanted = scenario.load("transport/calm", ["guidance.glide_deg=3.15"])
    assert onboard.prepared(wanted, vehicle.load("transport")).guidance.path.glide_deg == 3.15


class _Follow:
    """A guidance that asks for the y it is told."""

    def init(self) -> int:
        return 0

    def step(self, memory: int, estimate: Estimate) -> tuple[int, Reference]:
        return memory + 1, Reference("glide", 60.0, 50.0, -3.0, 0.5 * estimate["y"], 0.0, 0.0)


def test_a_line_that_is_off_moves_what_is_believed_and_what_is_asked_for() -> None:
    guidance = OffsetGuidance(_Follow(), 3.0)
    estimate = Estimate(0.0, ("x", "y"), np.array([-100.0, 7.0]), None, True)
    memory, reference = guidance.step(guidance.init(), estimate)
    assert (memory, reference.y) == (1, 0.5 * (7.0 - 3.0) + 3.0)
    assert estimate["y"] == 7.0


def test_a_start_in_strong_wind_is_calm_where_the_wind_is_reported() -> None:
    wanted = scenario.load("transport/calm", CROSSWIND)
    craft = onboard.prepared(wanted, vehicle.load("transport"))
    across, airspeed = truth.steady_wind(wanted, craft)[1], craft.guidance.path.approach_mps
    assert across == pytest.approx(12.9 * 1.62, rel=0.02)  # at 270 m, of the wind at 33 ft
    log = fly("transport/calm", *CROSSWIND).log
    assert log["true_psi_rad"][0] == pytest.approx(-math.asin(across / airspeed), abs=1e-6)
    assert log["true_vy_mps"][0] == pytest.approx(0.0, abs=0.5)  # no ground track but along the runway
    assert log["est_wy_mps"][log["valid"]][0] == pytest.approx(across, abs=0.5)
    assert np.abs(log["true_phi_rad"]).max() < math.radians(3.0)
    still = fly("transport/calm", *CROSSWIND[:-1]).log
    assert np.abs(still["true_phi_rad"]).max() > math.radians(10.0)
