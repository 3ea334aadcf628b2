"""From an aircraft's linear models to scheduled gains, feed-forwards and a printable report.

The models come in as plain arrays; whoever owns the flight model linearises it. Everything is computed once, before the
flight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from landing_sim.control.eigenstructure import (
    Achieved,
    DesignError,
    Margins,
    Mode,
    Solution,
    achieved,
    follow,
    margins,
    prescribed_gain,
)
from landing_sim.control.settings import AxisSettings, ControlSettings
from landing_sim.types import Array

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H")
INPUTS = ("elevator", "thrust", "aileron", "rudder")
LONGITUDINAL = ("u", "w", "q", "theta", "H", "int_V", "int_H")
LATERAL = ("v", "p", "r", "phi", "psi", "y")


@dataclass(frozen=True, slots=True)
class LinearModel:
    """The aircraft near one steady descent or climb: x' = A (x - state) + B (u - inputs), STATES and INPUTS, SI, rad."""

    airspeed: float  # [m/s] true
    flight_path: float  # [rad] > 0 climbing
    mass: float  # [kg]
    state: Array  # (12,)
    inputs: Array  # (4,) elevator, thrust [N] of all engines, aileron, rudder
    A: Array  # (12, 12)
    B: Array  # (12, 4)

    @staticmethod
    def straight(
        airspeed: float,
        flight_path: float,
        mass: float,
        alpha: float,
        elevator: float,
        thrust: float,
        A: Array,
        B: Array,
    ) -> LinearModel:
        """About steady straight flight with wings level."""
        state = np.zeros(len(STATES))
        state[0], state[2] = airspeed * math.cos(alpha), airspeed * math.sin(alpha)
        state[7] = alpha + flight_path
        return LinearModel(airspeed, flight_path, mass, state, np.array([elevator, thrust, 0.0, 0.0]), A, B)


@dataclass(frozen=True)
class AxisDesign:
    """One half of the aircraft at one trim point. What has become of it is worked out when asked for: no flight does."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    A: Array
    B: Array
    K_d: Array  # prescribed eigenstructure alone
    solution: Solution
    wanted: tuple[Mode, ...]
    scale: Array  # typical sizes of the states
    authority: Array  # of the inputs
    delay: float  # [s] of the loop
    lags: tuple[float, ...]  # [s] of the actuators

    @cached_property
    def modes(self) -> tuple[Achieved, ...]:
        return achieved(self.A, self.B, self.solution.K, self.wanted, self.states, self.scale)

    @cached_property
    def open_loop(self) -> np.ndarray:
        """Eigenvalues without the integrals and positions."""
        physical = [k for k, name in enumerate(self.states) if name not in ("y", "H", "psi", "int_V", "int_H")]
        return np.linalg.eigvals(self.A[np.ix_(physical, physical)])

    @cached_property
    def margins(self) -> Margins:
        return margins(self.A, self.B, self.solution.K, self.delay, self.lags, self.inputs, self.authority)


@dataclass(frozen=True, slots=True)
class PointDesign:
    """Gains and feed-forwards at one trim point.

    sideslip: steady phi, aileron, rudder [rad] for 1 m/s of sideways airspeed v; turn: aileron, rudder for 1 rad/s of
    yaw rate without sideslip; pull: w [m/s], elevator [rad] for 1 rad/s of steady pitch rate.
    """

    model: LinearModel
    longitudinal: AxisDesign
    lateral: AxisDesign
    sideslip: Array  # (3,)
    turn: Array  # (2,)
    pull: Array  # (2,)


@dataclass(frozen=True, slots=True)
class Design:
    """A landing controller's gains over its trim points, slowest last in the order given."""

    settings: ControlSettings
    points: tuple[PointDesign, ...]

    def at(self, airspeed: float) -> PointDesign:
        """The trim point nearest to `airspeed` [m/s]."""
        return min(self.points, key=lambda p: abs(p.model.airspeed - airspeed))


def design(settings: ControlSettings, models: Sequence[LinearModel]) -> Design:
    """Gains for every trim point of `settings`, from its linear model (same order).

    Raises     DesignError if a model does not belong to its trim point or a gain cannot be had
    """
    if len(models) != len(settings.trim_points):
        raise DesignError(f"{len(settings.trim_points)} trim points but {len(models)} linear models")
    points = []
    for wanted, model in zip(settings.trim_points, models):
        if abs(model.airspeed - wanted.airspeed_mps) > 0.5:
            raise DesignError(
                f"the model is for {model.airspeed:.1f} m/s, the trim point {wanted.airspeed_mps:.1f} m/s"
            )
        if model.A.shape != (12, 12) or model.B.shape != (12, 4):
            raise DesignError(f"A must be 12 x 12 and B 12 x 4, not {model.A.shape} and {model.B.shape}")
        points.append(_point(settings, model))
    return Design(settings, tuple(points))


def _point(settings: ControlSettings, model: LinearModel) -> PointDesign:
    elevator, aileron, rudder = (
        a.lag_s + a.smoothing_s for a in (settings.elevator, settings.aileron, settings.rudder)
    )
    lags = (elevator, settings.thrust.lag_s, aileron, rudder)
    A, B = longitudinal_model(model)
    longitudinal = _axis(settings.longitudinal, A, B, LONGITUDINAL, INPUTS[:2], settings.loop_delay_s, lags[:2])
    A, B = lateral_model(model)
    lateral = _axis(settings.lateral, A, B, LATERAL, INPUTS[2:], settings.loop_delay_s, lags[2:])
    return PointDesign(model, longitudinal, lateral, *_feedforwards(model))


def longitudinal_model(model: LinearModel) -> tuple[Array, Array]:
    """A (7, 7), B (7, 2) of LONGITUDINAL: the integrals are of airspeed and height."""
    rows = [STATES.index(name) for name in LONGITUDINAL[:5]]
    A, B = np.zeros((7, 7)), np.zeros((7, 2))
    A[:5, :5], B[:5] = model.A[np.ix_(rows, rows)], model.B[np.ix_(rows, [0, 1])]
    alpha = math.atan2(model.state[2], model.state[0])
    A[5, 0], A[5, 1], A[6, 4] = math.cos(alpha), math.sin(alpha), 1.0
    return A, B


def lateral_model(model: LinearModel) -> tuple[Array, Array]:
    """A (6, 6), B (6, 2) of LATERAL."""
    rows = [STATES.index(name) for name in LATERAL]
    return model.A[np.ix_(rows, rows)], model.B[np.ix_(rows, [2, 3])]


def _axis(
    axis: AxisSettings,
    A: Array,
    B: Array,
    states: tuple[str, ...],
    inputs: tuple[str, ...],
    delay: float,
    lags: tuple[float, ...],
) -> AxisDesign:
    modes = tuple(Mode(m.name, complex(m.real, m.imag), m.shape) for m in axis.modes)
    scale = _by_name(axis.typical, states, "typical")
    tolerance = _by_name({**axis.typical, **axis.tolerance}, states, "tolerance")
    authority = _by_name(axis.authority, inputs, "authority")
    authority = np.where([name == "thrust" for name in inputs], authority, np.radians(authority))
    K_d = prescribed_gain(A, B, modes, states, scale)
    weight = np.diag(authority**-2)
    # In scaled states the Riccati equation is well conditioned.
    S = np.diag(scale)
    scaled = follow(A / scale[:, None] * scale, B / scale[:, None], K_d @ S, weight,
                    np.diag((scale / tolerance) ** 2), weight, axis.rho)  # fmt: skip
    solution = Solution(scaled.K / scale, scaled.P / scale[:, None] / scale, scaled.residual)
    return AxisDesign(states, inputs, A, B, K_d, solution, modes, scale, authority, delay, lags)


def _by_name(values: dict[str, float], names: tuple[str, ...], what: str) -> Array:
    if set(values) != set(names):
        raise DesignError(f"{what} must name exactly {', '.join(names)}; got {', '.join(values)}")
    return np.array([values[name] for name in names])


def _feedforwards(model: LinearModel) -> tuple[Array, Array, Array]:
    """sideslip (3,), turn (2,), pull (2,) of PointDesign: steady solutions of the linear model."""

    def steady(rows: str, unknown: str, inputs: list[int], given: str) -> Array:
        r = [STATES.index(name) for name in rows.split()]
        M = np.hstack(
            [model.A[np.ix_(r, [STATES.index(name) for name in unknown.split()])], model.B[np.ix_(r, inputs)]]
        )
        return np.asarray(np.linalg.solve(M, -model.A[r, STATES.index(given)]), np.float64)

    sideslip = steady("v p r", "phi", [2, 3], "v")
    turn = steady("v p r", "phi", [2, 3], "r")[1:]
    return sideslip, turn, steady("w q", "w", [0], "q")


# ------------------------------------------------------------------------------------------------------------- report


def design_dict(result: Design) -> dict[str, Any]:
    """The design as plain numbers and strings (angles in deg where the key says so), ready for JSON."""
    return {"trim_points": [_point_dict(point) for point in result.points]}


def _point_dict(point: PointDesign) -> dict[str, Any]:
    m = point.model
    return {
        "airspeed_mps": m.airspeed,
        "flight_path_deg": math.degrees(m.flight_path),
        "mass_kg": m.mass,
        "alpha_deg": math.degrees(math.atan2(m.state[2], m.state[0])),
        "theta_deg": math.degrees(m.state[7]),
        "elevator_deg": math.degrees(m.inputs[0]),
        "thrust_n": float(m.inputs[1]),
        "longitudinal": _axis_dict(point.longitudinal),
        "lateral": _axis_dict(point.lateral),
    }


def _axis_dict(axis: AxisDesign) -> dict[str, Any]:
    def pair(value: complex) -> list[float]:
        return [float(value.real), float(value.imag)]

    return {
        "states": list(axis.states),
        "inputs": list(axis.inputs),
        "open_loop": [pair(v) for v in axis.open_loop if v.imag >= 0.0],
        "modes": [
            {
                "name": mode.name,
                "wanted": pair(mode.wanted),
                "achieved": pair(mode.eigenvalue),
                "shape_error": mode.shape_error,
                "vector_abs": np.abs(mode.vector).tolist(),
                "vector_angle_deg": np.degrees(np.angle(mode.vector)).tolist(),
            }
            for mode in axis.modes
        ],
        "K_d": axis.K_d.tolist(),
        "K": axis.solution.K.tolist(),
        "riccati_residual": axis.solution.residual,
        "stable": axis.margins.stable,
        "max_sensitivity": axis.margins.max_sensitivity,
        "margins": [
            {
                "loop": loop.loop,
                "gain_up": None if math.isinf(loop.gain_up) else float(loop.gain_up),
                "gain_down": float(loop.gain_down),
                "phase_deg": math.degrees(loop.phase),
                "delay_s": None if math.isinf(loop.delay) else float(loop.delay),
                "crossover_rad_s": float(loop.crossover),
            }
            for loop in axis.margins.loops
        ],
    }


def design_report(result: Design, title: str = "") -> str:
    """The design as text for a terminal: trim, modes wanted and achieved, gains, margins."""
    s = result.settings
    lines = [title, "=" * len(title), ""] if title else []
    for point in result.points:
        d = _point_dict(point)
        lines += [
            f"{d['airspeed_mps']:.1f} m/s, flight path {d['flight_path_deg']:+.1f} deg, {d['mass_kg']:.0f} kg",
            f"  trim    alpha {d['alpha_deg']:+.2f} deg  theta {d['theta_deg']:+.2f} deg  "
            f"elevator {d['elevator_deg']:+.2f} deg  thrust {d['thrust_n'] / 1e3:.2f} kN",
        ]
        for name, axis, rho in (
            ("longitudinal", point.longitudinal, s.longitudinal.rho),
            ("lateral", point.lateral, s.lateral.rho),
        ):
            lines += _axis_lines(name, axis, rho, s.loop_delay_s)
        lines.append("")
    return "\n".join(lines)


def _axis_lines(name: str, axis: AxisDesign, rho: float, delay: float) -> list[str]:
    unaided = ", ".join(_root(v) for v in sorted(axis.open_loop, key=abs) if v.imag >= 0.0)
    lines = [f"  {name}, rho {rho:g}", f"    unaided {unaided}",
             f"    {'mode':<14}{'wanted':>16}{'achieved':>16}{'zeta':>7}  shape error  vector"]  # fmt: skip
    for mode in axis.modes:
        largest = np.abs(mode.vector).max()
        vector = "  ".join(
            f"{state} {abs(c):.3g}" for state, c in zip(axis.states, mode.vector) if abs(c) > 0.01 * largest
        )
        zeta = -mode.eigenvalue.real / abs(mode.eigenvalue)
        lines.append(f"    {mode.name:<14}{_root(mode.wanted):>16}{_root(mode.eigenvalue):>16}{zeta:>7.2f}"
                     f"{mode.shape_error:>11.2f}    {vector}")  # fmt: skip
    lines.append(f"    {'gain':<14}" + "".join(f"{state:>11}" for state in axis.states))
    for label, row in zip(axis.inputs, axis.solution.K):
        unit = "N" if label == "thrust" else "rad"
        lines.append(f"    {label + ' [' + unit + ']':<14}" + "".join(f"{k:>11.4g}" for k in row))
    m = axis.margins
    lines.append(
        f"    margins with {delay * 1e3:.0f} ms and actuator lags in the loop: "
        f"{'stable' if m.stable else 'UNSTABLE'}, max sensitivity {m.max_sensitivity:.2f}"
    )
    for loop in m.loops:
        lines.append(
            f"      {loop.loop:<10} gain x{loop.gain_down:.2f} .. x{loop.gain_up:.1f}   phase "
            f"{math.degrees(loop.phase):.0f} deg   delay {loop.delay:.2f} s   crossover {loop.crossover:.2f} rad/s"
        )
    return lines


def _root(value: complex) -> str:
    return f"{value.real:.2f}" if abs(value.imag) < 1e-9 else f"{value.real:.2f} ± {abs(value.imag):.2f}j"
