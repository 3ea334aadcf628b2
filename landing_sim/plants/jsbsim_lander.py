"""JSBSim away from the Earth: a vehicle on a planet of its own, without air, driven by forces. SI, radians, our names.

The planet comes from a file beside the vehicle's; it must be loaded first. The ground is JSBSim's own: level where the
vehicle is, at the height that it is told, and the vehicle's legs stand on it.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import jsbsim
import numpy as np

from landing_sim.plants.jsbsim import FT, INCH, KG_PER_LB, PlantError
from landing_sim.types import Array

FEET_PER_METRE = 3.2808399  # as JSBSim reads planets: 2.6 mm on the Moon's radius


class LanderModel:
    """One vehicle on one planet in one JSBSim executive.

    Parameters
    ----------
    folder : aircraft/NAME with NAME.xml
    planet : the planet's file: a sphere that does not turn, else PlantError
    dt : [s], fixed for the life of the object

    Raises PlantError.
    """

    def __init__(self, folder: Path, planet: Path, dt: float) -> None:
        name, folder = folder.name, folder.resolve()
        self.radius = _radius(planet)
        if not (folder / f"{name}.xml").is_file():
            raise PlantError(f"no flight model {folder / (name + '.xml')}")
        jsbsim.FGJSBBase().debug_lvl = 0
        self._fdm = fdm = jsbsim.FGFDMExec(None)
        fdm.set_debug_level(0)
        fdm.set_dt(dt)  # before loading: the integrator is discretised as it is loaded
        self.dt = dt
        try:
            loaded = fdm.load_planet(str(planet.resolve()), False) and fdm.load_model_with_paths(
                name, str(folder.parent), str(folder), str(folder), True
            )
        except Exception as error:  # JSBSim throws several types on malformed files
            raise PlantError(f"JSBSim cannot load {folder / (name + '.xml')} on {planet}: {error}") from error
        if not loaded:
            raise PlantError(f"JSBSim cannot load {folder / (name + '.xml')} on {planet}: see its messages above")
        self._properties = fdm.get_property_manager()
        node = self.node
        self.ecef = [node(f"position/ecef-{a}-ft").get_double_value for a in "xyz"]
        self.euler = [node(f"attitude/{a}-rad").get_double_value for a in ("phi", "theta", "psi")]
        self.uvw_fps = [node(f"velocities/{a}-fps").get_double_value for a in "uvw"]
        self.pqr = [node(f"velocities/{a}-rad_sec").get_double_value for a in "pqr"]
        self.latitude = node("position/lat-geod-rad").get_double_value
        self.longitude = node("position/long-gc-rad").get_double_value
        self.thrust = node("fcs/main-N").get_double_value
        self.torque_force = node("fcs/attitude-N").get_double_value
        self.set_terrain_ft = node("position/terrain-elevation-asl-ft").set_double_value
        self.set_main = node("fcs/main-cmd-N").set_double_value
        self.set_attitude = node("fcs/attitude-cmd-N").set_double_value
        self._weight_lbs = node("inertia/weight-lbs").get_double_value
        self.specific_z = node("accelerations/Nz").get_double_value
        self.full_thrust = node("fcs/main-max-N").get_double_value()
        self.full_attitude = node("fcs/attitude-max-N").get_double_value()
        node("simulation/gravity-model").set_double_value(0.0)  # of a sphere
        node("atmosphere/override/density").set_double_value(0.0)

    def node(self, path: str) -> Any:
        """The property's node. Raises PlantError if nothing provides it."""
        if path != "atmosphere/override/density" and not self._properties.hasNode(path):
            raise PlantError(f"the lander's model has no property {path!r}")
        return self._properties.get_node(path, True)

    @property
    def mass(self) -> float:
        """[kg]"""
        return float(self._weight_lbs() * KG_PER_LB)

    @property
    def feet_B(self) -> Array:
        """(n, 3) [m] of the ground contacts from the centre of gravity, body axes."""
        count = self._fdm.get_ground_reactions().get_num_gear_units()
        out = np.empty((count, 3))
        for i in range(count):
            for j, axis in enumerate("xyz"):
                kind = "gear" if self._properties.hasNode(f"gear/unit[{i}]/z-position") else "contact"
                at = self.node(f"{kind}/unit[{i}]/{axis}-position").get_double_value()
                out[i, j] = (at - self.node(f"inertia/cg-{axis}-in").get_double_value()) * INCH
        return out * np.array([-1.0, 1.0, -1.0])  # structural: x aft, z up

    def place(
        self, longitude: float, latitude: float, height: float, euler_N: Array, v_N: Array, pqr: Array, mass: float
    ) -> None:
        """Put the cg at `height` [m] above the sphere with attitude from local north-east-down [rad], velocity over the
        ground v_N (3,) [m/s], rates pqr (3,) [rad/s], body axes, weighing `mass` [kg]. Raises PlantError.
        """
        fdm = self._fdm
        self._load(mass)
        fdm["ic/lat-geod-rad"], fdm["ic/long-gc-rad"], fdm["ic/h-sl-ft"] = latitude, longitude, height / FT
        for name, value in zip(("phi", "theta", "psi-true"), euler_N):
            fdm[f"ic/{name}-rad"] = float(value)
        for name, value in zip(("vn", "ve", "vd"), v_N):
            fdm[f"ic/{name}-fps"] = float(value) / FT
        for name, value in zip("pqr", pqr):
            fdm[f"ic/{name}-rad_sec"] = float(value)
        if not fdm.run_ic():
            raise PlantError("JSBSim refused the initial state")
        if fdm["atmosphere/rho-slugs_ft3"] != 0.0:
            raise PlantError("JSBSim flies in air: atmosphere/override/density did not take")
        self.check()

    def release(self, mass: float) -> None:
        """End the placing: the thrust commanded acts from the first step on, and `mass` [kg] is what it weighs now."""
        fdm = self._fdm
        fdm.suspend_integration()
        for _ in range(5):  # the integrators remember up to four derivatives: all under the same thrust
            fdm.run()
        self._load(mass)
        fdm.resume_integration()
        if fdm.get_delta_t() != self.dt:
            raise PlantError(f"JSBSim's time step is {fdm.get_delta_t()!r}, not {self.dt!r}")
        fdm.set_sim_time(0.0)

    def _load(self, mass: float) -> None:
        """Take the difference to `mass` into the propellant. Raises PlantError if there is not enough."""
        start, weight = self.node("fcs/propellant-at-start-kg"), self.node("inertia/pointmass-weight-lbs[0]")
        inside = weight.get_double_value() * KG_PER_LB
        propellant = inside + mass - self.mass
        if not propellant > 0.0:
            raise PlantError(
                f"mass {mass:g} kg leaves no propellant: the lander weighs {self.mass - inside:g} kg empty"
            )
        start.set_double_value(propellant + self.node("fcs/burnt-kg").get_double_value())
        weight.set_double_value(propellant / KG_PER_LB)

    def check(self) -> None:
        """Raises PlantError if the state is not finite."""
        if not math.isfinite(self.ecef[0]() + sum(read() for read in self.pqr) + sum(r() for r in self.uvw_fps)):
            raise PlantError(f"the lander's state is not finite at t = {self._fdm.get_sim_time():.3f} s")

    def run(self) -> None:
        """One dt. Raises PlantError if the state is no longer finite."""
        if not self._fdm.run():
            raise PlantError("JSBSim ended the simulation")
        self.check()


def _radius(planet: Path) -> float:
    """[m] Raises PlantError if the file is no sphere at rest."""
    try:
        root = ElementTree.parse(planet).getroot()
        value = {name: float(root.findtext(name, "nan")) for name in ("semimajor_axis", "semiminor_axis")}
        turning, oblate = float(root.findtext("rotation_rate", "nan")), float(root.findtext("J2", "nan"))
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise PlantError(f"no planet in {planet}: {error}") from error
    if len(set(value.values())) != 1 or turning != 0.0 or oblate != 0.0:
        raise PlantError(f"{planet}: the planet must be a sphere that does not turn, J2 0")
    return value["semimajor_axis"] * FEET_PER_METRE * FT
