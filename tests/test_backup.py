"""When the inertial unit dies: faults as the scenario has them, flow of the field, the filter alone, giving up in doubt."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import filter_bench as bench
import numpy as np
import pytest
from flights import fly

from landing_sim import scenario, vehicle
from landing_sim.control.go_around import DoubtfulGuidance, Limits
from landing_sim.control.guidance import LandingGuidance
from landing_sim.errors import ScenarioError
from landing_sim.estimators import states
from landing_sim.estimators.optic_flow.aircraft import FieldFlowFrontEnd, aircraft_flow
from landing_sim.estimators.optic_flow.aircraft_backup import BackupEkf, BackupMemory
from landing_sim.estimators.readings import Fresh
from landing_sim.estimators.runway_filter import FilterConfig
from landing_sim.geometry.so3 import from_euler
from landing_sim.missions.failing import with_faults
from landing_sim.noise import Noise
from landing_sim.sections.faults import Fault
from landing_sim.sensors.inertial import Gyro, GyroConfig
from landing_sim.sensors.optic_flow import FlowReading, MotionSensor, MotionSensorConfig
from landing_sim.sensors.optic_flow_edges import EdgeConfig
from landing_sim.signals import CameraTruth, Estimate, Measurement, Sample, Truth
from landing_sim.world.field import Field, FieldConfig

RAD = math.radians(1.0)
NOWHERE = CameraTruth(np.zeros(3), np.eye(3), 0.0, 0.0)


def truth(t: float, p: tuple[float, float, float], theta: float = 0.0) -> Truth:
    zero = np.zeros(3)
    R = from_euler(0.0, theta, 0.0)
    return Truth(
        *(0, t, np.array(p), R, zero, np.array([0.01, 0.02, 0.03]), zero, zero, 0.0, 0.0, 0.0, np.zeros(4)),
        *(0.0, zero, zero > 1.0, 0.0),
    )


# --------------------------------------------------------------------------------------------------- flow of the ground


def state(**values: float) -> np.ndarray:
    x = np.zeros(states.N)
    for name, value in values.items():
        x[states.NAMES.index(name)] = value
    return x


@pytest.mark.parametrize(
    ("values", "alpha", "expected"),
    [
        # 50 m/s, level, 40 m up, 30 deg down: V/h sin^2 = 1.25 * 0.25
        ({"u": 50.0, "H": 40.0}, 30.0, 0.3125),
        # turning nose up at 0.1 rad/s besides: everything moves down by as much
        ({"u": 50.0, "H": 40.0, "q": 0.1}, 30.0, 0.4125),
        # sinking at 3 m/s as well: less by w/h sin a cos a = 0.075 * 0.4330127
        ({"u": 50.0, "w": 3.0, "H": 40.0}, 30.0, 0.3125 - 0.0324760),
        # nose 10 deg up and flying along it, 30 deg under the nose is 20 under the horizon: V/h sin 30 sin 20
        ({"u": 50.0, "H": 40.0, "theta": 10.0 * RAD}, 30.0, 1.25 * 0.5 * 0.3420201),
        # on a descent straight along the line of sight nothing moves
        ({"u": 50.0 * math.cos(0.2), "w": 50.0 * math.sin(0.2), "H": 40.0}, 0.2 / RAD, 0.0),
    ],
)
def test_flow_by_hand(values: dict[str, float], alpha: float, expected: float) -> None:
    assert aircraft_flow(state(**values), alpha * RAD, np.empty(states.N)) == pytest.approx(expected, abs=1e-6)


def tilted() -> np.ndarray:
    return state(u=48.0, v=2.0, w=3.5, p=0.1, q=-0.07, r=0.05, phi=0.2, theta=0.06, psi=0.3, x=-700.0, y=5.0, H=41.0)


@pytest.mark.parametrize("alpha", [0.12, 0.3, 1.2])
def test_flow_is_that_of_geometry(alpha: float) -> None:
    """The angle under the nose of the ground point that is seen, differenced over the body's motion in six degrees."""
    x = tilted()
    R_RB = from_euler(*x[states.PHI : states.PSI + 1])
    d = R_RB @ [math.cos(alpha), 0.0, math.sin(alpha)]
    point = d * x[states.H] / d[2]  # from the eye
    v, w = R_RB @ x[:3], x[3:6]

    def angle(dt: float) -> float:
        turn = np.eye(3) + dt * np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        seen = (R_RB @ turn).T @ (point - v * dt)
        return math.atan2(seen[2], seen[0])

    h = 1e-5
    moved = (angle(h) - angle(-h)) / (2.0 * h)
    assert aircraft_flow(x, alpha, np.empty(states.N)) == pytest.approx(moved, abs=1e-8)


def test_flow_jacobian() -> None:
    x, alpha, row, nothing = tilted(), 0.3, np.empty(states.N), np.empty(states.N)
    aircraft_flow(x, alpha, row)
    for i in range(states.N):
        h = np.zeros(states.N)
        h[i] = 1e-4 if i in (states.U, states.W, states.H) else 1e-6
        slope = (aircraft_flow(x + h, alpha, nothing) - aircraft_flow(x - h, alpha, nothing)) / (2.0 * h[i])
        assert row[i] == pytest.approx(slope, abs=1e-6), states.NAMES[i]
    assert np.count_nonzero(row) == 6


# ------------------------------------------------------------------------------------------------------ the sensor


@pytest.fixture(scope="module")
def field() -> Field:
    return Field(FieldConfig(), Noise(5, "field"))


def rig(field: Field, speed: float, height: float, down_deg: float, seconds: float, **changes: float) -> np.ndarray:
    """[rad/s] all that a sensor says, looking down_deg below the horizon from an aircraft whose nose hangs by 3 deg."""
    theta = -3.0 * RAD
    edges = EdgeConfig(spacing=0.1 * RAD)
    config = MotionSensorConfig(0.04, down_deg * RAD + theta, level=90.0, rate=250.0, edges=edges, **changes)
    sensor, said = MotionSensor("flow_1", config, field, Noise(1, "flow_1")), []
    for k in range(round(seconds / 0.04)):
        sample = sensor.sense(truth(k * 0.04, (-2000.0 + speed * k * 0.04, 3.0, -height), theta), NOWHERE)
        said += list(sample.data.flows) if sample is not None else []
    return np.array(said)


@pytest.mark.parametrize(("speed", "height", "down"), [(66.0, 200.0, 18.0), (66.0, 60.0, 10.0), (50.0, 45.0, 15.0)])
def test_the_field_moves_as_fast_as_it_does(field: Field, speed: float, height: float, down: float) -> None:
    """Bias <= 2 %, robust spread <= 5 %, outliers <= 5 % of V/h sin^2, 1 to 5 deg/s."""
    true = speed / height * math.sin(down * RAD) ** 2
    assert 1.0 < true / RAD < 5.0
    error = rig(field, speed, height, down, 6.0) / true - 1.0
    assert len(error) >= 8
    assert abs(np.median(error)) <= 0.02
    assert 1.4826 * np.median(np.abs(error - np.median(error))) <= 0.05
    assert np.mean(np.abs(error) > 0.3) <= 0.05


def test_a_dark_field_says_nothing(field: Field) -> None:
    assert len(rig(field, 50.0, 20.0, 15.0, 2.0, blind=24.0)) == 0
    assert len(rig(field, 50.0, 40.0, 0.5, 2.0)) == 0  # at the horizon there is haze


def test_the_same_seed_is_the_same_field() -> None:
    places = np.array([-100.3, 5.0]), np.array([2.0, 7.7])
    same, again, other = (Field(FieldConfig(), Noise(s, "field")).brightness(*places, 0.3) for s in (1, 1, 2))
    assert (same == again).all()
    assert (same != other).all()
    with pytest.raises(ValueError, match="contrast"):
        Field(FieldConfig(0.0), Noise(1, "field"))


def test_front_end_passes_on_what_is_valid() -> None:
    front_end = FieldFlowFrontEnd("flow_1", 0.2, 0.1 * RAD, 0.02, 0.5 * RAD, 10.0 * RAD, 30.0, 0.5)
    flows = tuple(w * RAD for w in (0.3, 2.0, -3.0, 11.0, 4.0))
    sample = Sample("flow_1", 10.0, 10.0, FlowReading(0.2, flows, (9.9, 9.8, 9.9, 9.9, 9.4), (0.0, 0.0, 0.0)))

    def at(height: float, valid: bool = True) -> Estimate:
        return Estimate(10.0, ("H",), np.array([height]), None, valid)

    said = front_end.process(sample, lambda: at(31.0))
    assert [(m.kind, m.t_valid, round(m.z[1] / RAD, 6)) for m in said] == [("flow", 9.8, 2.0), ("flow", 9.9, -3.0)]
    assert math.sqrt(said[1].R[1]) == pytest.approx((0.1 + 0.02 * 3.0) * RAD)
    # over a row of 0.5 deg at 2 deg/s, 0.25 s, a flow of 60 deg/s^3 differs from its mean by 0.15625 deg/s
    gusty = replace(front_end, row=0.5 * RAD, unsteady=60.0 * RAD).process(sample, lambda: at(31.0))
    assert math.sqrt(gusty[0].R[1]) == pytest.approx(math.hypot(0.14, 0.15625) * RAD)
    assert front_end.process(sample, lambda: at(29.0)) == ()
    assert front_end.process(sample, lambda: at(31.0, valid=False)) == ()


# ----------------------------------------------------------------------------------------------------------- faults

HEAD = "schema_version: 1\nmission: runway_landing\nfaults:\n"
MISTAKES = {
    "unknown sensor": ("  - {sensor: gyros, kind: off}", r"4:14: faults.0.sensor: no sensor 'gyros' here .*'gyro'"),
    "unknown kind": ("  - {sensor: gyro, kind: of}", r"4:26: faults.0.kind: must be .* \(did you mean 'off'\?\)"),
    "key of another kind": ("  - {sensor: gyro, kind: off, loss: 0.5}", r"4:37: faults.0.loss: belongs to kind interm"),
    "no spread": ("  - {sensor: gyro, kind: garbage}", r"4:26: faults.0.kind: garbage needs a spread"),
    "spread of pixels": ("  - {sensor: camera, kind: garbage, spread: 1}", r"4:45: faults.0.spread: random pixels"),
    "wrong by nothing": ("  - {sensor: gyro, kind: wrong}", r"4:26: faults.0.kind: wrong needs a bias other than 0"),
    "slow by nothing": ("  - {sensor: gyro, kind: slow}", r"4:26: faults.0.kind: slow needs factor"),
    "begins twice": (
        "  - {sensor: gyro, kind: off, start_s: 2, below_height_m: 20}",
        r"4:59: faults.0.below_height_m: it begins once: leave out this or start_s",
    ),
    "ends before": ("  - {sensor: gyro, kind: off, start_s: 5, end_s: 4}", r"4:50: faults.0.end_s: is not after start"),
    "ends at a time": (
        "  - {sensor: gyro, kind: off, from_x_m: -600, end_s: 4}",
        r"4:54: faults.0.end_s: with from_x_m give for_s",
    ),
    "image with a scale": ("  - {sensor: camera, kind: wrong, scale: 2}", r"4:28: faults.0.kind: an image has no bias"),
    "second of two": ("  - {sensor: gyro, kind: off}\n  - {sensor: flow_1, kind: off}", r"5:14: faults.1.sensor"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_in_faults_are_named_with_their_place(case: str, tmp_path: Path) -> None:
    text, expected = MISTAKES[case]
    (tmp_path / "s.yaml").write_text(HEAD + text + "\n")
    with pytest.raises(ScenarioError, match=rf"s.yaml:{expected}") as error:
        scenario.load(tmp_path / "s.yaml")
    assert len(error.value.problems) == 1


def test_a_fault_can_be_changed_from_outside() -> None:
    """What `--set` and a campaign do."""
    s = scenario.load("do128/inertial_off", ["faults.0.from_x_m=-200"])
    assert (s.faults[0].sensor, s.faults[0].kind, s.faults[0].from_x_m) == ("inertial", "off", -200.0)


def gyro() -> Gyro:
    return Gyro(GyroConfig(0.06, noise=0.001, bias=(0.0, 0.0, 0.0)), Noise(1, "gyro"))


def heard(*faults: dict[str, object], heights: list[float]) -> list[float]:
    """q as the faulty gyro says it, NaN for nothing, at these heights, 0.06 s apart."""
    (sensor,) = with_faults([gyro()], [Fault(**f) for f in faults], lambda n: Noise(1, n), {"inertial": ("gyro",)})
    samples = [sensor.sense(truth(0.06 * k, (-10.0 * h, 0.0, -h)), NOWHERE) for k, h in enumerate(heights)]
    return [math.nan if s is None else float(s.data[1]) for s in samples]


def test_a_fault_begins_where_the_aircraft_is_and_once() -> None:
    heights = [50.0, 31.0, 29.0, 31.0, 20.0]
    lost = heard({"sensor": "inertial", "kind": "off", "below_height_m": 30.0}, heights=heights)
    assert np.isnan(lost).tolist() == [False, False, True, True, True]
    passed = heard({"sensor": "gyro", "kind": "off", "from_x_m": -300.0, "for_s": 0.1}, heights=heights)
    assert np.isnan(passed).tolist() == [False, False, True, True, False]
    timed = heard({"sensor": "gyro", "kind": "off", "start_s": 0.06, "end_s": 0.18}, heights=heights)
    assert np.isnan(timed).tolist() == [False, True, True, False, False]


def test_every_kind_of_fault_is_what_it_says() -> None:
    level = [50.0] * 6
    sound = heard({"sensor": "gyro", "kind": "off", "start_s": 9.0}, heights=level)
    since = {"sensor": "gyro", "below_height_m": 60.0}
    assert heard({**since, "kind": "wrong", "bias": 0.5, "scale": 2.0}, heights=level) == pytest.approx(
        [0.5 + 2.0 * q for q in sound]
    )
    assert np.isnan(heard({**since, "kind": "slow", "factor": 3}, heights=level)).tolist() == [
        *(False, True, True),
        *(False, True, True),
    ]
    stuck = heard({"sensor": "gyro", "kind": "stuck", "start_s": 0.1}, heights=level)
    assert stuck[:2] == sound[:2]
    assert set(stuck[2:]) == {sound[1]}
    noise = heard({**since, "kind": "garbage", "spread": 3.0}, heights=[50.0] * 200)
    assert 2.5 < np.std(noise) < 3.5
    lossy = heard({**since, "kind": "intermittent", "loss": 0.25}, heights=[50.0] * 400)
    assert 0.18 < np.mean(np.isnan(lossy)) < 0.32


def test_a_sample_too_old_is_left_alone() -> None:
    class Echo:
        sensor = "gyro"

        def process(self, sample: Sample, estimate: object) -> tuple[Measurement, ...]:
            return (Measurement("gyro", sample.t_valid, sample.t_arrival, np.zeros(3), np.ones(3)),)

    fresh = Fresh(Echo(), 0.3)
    assert fresh.sensor == "gyro"
    assert len(fresh.process(Sample("gyro", 1.0, 1.3, None), None)) == 1  # type: ignore[arg-type]
    assert fresh.process(Sample("gyro", 1.0, 1.4, None), None) == ()  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------- the filter


def backup(factorisation: str = "dense", kind: str = "augmented") -> BackupEkf:
    config = FilterConfig(kind=kind, factorisation=factorisation)  # type: ignore[arg-type]
    alone = replace(config, q_rates=tuple(2.0 * q for q in config.q_rates))
    return BackupEkf(bench.filter_of(config), bench.filter_of(alone), 0.21)


def flown(
    ekf: BackupEkf, frames: int, gyro: str = "sound", seeing: bool = True, flows: bool = False
) -> tuple[np.ndarray, list[Estimate], BackupMemory]:
    """A matched world, 2 s with everything, then with gyros "sound", "silent", "stuck" or "mad", and flows or none."""
    rng = np.random.default_rng(3)
    x = bench.truth_at(rng)
    s, q = bench.settle(x, ekf.filter._par), np.zeros(states.N)
    q[ekf.filter.blocks.index] = ekf.filter._q["air"]
    memory, at, out, held = ekf.init(0.0), [], [], np.full(3, 0.01)
    for k in range(frames):
        t, ill = k * 0.06, k > 33
        memory = ekf.predict(memory, bench.COMMAND, t)
        for m in bench.inertial(x, t, rng, ekf.filter.config):
            if m.kind != "gyro" or not ill or gyro == "sound":
                memory = ekf.update(memory, m)
            elif gyro != "silent":
                z = held if gyro == "stuck" else rng.normal(size=3)
                memory = ekf.update(memory, replace(m, z=z))
        if not memory.inner.valid:
            memory = ekf.update(memory, bench.pose(x, t, rng))
        if seeing or not ill:
            memory = ekf.update(memory, bench.edges(x, t, rng))
        for alpha in (0.15, 0.25, 0.35) if flows and ill else ():
            seen = aircraft_flow(x, alpha, np.empty(states.N)) + 0.002 * rng.normal()
            told = Measurement("flow", t, t, np.array([alpha, seen]), np.array([0.0, 0.002**2]))
            memory = ekf.update(memory, told)
        at.append(x.copy())
        out.append(ekf.read(memory))
        bench.fly(x, s, ekf.filter._par, q, 0.06, rng)
    return np.array(at), out, memory


@pytest.mark.parametrize("gyro", ["silent", "stuck", "mad"])
def test_dead_gyros_are_noticed(gyro: str) -> None:
    at, out, _ = flown(backup(), 70, gyro)
    flags = [e.flags["inertial"] for e in out]
    assert all(flags[:35])
    assert not any(flags[40:])
    late = slice(45, 70)
    error = np.array([e["q"] for e in out])[late] - at[late, states.Q]
    assert np.abs(error).max() < 2.0 * RAD  # a held or mad reading would have pulled it to 10 degrees a second or more
    assert not any(e.flags["unseen"] for e in out)


def test_sound_gyros_and_no_flow_change_no_bit() -> None:
    ekf = backup()
    _, with_watch, _ = flown(ekf, 40)
    plain = ekf.filter
    rng = np.random.default_rng(3)
    x = bench.truth_at(rng)
    s, q = bench.settle(x, plain._par), np.zeros(states.N)
    q[plain.blocks.index] = plain._q["air"]
    memory = plain.init(0.0)
    for k in range(40):
        memory = plain.predict(memory, bench.COMMAND, k * 0.06)
        for m in bench.inertial(x, k * 0.06, rng, plain.config):
            memory = plain.update(memory, m)
        if not memory.valid:
            memory = plain.update(memory, bench.pose(x, k * 0.06, rng))
        memory = plain.update(memory, bench.edges(x, k * 0.06, rng))
        assert (plain.read(memory).mean == with_watch[k].mean).all()
        bench.fly(x, s, plain._par, q, 0.06, rng)


@pytest.mark.parametrize("factorisation", ["dense", "ud"])
def test_flows_hold_what_neither_gyros_nor_edges_do(factorisation: str) -> None:
    """3 s without gyros and edges: what is believed of q, theta, H, and how well, with flows and without."""
    blind, seeing = (flown(backup(factorisation), 84, "silent", seeing=False, flows=f) for f in (False, True))
    assert blind[1][-1].flags["unseen"]
    for name, times in (("q", 2.0), ("theta", 2.0), ("H", 1.2)):
        i = seeing[1][-1].names.index(name)
        sd = [math.sqrt(run[1][-1].cov[i, i]) for run in (blind, seeing)]  # type: ignore[index]
        assert sd[0] > times * sd[1], name
        error = seeing[1][-1].mean[i] - seeing[0][-1, states.NAMES.index(name)]
        assert abs(error) < 4.0 * sd[1], name


def test_a_flow_that_cannot_be_is_not_believed() -> None:
    ekf = backup()
    _, _, memory = flown(ekf, 30)
    true = aircraft_flow(memory.inner.x, 0.3, np.empty(states.N))
    wild = Measurement("flow", 1.8, 1.8, np.array([0.3, true + 0.2]), np.array([0.0, 0.002**2]))
    after = ekf.update(memory, wild)
    assert after.inner is memory.inner
    assert after.flow > 10.0
    near = ekf.update(memory, replace(wild, z=np.array([0.3, true + 0.002])))
    assert (near.inner.x != memory.inner.x).any()


@pytest.mark.parametrize("kind", ["plain", "split", "augmented"])
def test_every_filter_takes_flows(kind: str) -> None:
    ekf = backup(kind=kind)
    _, out, memory = flown(ekf, 12)
    flow = aircraft_flow(memory.inner.x, 0.3, np.empty(states.N)) + 0.001
    after = ekf.update(memory, Measurement("flow", 0.7, 0.7, np.array([0.3, flow]), np.array([0.0, 0.001**2])))
    q = out[-1].names.index("q")
    assert ekf.read(after).cov[q, q] < 0.9 * ekf.read(memory).cov[q, q]  # type: ignore[index]
    assert ekf.read(after)["q"] > ekf.read(memory)["q"]


def test_two_filters_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="same states"):
        BackupEkf(bench.filter_of(FilterConfig()), bench.filter_of(FilterConfig(kind="plain")), 0.2)


# ------------------------------------------------------------------------------------------------------- giving up

NAMES = states.NAMES[: states.WZ + 1]


def believed(t: float, height: float, x: float = -600.0, unseen: bool = False, **sd: float) -> Estimate:
    mean = np.zeros(len(NAMES))
    mean[[states.U, states.X, states.H]] = 50.0, x, height
    sigma = np.full(len(NAMES), 0.01)
    for name, value in sd.items():
        sigma[NAMES.index(name)] = value
    return Estimate(t, NAMES, mean, np.diag(sigma**2), True, {"unseen": unseen, "on_ground": False})


def mode_after(seconds: float, height: float = 33.0, **wanted: float) -> str:
    settings = vehicle.load("do128").guidance
    guidance = DoubtfulGuidance(LandingGuidance(settings), Limits(patience=0.5, blind=2.0))
    memory, reference = guidance.init(), None
    for k in range(round(seconds / 0.1) + 1):
        memory, reference = guidance.step(memory, believed(0.1 * k, height, **wanted))
    assert reference is not None
    return reference.mode


def test_doubt_is_waited_out_and_then_acted_upon() -> None:
    assert mode_after(3.0) == "glide"
    # 0.7 m + 2 % of 33 m; 1 m + 1 % of 600 m; 1 degree
    for wrong, fine in (({"H": 1.4}, {"H": 1.3}), ({"y": 7.1}, {"y": 6.9}), ({"phi": 0.018}, {"theta": 0.017})):
        assert mode_after(0.4, **wrong) == "glide"
        assert mode_after(0.7, **wrong) == "go_around"
        assert mode_after(3.0, **fine) == "glide"
    assert mode_after(1.9, unseen=True) == "glide"
    assert mode_after(2.2, unseen=True) == "go_around"


def test_below_the_decision_height_it_goes_on() -> None:
    settings = vehicle.load("do128").guidance
    height = settings.go_around.decision_height_m + settings.gear.down_m
    assert mode_after(3.0, height=height - 0.5, H=5.0) != "go_around"
    assert mode_after(3.0, height=height + 0.5, H=5.0) == "go_around"


def test_a_go_around_begins_with_what_is_flown() -> None:
    settings = vehicle.load("do128").guidance
    guidance = DoubtfulGuidance(LandingGuidance(settings), Limits(patience=0.0))
    memory = guidance.init()
    for k in range(40):
        memory, reference = guidance.step(memory, believed(0.1 * k, 33.0, H=3.0 if k > 5 else 0.01))
    assert reference.mode == "go_around"
    assert memory.inner.start[1] == pytest.approx(33.0)
    assert reference.climb_rate == pytest.approx(settings.path.approach_mps * math.sin(math.radians(4.0)), rel=1e-3)


# --------------------------------------------------------------------------------------------------------- missions

NEAR = {
    "do128": ("initial.x_m=-750", "initial.y_m=0", "initial.height_m=42.5", "initial.heading_deg=0"),
    "transport": ("initial.x_m=-1000", "initial.height_m=66"),
}


@pytest.mark.parametrize("aircraft", ["do128", "transport"])
def test_it_lands_when_the_inertial_unit_dies(aircraft: str) -> None:
    flight = fly(f"{aircraft}/inertial_off", *NEAR[aircraft])
    log = flight.log
    assert flight.verdict.outcome == "landed"
    assert flight.verdict.passed, flight.verdict.criteria
    dead = ~log["flag_inertial"]
    silent = np.isnan(log["meas_q_radps"])
    first = int(np.argmax(silent))
    assert -600.0 <= log["true_x_m"][first] < -595.0
    assert silent[first:].all()
    assert (dead[first + 4 :]).all()
    assert not dead[:first].any()
    looked = [k for k in (1, 2, 3) if np.isfinite(log[f"meas_flow_{k}_radps"]).any()]
    assert len(looked) >= 2
    airborne = dead & (log["true_H_m"] > 8.0)
    assert np.sqrt(np.mean(log.error("theta")[airborne] ** 2)) < 0.1 * RAD


def test_a_fault_that_never_comes_changes_no_bit() -> None:
    never = "faults=[{sensor: inertial, kind: off, start_s: 1000}]"
    sound, watched = (fly("do128/gust", *NEAR["do128"], *changes).log for changes in ((), (never,)))
    assert sound.touchdown == watched.touchdown
    assert (sound["est_H_m"] == watched["est_H_m"]).all()


def test_without_gyros_and_eyes_it_goes_around() -> None:
    """No camera either from 500 m out, for 3 s: the approach is given up after two, and flown away."""
    blind = "{sensor: camera, kind: off, from_x_m: -500, for_s: 3}"
    flight = fly(
        "do128/inertial_off", *NEAR["do128"], f"faults=[{{sensor: inertial, kind: off, from_x_m: -600}}, {blind}]"
    )
    log = flight.log
    assert flight.verdict.outcome == "go_around"
    begun = int(np.argmax(log["mode"] == "go_around"))
    assert -500.0 < log["true_x_m"][begun] < -350.0
    assert log["true_H_m"].min() > 15.0
    assert log["true_H_m"][-1] > log["true_H_m"].min() + 10.0


def test_lines_of_sight_reach_the_ground_ahead() -> None:
    log = fly("do128/inertial_off", *NEAR["do128"]).log
    high = log["true_H_m"] > 32.0
    for k, down in enumerate((8.0, 12.5, 17.0), 1):
        x, z = log[f"sight_{k}_x_m"][high][3:], log[f"sight_{k}_z_m"][high][3:]
        assert (z == 0.0).all()
        level = np.degrees(np.arctan2(log["true_H_m"][high][3:], x - log["true_x_m"][high][3:]))
        assert level == pytest.approx(down - np.degrees(log["true_theta_rad"][high][3:]), abs=0.3)
        true, seen = log[f"true_flow_{k}_radps"], log[f"meas_flow_{k}_radps"]
        both = np.isfinite(true) & np.isfinite(seen)
        assert abs(np.median(seen[both] - true[both])) < 1.5 * RAD


def test_a_recording_shows_sights_and_signals(tmp_path: Path) -> None:
    from landing_sim import runner

    wanted = scenario.load("do128/inertial_off", [*NEAR["do128"], "time.limit_s=3", "record.frames_hz=0"])
    runner.fly(wanted, vehicle.load("do128"), recording=tmp_path / "r.rrd")
    told = (tmp_path / "r.rrd").read_bytes()
    for entity in ("world/aircraft/looks/2", "flow/3/seen", "flow/1/true"):
        assert entity.encode() in told, entity


def test_where_the_path_ends_can_be_asked_for() -> None:
    from landing_sim.missions import onboard

    told = scenario.load("transport/inertial_off")
    own = scenario.load("transport/inertial_off", ["guidance.touchdown_x_m=null"])
    ends = [onboard.prepared(s, vehicle.load("transport")).guidance.path.touchdown_x_m for s in (told, own)]
    assert ends == [500.0, vehicle.load("transport").guidance.path.touchdown_x_m]
