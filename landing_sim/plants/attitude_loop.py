"""The attitude loop that ships with a multirotor: every plant step, on its own erring idea of its attitude.

Roll and pitch are PD loops with the natural frequency and damping given, their rates limited; yaw follows a rate. What
collective and moments ask of the four rotors is mixed, and limited to what they can turn.

Source     Brockers et al. 2012, section 4.1: the firmware's attitude stabilisation at 1 kHz, which works on attitudes that
           the firmware's own filter estimates, and hands those on. Departs: the loop's law and errors are ours, for the
           paper gives neither.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from landing_sim.noise import NoiseStream
from landing_sim.signals import Command

ERRING = 0.01  # [s] between two changes of the attitude's error
BLOCK = 3 * 512


@dataclass(frozen=True, slots=True)
class AttitudeConfig:
    """SI. Errors are 1 sigma of each axis."""

    frequency: float = 16.0  # [rad/s] natural, of roll and pitch
    damping: float = 0.8
    lean_max: float = math.radians(30.0)  # of what is asked for
    rate_max: float = math.radians(220.0)  # [rad/s]
    yaw_gain: float = 4.0  # [1/s]
    yaw_rate_max: float = math.radians(90.0)
    yaw_moment_max: float = 0.05  # [N m]
    idle: float = 105.0  # [rad/s] no rotor turns slower while the motors run
    bias: float = math.radians(0.6)  # constant over a run
    wander: float = math.radians(0.12)
    wander_time: float = 2.0  # [s]
    gyro_bias: float = math.radians(0.2)  # [rad/s]


class AttitudeLoop:
    """Attitude wanted into rotor speeds.

    Parameters
    ----------
    inertia : Ixx, Iyy, Izz [kg m^2]
    thrust_factor : [N/(rad/s)^2]; drag_lever [m]: moment per thrust; arm [m]; rotor_max [rad/s]: of the rotors as they are
        nominally
    noise : stream of the errors; after `reset` the same errors come again
    """

    def __init__(
        self,
        config: AttitudeConfig,
        inertia: tuple[float, float, float],
        thrust_factor: float,
        drag_lever: float,
        arm: float,
        rotor_max: float,
        dt: float,
        noise: NoiseStream,
    ) -> None:
        self._config, self._inertia, self._noise = config, inertia, noise
        self._full = 4.0 * thrust_factor * rotor_max**2
        self._factor, self._lever, self._arm = thrust_factor, drag_lever, arm
        self._low, self._high = config.idle**2, rotor_max**2
        drawn = noise.normal(9).tolist()
        self.bias = tuple(config.bias * n for n in drawn[:3])
        """[rad] of roll, pitch and yaw in this run."""
        self._first = [config.wander * n for n in drawn[3:6]]
        self._gyro = tuple(config.gyro_bias * n for n in drawn[6:])
        self._every = max(1, round(ERRING / dt))
        step = self._every * dt
        self._keep = math.exp(-step / config.wander_time)
        self._new = config.wander * math.sqrt(-math.expm1(-2.0 * step / config.wander_time))
        self._drawn: list[float] = []
        self.reset()

    def reset(self) -> None:
        """Begin the run again."""
        self._count, self._at = 0, 0
        self._wander = list(self._first)
        self.error = [b + w for b, w in zip(self.bias, self._wander)]
        """[rad] believed minus true roll, pitch, yaw."""

    def _err(self) -> None:
        if self._at == len(self._drawn):
            self._drawn += self._noise.normal(BLOCK).tolist()
        n, at = self._drawn, self._at
        self._wander = [self._keep * w + self._new * n[at + i] for i, w in enumerate(self._wander)]
        self._at += 3
        self.error = [b + w for b, w in zip(self.bias, self._wander)]

    def step(
        self, phi: float, theta: float, p: float, q: float, r: float, command: Command
    ) -> tuple[float, float, float, float]:
        """Speeds [rad/s] for the rotors front, right, rear, left; all 0 where the collective is 0: motors cut.

        phi, theta, p, q, r : the true ones, to which the errors are added here
        """
        self._count += 1
        if self._count >= self._every:
            self._count = 0
            self._err()
        if command.throttle <= 0.0:
            return 0.0, 0.0, 0.0, 0.0
        c, error, gyro = self._config, self.error, self._gyro
        lean, fast = c.lean_max, c.rate_max
        stiff, damp = 0.5 * c.frequency / c.damping, 2.0 * c.damping * c.frequency
        wanted = min(max(command.aileron, -lean), lean)
        rate = min(max(stiff * (wanted - phi - error[0]), -fast), fast)
        roll = self._inertia[0] * damp * (rate - p - gyro[0])
        wanted = min(max(-command.elevator, -lean), lean)
        rate = min(max(stiff * (wanted - theta - error[1]), -fast), fast)
        pitch = self._inertia[1] * damp * (rate - q - gyro[1])
        rate = min(max(-command.rudder, -c.yaw_rate_max), c.yaw_rate_max)
        most = c.yaw_moment_max
        yaw = min(max(self._inertia[2] * c.yaw_gain * (rate - r - gyro[2]), -most), most)
        lift = 0.25 * min(command.throttle, 1.0) * self._full
        roll *= 0.5 / self._arm
        pitch *= 0.5 / self._arm
        yaw *= 0.25 / self._lever
        low, high, k = self._low, self._high, 1.0 / self._factor
        return (
            math.sqrt(min(max(k * (lift + pitch - yaw), low), high)),
            math.sqrt(min(max(k * (lift - roll + yaw), low), high)),
            math.sqrt(min(max(k * (lift - pitch - yaw), low), high)),
            math.sqrt(min(max(k * (lift + roll + yaw), low), high)),
        )
