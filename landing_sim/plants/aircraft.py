"""An aircraft on the runway's Earth: flight model, wheels and camera platform behind the Plant contract."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from landing_sim.geometry import so3
from landing_sim.geometry.earth import RunwayFrame
from landing_sim.jit import kernel
from landing_sim.plants.jsbsim import FT, LBF, FlightModel, PlantError
from landing_sim.plants.trim import TrimPoint, trim
from landing_sim.plants.wheels import Contacts, heights, reactions, read_contacts
from landing_sim.signals import CameraTruth, Command, Touchdown, Truth
from landing_sim.types import Array

NEAR_GROUND = 30.0  # [m] of the cg, below which the wheels are looked at
FAR_AWAY = 50e3  # [m] where a level plane is no longer the Earth


class Platform(Protocol):
    """A camera platform: servos moved by commands and carried round by the body."""

    pan: float  # [rad]
    tilt: float

    def reset(self, pan: float, tilt: float) -> None: ...

    def step(self, pan_cmd: float, tilt_cmd: float, w_RB_B: Array, dt: float) -> None: ...


@dataclass(frozen=True, slots=True)
class InitialState:
    """Where the flight begins: trimmed for still air, wings level.

    Wind at the start is added on top: airspeed, alpha and heading stay, and the velocity over the ground is that through
    the air plus the wind's. With `on_ground` the aircraft stands on its wheels at (x, y), engines idling; height, airspeed
    and gamma are ignored.
    """

    x: float = -950.0  # [m] nominal cg in R
    y: float = 0.0
    height: float = 51.0  # [m] H = -z
    psi: float = 0.0  # [rad] heading in R
    airspeed: float = 50.0  # [m/s] true
    gamma: float = 0.0  # [rad] flight path through the air
    flap: float = 0.5
    mass: float | None = None  # [kg]; None: the flight model's own
    cg_offset_B: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] of the actual cg from the nominal
    on_ground: bool = False
    temperature_offset: float = 0.0  # [K] warmer than the standard atmosphere


@dataclass(slots=True)
class _Body:
    """Scratch: the state in R, refreshed in place after every step."""

    p_R: Array = field(default_factory=lambda: np.zeros(3))  # nominal cg
    v_R: Array = field(default_factory=lambda: np.zeros(3))
    R_RN: Array = field(default_factory=lambda: np.eye(3))
    R_RB: Array = field(default_factory=lambda: np.eye(3))
    uvw: Array = field(default_factory=lambda: np.zeros(3))
    pqr: Array = field(default_factory=lambda: np.zeros(3))


@kernel
def _locate(
    x: float, y: float, z: float, lat: float, lon: float, altitude: float, origin_E: Array, R_RE: Array, slope: float,
    p_R: Array, R_RN: Array,
) -> float:  # fmt: skip
    """p_R (3,) [m] of the actual cg and R_RN (3, 3) there; returns the elevation [m] of the runway's surface below."""
    sp, cp, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    dx, dy, dz = x - origin_E[0], y - origin_E[1], z - origin_E[2]
    for i in range(3):
        a, b, c = R_RE[i, 0], R_RE[i, 1], R_RE[i, 2]
        p_R[i] = a * dx + b * dy + c * dz
        R_RN[i, 0] = -a * sp * cl - b * sp * sl + c * cp
        R_RN[i, 1] = -a * sl + b * cl
        R_RN[i, 2] = -a * cp * cl - b * cp * sl - c * sp
    up_x, up_z = -R_RN[0, 2], -R_RN[2, 2]
    s, c = math.sin(slope), math.cos(slope)
    above = (-s * p_R[0] - c * p_R[2]) / (-s * up_x - c * up_z)
    return altitude - above


class JsbsimPlant:
    """The aircraft in `folder` above a runway: implements interfaces.Plant.

    Parameters
    ----------
    folder : aircraft/NAME
    frame : the runway's place on the Earth
    slope : [rad] of its surface, > 0 uphill along x; the surface is a plane through the threshold
    initial : where to begin
    dt : [s]
    wind_R : (3,) [m/s] at the start
    platform : camera platform, or None where there is no camera
    p_BC : (3,) [m] the camera's place

    Raises PlantError from the constructor and from any step after which the flight model cannot be trusted.
    """

    def __init__(
        self,
        folder: Path,
        frame: RunwayFrame,
        initial: InitialState,
        slope: float = 0.0,
        dt: float = 0.005,
        wind_R: Sequence[float] | None = None,
        platform: Platform | None = None,
        p_BC: Array | None = None,
    ) -> None:
        self.dt, self._folder, self._frame, self._initial, self._slope = dt, folder, frame, initial, slope
        self._wind_R0 = np.zeros(3) if wind_R is None else np.array(wind_R, dtype=float)
        self._platform = platform
        self._start_angles = (platform.pan, platform.tilt) if platform is not None else (0.0, 0.0)
        self._p_BC = np.zeros(3) if p_BC is None else np.array(p_BC, dtype=float)
        self.reset()

    # ------------------------------------------------------------------------------------------ beginning

    def reset(self) -> Truth:
        """A fresh flight model at the initial state; the same bits every time. Raises PlantError."""
        s = self._initial
        self._model = model = FlightModel(
            self._folder, self.dt, s.mass, np.array(s.cg_offset_B), s.temperature_offset
        )
        self._contacts = read_contacts(self._folder / f"{self._folder.name}.xml", model.nominal_cg)
        n = len(self._contacts.names)
        self._height, self._bristle, self._reaction = np.full(n, math.inf), np.zeros((n, 2)), np.zeros(6)
        self._pushing, self._tan_slope, self._offset_B = False, math.tan(self._slope), model.cg_offset_B
        self._body, self._tick = _Body(), 0
        self._touchdown: Touchdown | None = None
        if self._platform is not None:
            self._platform.reset(*self._start_angles)
        self._trim, p_R, theta, speed = self._stand() if s.on_ground else self._fly()
        self._written: Command | None = None

        R_RB = so3.from_euler(0.0, theta, s.psi)
        geodetic = self._frame.R_to_geodetic(p_R + R_RB @ self._offset_B)
        R_NR = self._frame.R_RN(*geodetic[:2]).T
        v_R = R_RB @ speed + (0.0 if s.on_ground else 1.0) * self._wind_R0
        model.controls(self._trim.elevator, 0.0, 0.0, self._trim.throttle, s.flap)
        model.place(geodetic, so3.to_euler(R_NR @ R_RB), R_RB.T @ v_R)
        self._refresh()
        self._attitude()
        least = heights(self._body.p_R, self._body.R_RB, self._slope, self._contacts.p_B, self._height)
        if least < 0.0 and not s.on_ground:
            raise PlantError(f"the flight would begin {-least:.2f} m below the runway's surface: start higher")
        self._wheels(Command())
        self._wind_N = (R_NR @ self._wind_R0).tolist()
        model.release(self._wind_N)
        self._write(self.trimmed)
        return self.truth()

    def _fly(self) -> tuple[TrimPoint, Array, float, Array]:
        s = self._initial
        p_R = np.array([s.x, s.y, -s.height])
        latitude, longitude, height = self._frame.R_to_geodetic(p_R)
        clearance = s.height - s.x * self._tan_slope
        point = trim(
            self._folder, s.airspeed, s.gamma, s.flap, height=height, clearance=clearance, place=(latitude, longitude),
            model=self._model,
        )  # fmt: skip
        return point, p_R, point.theta, s.airspeed * np.array([math.cos(point.alpha), 0.0, math.sin(point.alpha)])

    def _stand(self) -> tuple[TrimPoint, Array, float, Array]:
        """Static balance of weight on the three wheels' springs, on the slope."""
        c, s = self._contacts, self._initial
        weight = self._model.mass * 9.81
        reach, stiffness = c.p_B[:3, 0] - self._offset_B[0], c.values[:3, 0]
        tail = weight * reach[0] / (reach[0] - reach[2])
        load = np.array([0.5 * (weight - tail), 0.5 * (weight - tail), tail])
        drop = c.p_B[:3, 2] - load / stiffness  # of the tyres below the cg, compressed, nose level
        forward = math.copysign(1.0, c.p_B[0, 0] - c.p_B[2, 0])  # the third wheel may be a nose wheel
        theta = math.atan2(forward * (drop[0] - drop[2]), forward * (c.p_B[0, 0] - c.p_B[2, 0]))
        over = c.p_B[0, 2] * math.cos(theta) - c.p_B[0, 0] * math.sin(theta) - load[0] / stiffness[0]
        height = (over + s.x * math.sin(self._slope)) / math.cos(self._slope)
        point = TrimPoint(0.0, 0.0, s.flap, self._model.mass, height, 0.0, theta, 0.0, 0.0, 0.0, 0.0)
        return point, np.array([s.x, s.y, -height]), theta + self._slope, np.zeros(3)

    @property
    def trim_point(self) -> TrimPoint:
        """The steady flight it began in."""
        return self._trim

    @property
    def trimmed(self) -> Command:
        """The command that keeps the aircraft in the steady flight it began in."""
        t = self._trim
        pan, tilt = self._start_angles
        return Command(elevator=t.elevator, throttle=t.throttle, flap=self._initial.flap, pan=pan, tilt=tilt)

    @property
    def contacts(self) -> Contacts:
        return self._contacts

    # ------------------------------------------------------------------------------------------ stepping

    def step(self, command: Command, wind_R: Sequence[float]) -> None:
        """Advance one dt under `command` in air moving at wind_R: x, y, z in R [m/s]. Raises PlantError."""
        model = self._model
        self._write(command)
        a, b, c = wind_R
        R = self._R_RN_rows
        self._wind_N = [R[0][i] * a + R[1][i] * b + R[2][i] * c for i in range(3)]
        for write, value in zip(model.set_wind_fps, self._wind_N):
            write(value / FT)
        model.run()
        self._tick += 1
        self._refresh()
        if self._platform is not None:
            self._platform.step(command.pan, command.tilt, self._body.pqr, self.dt)
        self._wheels(command)

    def _write(self, command: Command) -> None:
        if command is self._written:
            return
        c = command
        if not math.isfinite(
            c.elevator + c.aileron + c.rudder + c.throttle + c.flap + c.brake_left + c.brake_right + c.pan + c.tilt
        ):  # JSBSim would clip it to a number
            raise PlantError(f"a command is not finite: {command}")
        self._model.controls(c.elevator, c.aileron, c.rudder, c.throttle, c.flap)
        self._written = command

    def _refresh(self) -> None:
        """Position, rates and the terrain below, which JSBSim needs for the ground effect; near it, attitude too."""
        model, body = self._model, self._body
        x, y, z = model.ecef
        lat, lon = model.geodetic
        elevation = _locate(
            x() * FT, y() * FT, z() * FT, lat(), lon(), model.altitude_ft() * FT, self._frame.origin_E,
            self._frame.R_RE, self._slope, body.p_R, body.R_RN,
        )  # fmt: skip
        model.set_terrain_ft(elevation / FT)
        self._R_RN_rows = body.R_RN.tolist()
        self._x, self._y, down = body.p_R.tolist()
        self._H = -down
        if not abs(self._x) + abs(down) < FAR_AWAY:
            raise PlantError(f"the aircraft has left the runway's neighbourhood: x {self._x:g} m, H {self._H:g} m")
        p, q, r = model.pqr
        body.pqr[0], body.pqr[1], body.pqr[2] = p(), q(), r()
        self._full = False
        if self._H - self._x * self._tan_slope < NEAR_GROUND:
            self._attitude()

    def _attitude(self) -> None:
        if self._full:
            return
        model, body = self._model, self._body
        phi, theta, psi = (read() for read in model.euler)
        body.R_RB = body.R_RN @ so3.from_euler(phi, theta, psi)
        body.uvw[:] = [read() * FT for read in model.uvw_fps]
        if self._offset_B.any():  # from the actual to the nominal cg
            body.p_R -= body.R_RB @ self._offset_B
            body.uvw -= np.cross(body.pqr, self._offset_B)
        body.v_R = body.R_RB @ body.uvw
        self._full = True

    def _wheels(self, command: Command) -> None:
        """What the ground does to the wheels in this state, for the next step; the first touch of a main wheel."""
        body, contacts = self._body, self._contacts
        if not self._full or heights(body.p_R, body.R_RB, self._slope, contacts.p_B, self._height) >= 0.0:
            if self._pushing:
                self._bristle[:] = self._reaction[:] = 0.0
                self._push()
                self._pushing = False
            return
        if self._touchdown is None and not self._initial.on_ground and min(self._height[0], self._height[1]) < 0.0:
            self._touchdown = self._touch()
        reactions(
            body.R_RB, body.v_R, body.pqr, self._slope, command.brake_left, command.brake_right, self.dt,
            contacts.p_B, contacts.values, self._height, self._bristle, self._reaction,
        )  # fmt: skip
        self._push()
        self._pushing = True

    def _push(self) -> None:
        for i, (write, value) in enumerate(zip(self._model.set_wheels_lbs, self._reaction.tolist())):
            write(value / LBF if i < 3 else value / (LBF * FT))

    def _touch(self) -> Touchdown:
        body = self._body
        wheel = int(np.argmin(self._height[:2]))
        arm = self._contacts.p_B[wheel]
        p = body.p_R + body.R_RB @ arm
        v = body.v_R + body.R_RB @ np.cross(body.pqr, arm)
        middle = body.p_R + body.R_RB @ (0.5 * (self._contacts.p_B[0] + self._contacts.p_B[1]))
        phi, theta, psi = so3.to_euler(body.R_RB).tolist()
        return Touchdown(
            t=self._tick * self.dt,
            x=float(p[0]),
            y=float(middle[1]),
            sink_rate=float(v[0] * math.sin(self._slope) + v[2] * math.cos(self._slope)),
            airspeed=self._model.airspeed_fps() * FT,
            groundspeed=math.hypot(body.v_R[0], body.v_R[1]),
            pitch=theta,
            bank=phi,
            heading_error=psi,
            sideslip=math.atan2(body.uvw[1], body.uvw[0]),
        )

    # ------------------------------------------------------------------------------------------ looking

    @property
    def touchdown(self) -> Touchdown | None:
        return self._touchdown

    def fast_truth(self) -> tuple[float, float, float, float]:
        return self._x, self._y, self._H, self._model.airspeed_fps() * FT

    def truth(self) -> Truth:
        """Raises PlantError if JSBSim does not fly in the wind it was given."""
        self._attitude()
        model, body = self._model, self._body
        model.check_wind(self._wind_N)
        height = np.empty(len(self._contacts.names))
        heights(body.p_R, body.R_RB, self._slope, self._contacts.p_B, height)
        return Truth(
            tick=self._tick,
            t=self._tick * self.dt,
            p_RB=body.p_R.copy(),
            R_RB=body.R_RB.copy(),
            v_RB_R=body.v_R.copy(),
            w_RB_B=body.pqr.copy(),
            euler=so3.to_euler(body.R_RB),
            wind_R=body.R_RN @ np.array([read() * FT for read in model.wind_fps]),
            airspeed=model.airspeed_fps() * FT,
            alpha=model.alpha(),
            beta=model.beta(),
            surfaces=np.array([read() for read in model.surfaces]),
            thrust=sum(read() for read in model.thrust_lbs) * LBF,
            wheels_height=height[:3],
            on_ground=height[:3] < 0.0,
            load_factor=model.specific_z(),
        )

    def camera(self) -> CameraTruth:
        """Raises PlantError where there is no platform."""
        if self._platform is None:
            raise PlantError("this plant was built without a camera platform")
        self._attitude()
        body, pan, tilt = self._body, self._platform.pan, self._platform.tilt
        return CameraTruth(
            p_RC=body.p_R + body.R_RB @ self._p_BC,
            R_CR=so3.camera_from_body(pan, tilt) @ body.R_RB.T,
            pan=pan,
            tilt=tilt,
        )
