"""The 4D-approach filter: an extended Kalman filter on the aircraft's motion, fed with edges of the runway's image.

One code base for the plain twelve-state filter of the paper, its split into longitudinal and lateral halves, the
augmented filter (wind, gyro and encoder bias) and the runway's width, as a state or as a second filter beside: they
differ in which states are covered (`Blocks`) and how the covariance is carried (dense or U-D).

Source     Dickmanns & Schell 1992, sections 2-4 and 7.1; Bierman 1977. Departs: see kalman.py, aircraft_model.py,
           edge_model.py; a robust start, a gate and a watchdog are added.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from landing_sim.estimators import kalman, states
from landing_sim.estimators.aircraft_model import downwash, parameters, thrust
from landing_sim.estimators.belief import AircraftBelief
from landing_sim.estimators.gusts import change
from landing_sim.estimators.inertial_model import airspeed_model, gyro_model
from landing_sim.estimators.reckoning import reckoned
from landing_sim.estimators.runway_filter import RAD, Blocks, FilterConfig, Memory
from landing_sim.estimators.runway_steps import (
    airspeed_dense,
    correct_dense,
    correct_ud,
    edges_dense,
    forward_dense,
    gyro_dense,
    of_index,
    transition,
    weigh,
)
from landing_sim.estimators.width import WidthFilter, rescaled
from landing_sim.geometry.pinhole import Intrinsics
from landing_sim.geometry.so3 import from_euler
from landing_sim.signals import Command, Estimate, Measurement, Residuals
from landing_sim.types import Array

_ALL: np.ndarray = np.ones(3, dtype=np.bool_)  # readings of a sensor are not gated


class RunwayEkf:
    """The estimator (interfaces.Estimator): constants only, memory in, memory out.

    Parameters
    ----------
    belief : the aircraft as believed
    camera, lever : believed intrinsics [px] and camera place in body axes (3,) [m]
    width, slope : believed runway width [m] and slope [rad]
    """

    def __init__(
        self, config: FilterConfig, belief: AircraftBelief, camera: Intrinsics, lever: Array, width: float, slope: float
    ) -> None:
        self.config = config
        self.blocks = Blocks.of(config)
        self.names = tuple(states.NAMES[i] for i in self.blocks.index)
        self._width_filter = WidthFilter(config.airspeed_sigma) if config.width == "separate" else None
        if self._width_filter is not None:
            self.names = (*self.names, "W")
        self._par = parameters(belief, slope)
        self._focal = np.array([camera.f, camera.cx, camera.cy])
        self._lever = np.asarray(lever, dtype=float)
        self._width, self._slope = width, slope
        q = np.zeros(states.N)
        alone = config.kind != "augmented"
        q[:3] = np.square(config.q_velocity_alone if alone else config.q_velocity)
        q[:3] += (config.turbulence_velocity * config.turbulence) ** 2
        q[3:6] = np.square(config.q_rates)
        q[6:9] = config.q_attitude**2
        q[9:12] = config.q_position**2
        q[12:15] = np.square(config.q_wind)
        q[states.CX : states.CM + 1] = np.square(config.offset_drift * np.array(config.offset_sigma))
        q[states.WIDTH] = config.q_width**2
        self._keep = np.where(np.isin(self.blocks.index, (states.JPAN, states.JTILT)), 0.0, 1.0)
        self._noise_variance = np.where(self._keep == 0.0, config.encoder_noise**2, 0.0)
        # a filter that does not know of them takes the readings' errors for noise of the edges
        self._extra_R = 0.0 if states.JPAN in self.blocks.index else (camera.f * config.encoder_noise) ** 2
        ground = q.copy()
        ground[:3] = config.q_ground_velocity**2
        ground[3:6] = config.q_ground_rates**2
        start = q.copy()
        start[3:6] *= config.start_rates**2
        self._q = {name: d[self.blocks.index] for name, d in (("air", q), ("ground", ground), ("start", start))}
        self._wind = None  # (n, 3) where the covariance has the wind, if turbulence is reported
        if config.turbulence > 0.0:
            self._wind = np.equal.outer(self.blocks.index, states.WIND).astype(float)
        self._integrated = config.process_noise == "integrated"
        self._prior = self._prior_variance()
        self._gate = math.inf if config.gate_sigma is None else config.gate_sigma**2

    # ------------------------------------------------------------------------------------------- interface

    def init(self, t: float) -> Memory:
        x = np.zeros(states.N)
        x[states.WIDTH] = self._width
        n = len(self.blocks.index)
        return Memory(t, False, x, np.zeros(6), np.zeros((n, n)), None, width_variance=self.config.width_sigma**2)

    def predict(self, memory: Memory, command: Command, t: float) -> Memory:
        """To time t under `command` (eqs. 8, 9). Before the start attitude alone is reckoned."""
        dt = t - memory.t
        if dt <= 0.0:
            return memory
        u = np.array([command.elevator, command.aileron, command.rudder, command.throttle, command.flap])
        if not memory.valid:
            steady = thrust(command.throttle, memory.airspeed, self._par)
            shadow = np.array([*u[:3], command.flap, steady, 0.0])
            return memory._replace(t=t, shadow=shadow, x=reckoned(memory.x, memory.gyro, memory.airspeed, dt))
        phase = "ground" if memory.on_ground else "start" if memory.frames < self.config.start_frames else "air"
        told = (
            memory.x, memory.shadow, u, self._par, memory.on_ground, dt, self.blocks.index, self.blocks.starts,
            self._keep, self._q[phase], self._noise_variance, self._integrated,
        )  # fmt: skip
        if memory.D is None and self._wind is None:
            x, shadow, P = forward_dense(memory.P, *told)
            return Memory(t, memory.valid, x, shadow, P, *memory[5:])
        x, shadow, Phi, Qd = transition(*told)
        if self._wind is not None and not memory.on_ground:
            changes = change(x[states.H] - self._slope * x[states.X], self.config.turbulence, memory.airspeed, dt)
            Qd = Qd + np.diag(self._wind @ changes)
        P, D = memory.P, memory.D
        if D is None:
            P = kalman.predict_dense(P, Phi, Qd, self.blocks.starts)
        else:
            P, D = kalman.predict_ud(P, D, Phi, Qd, self.blocks.starts)
        return memory._replace(t=t, x=x, shadow=shadow, P=P, D=D)

    def update(self, memory: Memory, measurement: Measurement) -> Memory:
        """Take in one measurement at the memory's time (eqs. 10-12)."""
        match measurement.kind:
            case "edges":
                return self._edges(memory, measurement) if memory.valid else memory
            case "gyro":
                if not memory.valid:
                    return memory._replace(gyro=measurement.z)
                x, P, D = self._reading(memory, gyro_dense, gyro_model, measurement.z, measurement.R)
                return Memory(*memory[:2], x, memory.shadow, P, D, memory.airspeed, measurement.z, *memory[8:])  # type: ignore[arg-type]
            case "airspeed":
                z = float(measurement.z[0])
                if not memory.valid:
                    return memory._replace(airspeed=z)
                x, P, D = self._reading(memory, airspeed_dense, airspeed_model, z, measurement.R)
                return Memory(*memory[:2], x, memory.shadow, P, D, z, *memory[7:])  # type: ignore[arg-type]
            case "on_ground":
                down = bool(measurement.z[0] > 0.5)
                return memory if down == memory.on_ground else memory._replace(on_ground=down)
            case "pose":
                return self._start(memory, measurement)
        raise ValueError(f"the runway filter does not know measurements of kind {measurement.kind!r}")

    def read(self, memory: Memory, t: float | None = None) -> Estimate:
        """The estimate at the memory's time; an age `t` asked for is ignored (see Rewind)."""
        flags = {
            "threshold_in_view": memory.threshold_in_view,
            "on_ground": memory.on_ground,
            "lost": memory.misses >= self.config.lost_after,
            "reinflated": memory.reinflated > 0,
        }
        mean, cov = memory.x[self.blocks.index], None
        if memory.valid:
            cov = self._covariance(memory)
        if self._width_filter is not None:
            mean = np.append(mean, memory.x[states.WIDTH])
            if cov is not None:
                cov = np.pad(cov, (0, 1))
                cov[-1, -1] = memory.width_variance
        return Estimate(memory.t, self.names, mean, cov, memory.valid, flags, memory.residuals)

    # ------------------------------------------------------------------------------------------- start

    def _prior_variance(self) -> Array:
        c = self.config
        sd = np.zeros(states.N)
        sd[:3] = (2.0, 3.0, 2.0)
        sd[3:6] = 2.0 * RAD
        sd[6:9] = (2.0 * RAD, 2.0 * RAD, 2.0 * RAD)
        sd[9:12] = (40.0, 10.0, 5.0)
        sd[12:15] = c.wind_sigma
        if c.width == "separate":
            sd[states.WX] = 8.0  # m/s: a wrong width looks like wind along the track
        sd[states.CX : states.CM + 1] = c.offset_sigma
        sd[states.BP : states.BR + 1] = c.gyro_bias_sigma
        sd[[states.EPAN, states.ETILT]] = c.encoder_sigma
        sd[[states.JPAN, states.JTILT]] = c.encoder_noise
        sd[states.WIDTH] = c.width_sigma
        return np.square(sd)

    def _start(self, memory: Memory, m: Measurement) -> Memory:
        """From an acquired pose: velocity from the airspeed and the approach angle, rates from the gyros.

        A filter that flies blind takes a pose only if it is where it may be; the longer it is blind, the more may be.
        """
        c, idx = self.config, self.blocks.index
        x = memory.x.copy()
        pose = [states.X, states.Y, states.H, states.PHI, states.THETA, states.PSI]
        if memory.valid:
            rows = [int(np.flatnonzero(idx == state)[0]) for state in pose]
            off = m.z - x[pose]
            S = self._covariance(memory)[np.ix_(rows, rows)] + m.R
            if off @ np.linalg.solve(S, off) > c.pose_gate**2 * len(pose):
                return memory._replace(misses=memory.misses + 1)
        var = self._prior.copy()
        if not memory.valid:
            x[:] = 0.0
            x[states.WIDTH] = self._width
            theta = m.z[4]
            alpha = min(max(theta - c.approach_angle, -0.1), 0.2)
            x[states.U], x[states.W] = memory.airspeed * math.cos(alpha), memory.airspeed * math.sin(alpha)
            x[states.P : states.R + 1] = memory.gyro
            if any(c.wind):  # the air moves, and the aircraft with it
                x[states.WX : states.WX + 2] = c.wind
                x[states.U : states.W + 1] += np.array([*c.wind, 0.0]) @ from_euler(*m.z[3:])
        x[pose] = m.z
        P = np.diag(var)
        P[np.ix_(pose, pose)] = m.R
        # the encoder's errors are in the acquired attitude as well
        if states.EPAN in idx:
            for angle, errors in ((states.PSI, states.ENCODER[::2]), (states.THETA, states.ENCODER[1::2])):
                for error in errors:
                    P[angle, angle] += var[error]
                    P[angle, error] = P[error, angle] = var[error]
        if c.width == "state":  # the acquired lengths hold for the width they were acquired with
            scale = np.zeros(states.N)
            scale[[states.X, states.Y, states.H]] = m.z[:3] / x[states.WIDTH]
            scale[states.WIDTH] = 1.0
            P += var[states.WIDTH] * (np.outer(scale, scale) - np.diag(scale == 1.0))
        P = P[np.ix_(idx, idx)]
        for lo, hi in zip(self.blocks.starts, self.blocks.starts[1:]):
            P[lo:hi, :lo] = 0.0
            P[lo:hi, hi:] = 0.0
        shadow = memory.shadow
        if not memory.valid:
            alpha = math.atan2(x[states.W], x[states.U])
            shadow = shadow.copy()
            shadow[5] = downwash(x, alpha, shadow[3], self._par)
        start = memory._replace(valid=True, x=x, shadow=shadow, frames=0, misses=0, rejected=0.0)
        return self._with_covariance(start, P)

    # ------------------------------------------------------------------------------------------- updates

    def _covariance(self, memory: Memory) -> Array:
        return memory.P if memory.D is None else kalman.ud_product(memory.P, memory.D)

    def _with_covariance(self, memory: Memory, P: Array) -> Memory:
        if self.config.factorisation == "dense":
            return memory._replace(P=P, D=None)
        U, D = kalman.ud_factor(P)
        return memory._replace(P=U, D=D)

    def _correct(
        self, memory: Memory, Hn: Array, R: Array, nu: Array, use: np.ndarray
    ) -> tuple[Array, Array, Array | None, Array, float]:
        """x, P, D after an update with nu, R (m,), Hn (m, n); the step (n,) and the NIS."""
        index, starts = self.blocks.index, self.blocks.starts
        if memory.D is None:
            x, P, step, nis = correct_dense(memory.x, memory.P, index, starts, Hn, R, nu, use)
            return x, P, None, step, nis
        return correct_ud(memory.x, memory.P, memory.D, index, starts, Hn, R, nu, use)  # type: ignore[no-any-return]

    def _reading(
        self, memory: Memory, dense: Callable[..., Any], model: Callable[..., Any], z: Array | float, R: Array
    ) -> tuple[Array, Array, Array | None]:
        """x, P, D after a reading z of variance R, which `model` explains; `dense` is its kernel where P is dense."""
        if memory.D is None:
            x, P = dense(memory.x, memory.P, self.blocks.index, self.blocks.starts, z, R, _ALL)
            return x, P, None
        nu, Hx = model(memory.x, z)
        return self._correct(memory, of_index(Hx, self.blocks.index), R, nu, _ALL)[:3]

    def _edges(self, memory: Memory, m: Measurement) -> Memory:
        edges, c = m.geometry, self.config
        if edges is None:
            raise ValueError("a measurement of kind 'edges' needs its EdgeSet")
        starting = memory.frames < c.start_frames
        index, gate = self.blocks.index, math.inf if starting else self._gate
        told = (
            m.z, m.R, self._extra_R, gate, edges.feature, edges.status, edges.centre, edges.direction, edges.pan,
            edges.tilt, self._lever, self._focal, self._slope,
        )  # fmt: skip
        D = memory.D
        if D is None and not starting:
            x, P, innovation, status, nis, found, used, runway, threshold = edges_dense(
                memory.x, memory.P, index, self.blocks.starts, *told
            )
        else:
            cov = self._covariance(memory)
            nu, R, Hn, use, innovation, status, found, used, runway, threshold = weigh(memory.x, cov, index, *told)
            R_used = R * np.maximum(1.0, np.abs(nu) / (np.sqrt(R) * c.huber)) if starting else R
            x, P, D, step, nis = self._correct(memory, Hn, R_used, nu, use)
            for _ in range(c.start_iterations - 1 if starting else 0):
                # Huber: an edge far off at the current iterate counts less
                nu, R, Hn, *_ = weigh(x, cov, index, *told)
                R_used = R * np.maximum(1.0, np.abs(nu) / (np.sqrt(R) * c.huber))
                x, P, D, step, nis = self._correct(memory, Hn, R_used, nu + Hn @ step, use)
        misses = 0 if runway else memory.misses + 1  # a horizon alone tells no place
        residuals, rejected = Residuals(innovation, status, nis, used), self._rejected(memory, found, used)
        after = Memory(
            *memory[:2], x, memory.shadow, P, D, *memory[6:8], memory.frames + 1, misses, rejected, memory.on_ground,
            threshold, max(0, memory.reinflated - 1), residuals, memory.width_variance,
        )  # fmt: skip
        if self._width_filter is not None and threshold and not starting:
            after = self._widened(after, self._width_filter)
        return after if after.rejected <= c.watchdog_share else self._opened(after)

    def _widened(self, memory: Memory, second: WidthFilter) -> Memory:
        """The second filter's turn, and the scene rescaled to its width."""
        x = memory.x
        ground = math.sqrt(x[states.U] ** 2 + x[states.V] ** 2 + x[states.W] ** 2)
        row = int(np.flatnonzero(self.blocks.index == states.U)[0])
        variance = float(self._covariance(memory)[row, row])
        width, left = second.update(x[states.WIDTH], memory.width_variance, memory.airspeed, ground, variance)
        x = rescaled(x, width / x[states.WIDTH])
        x[states.WIDTH] = width
        return memory._replace(x=x, width_variance=left)

    def _rejected(self, memory: Memory, found: int, used: int) -> float:
        """The share of rejected edges, smoothed."""
        if found == 0:
            return memory.rejected
        return memory.rejected + ((found - used) / found - memory.rejected) / self.config.watchdog_memory

    def _opened(self, memory: Memory) -> Memory:
        """A filter that rejects what it sees is the one that is wrong: open up and start over from here."""
        P = self._covariance(memory) + np.diag(0.25 * self._prior[self.blocks.index])
        opened = memory._replace(rejected=0.0, frames=self.config.start_frames - 5, reinflated=16)
        return self._with_covariance(opened, P)
