"""Optic-flow observers: equations against differences, the discrete form against the differential one, degenerate cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landing_sim.estimators.optic_flow import lpv
from landing_sim.estimators.optic_flow.contract import FlowState, Push
from landing_sim.estimators.optic_flow.dynamics import Lander
from landing_sim.estimators.optic_flow.geometry import flow, fusion, left_inverse, outputs
from landing_sim.estimators.optic_flow.kalman import FlowEkf, FlowUkf
from landing_sim.estimators.optic_flow.lpv_observer import PUBLISHED, SHIPPED, LpvObserver
from landing_sim.estimators.optic_flow.reference import Reference, reference
from landing_sim.papers import sabiron_checks as check
from landing_sim.papers.sabiron_trials import ANGLES, BELIEVED, DEVIATION, UNITS

REF = reference()
SPREAD = (100.0, *np.radians([0.2, 0.3, 0.3, 4.0]))


def test_flow_is_the_turning_of_a_ground_point() -> None:
    assert check.flow_error() < 1e-8


def test_flow_by_hand() -> None:
    """Level, 100 m high, 10 m/s along, 5 m/s down: straight down 0.1 rad/s; at 135 deg also what comes nearer."""
    X = np.array([100.0, 0.02, 0.1, -0.05, 0.0])
    assert flow(X, math.pi / 2) == pytest.approx(0.1 - 0.02)
    assert flow(X, math.radians(135.0)) == pytest.approx(0.05 + 0.025 - 0.02)


def test_fusion_is_exact_and_the_printed_forms_are_not() -> None:
    assert check.fusion_error("corrected") < 1e-12
    assert check.fusion_error("(7)") == pytest.approx(0.5)
    assert check.fusion_error("(8)") == pytest.approx(0.5)


def test_more_sensors_than_needed() -> None:
    angles = np.radians([80.0, 100.0, 120.0, 145.0, 160.0])
    X = REF.state(20.0)
    assert left_inverse(angles) @ [flow(X, a) for a in angles] == pytest.approx(outputs(X), abs=1e-12)


@pytest.mark.parametrize("angles", [[90.0, 120.0], [90.0, 90.0, 160.0], [90.0, 270.0, 120.0]])
def test_directions_that_do_not_tell_rotation_from_translation(angles: list[float]) -> None:
    with pytest.raises(ValueError, match="do not tell"):
        left_inverse(np.radians(angles))


def test_linear_model_against_differences() -> None:
    assert check.jacobian_error() < 1e-6
    assert check.c2_rate_error() < 1e-6
    assert check.determinant_error() < 1e-12


def test_reference() -> None:
    assert REF.state(0.0) * UNITS == pytest.approx([1496.0, -0.92, 2.18, -1.72, -53.43], abs=1e-9)
    h, q, wx, wz, theta = REF.state(1e3)
    assert (h, h * wx, h * wz) == pytest.approx((10.0, 0.0, -1.0), abs=0.01)
    assert abs(theta) < 1e-6 and abs(q) < 1e-4
    assert REF.table[-1, 7] == pytest.approx(758.0 - 32.7, abs=0.05)
    step = 1e-3  # the table's rows belong together: X*' = f(X*, u*)
    for t in (3.0, 20.0, 40.0):
        row = REF.at(t)
        by_differences = (REF.state(t + step) - REF.state(t - step)) / (2.0 * step)
        assert check.rates(row[:5], row[5], row[6]) == pytest.approx(by_differences, rel=1e-4, abs=1e-5)


def watch_linear(observer: LpvObserver, dt: float, end: float) -> FlowState:
    """The observer beside a truth that is the linear model itself."""
    state = observer.start(0.0, REF.state(0.0) + BELIEVED)
    truth = FlowState(0.0, REF.state(0.0) + DEVIATION, state.P)
    C = np.empty((3, 5))

    def flows() -> np.ndarray:
        X = REF.state(truth.t)
        lpv.output_matrix(X, C)
        return fusion(ANGLES) @ (outputs(X) + C @ (truth.X - X))

    for k in range(round(end / dt)):
        row = REF.at((k + 0.5) * dt)
        push = Push(row[5], row[6])
        state = observer.fuse(state, ANGLES, flows(), 0.5 * dt)
        state, truth = observer.predict(state, push, dt), observer.predict(truth, push, dt)
        state = observer.fuse(state, ANGLES, flows(), 0.5 * dt)
    return state


@pytest.mark.parametrize(("gains", "step"), [(SHIPPED, 5e-5), (PUBLISHED, 5e-5)])
def test_discrete_form_solves_the_papers_equations(gains, step) -> None:
    """Against (18) and (19) stepped 50 us at a time in the coordinates Xbar, where the paper has them."""
    end = 0.5
    dX, S, lost = check.observer_equations(gains, end, step=step)
    ours = watch_linear(LpvObserver(REF, gains), 0.002, end)
    first = np.abs(BELIEVED - DEVIATION) * UNITS + [0.0, 0.2, 0.1, 0.0, 0.0]
    assert ((ours.X - REF.state(ours.t)) - dX) * UNITS == pytest.approx(np.zeros(5), abs=0.02 * float(first.max()))
    assert np.all(np.abs((ours.X - REF.state(ours.t)) - dX)[2:] * UNITS[2:] < 0.02 * first[2:])
    S_km = S / np.outer(lpv.SCALE, lpv.SCALE)
    assert LpvObserver(REF, gains).barred_information(ours) == pytest.approx(
        S_km, rel=0.02, abs=0.02 * np.max(np.diag(S))
    )
    assert math.isinf(lost)


def test_printed_riccati_equation_loses_definiteness_at_once() -> None:
    assert check.observer_equations(PUBLISHED, 0.05, symmetric=False)[2] < 0.02


OBSERVERS = (LpvObserver(REF, spread=SPREAD), FlowEkf(), FlowUkf())


@pytest.mark.parametrize("observer", OBSERVERS, ids=lambda o: type(o).__name__)
def test_sensor_by_sensor(observer) -> None:
    """Sparse looks, one sensor at a time, lead to the truth; P stays symmetric, positive, and shrinks."""
    X = REF.state(0.0) + 0.3 * DEVIATION
    state = observer.start(0.0, REF.state(0.0))
    first = state.P
    truth = FlowEkf().start(0.0, X)
    for k in range(1200):
        row = REF.at((k + 0.5) * 0.01)
        push = Push(row[5], row[6])
        truth, state = FlowEkf().predict(truth, push, 0.01), observer.predict(state, push, 0.01)
        if k % 10 == 0:
            alpha = ANGLES[k // 10 % 3]
            state = observer.look(state, alpha, flow(truth.X, alpha), math.radians(0.05))
            assert state.used
    error = np.abs(state.X - truth.X) * UNITS
    assert (error < [25.0, 0.03, 0.06, 0.06, 0.8]).all()
    assert np.allclose(state.P, state.P.T, rtol=0, atol=1e-15) and np.linalg.eigvalsh(state.P)[0] > 0.0
    assert np.trace(state.P[2:, 2:]) < 0.2 * np.trace(first[2:, 2:])


@pytest.mark.parametrize("observer", OBSERVERS, ids=lambda o: type(o).__name__)
def test_a_wild_flow_is_not_believed(observer) -> None:
    state = observer.start(0.0, REF.state(0.0))
    after = observer.look(state, ANGLES[1], flow(state.X, ANGLES[1]) + math.radians(40.0), math.radians(0.1))
    assert not after.used and (after.X == state.X).all() and (after.P == state.P).all()


def test_hover_is_sat_out() -> None:
    """Where C2 cannot be inverted the LPV observer neither forgets nor learns, and nothing becomes NaN."""
    table = np.repeat(REF.table[-1:], 200, axis=0)
    table[:, 3] = np.linspace(math.radians(-1.0), math.radians(1.0), 200)
    observer = LpvObserver(Reference(Lander(), 0.005, table), spread=SPREAD)
    state = observer.start(0.0, table[0, :5])
    used = []
    for _ in range(90):
        state = observer.predict(state, Push(table[0, 5], 0.0), 0.01)
        state = observer.look(state, ANGLES[1], 0.03, math.radians(0.1))
        used.append(state.used)
    assert np.isfinite(state.X).all() and np.isfinite(state.P).all()
    assert not any(used[30:65]) and any(used[:20])


def test_known_thrust_beside_the_reference_is_taken_into_account() -> None:
    """An LPV prediction under another thrust and torque is that of eq. (2), as far as it is linear."""
    X = REF.state(10.0)
    observer = LpvObserver(REF, spread=SPREAD)
    state, truth = observer.start(10.0, X), FlowEkf().start(10.0, X)
    for k in range(50):
        row = REF.at(10.0 + (k + 0.5) * 0.01)
        push = Push(row[5] + 0.05, row[6] + 2e-3)
        state, truth = observer.predict(state, push, 0.01), FlowEkf().predict(truth, push, 0.01)
    moved = truth.X - REF.state(10.5)
    assert state.X - REF.state(10.5) == pytest.approx(moved, rel=0.02, abs=1e-7)
    assert abs(moved[1]) > 5e-4
