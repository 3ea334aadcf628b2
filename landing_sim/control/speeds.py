"""How fast to approach and touch down: the rule from mass and headwind, settings moved to its speed, turbulence."""

from __future__ import annotations

import math
from dataclasses import replace

from landing_sim.control.path_settings import GuidanceSettings, SpeedSettings
from landing_sim.control.settings import ControlSettings

KNOT = 1852.0 / 3600.0  # [m/s]
SEA_LEVEL_DENSITY = 1.225  # [kg/m^3]


def approach_speed(rule: SpeedSettings, mass: float, headwind: float, density: float) -> float:
    """True airspeed [m/s] of the approach for mass [kg], headwind [m/s] and density [kg/m^3].

    The rule's calibrated airspeed is taken for the equivalent one: 0.1 % apart at these speeds.
    """
    reference = max(rule.reference_kt * math.sqrt(mass / rule.at_mass_kg), rule.least_kt)
    calibrated = reference + max(rule.add_least_kt, rule.headwind_share * headwind / KNOT)
    return calibrated * KNOT * math.sqrt(SEA_LEVEL_DENSITY / density)


def at_speed(
    airspeed: float, control: ControlSettings, guidance: GuidanceSettings
) -> tuple[ControlSettings, GuidanceSettings]:
    """Both settings with every airspeed in proportion, so that the approach is flown at `airspeed` [m/s]."""
    factor = airspeed / guidance.path.approach_mps
    points = tuple(replace(p, airspeed_mps=factor * p.airspeed_mps) for p in control.trim_points)
    path = replace(guidance.path, approach_mps=airspeed, touchdown_mps=factor * guidance.path.touchdown_mps)
    return replace(control, trim_points=points), replace(guidance, path=path)


def in_turbulence(wind_20ft: float, guidance: GuidanceSettings) -> GuidanceSettings:
    """Guidance that keeps some of the approach's speed for a touchdown in turbulence (its wind at 20 ft [m/s]).

    A gust of the same strength takes less lift the faster one flies, and leaves more margin over the stall.
    """
    path = guidance.path
    touchdown = min(path.touchdown_mps + path.turbulence_share * wind_20ft, path.approach_mps)
    return replace(guidance, path=replace(path, touchdown_mps=touchdown))
