"""A vehicle: aircraft/NAME/vehicle.yaml, beside the flight model JSBSim reads, into frozen, checked values."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from landing_sim import config, paths, yamlfile
from landing_sim.config import Section
from landing_sim.control.path_settings import GuidanceSettings, SpeedSettings
from landing_sim.control.settings import ControlSettings
from landing_sim.control.speeds import approach_speed, at_speed, in_turbulence
from landing_sim.errors import ConfigError, VehicleError
from landing_sim.estimators.belief import AircraftBelief


class Size(Section):
    """Outer dimensions, for drawing."""

    span_m: float = Field(gt=0, description="wing span")
    length_m: float = Field(gt=0, description="nose to tail")


class CameraMount(Section):
    """Where the camera sits, and the platform that turns it; or none, where it is strapped down."""

    p_BC_m: tuple[float, float, float] = Field(description="camera from the nominal cg: forward, right, down")
    fixed_tilt_deg: float | None = Field(
        None, ge=-60, le=60, description="strapped down, looking up (+) by this from body x; null = on a platform"
    )
    pan_limit_deg: float = Field(60.0, gt=0, le=180, description="either way")
    tilt_limit_deg: float = Field(45.0, gt=0, le=80, description="either way")


class Vehicle(Section):
    """One aircraft as the crew and its designers know it; its flight model is NAME.xml in the same folder."""

    schema_version: Literal[1] = Field(description="version of this format")
    name: str = Field(min_length=1, max_length=100, description="what it is called")
    description: str = Field("", max_length=2000, description="what it is")
    mass_kg: float = Field(gt=0, description="nominal mass, for which the gains are made")
    size: Size = Field(description="outer dimensions")
    camera: CameraMount = Field(description="camera platform")
    control: ControlSettings = Field(description="what the controller is designed from")
    believed: AircraftBelief = Field(AircraftBelief(), description="the aircraft as the filter takes it to be")
    guidance: GuidanceSettings = Field(description="what the guidance flies")
    speeds: SpeedSettings | None = Field(
        None, description="approach speed from mass and headwind; null = guidance.path.approach_mps and nominal mass"
    )

    def prepared(self, mass: float, headwind: float, density: float, turbulence: float = 0.0) -> Vehicle:
        """For one approach, as its crew prepares it: airspeeds and mass [kg] that gains and guidance are made for.

        headwind [m/s], density [kg/m^3], turbulence (the wind at 20 ft that goes with it [m/s]) as known on board.
        Without a speed rule the approach is flown as it stands in the file.
        """
        vehicle = self
        if self.speeds is not None:
            V = approach_speed(self.speeds, mass, headwind, density)
            control, guidance = at_speed(V, self.control, self.guidance)
            vehicle = self.model_copy(update={"mass_kg": mass, "control": control, "guidance": guidance})
        if turbulence > 0.0 and self.guidance.path.turbulence_share > 0.0:
            return vehicle.model_copy(update={"guidance": in_turbulence(turbulence, vehicle.guidance)})
        return vehicle


def load(name: str) -> Vehicle:
    """A vehicle by its folder's name. Raises VehicleError holding every problem with its place."""
    try:
        folder = paths.aircraft_folder(name)
    except ConfigError as error:
        raise VehicleError(error.problems) from None
    return load_file(folder / "vehicle.yaml")


def load_file(path: Path) -> Vehicle:
    """A vehicle from its file. Raises VehicleError holding every problem with its place."""
    try:
        return config.validate(yamlfile.load(path), Vehicle)
    except ConfigError as error:
        raise VehicleError(error.problems) from None
