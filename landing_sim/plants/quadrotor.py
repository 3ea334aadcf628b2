"""A quadrotor behind the Plant contract, its firmware's attitude loop included.

R has its origin on the ground below the start, x along the first heading, y right, z down. Command.throttle is the share
of full collective thrust (0 cuts the motors), elevator the pitch wanted, > 0 nose down, aileron the roll wanted, > 0 right
side down, rudder the yaw rate wanted, > 0 nose left; a command acts at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landing_sim.geometry import so3
from landing_sim.noise import NoiseStream
from landing_sim.plants.attitude_loop import AttitudeConfig, AttitudeLoop
from landing_sim.plants.jsbsim import FT, PlantError
from landing_sim.plants.jsbsim_quadrotor import GRAVITY, PLACE, QuadrotorModel
from landing_sim.plants.legs import NOTHING, Legs, Vector
from landing_sim.signals import CameraTruth, Command, Touchdown, Truth
from landing_sim.types import Array

CLEAR = 0.05  # [m] all feet this high: it has taken off
NEAR = 0.1  # [m] contacts are worked out below the highest surface plus reach plus this
R_CB = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""The camera looks straight down the body's z; up in the image is forward."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where the flight begins: level, at rest. A height of None is standing on what is there."""

    x: float = 0.0
    y: float = 0.0
    height: float | None = None  # [m] of the cg above z = 0
    psi: float = 0.0


class QuadrotorPlant:
    """The quadrotor in `folder` above `height(x, y)` [m], the surface's height above z = 0: implements interfaces.Plant.

    Parameters
    ----------
    noise : stream of the firmware's errors
    payload : [kg]; None keeps the file's
    thrust_share : true thrust over nominal
    p_BC : (3,) [m] camera from the cg
    highest : [m] no surface is higher; contacts are not looked for well above it

    Raises PlantError from the constructor and from any step after which the model cannot be trusted.
    """

    def __init__(
        self,
        folder: Path,
        start: Start,
        height: Callable[[float, float], float],
        dt: float,
        noise: NoiseStream,
        config: AttitudeConfig | None = None,
        payload: float | None = None,
        thrust_share: float = 1.0,
        p_BC: Sequence[float] = (0.0, 0.0, 0.05),
        highest: float = math.inf,
    ) -> None:
        self.dt, self._folder, self._start, self._height = dt, folder, start, height
        self._payload, self._share = payload, thrust_share
        self._p_BC = np.array(p_BC, dtype=float)
        model = self._load()
        self.full_thrust = 4.0 * model.thrust_factor * model.rotor_max**2
        """[N] nominal."""
        ixx, iyy, izz = model.inertia
        self._loop = AttitudeLoop(
            config or AttitudeConfig(), (ixx, iyy, izz), model.thrust_factor, model.drag_lever, model.arm,
            model.rotor_max, dt, noise,
        )  # fmt: skip
        self._legs = Legs(model.contacts, height)
        self._feet = np.array([c.p_B for c in model.contacts[:4]])
        reach = max(math.hypot(*c.p_B) for c in model.contacts)
        self._contact_below = highest + reach + NEAR
        self._M = PLACE.R_RE.tolist()
        self._origin = PLACE.origin_E.tolist()
        self.reset()

    def _load(self) -> QuadrotorModel:
        self._model = model = QuadrotorModel(self._folder, self.dt, self._payload)
        model.set_thrust_share(self._share)
        return model

    def reset(self) -> Truth:
        """A fresh model at the start; the same bits every time. Raises PlantError."""
        model, s = self._load(), self._start
        self._loop.reset()
        self._legs.reset()
        self._tick, self._pressed, self._flown = 0, False, False
        self._touchdown: Touchdown | None = None
        self._specific, self._samples = [0.0, 0.0, 0.0], 0
        if s.height is None:
            # as deep in its feet as its weight takes it
            foot = model.contacts[0]
            sunk = model.mass * GRAVITY / (4.0 * foot.stiffness)
            model.place((s.x, s.y, -(self._height(s.x, s.y) + foot.p_B[2] - sunk)), s.psi, (0.0, 0.0, 0.0), 0.0)
        else:
            model.place((s.x, s.y, -s.height), s.psi, (0.0, 0.0, 0.0), self._hover_speed())
            self._flown = s.height - self._height(s.x, s.y) - float(self._feet[0, 2]) > CLEAR
        self._read()
        self._touch()
        return self.truth()

    def _hover_speed(self) -> float:
        m = self._model
        return math.sqrt(m.mass * GRAVITY / (4.0 * self._share * m.thrust_factor))

    @property
    def trimmed(self) -> Command:
        """What holds it where it starts, were its rotors nominal; motors cut where it stands."""
        if self._start.height is None:
            return Command()
        return Command(throttle=self._model.mass * GRAVITY / self.full_thrust)

    @property
    def mass(self) -> float:
        """[kg]"""
        return float(self._model.mass)

    # ------------------------------------------------------------------------------------------ stepping

    def step(self, command: Command, wind_R: Sequence[float]) -> None:
        """Advance one dt in air moving at wind_R (3,) [m/s]. Raises PlantError."""
        if not math.isfinite(command.throttle + command.elevator + command.aileron + command.rudder):
            raise PlantError(f"a command is not finite: {command}")
        model = self._model
        speeds = self._loop.step(self._phi, self._theta, *self._w, command)
        for write, value in zip(model.set_rotor, speeds):
            write(value)
        model.wind(wind_R)
        model.run()
        self._tick += 1
        self._read()
        total, now = self._specific, model.force_fps2
        total[0] += now[0]()
        total[1] += now[1]()
        total[2] += now[2]()
        self._samples += 1
        if self._contact_below > self._H:
            self._touch()
        elif self._pressed:
            self._lift()

    def _read(self) -> None:
        model, (X, Y, Z), M = self._model, self._origin, self._M
        x, y, z = (read() * FT for read in model.ecef_ft)
        x, y, z = x - X, y - Y, z - Z
        self._x = M[0][0] * x + M[0][1] * y + M[0][2] * z
        self._y = M[1][0] * x + M[1][1] * y + M[1][2] * z
        self._H = -(M[2][0] * x + M[2][1] * y + M[2][2] * z)
        phi, theta, psi = model.attitude
        self._phi, self._theta, self._psi = phi(), theta(), psi()
        p, q, r = model.pqr
        self._w: Vector = (p(), q(), r())
        if not math.isfinite(self._H + self._phi + self._theta + self._psi):
            model.check()

    def _velocity(self) -> Vector:
        n, e, d = self._model.v_fps
        return n() * FT, e() * FT, d() * FT

    def _rotation(self) -> tuple[Vector, Vector, Vector]:
        """Rows of R_RB."""
        cph, sph, cth, sth = math.cos(self._phi), math.sin(self._phi), math.cos(self._theta), math.sin(self._theta)
        cps, sps = math.cos(self._psi), math.sin(self._psi)
        return (
            (cth * cps, sph * sth * cps - cph * sps, cph * sth * cps + sph * sps),
            (cth * sps, sph * sth * sps + cph * cps, cph * sth * sps - sph * cps),
            (-sth, sph * cth, cph * cth),
        )

    def _touch(self) -> None:
        """Legs: what they push with in the next step; take-off and touchdown."""
        legs = self._legs
        force, moment = legs.reactions((self._x, self._y, -self._H), self._rotation(), self._velocity(), self._w)
        pressed = force != NOTHING
        if pressed or self._pressed:
            self._model.legs(force, moment)
        self._pressed = pressed
        lowest = min(legs.clearance)
        if not self._flown:
            self._flown = lowest > CLEAR
        elif self._touchdown is None and lowest < 0.0:
            self._touchdown = self._touched()

    def _lift(self) -> None:
        self._model.legs(NOTHING, NOTHING)
        self._pressed = False

    def _touched(self) -> Touchdown:
        vx, vy, vz = self._velocity()
        return Touchdown(
            t=self._tick * self.dt,
            x=self._x,
            y=self._y,
            sink_rate=vz,
            airspeed=self._model.airspeed_fps() * FT,
            groundspeed=math.hypot(vx, vy),
            pitch=self._theta,
            bank=self._phi,
            heading_error=so3.wrap(self._psi),
            sideslip=0.0,
        )

    # ------------------------------------------------------------------------------------------ looking

    def specific_force(self) -> Array:
        """(3,) [m/s^2] body axes, averaged over the steps since it was last asked for: what accelerometers integrate."""
        count = max(self._samples, 1)
        out = np.array([f * FT / count for f in self._specific])
        self._specific, self._samples = [0.0, 0.0, 0.0], 0
        return out

    def believed_euler(self) -> Array:
        """(3,) [rad] roll, pitch, yaw as the firmware has them."""
        e = self._loop.error
        return np.array([self._phi + e[0], self._theta + e[1], so3.wrap(self._psi + e[2])])

    @property
    def touchdown(self) -> Touchdown | None:
        """The first contact after take-off: x and y are the cg's."""
        return self._touchdown

    def fast_truth(self) -> tuple[float, float, float, float]:
        return self._x, self._y, self._H, 0.0

    def truth(self) -> Truth:
        """`surfaces` holds rotor speeds [rad/s], front, right, rear, left; wheels are the front feet and the lower rear."""
        model, R = self._model, np.array(self._rotation())
        p = np.array([self._x, self._y, -self._H])
        feet = p + self._feet @ R.T
        above = [float(-f[2]) - self._height(float(f[0]), float(f[1])) for f in feet]
        heights = np.array([above[0], above[1], min(above[2:])])
        air = model.airspeed_fps() * FT
        v = np.array(self._velocity())
        return Truth(
            tick=self._tick,
            t=self._tick * self.dt,
            p_RB=p,
            R_RB=R,
            v_RB_R=v,
            w_RB_B=np.array(self._w),
            euler=np.array([self._phi, self._theta, so3.wrap(self._psi)]),
            wind_R=model.air_velocity(),
            airspeed=air,
            alpha=0.0,
            beta=0.0,
            surfaces=np.array([read() for read in model.rotor]),
            thrust=sum(read() for read in model.thrust),
            wheels_height=heights,
            on_ground=heights < 0.0,
            load_factor=-model.force_fps2[2]() * FT / 9.80665,
        )

    def camera(self) -> CameraTruth:
        R_RB = np.array(self._rotation())
        p = np.array([self._x, self._y, -self._H])
        return CameraTruth(p_RC=p + R_RB @ self._p_BC, R_CR=R_CB @ R_RB.T, pan=0.0, tilt=-0.5 * math.pi)
