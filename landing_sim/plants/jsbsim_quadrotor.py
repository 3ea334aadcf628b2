"""JSBSim with a multirotor: rotors commanded by speed, legs that somebody else works out. SI, radians, our names.

The place is fixed (PLACE); there local north-east-down serves as R. Over the few metres that are flown it turns by
1.6e-7 rad a metre, which is left out of attitudes; positions are exact.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jsbsim
import numpy as np

from landing_sim.geometry.earth import RunwayFrame
from landing_sim.plants.jsbsim import FT, KG_PER_LB, LBF, PlantError
from landing_sim.types import Array

PLACE = RunwayFrame(math.radians(34.2), math.radians(-118.17), 250.0, 0.0)
"""Where R lies: Pasadena, x north."""
GRAVITY = 9.7959
"""[m/s^2] what is felt of it there."""
FT_LBF = FT * LBF  # [N m]
ROTORS = 4
SETTLE = 5000  # steps that the rotors' lags may take to the steady value


@dataclass(frozen=True, slots=True)
class Contact:
    """A point of the airframe that may touch something: a spring and a damper along the vertical, and friction."""

    name: str
    p_B: tuple[float, float, float]  # [m] from the cg
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    friction: float


class QuadrotorModel:
    """One multirotor in one JSBSim executive.

    Parameters
    ----------
    folder : aircraft/NAME with NAME.xml
    dt : [s], fixed for the life of the object
    payload : [kg]; None keeps the file's. Inertia stays as in the file.

    Raises PlantError.
    """

    def __init__(self, folder: Path, dt: float, payload: float | None = None) -> None:
        name, folder = folder.name, folder.resolve()
        file = folder / f"{name}.xml"
        if not file.is_file():
            raise PlantError(f"no flight model {file}")
        jsbsim.FGJSBBase().debug_lvl = 0
        self._fdm = fdm = jsbsim.FGFDMExec(None)
        self._run = fdm.run
        fdm.set_debug_level(0)
        fdm.set_dt(dt)  # before loading: filters are discretised as they are loaded
        self.dt = dt
        try:
            loaded = fdm.load_model_with_paths(name, str(folder.parent), str(folder), str(folder), True)
        except Exception as error:  # JSBSim throws several types on malformed files
            raise PlantError(f"JSBSim cannot load {file}: {error}") from error
        if not loaded:
            raise PlantError(f"JSBSim cannot load {file}: see its messages above")
        self._properties = fdm.get_property_manager()
        node = self.node
        self.ecef_ft = [node(f"position/ecef-{a}-ft").get_double_value for a in "xyz"]
        self.attitude = [node(f"attitude/{a}-rad").get_double_value for a in ("phi", "theta", "psi")]
        self.v_fps = [node(f"velocities/v-{a}-fps").get_double_value for a in ("north", "east", "down")]
        self.pqr = [node(f"velocities/{a}-rad_sec").get_double_value for a in "pqr"]
        self.airspeed_fps = node("velocities/vt-fps").get_double_value
        self.force_fps2 = [node(f"accelerations/a-pilot-{a}-ft_sec2").get_double_value for a in "xyz"]
        self.rotor = [node(f"fcs/rotor[{i}]").get_double_value for i in range(ROTORS)]
        self.thrust = [node(f"fcs/thrust-N[{i}]").get_double_value for i in range(ROTORS)]
        self.set_rotor = [node(f"fcs/rotor-cmd[{i}]").set_double_value for i in range(ROTORS)]
        self.set_thrust_share = node("fcs/thrust-share").set_double_value
        self._set_wind_fps = [node(f"atmosphere/wind-{a}-fps").set_double_value for a in ("north", "east", "down")]
        self._wind_fps = [node(f"atmosphere/total-wind-{a}-fps").get_double_value for a in ("north", "east", "down")]
        self._set_force_lbs = [node(f"external_reactions/legs/{a}").set_double_value for a in "xyz"]
        self._set_moment = [node(f"external_reactions/legs-moment/{a}").set_double_value for a in "lmn"]
        node("external_reactions/legs/magnitude").set_double_value(1.0)
        node("external_reactions/legs-moment/magnitude-lbsft").set_double_value(1.0)
        node("atmosphere/turb-type").set_double_value(0.0)  # the wind is ours
        self.thrust_factor = node("fcs/thrust-N-per-rad2_sec2").get_double_value()  # [N/(rad/s)^2]
        self.drag_lever = node("fcs/drag-moment-per-thrust-m").get_double_value()  # [m]
        self.rotor_max = node("fcs/rotor-max-rad_sec").get_double_value()
        self.contacts = _contacts(file)
        self.arm = _arm(file)
        weight = node("inertia/pointmass-weight-lbs[0]")
        if payload is not None:
            weight.set_double_value(payload / KG_PER_LB)
        fdm.run_ic()
        self.mass = node("inertia/weight-lbs").get_double_value() * KG_PER_LB
        slug_ft2 = FT_LBF  # [kg m^2]: a slug times a square foot is a pound-force times a foot times a second squared
        self.inertia = [node(f"inertia/i{a}-slugs_ft2").get_double_value() * slug_ft2 for a in ("xx", "yy", "zz")]

    def node(self, path: str) -> Any:
        """The property's node. Raises PlantError if nothing provides it."""
        if not self._properties.hasNode(path):
            raise PlantError(f"the quadrotor's model has no property {path!r}")
        return self._properties.get_node(path)

    def place(self, p_R: Sequence[float], psi: float, v_R: Sequence[float], rotor: float) -> None:
        """Put the cg at p_R (3,) [m], level, heading psi [rad], moving with v_R (3,) [m/s], all rotors at `rotor` [rad/s]
        in still air. Raises PlantError.
        """
        fdm = self._fdm
        latitude, longitude, height = PLACE.R_to_geodetic(np.array(p_R, dtype=float))
        for write in self.set_rotor:
            write(rotor)
        self.legs((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        # JSBSim's own ground out of the way of its contacts: the legs are ours
        self.node("position/terrain-elevation-asl-ft").set_double_value((height - 1000.0) / FT)
        fdm["ic/long-gc-rad"] = longitude
        altitude = height / FT
        for _ in range(3):  # "altitude above sea level" is along the radius
            fdm["ic/h-sl-ft"] = altitude
            fdm["ic/lat-geod-rad"] = latitude
            altitude += height / FT - fdm["ic/geod-alt-ft"]
        fdm["ic/phi-rad"] = fdm["ic/theta-rad"] = 0.0
        fdm["ic/psi-true-rad"] = psi
        for name, value in zip(("vn", "ve", "vd"), v_R):
            fdm[f"ic/{name}-fps"] = float(value) / FT
        self._initialise()
        fdm.suspend_integration()
        for _ in range(SETTLE):
            fdm.run()
            if max(abs(read() - rotor) for read in self.rotor) < 1e-9 * max(rotor, 1.0):
                break
        else:
            raise PlantError(f"the rotors do not settle at {rotor:g} rad/s: {[read() for read in self.rotor]}")
        fdm.resume_integration()
        self._initialise()  # again: the integrators remember accelerations, and those were without thrust
        if np.abs(self.position() - p_R).max() > 1e-4:  # JSBSim's polar radius is rounded: 0.06 mm
            raise PlantError(f"JSBSim did not take the initial position {p_R}: it is at {self.position()}")
        if fdm.get_delta_t() != self.dt:
            raise PlantError(f"JSBSim's time step is {fdm.get_delta_t()!r}, not {self.dt!r}")
        fdm.set_sim_time(0.0)
        self.check()

    def _initialise(self) -> None:
        if not self._fdm.run_ic():
            raise PlantError("JSBSim refused the initial state")

    def position(self) -> Array:
        """p_RB (3,) [m]."""
        return PLACE.ecef_to_R(np.array([read() * FT for read in self.ecef_ft]))

    def wind(self, wind_R: Sequence[float]) -> None:
        """The air's velocity (3,) [m/s] from the next step on."""
        x, y, z = self._set_wind_fps
        x(wind_R[0] / FT)
        y(wind_R[1] / FT)
        z(wind_R[2] / FT)

    def air_velocity(self) -> Array:
        """(3,) [m/s] in R, in the last step."""
        return np.array([read() * FT for read in self._wind_fps])

    def legs(self, force_R: Sequence[float], moment_B: Sequence[float]) -> None:
        """What the ground gives: (3,) [N] and (3,) [N m] at the cg, in the next step."""
        for write, value in zip(self._set_force_lbs, force_R):
            write(value / LBF)
        for write, value in zip(self._set_moment, moment_B):
            write(value / FT_LBF)

    def check(self) -> None:
        """Raises PlantError if the state is not finite."""
        if not math.isfinite(sum(read() for read in (*self.ecef_ft, *self.v_fps, *self.pqr))):
            raise PlantError(f"the quadrotor's state is not finite at t = {self._fdm.get_sim_time():.3f} s")

    def run(self) -> None:
        """One dt. Raises PlantError if JSBSim ends it."""
        if not self._run():
            raise PlantError("JSBSim ended the simulation")


def _contacts(file: Path) -> tuple[Contact, ...]:
    """What may touch the ground, as the file has it. Raises PlantError."""
    found = []
    for contact in ElementTree.parse(file).getroot().iterfind("ground_reactions/contact"):
        x, y, z = _location(contact, file)
        k, c, mu = (contact.findtext(n, "nan") for n in ("spring_coeff", "damping_coeff", "static_friction"))
        found.append(Contact(contact.get("name", ""), (-x, y, -z), float(k), float(c), float(mu)))
    if len(found) < ROTORS or not all(math.isfinite(c.stiffness + c.damping + c.friction) for c in found):
        raise PlantError(f"{file.name}: needs four feet or more, each with spring, damper and friction")
    return tuple(found)


def _arm(file: Path) -> float:
    """[m] of every rotor from the cg. Raises PlantError unless they sit front, right, rear, left at the same distance."""
    forces = {f.get("name"): f for f in ElementTree.parse(file).getroot().iterfind("external_reactions/force")}
    names = ("rotor-front", "rotor-right", "rotor-rear", "rotor-left")
    if not all(name in forces for name in names):
        raise PlantError(f"{file.name}: needs the forces {', '.join(names)}")
    at = [_location(forces[name], file)[:2] for name in names]
    arm = -at[0][0]
    if at != [(-arm, 0.0), (0.0, arm), (arm, 0.0), (0.0, -arm)]:
        raise PlantError(f"{file.name}: rotors must sit front, right, rear and left at one distance, not {at}")
    return arm


def _location(element: ElementTree.Element, file: Path) -> tuple[float, float, float]:
    """Structural axes. Raises PlantError unless it is in metres."""
    location = element.find("location")
    if location is None or location.get("unit") != "M":
        raise PlantError(f"{file.name}: {element.get('name')} needs its location in M")
    x, y, z = (float(location.findtext(axis, "nan")) for axis in "xyz")
    return x, y, z
