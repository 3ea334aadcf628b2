"""An aircraft on the runway's Earth: flight model, wheels and camera platform behind the Plant contract."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from landing_sim.geometry import so3
from landing_sim.geometry.earth import RunwayFrame
from landing_sim.jit import direct
from landing_sim.plants import motion
from landing_sim.plants.jsbsim import FT, LBF, RATES, FlightModel, PlantError
from landing_sim.plants.trim import TrimPoint, trim
from landing_sim.plants.wheels import Contacts, read_contacts
from landing_sim.signals import CameraTruth, Command, Touchdown, Truth
from landing_sim.types import Array


class Platform(Protocol):
    """A camera platform: servos moved by commands and carried round by the body."""

    pan: float  # [rad]
    tilt: float

    def reset(self, pan: float, tilt: float) -> None: ...

    def step(self, pan_cmd: float, tilt_cmd: float, w_RB_B: Sequence[float], dt: float) -> None: ...


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
        self._begin()

    # ------------------------------------------------------------------------------------------ beginning

    def reset(self) -> Truth:
        """Back to the initial state in a fresh flight model; the same bits every time. Raises PlantError."""
        if self._tick > 0:
            self._begin()
        return self.truth()

    def _begin(self) -> None:
        s = self._initial
        self._model = model = FlightModel(self._folder, self.dt, s.mass, np.array(s.cg_offset_B), s.temperature_offset)
        self._contacts = read_contacts(self._folder / f"{self._folder.name}.xml", model.nominal_cg)
        n = len(self._contacts.names)
        self._height, self._bristle, self._pushing = np.full(n, math.inf), np.zeros((n, 2)), False
        self._body, self._tick = np.zeros((motion.ROWS, 3)), 0
        self._forces = self._body[motion.FORCE : motion.MOMENT + 1].reshape(6)
        self._settle_kernel: Callable[..., Any] = motion.settle
        site = np.vstack([self._frame.origin_E, self._frame.R_RE, model.cg_offset_B])
        p_B, values = self._contacts.p_B, self._contacts.values
        self._settling = (self._slope, self.dt, site, p_B, values, self._height, self._bristle, self._body)
        self._touchdown: Touchdown | None = None
        if self._platform is not None:
            self._platform.reset(*self._start_angles)
        self._trim, p_R, theta, speed = self._stand() if s.on_ground else self._fly()
        self._written: Command | None = None

        R_RB = so3.from_euler(0.0, theta, s.psi)
        geodetic = self._frame.R_to_geodetic(p_R + R_RB @ model.cg_offset_B)
        R_NR = self._frame.R_RN(*geodetic[:2]).T
        v_R = R_RB @ speed + (0.0 if s.on_ground else 1.0) * self._wind_R0
        model.controls(self._trim.elevator, 0.0, 0.0, self._trim.throttle, s.flap)
        model.place(geodetic, so3.to_euler(R_NR @ R_RB), R_RB.T @ v_R)
        self._settle(Command())
        least = self._height.min()
        if least < 0.0 and not s.on_ground:
            raise PlantError(f"the flight would begin {-least:.2f} m below the runway's surface: start higher")
        self._wind_N = motion.into_N(self._body, *self._wind_R0)
        self._settle_kernel, self._into_N = direct(motion.settle), direct(motion.into_N)
        model.release(self._wind_N)
        self._airspeed = model.airspeed_fps() * FT
        self._write(self.trimmed)

    def _fly(self) -> tuple[TrimPoint, Array, float, Array]:
        s = self._initial
        p_R = np.array([s.x, s.y, -s.height])
        latitude, longitude, height = self._frame.R_to_geodetic(p_R)
        clearance = s.height - s.x * math.tan(self._slope)
        point = trim(
            self._folder, s.airspeed, s.gamma, s.flap, height=height, clearance=clearance, place=(latitude, longitude),
            model=self._model,
        )  # fmt: skip
        return point, p_R, point.theta, s.airspeed * np.array([math.cos(point.alpha), 0.0, math.sin(point.alpha)])

    def _stand(self) -> tuple[TrimPoint, Array, float, Array]:
        """Static balance of weight on the three wheels' springs, on the slope."""
        c, s = self._contacts, self._initial
        weight = self._model.mass * 9.81
        reach, stiffness = c.p_B[:3, 0] - self._model.cg_offset_B[0], c.values[:3, 0]
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
        if command is not self._written:
            self._write(command)
        self._wind_N = north, east, down = self._into_N(self._body, *wind_R)
        set_north, set_east, set_down = model.set_wind_fps
        set_north(north / FT)
        set_east(east / FT)
        set_down(down / FT)
        self._tick += 1
        model.run()
        rates = self._settle(command)
        if self._platform is not None:
            self._platform.step(command.pan, command.tilt, rates, self.dt)

    def _write(self, command: Command) -> None:
        c = command
        if not math.isfinite(
            c.elevator + c.aileron + c.rudder + c.throttle + c.flap + c.brake_left + c.brake_right + c.pan + c.tilt
        ):  # JSBSim would clip it to a number
            raise PlantError(f"a command is not finite: {command}")
        self._model.controls(c.elevator, c.aileron, c.rudder, c.throttle, c.flap)
        self._written = command

    def _settle(self, command: Command) -> tuple[float, ...]:
        """Take over where JSBSim has got to; tell it what lies below: terrain for the ground effect, and what the ground
        does to the wheels until the next step. Returns p, q, r [rad/s]."""
        model = self._model
        said = model.motion()
        self._x, self._y, self._H, self._airspeed, elevation, least, sound = self._settle_kernel(
            *said, command.brake_left, command.brake_right, *self._settling
        )
        if not sound:
            if not math.isfinite(sum(said)):
                raise PlantError(f"the flight model's state is not finite at t = {self._tick * self.dt:.3f} s")
            raise PlantError(f"the aircraft has left the runway's neighbourhood: x {self._x:g} m, H {self._H:g} m")
        model.set_terrain_ft(elevation)
        if least < 0.0 or self._pushing:
            self._push(least < 0.0)
        return said[RATES:]

    def _push(self, touching: bool) -> None:
        """Hand the wheels' forces to JSBSim, and none once they have left the ground."""
        self._pushing = touching
        if not touching:
            self._bristle[:] = self._forces[:] = 0.0
        elif self._touchdown is None and not self._initial.on_ground and min(self._height[0], self._height[1]) < 0.0:
            self._touchdown = self._touch()
        for write, value in zip(self._model.set_wheels_lbs, self._forces.tolist()):
            write(value)

    def _touch(self) -> Touchdown:
        body = self._body
        p_RB, v_R, w_B, uvw = (body[row] for row in (motion.P, motion.V, motion.W, motion.UVW))
        R_RB = body[motion.R_RB : motion.R_RB + 3]
        wheel = int(np.argmin(self._height[:2]))
        arm = self._contacts.p_B[wheel]
        p = p_RB + R_RB @ arm
        v = v_R + R_RB @ np.cross(w_B, arm)
        middle = p_RB + R_RB @ (0.5 * (self._contacts.p_B[0] + self._contacts.p_B[1]))
        phi, theta, psi = so3.to_euler(R_RB).tolist()
        return Touchdown(
            t=self._tick * self.dt,
            x=float(p[0]),
            y=float(middle[1]),
            sink_rate=float(v[0] * math.sin(self._slope) + v[2] * math.cos(self._slope)),
            airspeed=self._model.airspeed_fps() * FT,
            groundspeed=math.hypot(v_R[0], v_R[1]),
            pitch=theta,
            bank=phi,
            heading_error=psi,
            sideslip=math.atan2(uvw[1], uvw[0]),
        )

    # ------------------------------------------------------------------------------------------ looking

    @property
    def touchdown(self) -> Touchdown | None:
        return self._touchdown

    def fast_truth(self) -> tuple[float, float, float, float]:
        return self._x, self._y, self._H, self._airspeed

    def truth(self) -> Truth:
        """Raises PlantError if JSBSim does not fly in the wind it was given."""
        model = self._model
        body = self._body.copy()
        motion.look(body, *model.check_wind(self._wind_N))
        height = body[motion.WHEELS]
        return Truth(
            tick=self._tick,
            t=self._tick * self.dt,
            p_RB=body[motion.P],
            R_RB=body[motion.R_RB : motion.R_RB + 3],
            v_RB_R=body[motion.V],
            w_RB_B=body[motion.W],
            euler=body[motion.EULER],
            wind_R=body[motion.WIND],
            airspeed=model.airspeed_fps() * FT,
            alpha=model.alpha(),
            beta=model.beta(),
            surfaces=np.array([read() for read in model.surfaces]),
            thrust=sum(read() for read in model.thrust_lbs) * LBF,
            wheels_height=height,
            on_ground=height < 0.0,
            load_factor=model.specific_z(),
        )

    def camera(self) -> CameraTruth:
        """Raises PlantError where there is no platform."""
        if self._platform is None:
            raise PlantError("this plant was built without a camera platform")
        pan, tilt, pose = self._platform.pan, self._platform.tilt, np.empty((4, 3))
        motion.camera_pose(self._body, self._p_BC, pan, tilt, pose)
        return CameraTruth(p_RC=pose[0], R_CR=pose[1:], pan=pan, tilt=tilt)
