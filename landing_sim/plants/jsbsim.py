"""The only module that knows JSBSim: load a vehicle, put it into a state, step it, read it. SI, radians, our names.

JSBSim accepts unknown properties, ignores writes to read-only ones and forgets wind and engines when it is initialised,
all without a word; here each of these is a PlantError. JSBSim's own turbulence is not used (the wind is ours), and its
ground contacts are lifted out of the way: it knows only level terrain, so `plants/wheels.py` does their work.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jsbsim
import numpy as np

from landing_sim.types import Array

FT = 0.3048  # [m]
LBF = 4.4482216152605  # [N]
KG_PER_LB = 0.45359237
SLUG = LBF / FT  # [kg]
INCH = 0.0254  # [m]
OUT_OF_REACH = 1e6  # [in]


class PlantError(RuntimeError):
    """The flight model cannot be loaded, trimmed or trusted any longer; the message says what to do."""


def control_names(n_engines: int) -> tuple[str, ...]:
    throttles = tuple(f"fcs/throttle-cmd-norm[{i}]" for i in range(n_engines))
    return ("fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm", "fcs/rudder-cmd-norm", "fcs/flap-cmd-norm", *throttles)


RATES = 13  # where they begin in what `FlightModel.motion` reads

Read = Callable[[], float]


def _at_once(reads: Sequence[Read]) -> Callable[[], tuple[float, ...]]:
    """One call for all sixteen of `FlightModel.motion`. Spelt out: a loop costs half as much again as the reading."""
    x, y, z, lat, lon, altitude, phi, theta, psi, u, v, w, airspeed, p, q, r = reads
    return lambda: (
        x(), y(), z(), lat(), lon(), altitude(), phi(), theta(), psi(), u(), v(), w(), airspeed(), p(), q(), r()
    )  # fmt: skip


class FlightModel:
    """One vehicle in one JSBSim executive.

    Parameters
    ----------
    folder : aircraft/NAME with NAME.xml and engine/
    dt : [s], fixed for the life of the object
    mass : [kg] total; None keeps the file's. Needs a pointmass in the file to take up the difference.
    cg_offset_B : (3,) [m] of the actual cg from the nominal one (the file's), body axes
    temperature_offset : [K] warmer than the standard atmosphere, at any height

    Raises PlantError.
    """

    def __init__(
        self,
        folder: Path,
        dt: float,
        mass: float | None = None,
        cg_offset_B: Array | None = None,
        temperature_offset: float = 0.0,
    ) -> None:
        name, folder = folder.name, folder.resolve()
        if not (folder / f"{name}.xml").is_file():
            raise PlantError(f"no flight model {folder / (name + '.xml')}")
        jsbsim.FGJSBBase().debug_lvl = 0
        self._fdm = fdm = jsbsim.FGFDMExec(None)
        self._run = fdm.run
        fdm.set_debug_level(0)
        fdm.set_dt(dt)  # before loading: filters are discretised as they are loaded
        self.dt = dt
        try:
            loaded = fdm.load_model_with_paths(
                name, str(folder.parent), str(folder / "engine"), str(folder / "systems"), True
            )
        except Exception as error:  # JSBSim throws several types on malformed files
            raise PlantError(f"JSBSim cannot load {folder / (name + '.xml')}: {error}") from error
        if not loaded:
            raise PlantError(f"JSBSim cannot load {folder / (name + '.xml')}: see its messages above")
        self._properties = fdm.get_property_manager()
        self._bind(fdm.get_propulsion().get_num_engines())
        self._lift_contacts()
        if temperature_offset:
            self.set("atmosphere/delta-T", 1.8 * temperature_offset)  # Rankine
        self.cg_offset_B = np.zeros(3) if cg_offset_B is None else np.array(cg_offset_B, dtype=float)
        fdm.run_ic()
        self.nominal_cg = np.array([self.get(f"inertia/cg-{a}-in") for a in "xyz"]) * INCH  # structural frame
        for axis, value in zip("xyz", self.nominal_cg):
            self.set(f"external_reactions/wheels/location-{axis}-in", float(value) / INCH)
        self._load_mass(mass)

    # ------------------------------------------------------------------------------------------ properties

    def node(self, path: str) -> Any:
        """The property's node. Raises PlantError if nothing provides it."""
        node = self._properties.get_node(path) if self._properties.hasNode(path) else None
        if node is None:
            raise PlantError(f"the flight model has no property {path!r}")
        return node

    def has(self, path: str) -> bool:
        return bool(self._properties.hasNode(path))

    def get(self, path: str) -> float:
        return float(self.node(path).get_double_value())

    def set(self, path: str, value: float) -> None:
        """Write and read back. Raises PlantError if the property is unknown or does not take the value."""
        node = self.node(path)
        node.set_double_value(value)
        if abs(node.get_double_value() - value) > 1e-9 * max(1.0, abs(value)):
            raise PlantError(f"property {path!r} did not take {value!r}: it is {node.get_double_value()!r}")

    def _bind(self, n_engines: int) -> None:
        node = self.node
        self.ecef_ft = [node(f"position/ecef-{a}-ft").get_double_value for a in "xyz"]
        self.geodetic = [node("position/lat-geod-rad").get_double_value, node("position/long-gc-rad").get_double_value]
        self.altitude_ft = node("position/geod-alt-ft").get_double_value
        self.set_terrain_ft = node("position/terrain-elevation-asl-ft").set_double_value
        self.euler = [node(f"attitude/{a}-rad").get_double_value for a in ("phi", "theta", "psi")]
        self.uvw_fps = [node(f"velocities/{a}-fps").get_double_value for a in "uvw"]
        self.pqr = [node(f"velocities/{a}-rad_sec").get_double_value for a in "pqr"]
        self.airspeed_fps = node("velocities/vt-fps").get_double_value
        self.motion = _at_once(
            [*self.ecef_ft, *self.geodetic, self.altitude_ft, *self.euler, *self.uvw_fps, self.airspeed_fps, *self.pqr]
        )
        self.alpha = node("aero/alpha-rad").get_double_value
        self.beta = node("aero/beta-rad").get_double_value
        self.specific_z = node("accelerations/Nz").get_double_value
        self.set_wind_fps = [node(f"atmosphere/wind-{a}-fps").set_double_value for a in ("north", "east", "down")]
        self.wind_fps = [node(f"atmosphere/total-wind-{a}-fps").get_double_value for a in ("north", "east", "down")]
        self.turbulence = node("atmosphere/turb-type").get_double_value
        names = ("fcs/elevator-pos-rad", "fcs/left-aileron-pos-rad", "fcs/rudder-pos-rad", "fcs/flap-pos-norm")
        self.surfaces = [node(n).get_double_value for n in names]
        self.thrust_lbs = [node(f"propulsion/engine[{i}]/thrust-lbs").get_double_value for i in range(n_engines)]
        accelerations = [f"accelerations/{a}dot-ft_sec2" for a in "uvw"] + [
            f"accelerations/{a}dot-rad_sec2" for a in "pqr"
        ]
        self._accelerations = [node(n).get_double_value for n in accelerations]
        self.set_controls_norm = [node(n).set_double_value for n in control_names(n_engines)]
        self.ranges = tuple(self.get(f"fcs/{s}-range-rad") for s in ("elevator", "aileron", "rudder"))
        force = [node(f"external_reactions/wheels/{a}") for a in "xyz"]
        moment = [node(f"external_reactions/wheels-moment/{a}") for a in "lmn"]
        self.set_wheels_lbs = [n.set_double_value for n in force + moment]
        self.set("external_reactions/wheels/magnitude", 1.0)
        self.set("external_reactions/wheels-moment/magnitude-lbsft", 1.0)
        self.set("atmosphere/turb-type", 0.0)
        self.node("propulsion/fuel_freeze").set_double_value(1.0)  # write-only
        self.n_engines = n_engines
        self.stabiliser_limits: tuple[float, float] | None = None  # [rad] elevator-equivalent, if there is one
        if self.has("fcs/stabiliser-cmd-rad"):
            self.stabiliser_limits = (self.get("fcs/stabiliser-min-rad"), self.get("fcs/stabiliser-max-rad"))

    def _lift_contacts(self) -> None:
        for i in range(self._fdm.get_ground_reactions().get_num_gear_units()):
            kind = "gear" if self._properties.hasNode(f"gear/unit[{i}]/z-position") else "contact"
            self.set(f"{kind}/unit[{i}]/z-position", OUT_OF_REACH)

    def _load_mass(self, mass: float | None) -> None:
        if mass is None and not self.cg_offset_B.any():
            return
        path = "inertia/pointmass-{}[0]"
        payload = self.get(path.format("weight-lbs")) * KG_PER_LB
        nominal = self.mass
        total = nominal if mass is None else mass
        payload += total - nominal
        if not payload > 0.0:
            raise PlantError(
                f"mass {total:g} kg leaves no payload: the flight model weighs {total - payload:g} kg empty"
            )
        self.set(path.format("weight-lbs"), payload / KG_PER_LB)
        shift = self.cg_offset_B * total / payload / INCH * np.array([-1.0, 1.0, -1.0])  # structural x aft, z up
        for axis, delta in zip("XYZ", shift):
            place = path.format(f"location-{axis}-inches")
            self.set(place, self.get(place) + float(delta))
        self._fdm.run_ic()

    @property
    def mass(self) -> float:
        """[kg]"""
        return self.get("inertia/weight-lbs") * KG_PER_LB

    # ------------------------------------------------------------------------------------------ state

    def place(self, geodetic: tuple[float, float, float], euler_N: Array, uvw: Array, pqr: Array | None = None) -> None:
        """Put the actual cg at (latitude, longitude [rad], height [m]) with attitude from local north-east-down [rad]
        and velocity over the ground uvw (3,) [m/s] and rates pqr (3,) [rad/s] in body axes; still air.

        Actuators, flap and delays take the steady values of the controls in force. Raises PlantError if JSBSim ends up
        elsewhere.
        """
        latitude, longitude, height = geodetic
        fdm = self._fdm
        fdm.set_trim_status(True)
        fdm["ic/long-gc-rad"] = longitude
        altitude = height / FT
        for _ in range(3):  # "altitude above sea level" is along the radius: a millimetre off at 300 m
            fdm["ic/h-sl-ft"] = altitude
            fdm["ic/lat-geod-rad"] = latitude
            altitude += height / FT - fdm["ic/geod-alt-ft"]
        for name, value in zip(("phi", "theta", "psi-true"), euler_N):
            fdm[f"ic/{name}-rad"] = float(value)
        for name, value in zip("uvw", uvw):
            fdm[f"ic/{name}-fps"] = float(value) / FT
        for name, value in zip("pqr", np.zeros(3) if pqr is None else pqr):
            fdm[f"ic/{name}-rad_sec"] = float(value)
        if not fdm.run_ic():
            raise PlantError("JSBSim refused the initial state")
        fdm["propulsion/set-running"] = -1
        self.check()
        reached = (*(g() for g in self.geodetic), self.altitude_ft() * FT)
        if max(abs(reached[0] - latitude), abs(reached[1] - longitude)) > 1e-9 or abs(reached[2] - height) > 1e-6:
            raise PlantError(f"JSBSim did not take the initial position {geodetic}: it is at {reached}")
        if max(abs(g() * FT - v) for g, v in zip(self.uvw_fps, uvw)) > 1e-6:
            raise PlantError("JSBSim did not take the initial velocity")

    def controls(self, elevator: float, aileron: float, rudder: float, throttle: float, flap: float) -> None:
        """Commands: [rad] of surface, 0..1."""
        e, a, r = self.ranges
        for write, value in zip(
            self.set_controls_norm, (elevator / e, aileron / a, rudder / r, flap, *(throttle,) * self.n_engines)
        ):
            write(value)

    def stabilise(self, angle: float) -> None:
        """Set the stabiliser [rad], as the elevator angle worth as much. Raises PlantError beyond its range."""
        low, high = self.stabiliser_limits or (-math.inf, math.inf)
        if not low - 1e-3 <= angle <= high + 1e-3:  # differences are taken across the ends
            raise PlantError(f"stabiliser {angle:g} rad is beyond its {low:g} ... {high:g} rad")
        self.set("fcs/stabiliser-cmd-rad", angle)

    def release(self, wind_N: Sequence[float]) -> None:
        """End the placing: from now on actuators and engines have memory, and the air moves with wind_N (3,) [m/s]."""
        fdm = self._fdm
        for write, value in zip(self.set_wind_fps, wind_N):
            write(float(value) / FT)
        fdm.suspend_integration()
        for _ in range(5):  # the integrators remember up to four derivatives: all from the same air
            fdm.run()
        fdm.resume_integration()
        fdm["propulsion/set-running"] = -1
        fdm.set_trim_status(False)
        if fdm.get_delta_t() != self.dt:
            raise PlantError(f"JSBSim's time step is {fdm.get_delta_t()!r}, not {self.dt!r}")
        fdm.set_sim_time(0.0)
        self.check_wind(wind_N)

    def check_wind(self, wind_N: Sequence[float]) -> tuple[float, float, float]:
        """The wind [m/s] JSBSim flies in, north, east, down.

        Raises PlantError if it is another than wind_N (3,) [m/s], or if JSBSim adds turbulence of its own.
        """
        if self.turbulence() != 0.0:
            raise PlantError(f"atmosphere/turb-type is {self.turbulence():g}: the wind is ours, JSBSim must add none")
        north, east, down = self.wind_fps
        told = north() * FT, east() * FT, down() * FT
        for read, value in zip(told, wind_N):
            if not abs(read - value) < 1e-6:
                raise PlantError(f"JSBSim lost the wind: {read:.6f} m/s instead of {value:.6f}")
        return told

    def accelerations(self) -> tuple[Array, float]:
        """(6,) du dv dw [m/s^2] dp dq dr [rad/s^2] in the placed state, and thrust [N]."""
        out = np.array([read() for read in self._accelerations])
        out[:3] *= FT
        return out, sum(read() for read in self.thrust_lbs) * LBF

    def check(self) -> None:
        """Raises PlantError if the state is not finite."""
        if not math.isfinite(self.ecef_ft[0]() + self.airspeed_fps() + self.pqr[0]() + self.pqr[1]() + self.pqr[2]()):
            raise PlantError(f"the flight model's state is not finite at t = {self._fdm.get_sim_time():.3f} s")

    def run(self) -> None:
        """One dt. Raises PlantError if JSBSim ends it; whether the state is still finite is for whoever reads it."""
        if not self._run():
            raise PlantError("JSBSim ended the simulation")
