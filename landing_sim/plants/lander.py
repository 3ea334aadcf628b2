"""A lunar lander behind the Plant contract.

R here has its origin on the Moon's mean surface below where the descent is meant to end, x along the flight (east), y
right, z down; heights are above the plane z = 0. Command.throttle is the share of full thrust, Command.elevator the share
of full attitude force, > 0 nose down, which tilts the thrust forward: theta > 0 in Sabiron et al. 2014. JSBSim's pitch is
minus that. A command acts a step later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landing_sim.geometry import so3
from landing_sim.plants.jsbsim import FT, PlantError
from landing_sim.plants.jsbsim_lander import LanderModel
from landing_sim.signals import CameraTruth, Command, Touchdown, Truth
from landing_sim.types import Array

FEET = 3  # the first three contacts: aft left, aft right, front
R_RE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""From planet-fixed axes; R lies at latitude 0, longitude 0."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where the descent begins, in the paper's variables: theta, q > 0 nose down."""

    x: float  # [m] before the target: negative
    height: float  # [m]
    v_x: float  # [m/s]
    v_z: float  # [m/s] > 0 upwards
    theta: float  # [rad]
    q: float  # [rad/s]
    mass: float  # [kg]
    throttle: float  # shares, as commanded meanwhile
    attitude: float


def flat(x: float, y: float) -> float:
    """The ground of the paper: a plane."""
    return 0.0


class LanderPlant:
    """The lander in `folder` above `ground(x, y)` [m], a height above z = 0: implements interfaces.Plant.

    planet : file; None takes the Moon beside the vehicle
    look : [rad] below the body's horizontal where the camera of a recording looks

    Raises PlantError from the constructor and from any step after which the model cannot be trusted.
    """

    def __init__(
        self,
        folder: Path,
        start: Start,
        ground: Callable[[float, float], float] = flat,
        dt: float = 0.005,
        planet: Path | None = None,
        look: float = math.radians(120.0),
    ) -> None:
        self.dt, self._folder, self._start, self._ground = dt, folder, start, ground
        self._planet = folder / "moon.xml" if planet is None else planet
        self._R_CB = so3.camera_from_body(0.0, -look)
        self._look = look
        self.reset()

    def reset(self) -> Truth:
        """A fresh model at the start; the same bits every time. Raises PlantError."""
        s = self._start
        self._model = model = LanderModel(self._folder, self._planet, self.dt)
        self._feet = model.feet_B[:FEET]
        self._tick = 0
        self._touchdown: Touchdown | None = None
        down = model.radius + s.height  # distance of the plane z = -height from the centre, along z
        longitude = math.atan2(s.x, down)
        altitude = math.hypot(s.x, down) - model.radius
        R_NR = self._R_RN(longitude, 0.0).T
        euler_N = so3.to_euler(R_NR @ so3.from_euler(0.0, -s.theta, 0.0))
        v_N = R_NR @ np.array([s.v_x, 0.0, -s.v_z])
        model.set_main(s.throttle * model.full_thrust)
        model.set_attitude(s.attitude * model.full_attitude)
        model.place(longitude, 0.0, altitude, euler_N, v_N, np.array([0.0, -s.q, 0.0]), s.mass)
        model.release(s.mass)
        self._read()
        return self.truth()

    @property
    def trimmed(self) -> Command:
        """The command in force at the start."""
        return Command(elevator=self._start.attitude, throttle=self._start.throttle)

    @property
    def mass(self) -> float:
        return self._model.mass

    @staticmethod
    def _R_RN(longitude: float, latitude: float) -> Array:
        """(3, 3) local north-east-down, as JSBSim has it, to R."""
        sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
        R_EN = np.array([[-sp * cl, -sl, -cp * cl], [-sp * sl, cl, -cp * sl], [cp, 0.0, -sp]])
        return R_RE @ R_EN

    # ------------------------------------------------------------------------------------------ stepping

    def step(self, command: Command, wind_R: Sequence[float]) -> None:
        """Advance one dt; there is no air, whatever the wind. Raises PlantError."""
        model = self._model
        if not math.isfinite(command.throttle + command.elevator):
            raise PlantError(f"a command is not finite: {command}")
        model.set_main(command.throttle * model.full_thrust)
        model.set_attitude(command.elevator * model.full_attitude)
        model.run()
        self._tick += 1
        self._read()
        if self._touchdown is None and min(self._heights()) < 0.0:
            self._touchdown = self._touch()

    def _read(self) -> None:
        model = self._model
        x, y, z = (read() * FT for read in model.ecef)
        self._x, self._y, self._H = y, -z, x - model.radius
        # JSBSim's ground is a sphere: at the terrain's height below the vehicle
        drop = math.hypot(model.radius, self._x, self._y) - model.radius
        self._below = self._ground(self._x, self._y)
        model.set_terrain_ft((self._below + drop) / FT)

    def _pose(self) -> tuple[Array, Array, Array, Array]:
        """p_R, R_RB, v_R, rates."""
        model = self._model
        R_RN = self._R_RN(model.longitude(), model.latitude())
        R_RB = R_RN @ so3.from_euler(*(read() for read in model.euler))
        v_R = R_RB @ np.array([read() * FT for read in model.uvw_fps])
        return np.array([self._x, self._y, -self._H]), R_RB, v_R, np.array([read() for read in model.pqr])

    def _heights(self) -> list[float]:
        """[m] of the feet above the ground beneath each; far up, of the lander itself."""
        if self._H - self._below > 20.0:
            return [self._H - self._below] * FEET
        p, R_RB, _, _ = self._pose()
        return [float(-f[2]) - self._ground(float(f[0]), float(f[1])) for f in p + self._feet @ R_RB.T]

    def _touch(self) -> Touchdown:
        p, R_RB, v, _ = self._pose()
        phi, theta, psi = so3.to_euler(R_RB).tolist()
        return Touchdown(
            t=self._tick * self.dt,
            x=float(p[0]),
            y=float(p[1]),
            sink_rate=float(v[2]),
            airspeed=float(np.linalg.norm(v)),
            groundspeed=math.hypot(v[0], v[1]),
            pitch=theta,
            bank=phi,
            heading_error=psi,
            sideslip=0.0,
        )

    # ------------------------------------------------------------------------------------------ looking

    @property
    def touchdown(self) -> Touchdown | None:
        return self._touchdown

    def fast_truth(self) -> tuple[float, float, float, float]:
        return self._x, self._y, self._H, 0.0

    def truth(self) -> Truth:
        """`surfaces` holds the attitude force [N] where an aircraft has its elevator."""
        p, R_RB, v, w = self._pose()
        heights = np.array(self._heights())
        return Truth(
            tick=self._tick,
            t=self._tick * self.dt,
            p_RB=p,
            R_RB=R_RB,
            v_RB_R=v,
            w_RB_B=w,
            euler=so3.to_euler(R_RB),
            wind_R=np.zeros(3),
            airspeed=float(np.linalg.norm(v)),
            alpha=0.0,
            beta=0.0,
            surfaces=np.array([self._model.torque_force(), 0.0, 0.0, 0.0]),
            thrust=self._model.thrust(),
            wheels_height=heights,
            on_ground=heights < 0.0,
            load_factor=self._model.specific_z(),
        )

    def camera(self) -> CameraTruth:
        p, R_RB, _, _ = self._pose()
        return CameraTruth(p_RC=p, R_CR=self._R_CB @ R_RB.T, pan=0.0, tilt=-self._look)
