"""The quadrotor's flights, closed: hovers, landings, refusals; on emulated positions, and once on rendered images."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from landing_sim import paths
from landing_sim import scenario as scenarios
from landing_sim.campaign import figures, landing
from landing_sim.campaign.file import load as load_campaign
from landing_sim.control.autonomy import Autonomy, AutonomySettings
from landing_sim.control.position import PositionSettings
from landing_sim.errors import ScenarioError
from landing_sim.estimators.readings import Reading
from landing_sim.missions import quadrotor_eyes as eyes
from landing_sim.missions import quadrotor_flight
from landing_sim.missions.quadrotor_landing import DRAG, Mission, build, scene
from landing_sim.noise import Noise
from landing_sim.plants.jsbsim_quadrotor import QuadrotorModel
from landing_sim.plants.quadrotor import QuadrotorPlant
from landing_sim.sections.quadrotor import METRICS, QuadrotorScenario
from landing_sim.sensors.latency import Latency, LatencyConfig
from landing_sim.sensors.place_fix import PlaceFix, PlaceFixConfig
from landing_sim.signals import CameraTruth, Command, Estimate, Sample, Step, Truth
from landing_sim.world.planes import Box

EMULATED = ("localisation.kind=emulated", "time.step_s=0.002")
NO_ESTIMATE = Estimate(0.0, (), np.zeros(0), None, False)


def quadrotor(name: str, *changes: str) -> QuadrotorScenario:
    found = scenarios.load(f"quadrotor/{name}", [*EMULATED, *changes])
    assert isinstance(found, QuadrotorScenario)
    return found


def flown(name: str, *changes: str):
    return quadrotor_flight.fly(quadrotor(name, *changes))


# ------------------------------------------------------------------------------------------------------- flights


def test_what_is_believed_of_the_vehicle_is_what_its_file_says() -> None:
    folder = paths.data_folder("aircraft") / "pelican"
    model, believed = QuadrotorModel(folder, 0.002), PositionSettings()
    assert believed.mass == pytest.approx(model.mass, rel=1e-6)
    assert believed.full_thrust == pytest.approx(4.0 * model.thrust_factor * model.rotor_max**2, rel=1e-3)
    assert [contact.p_B[2] for contact in model.contacts[:4]] == pytest.approx([eyes.LEGS] * 4)
    assert AutonomySettings().legs == eyes.LEGS
    per_fps = float((folder / "pelican.xml").read_text().split("u-aero-fps</property><value>")[1].split("<")[0])
    assert pytest.approx(-per_fps / 0.3048 / 0.2248089431, rel=1e-6) == DRAG


def test_fusion_steadies_the_hover() -> None:
    """25 s of hover in the same gusts: fused within 4.5 cm, alone with its own gains more than twice as far off."""
    for seed in (11,):
        changes = (f"seed={seed}", "time.limit_s=36")
        fused, alone = flown("hover", *changes), flown("hover_unfused", *changes)
        assert fused.verdict.outcome == alone.verdict.outcome == "hovered" and fused.verdict.passed
        rms, other = (f.verdict.metrics["hover_rms_m"] for f in (fused, alone))
        assert 0.01 < rms < 0.045 and 0.06 < other < 0.16 and other > 2.0 * rms
        assert fused.verdict.errors["x"]["rms"] < 0.02


def test_lands_on_the_platform() -> None:
    flight = flown("land_fast", "seed=3")
    assert flight.verdict.outcome == "landed" and flight.verdict.passed
    m = flight.verdict.metrics
    assert m["miss_m"] < 0.08 and m["flight_s"] < 25.0 and m["way_point_error_m"] < 0.05
    modes = [mode for mode, _ in itertools.groupby(flight.log["mode"].tolist())]
    assert modes == ["wait", "take_off", "hover", "traverse", "hover_above", "descend", "cut"]
    log = flight.log
    assert log["rotor_front_radps"][-1] < 1.0 and log["true_H_m"][-1] == pytest.approx(0.14 + 0.1184, abs=3e-3)
    fixes = np.isfinite(log["fix_t_s"])
    age = (log["t_s"] - log["fix_t_s"])[fixes]
    assert 0.14 < np.median(age) < 0.18 and log.touchdown.sink_rate == m["sink_rate_mps"]


def test_a_way_point_that_is_off_by_the_platforms_half_is_no_landing() -> None:
    """The same flight with a detector 30 cm off: the vehicle tips over the edge, and the verdict says so."""
    wrong = "faults=[{sensor: place_fix, kind: wrong, bias: [0.3, 0.0, 0.0]}]"
    flight = flown("land_fast", "seed=3", wrong)
    assert flight.verdict.outcome in ("crash", "off_platform") and not flight.verdict.passed
    assert flight.verdict.metrics["way_point_error_m"] == pytest.approx(0.3, abs=0.05)


def test_without_a_landing_place_it_lands_nowhere() -> None:
    flight = flown("land_fast", "faults=[{sensor: place_fix, kind: 'off'}]", "path.search_s=1")
    assert flight.verdict.outcome == "refused" and not flight.verdict.passed
    assert flight.log.touchdown is None and flight.log["true_H_m"][-1] == pytest.approx(1.0, abs=0.15)


def test_localisation_that_comes_back_is_waited_for_and_one_that_does_not_ends_on_the_ground() -> None:
    fault = "faults=[{{sensor: position_fix, kind: 'off', start_s: 12, for_s: {}}}]"
    short = flown("hover", "time.limit_s=32", fault.format(2.5))
    assert "hold" in short.log["mode"] and short.log["mode"][-1] == "hover"
    assert short.verdict.outcome == "hovered" and short.verdict.metrics["unlocalised_s"] > 1.0
    for_good = flown("hover", "time.limit_s=40", fault.format(100))
    assert {"hold", "land_blind"} <= set(for_good.log["mode"].tolist())
    assert for_good.log.touchdown is not None and for_good.verdict.outcome == "crash"  # no hover, at any rate
    assert for_good.log.touchdown.sink_rate < 1.5 and for_good.log["true_H_m"][-1] < 0.2


def test_same_bits_again() -> None:
    a, b = (list(itertools.islice(build(quadrotor("hover"), 5).steps(), 400)) for _ in range(2))
    assert (a[-1].truth.p_RB == b[-1].truth.p_RB).all() and (a[-1].estimate.mean[:6] == b[-1].estimate.mean[:6]).all()
    c = list(itertools.islice(build(quadrotor("hover"), 5, run=1).steps(), 400))
    assert (a[-1].truth.p_RB != c[-1].truth.p_RB).any()


# -------------------------------------------------------------------------------------------- nothing true on board


class Doctored:
    """A plant whose truth is told falsely in `changes`."""

    def __init__(self, plant: QuadrotorPlant, **changes) -> None:
        self._plant, self._changes, self.dt = plant, changes, plant.dt
        self.step, self.camera, self.fast_truth = plant.step, plant.camera, plant.fast_truth

    @property
    def touchdown(self):
        return self._plant.touchdown

    def reset(self) -> Truth:
        self._plant.reset()
        return self.truth()

    def truth(self) -> Truth:
        return replace(self._plant.truth(), **self._changes)


FALSE = {
    "v_RB_R": np.full(3, 7.0),
    "w_RB_B": np.full(3, 3.0),
    "wind_R": np.full(3, 9.0),
    "airspeed": 99.0,
    "alpha": 1.0,
    "beta": 1.0,
    "surfaces": np.full(4, 5.0),
    "thrust": 1e3,
    "wheels_height": np.full(3, 4.0),
    "on_ground": np.ones(3, bool),
    "load_factor": 9.0,
}


@pytest.mark.parametrize(("changes", "same"), [(FALSE, True), ({"p_RB": np.array([0.1, 0.0, -1.0])}, False)])
def test_what_only_the_truth_knows_changes_nothing(changes: dict, same: bool) -> None:
    """Commands and estimates of 6 s stay the same bits whatever is told of all that no sensor measures."""

    def said(doctored: bool) -> list[tuple[Command, tuple[float, ...]]]:
        mission = build(quadrotor("land_fast"), 4)
        if doctored:
            mission.parts = replace(mission.parts, plant=Doctored(mission.parts.plant, **changes))
        steps = itertools.islice(mission.steps(), 600)
        return [(s.command, tuple(np.nan_to_num(s.estimate.mean).tolist())) for s in steps]

    assert (said(False) == said(True)) is same


# ----------------------------------------------------------------------------------------------------- its parts


def test_standing_ends_with_the_take_off() -> None:
    inner = Reading("sonar", "sonar", 0.1)
    placed = [False]
    standing = eyes.Standing(inner, lambda: placed[0])

    def heard(height: float) -> list[str]:
        out = standing.process(Sample("sonar", 1.0, 1.0, height), lambda: NO_ESTIMATE)
        return [m.kind for m in out]

    assert heard(0.12) == ["sonar", "position"] == heard(0.12) and heard(0.15) == ["sonar"]
    assert heard(0.12) == ["sonar", "position"] and heard(0.25) == ["sonar"] == heard(0.12)
    standing, placed[0] = eyes.Standing(inner, lambda: placed[0]), True  # the camera knows better
    assert heard(0.12) == ["sonar"]
    for passed in (True, False):
        some = eyes.While(inner, lambda passed=passed: passed)
        assert some.sensor == "sonar"
        assert len(some.process(Sample("sonar", 1.0, 1.0, 0.3), lambda: NO_ESTIMATE)) == passed


def test_a_camera_on_its_face_sends_nothing() -> None:
    s = quadrotor("hover", "camera.width_px=320")
    eye = eyes.renderer(s, scene(s), Noise(1, "p"))
    camera = eyes.Uncovered(eyes.FisheyeCamera(eye, Latency(LatencyConfig(), Noise(1, "l")), 0.07))
    truth, down = build(s, 1).parts.plant.truth(), np.array(eyes.rig(s).R_CB)
    seen = [camera.sense(truth, CameraTruth(np.array([0.0, 0.0, z]), down, 0.0, 0.0)) for z in (-0.07, 0.01)]
    assert seen[0] is not None and seen[0].data.frame.full().shape == (240, 320) and seen[1] is None


def test_a_tour_visits_its_points() -> None:
    s = quadrotor("land")
    points = eyes.tour(s, (Box(1.5, 0.2),))
    assert points[0] == points[-1] == (0.0, 0.0, -1.0) and min(-p[2] for p in points) == 0.24
    assert (1.5, 0.2, -0.38) in points and max(p[0] for p in points) == 2.4
    tour = eyes.Tour(points[:3])
    memory, visited, t = tour.init(), set(), 0.0
    for _ in range(2000):
        memory, wanted = tour.step(memory, replace(NO_ESTIMATE, t=t))
        visited.add((wanted.extra["x"], wanted.y, -wanted.height))
        t += 0.01
    assert set(points[:3]) <= visited and wanted.mode == "done"


def test_flown_by_hand_until_the_map_is_there() -> None:
    ready = [False]
    settings = AutonomySettings(hold=0.0, traverse=0.5)
    led = eyes.HandFlown(eyes.Tour(((0.0, 0.0, -1.0), (2.0, 0.0, -1.0))), Autonomy(settings), lambda: ready[0])
    memory, modes, at = led.init(), [], 0.0
    for k in range(1000):
        ready[0] = k >= 300
        here = np.array([at, 0.0, 1.0, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan])
        names = ("x", "y", "H", "vx", "vy", "vz", "lx", "ly", "lH")
        told = Estimate(0.01 * k, names, here, None, True, {"localised": True, "platform": False})
        memory, wanted = led.step(memory, told)
        assert abs(wanted.extra["x"] - at) < 0.01 and wanted.height == 1.0  # no jump where it is let go
        at = wanted.extra["x"]
        modes.append(wanted.mode)
    assert [mode for mode, _ in itertools.groupby(modes)] == ["survey", "hover", "traverse"] and modes[299] == "survey"


def test_a_place_is_told_once_it_was_seen_whole() -> None:
    box = Box(0.0, 0.0)
    sensor = PlaceFix(
        PlaceFixConfig(latency=LatencyConfig(0.1, 0.0, 0.0), images=3), box.corners(), Noise(1, "a"), Noise(1, "b")
    )
    truth = build(quadrotor("hover"), 1).parts.plant.truth()

    def seen(x: float) -> Sample | None:
        return sensor.sense(
            truth, CameraTruth(np.array([x, 0.0, -1.0]), np.array(eyes.rig(quadrotor("land")).R_CB), 0, 0)
        )

    assert seen(1.5) is None and seen(0.0) is None and seen(0.1) is None and seen(3.0) is None
    told = seen(0.0)
    assert told is not None and told.t_arrival == pytest.approx(0.1)
    assert np.abs(told.data - [0.0, 0.0, -0.14]).max() < 0.05 and (seen(0.5).data == told.data).all()


def test_every_figure_of_a_campaign(tmp_path: Path) -> None:
    """A campaign over a quadrotor scenario: gust and latency drawn, figures by their names, run k alone the same."""
    file = tmp_path / "c.yaml"
    file.write_text(
        "schema_version: 1\nscenario: quadrotor/hover\nruns: 2\nseed: 3\n"
        "set: {localisation.kind: emulated, time.limit_s: 3, time.step_s: 0.002}\n"
        "dispersions:\n  air.gust_n: {uniform: {low: 0.1, high: 0.3}}\n"
        "  camera.latency.mean_s: {uniform: {low: 0.1, high: 0.2}}\n"
        "risks: [{name: far, metric: hover_rms_m, above: 0.1, probability: 0.1}]\n"
    )
    plan = load_campaign(file)
    assert plan.figures() == METRICS == figures.figures("quadrotor_landing")
    rows = [landing.land(plan, run) for run in (0, 1, 1)]
    assert [row.outcome for row in rows] == ["timeout"] * 3  # cut off before there was a hover
    assert all(tuple(row.figures) == METRICS for row in rows)
    assert (
        rows[1].figures["fix_error_rms_m"] == rows[2].figures["fix_error_rms_m"] != rows[0].figures["fix_error_rms_m"]
    )
    assert 0.1 < rows[0].values["air.gust_n"] < 0.3
    file.write_text(file.read_text().replace("hover_rms_m", "touchdown_x_m"))
    with pytest.raises(Exception, match=r"c.yaml:9:29: risks.0.metric: no such metric"):
        load_campaign(file)


def test_a_recording(tmp_path: Path) -> None:
    s = quadrotor("land_fast", "time.limit_s=1.5", "record.frames_hz=2", "camera.width_px=320")
    flight = quadrotor_flight.fly(s, recording=tmp_path / "recording.rrd")
    assert flight.verdict.outcome == "timeout" and (tmp_path / "recording.rrd").stat().st_size > 300_000


def test_the_mission_knows_when_it_is_over() -> None:
    mission = build(quadrotor("hover", "time.limit_s=0.5"), 1)
    assert isinstance(mission, Mission)
    with pytest.raises(RuntimeError, match="not over"):
        mission.outcome()
    *_, last = mission.steps()
    assert isinstance(last, Step) and mission.outcome().end == "time"


# ------------------------------------------------------------------------------------------------------- mistakes


WRONG = {
    "task: fly\n": r"s.yaml:3:7: task: must be 'hover' or 'land', not 'fly'",
    "task: land\n": r"scene.boxes: task land needs a box to land on",
    "task: hover\ntime: {cycle_s: 0.0123}\n": r"s.yaml:4:17: time.cycle_s: 0.0123 is not a whole multiple of time.step_s",
    "task: hover\ncamera: {period_s: 0.075}\n": r"s.yaml:4:20: camera.period_s: 0.075 is not a whole multiple",
    "task: hover\ntime: {cycle_s: 0.02}\n": r"time.cycle_s: is not a whole part of the inertial unit's period of 0.01 s",
    "task: hover\ncamera: {latency: {spike_low_s: 0.5}}\n": r"camera.latency.spike_low_s: is above spike_high_s = 0.25",
    "task: hover\nlocalisation: {survey: false, map: m}\n": r"localisation.map: without a survey the map is made in flight",
    "task: hover\ncamera: {lens: wide}\n": r"s.yaml:4:10: camera.lens: unknown key",
    "scene: {boxes: [{x_m: 1, slope_x_deg: 40}]}\n": r"scene.boxes.0.height_m: at this slope its top dips below",
    "scene: {boxes: [{x_m: 0.3}]}\n": r"s.yaml:3:23: scene.boxes.0.x_m: the flight starts on the ground at 0, 0",
    "task: hover\nfaults: [{sensor: camara, kind: 'off'}]\n": r"faults.0.sensor: no sensor 'camara' here.*mean 'camera'",
    "task: hover\nair: {gust_n: .nan}\n": r"s.yaml:4:15: air.gust_n: must be a finite number, not nan",
}


@pytest.mark.parametrize("text", WRONG)
def test_mistakes_are_told_with_their_place(text: str, tmp_path: Path) -> None:
    file = tmp_path / "s.yaml"
    file.write_text("schema_version: 1\nmission: quadrotor_landing\n" + text)
    with pytest.raises(ScenarioError, match=WRONG[text]):
        scenarios.load(file)


def test_what_cannot_be_flown_is_told(tmp_path: Path) -> None:
    crowded = quadrotor("land", "scene.clutter=20", "scene.boxes=[{x_m: 2.8, length_m: 4.9, width_m: 4.0}]")
    with pytest.raises(ScenarioError, match=r"cannot be flown: clutter: 20 boxes do not fit"):
        quadrotor_flight.fly(crowded)
    (tmp_path / "m.npz").write_text("no map")
    seeing = scenarios.load("quadrotor/hover", [f"localisation.map={tmp_path / 'm.npz'}"])
    with pytest.raises(ScenarioError, match=r"cannot be flown: .*m.npz: damaged, or not a map"):
        quadrotor_flight.fly(seeing)


# ------------------------------------------------------------------------------------------------------ with eyes


@pytest.mark.slow
def test_lands_by_what_it_sees(tmp_path: Path) -> None:
    """Rendered at half size: the map is made and kept in its file, the platform found and landed on."""
    file = tmp_path / "map.npz"
    seeing = ["time.step_s=0.002", "camera.width_px=320", f"localisation.map={file}", "path.goal_x_m=1.6", "seed=21"]
    s = scenarios.load("quadrotor/land_fast", [*seeing, "path.traverse_mps=0.3", "scene.boxes=[{x_m: 1.2}]"])
    flight = quadrotor_flight.fly(s)
    m = flight.verdict.metrics
    assert flight.verdict.outcome == "landed" and m["miss_m"] < 0.08
    assert m["fix_error_rms_m"] < 0.025 and m["way_point_error_m"] < 0.05 and abs(m["platform_height_error_m"]) < 0.02
    made = file.stat().st_mtime_ns
    again = quadrotor_flight.fly(s)
    assert file.stat().st_mtime_ns == made
    assert json.dumps(again.verdict.metrics) == json.dumps(m)  # from the file as from the survey
    assert not math.isnan(m["platform_height_m"])
