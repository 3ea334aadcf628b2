"""Log, judge and recording, against flights whose every number is known beforehand."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_flight as synthetic

from landing_sim.geometry.pinhole import Intrinsics, project
from landing_sim.geometry.so3 import camera_from_body, from_euler
from landing_sim.record import judge, overlay, parquet, replay
from landing_sim.record.builder import LogBuilder
from landing_sim.record.log import FlightLog, LogError
from landing_sim.record.poses import quaternions
from landing_sim.signals import Estimate, Feature, Residuals, Status, Touchdown

RUNWAY = {"width_m": 29.0, "length_m": 1680.0}


def build(steps, **arguments) -> FlightLog:
    builder = LogBuilder()
    for step in steps:
        builder.add(step)
    return builder.finish(**{"runway": RUNWAY, "touchdown": synthetic.touchdown(), "seed": 1} | arguments)


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return build(synthetic.fly())


# --------------------------------------------------------------------------------------------------- log


def test_log_holds_what_the_steps_said(log):
    steps = list(synthetic.fly())
    k = 137
    step = steps[k]
    assert len(log) == len(steps)
    assert log["true_x_m"][k] == step.truth.p_RB[0]
    assert log["true_H_m"][k] == -step.truth.p_RB[2]
    assert log["est_psi_rad"][k] == step.estimate["psi"]
    assert log["sd_wy_mps"][k] == pytest.approx(math.sqrt(step.estimate.cov[13, 13]))
    assert log["cmd_throttle"][k] == 0.4
    assert log["meas_airspeed_mps"][k] == step.truth.airspeed
    assert log["meas_frame"][k] == k
    assert log["mode"][k] == step.reference.mode
    assert log["ref_psi_wind"][k] == 0.02
    assert log["true_u_mps"][k] == pytest.approx((step.truth.R_RB.T @ step.truth.v_RB_R)[0])
    np.testing.assert_array_equal(log["window_z_px"][k], step.measurements[0].z)
    assert log["window_feature"][k, 6] == Feature.THRESHOLD


def test_nothing_is_believed_before_acquisition(log):
    assert np.isnan(log["est_x_m"][:2]).all()
    assert np.isfinite(log["est_x_m"][2:]).all()


def test_round_trip_through_parquet(log, tmp_path):
    parquet.write(log, tmp_path / "log.parquet")
    back = parquet.read(tmp_path / "log.parquet")
    assert back.columns.keys() == log.columns.keys()
    for name, column in log.columns.items():
        np.testing.assert_array_equal(back[name], column, err_msg=name)
        assert back[name].dtype.kind == column.dtype.kind, name
    assert back.meta == json.loads(json.dumps(log.meta))
    assert back.touchdown == log.touchdown
    assert [p.name for p in tmp_path.iterdir()] == ["log.parquet"]


def test_same_flight_same_bytes_other_seed_other_bytes(tmp_path):
    files = []
    for i, seed in enumerate((1, 1, 2)):
        parquet.write(build(synthetic.fly(seed, duration=3.0)), tmp_path / f"{i}.parquet")
        files.append((tmp_path / f"{i}.parquet").read_bytes())
    assert files[0] == files[1]
    assert files[0] != files[2]


def test_the_gate_has_the_last_word_on_a_window():
    step = next(iter(synthetic.fly()))
    seen = step.residuals
    status = seen.status.copy()
    status[3] = Status.REJECTED
    gated = Residuals(seen.innovation, status, seen.nis, seen.dof)
    assert build([replace(step, residuals=gated)])["window_status"][0, 3] == Status.REJECTED


def test_a_filter_that_changes_its_states_in_flight_is_an_error():
    first, second = list(synthetic.fly(duration=0.12))
    builder = LogBuilder()
    builder.add(first)
    other = Estimate(second.truth.t, ("x",), np.zeros(1), None, True)
    with pytest.raises(LogError, match="names changed"):
        builder.add(replace(second, estimate=other))


def test_what_is_no_log_is_refused(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    with pytest.raises(LogError, match="no step"):
        LogBuilder().finish()
    (tmp_path / "text").write_text("hello")
    with pytest.raises(LogError, match="not a readable Parquet"):
        parquet.read(tmp_path / "text")
    pq.write_table(pa.table({"a": [1]}), tmp_path / "other.parquet")
    with pytest.raises(LogError, match="not one of landing-sim"):
        parquet.read(tmp_path / "other.parquet")


# ------------------------------------------------------------------------------------------------- judge


def by_hand(**columns) -> FlightLog:
    """Ten seconds at 10 Hz from x = -600 m at 80 m/s, perfectly known, on the ground after x = 100 m, stopping."""
    n = 101
    t = 0.1 * np.arange(n)
    x = -600.0 + 80.0 * t
    zero = np.zeros(n)
    base = {"t_s": t, "est_t_s": t, "true_x_m": x, "true_y_m": zero, "true_H_m": np.maximum(0.0, 0.05 * (100.0 - x))}
    base |= {f"true_{a}_rad": zero for a in ("phi", "theta", "psi")} | {
        f"true_{w}_mps": zero for w in ("wx", "wy", "wz")
    }
    base |= {"true_u_mps": zero + 80.0, "true_v_mps": zero, "true_w_mps": zero, "true_airspeed_mps": zero + 80.0}
    names = {"x": "m", "y": "m", "H": "m", "phi": "rad", "theta": "rad", "psi": "rad"} | dict.fromkeys("uvw", "mps")
    for name, unit in names.items():
        base[f"est_{name}_{unit}"] = base[f"true_{name}_{unit}"].copy()
        base[f"sd_{name}_{unit}"] = zero + 0.5
    base |= {"valid": t >= 1.0 - 1e-9, "mode": np.where(t < 8.75, "glide", "rollout"), "threshold_found": x < -100.0}
    base |= {f"true_wheel_{w}_m": base["true_H_m"] for w in ("left", "right", "third")}
    base |= {"true_groundspeed_mps": np.linspace(80.0, 2.0, n), "nees": zero + 9.0, "nees_dof": np.full(n, 9)}
    base |= {"nis": zero + 8.0, "nis_dof": np.full(n, 10)}
    base |= {"ref_height_m": base["true_H_m"].copy(), "ref_climb_rate_mps": -0.05 * base["true_groundspeed_mps"]}
    down = {"t": 8.75, "x": 101.0, "y": 0.4, "sink_rate": 0.5, "airspeed": 43.0, "groundspeed": 44.0, "pitch": 0.1}
    meta = {"touchdown": down | {"bank": 0.0, "heading_error": 0.0, "sideslip": 0.0}, "seed": 3, "end": "stopped"}
    return FlightLog(base | columns, meta | {"runway_width_m": 29.0, "runway_length_m": 1680.0})


def spoiled(name: str, k: int, by: float) -> FlightLog:
    column = by_hand()[name].copy()
    column[k] += by
    return by_hand(**{name: column})


@pytest.mark.parametrize(
    ("column", "k", "by", "signal", "largest"),
    [
        ("est_x_m", 40, 3.0, "range", 3.0),  # x = -280 m
        ("est_x_m", 30, -2.0, "range", 2.0),
        ("est_H_m", 60, 0.7, "height_approach", 0.7),
        ("est_H_m", 80, -0.3, "height_runway", 0.3),
        ("est_y_m", 50, 0.9, "lateral", 0.9),
        ("est_phi_rad", 50, 0.01, "roll", math.degrees(0.01)),
        ("est_psi_rad", 50, 2 * math.pi + 0.02, "yaw", math.degrees(0.02)),
        ("est_u_mps", 50, 1.5, "airspeed", 1.5),
    ],
)
def test_an_error_is_found_where_it_is(column, k, by, signal, largest):
    found = judge.errors(spoiled(column, k, by))
    assert found[signal]["max"] == pytest.approx(largest)
    others = {"range", "height_approach", "height_runway", "lateral", "roll", "yaw", "pitch"} - {signal}
    assert all(found[name]["max"] == pytest.approx(0.0, abs=1e-9) for name in others)


def test_rms_by_hand():
    """3-4-0 over the cycles that count on approach: t = 2.5 ... 7.4 s, so 50 of them."""
    H = by_hand()["est_H_m"].copy()
    H[30] += 3.0
    H[31] -= 4.0
    assert judge.errors(by_hand(est_H_m=H))["height_approach"]["rms"] == pytest.approx(5.0 / math.sqrt(50.0))


@pytest.mark.parametrize("k", [10, 24])  # acquired at 1.0 s: the first 1.5 s do not count
def test_errors_while_settling_do_not_count(k):
    assert judge.errors(spoiled("est_y_m", k, 9.0))["lateral"]["max"] == 0.0


def test_errors_after_touchdown_do_not_count():
    assert judge.errors(spoiled("est_y_m", 90, 9.0))["lateral"]["max"] == 0.0


def test_range_is_judged_while_the_threshold_is_seen():
    assert judge.errors(spoiled("est_x_m", 65, 50.0))["range"]["max"] == 0.0  # x = -80 m, lost at -100 m
    early = by_hand(valid=np.ones(101, bool), true_x_m=by_hand()["true_x_m"] - 400.0)
    x = early["true_x_m"].copy()
    x[20] += 16.8  # at 840 m
    found = judge.errors(FlightLog({**early.columns, "est_x_m": x, "threshold_found": np.ones(101, bool)}, early.meta))
    assert found["range_far"]["max"] == pytest.approx(2.0)
    assert found["range_far"]["unit"] == "%"


def test_estimates_are_compared_with_the_truth_of_their_own_time():
    late = by_hand(est_t_s=by_hand()["t_s"] - 0.05)
    assert judge.errors(late)["range"]["max"] == pytest.approx(4.0)  # 50 ms at 80 m/s


def test_airspeed_of_a_filter_with_wind_states():
    headwind = by_hand(est_wx_mps=np.full(101, -5.0), est_wy_mps=np.zeros(101), est_wz_mps=np.zeros(101))
    assert judge.errors(headwind)["airspeed"]["max"] == pytest.approx(5.0)


def test_over_the_threshold_by_hand():
    """x = 0 at 7.5 s. Believed 4 m further on, the path looks 0.2 m lower than it is where the aircraft really is."""
    log = by_hand()
    off = {"est_x_m": log["true_x_m"] + 4.0, "est_y_m": log["true_y_m"] - 0.5, "est_H_m": log["true_H_m"] + 0.3}
    flown = {"true_y_m": log["true_y_m"] + 0.7, "ref_height_m": log["true_H_m"] - 1.2}
    found = judge.at_threshold(by_hand(**off, **flown))
    assert found["threshold_lateral_error_m"] == pytest.approx(1.2)
    assert found["threshold_height_error_m"] == pytest.approx(0.3)
    assert found["threshold_y_m"] == pytest.approx(0.7)
    assert found["threshold_above_m"] == pytest.approx(1.0)
    assert math.isnan(found["range_1km_percent"])  # it began nearer
    further = judge.at_threshold(by_hand(true_x_m=log["true_x_m"] - 600.0, est_x_m=log["true_x_m"] - 612.0))
    assert further["range_1km_percent"] == pytest.approx(1.2)


def with_touchdown(**changes) -> FlightLog:
    log = by_hand()
    return FlightLog(log.columns, {**log.meta, "touchdown": {**log.meta["touchdown"], **changes}})


def without_touchdown(end: str, **columns) -> FlightLog:
    log = by_hand(**columns)
    return FlightLog(log.columns, {**log.meta, "touchdown": None, "end": end})


@pytest.mark.parametrize(
    ("log", "outcome"),
    [
        (by_hand(), "landed"),
        (with_touchdown(sink_rate=3.2), "crash"),
        (with_touchdown(bank=0.3), "crash"),
        (with_touchdown(y=15.0), "off_runway"),
        (with_touchdown(x=-2.0), "off_runway"),
        (with_touchdown(x=1700.0), "off_runway"),
        (by_hand(true_y_m=np.where(np.arange(101) > 95, 16.0, 0.0)), "off_runway"),
        (by_hand(true_groundspeed_mps=np.full(101, 30.0)), "timeout"),
        (spoiled("est_y_m", 50, math.nan), "numeric_error"),
        (spoiled("true_x_m", 100, math.nan), "numeric_error"),
        (without_touchdown("time"), "timeout"),
        (without_touchdown("crash"), "crash"),
        (without_touchdown("numeric_error"), "numeric_error"),
        (without_touchdown("go_around", mode=np.full(101, "go_around")), "go_around"),
        (without_touchdown("time", true_wheel_left_m=np.full(101, -2.0)), "crash"),
    ],
)
def test_outcome(log, outcome):
    assert judge.outcome(log) == outcome


def test_consistency_by_hand():
    found = judge.consistency(spoiled("est_y_m", 50, 1.0))
    assert found["nees"] == pytest.approx(1.0)
    assert found["nis"] == pytest.approx(0.8)
    assert found["y"] == pytest.approx(4.0 / 63)  # (1 m / 0.5 m)^2 in one of the cycles from 2.5 to 8.7 s


def test_nees_of_errors_drawn_as_the_covariance_says(log):
    """Errors correlated over 2 s, 18 s of them: a mean over 12 states is 1 within a few tenths."""
    found = judge.consistency(log)
    assert 0.6 < found["nees"] < 1.5
    alone = [found[name] for name in ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "H")]
    assert found["nees"] == pytest.approx(np.mean(alone), rel=1e-9)  # a diagonal covariance


def test_capture_by_hand():
    y = np.where(by_hand()["true_x_m"] < -200.0, 20.0, 1.0)
    assert judge.captured_after(by_hand(true_y_m=y), 5.0) == pytest.approx(400.0)
    assert math.isnan(judge.captured_after(by_hand(true_y_m=np.full(101, 6.0)), 5.0))


def test_criteria_bounds_are_inclusive_and_missing_figures_fail():
    limits = (
        judge.Limit("touchdown_x_m", 101.0, 110.0, "box"),
        judge.Limit("sink_rate_mps", high=0.4),
        judge.Limit("touchdown_airspeed_mps", low=43.0),
        judge.Limit("width_m", high=1.0),
        judge.Limit("sink_rate_mps", high=0.5),
    )
    verdict = judge.judge(by_hand(), limits)
    assert [c.passed for c in verdict.criteria] == [True, False, True, False, True]
    assert not verdict.passed
    assert judge.judge(by_hand(), limits[:1]).passed
    with pytest.raises(KeyError):
        judge.judge(by_hand(), [judge.Limit("nonsense", high=1.0)])
    with pytest.raises(ValueError, match="neither"):
        judge.judge(by_hand(), [judge.Limit("roll_deg")])


def test_json_is_strict_and_complete():
    verdict = judge.judge(by_hand(), [judge.Limit("width_m", high=1.0), judge.Limit("touchdown_x_m", 0.0, 200.0)])
    found = judge.to_json(by_hand(), verdict, scenario="a/b", wall_s=2.0, files={"log": "log.parquet"})
    text = json.loads(json.dumps(found, allow_nan=False))
    assert set(text) == {
        "scenario", "seed", "outcome", "touchdown", "errors", "criteria", "passed", "timing", "files",
    }  # fmt: skip
    assert set(text["touchdown"]) == {
        "x_m", "y_m", "time_s", "sink_rate_mps", "airspeed_mps", "groundspeed_mps", "pitch_deg", "bank_deg",
        "heading_error_deg", "sideslip_deg",
    }  # fmt: skip
    assert all(set(error) == {"max", "rms", "unit"} for error in text["errors"].values())
    assert all(set(c) == {"name", "value", "limit", "passed", "source"} for c in text["criteria"])
    assert text["criteria"][0]["value"] is None
    assert text["criteria"][1]["limit"] == [0.0, 200.0]
    assert text["timing"] == {"sim_s": pytest.approx(10.0), "wall_s": 2.0, "realtime_factor": pytest.approx(5.0)}
    assert judge.to_json(without_touchdown("time"), verdict, scenario="", wall_s=1.0, files={})["touchdown"] is None


def test_a_stored_log_is_judged_the_same(log, tmp_path):
    parquet.write(log, tmp_path / "log.parquet")
    limits = [judge.Limit("lateral_m", high=1.0)]
    assert judge.judge(parquet.read(tmp_path / "log.parquet"), limits) == judge.judge(log, limits)


# ----------------------------------------------------------------------------------------------- overlay

CAMERA = overlay.BelievedCamera(synthetic.K, synthetic.LEVER, 29.0, 1680.0, 0.0)


def estimate(**values: float) -> Estimate:
    names = ("phi", "theta", "psi", "x", "y", "H")
    return Estimate(0.0, names, np.array([values.get(name, 0.0) for name in names]), None, True)


def test_predicted_edges_go_through_the_projected_corners():
    e = estimate(x=-600.0, y=-10.0, H=32.0, phi=0.03, theta=0.02, psi=0.01)
    pan, tilt = -0.01, -0.045
    lines, drawn = overlay.predicted_edges([e], [(pan, tilt)], CAMERA)
    assert drawn.tolist() == [4]
    R_RB = from_euler(0.03, 0.02, 0.01)
    R_CR = camera_from_body(pan, tilt) @ R_RB.T
    p_RC = np.array([-600.0, -10.0, -32.0]) + R_RB @ synthetic.LEVER
    corners = np.array([[0.0, -14.5, 0.0], [1680.0, -14.5, 0.0], [0.0, 14.5, 0.0], [1680.0, 14.5, 0.0]])
    uv = project((corners - p_RC) @ R_CR.T, synthetic.K)
    by_feature = dict(zip(lines.feature, lines.ends))
    np.testing.assert_allclose(by_feature[Feature.LEFT], uv[:2], atol=1e-9)
    np.testing.assert_allclose(by_feature[Feature.RIGHT], uv[2:], atol=1e-9)
    np.testing.assert_allclose(by_feature[Feature.THRESHOLD], uv[[0, 2]], atol=1e-9)
    assert by_feature[Feature.HORIZON][0, 0] == -0.5  # from border to border


@pytest.mark.parametrize("x", [-30.0, 5.0, 900.0, 1675.0])
def test_predicted_edges_over_the_runway_stay_in_the_image(x):
    lines, _ = overlay.predicted_edges([estimate(x=x, H=4.0)], [(0.0, 0.0)], CAMERA)
    assert Feature.THRESHOLD not in lines.feature
    assert np.isfinite(lines.ends).all()
    assert (lines.ends >= -0.5 - 1e-9).all()
    assert (lines.ends <= 511.5 + 1e-9).all()
    for feature, outward in ((Feature.LEFT, -1.0), (Feature.RIGHT, 1.0)):
        for (u0, v0), (u1, v1) in lines.ends[lines.feature == feature]:
            assert v0 > v1, "the near end is lower"
            assert outward * (u0 - u1) > 0.0, "and farther out"
            # both ends on the ray from the vanishing point straight ahead: slope H / (14.5 m) from the lens' height
            height = 4.0 - synthetic.LEVER[2]
            assert (v0 - 255.5) * 14.5 == pytest.approx(outward * (u0 - 255.5) * height)


def test_clipping_by_hand():
    k = Intrinsics.centred(11, 11, 100.0)
    lines = np.array([[(-10.5, 5.0), (20.5, 5.0)], [(-5.0, -5.0), (-5.0, 20.0)], [(3.0, 4.0), (5.0, 30.0)]])
    ends, inside = overlay._clip(lines, k)
    assert inside.tolist() == [True, False, True]
    np.testing.assert_allclose(ends[0], [[-0.5, 5.0], [10.5, 5.0]])
    np.testing.assert_allclose(ends[2], [[3.0, 4.0], [3.5, 10.5]])


def test_edges_of_many_images_are_those_of_each():
    several = [estimate(x=x, y=3.0, H=4.0 - 0.05 * x, phi=phi) for x in (-900.0, -5.0, 700.0) for phi in (-1.8, 0.4)]
    angles = [(0.01 * i, -0.02) for i in range(len(several))]
    lines, drawn = overlay.predicted_edges(several, angles, CAMERA)
    alone = [overlay.predicted_edges([e], [a], CAMERA)[0] for e, a in zip(several, angles)]
    assert drawn.tolist() == [len(each.feature) for each in alone]
    np.testing.assert_array_equal(lines.ends, np.concatenate([each.ends for each in alone]))
    np.testing.assert_array_equal(lines.feature, np.concatenate([each.feature for each in alone]))


def test_measured_edge_lies_at_the_measured_displacement():
    step = next(iter(synthetic.fly()))
    edges, z = step.measurements[0].geometry, step.measurements[0].z
    found = overlay.measured_edges(edges, z)
    np.testing.assert_allclose(found.ends[0].mean(axis=0), edges.centre[0] + z[0] * edges.direction[0])
    across = found.ends[0, 1] - found.ends[0, 0]
    assert across @ edges.direction[0] == pytest.approx(0.0)
    assert len(found.ends) == np.isfinite(z).sum()


# ------------------------------------------------------------------------------------------------ replay


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> tuple[Path, FlightLog]:
    path = tmp_path_factory.mktemp("replay") / "flight.rrd"
    recorder = replay.Recorder(path, replay.Scene(CAMERA, 29.0, 1680.0), frames_hz=2.0)
    steps = list(synthetic.fly(duration=6.0))
    for step in steps:
        recorder.add(step)
    down = Touchdown(5.0, 555.0, 0.0, 0.4, 43.0, 43.0, 0.0, 0.0, 0.0, 0.0)
    log = build(steps, touchdown=down)
    recorder.close(log)
    return path, log


def chunks(path: Path) -> dict[str, list]:
    from rerun.chunk import RrdReader

    found: dict[str, list] = {}
    for chunk in RrdReader(path).stream():
        found.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    return found


def test_recording_is_whole(recording):
    rerun = Path(sys.executable).with_name("rerun")
    done = subprocess.run([rerun, "rrd", "verify", recording[0]], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_recording_shows_what_it_should(recording):
    found = chunks(recording[0])
    wanted = {
        "/world/runway", "/world/markings", "/world/path/true", "/world/path/estimated", "/world/aircraft", "/world/camera",
        "/world/camera/image", "/world/camera/image/windows", "/world/camera/image/measured",
        "/world/camera/image/predicted", "/errors/x", "/errors/H", "/errors/wy", "/flight/commands", "/flight/phase",
        "/flight/events",
    }  # fmt: skip
    assert wanted <= found.keys()
    images = [b for b in found["/world/camera/image"] if "EncodedImage:blob" in b.schema.names]
    assert sum(b.num_rows for b in images) == 12  # 6 s at 2 Hz


def test_recorded_overlays_belong_to_their_image(recording):
    """Whatever is sent together, each image keeps its own edges and windows, and a window the colour of its status."""

    def rows(entity: str, column: str) -> list:
        found = [b for b in chunks(recording[0])[f"/world/camera/image/{entity}"] if "time" in b.schema.names]
        return [row.as_py() for b in found for row in b[f"LineStrips2D:{column}"]]

    due = [0.0]
    shown = []
    for step in synthetic.fly(duration=6.0):  # at 2 Hz, from when an image was due
        if step.truth.t >= due[-1] - 1e-9:
            due.append(due[-1] + 0.5)
            shown.append(step)
    assert len(rows("windows", "strips")) == len(shown) == 12
    looked = zip(shown, rows("measured", "strips"), rows("windows", "strips"), rows("windows", "colors"))
    for step, measured, windows, colours in looked:
        geometry, z = step.measurements[0].geometry, step.measurements[0].z
        np.testing.assert_allclose(measured, overlay.measured_edges(geometry, z).ends, atol=1e-3)
        np.testing.assert_allclose(windows, overlay.window_boxes(geometry), atol=1e-3)
        wanted = [overlay.STATUS_COLOURS[Status(s)] for s in step.residuals.status]
        assert [tuple(colour.to_bytes(4, "big")[:3]) for colour in colours] == wanted
    known = [step for step in shown if step.estimate.valid]
    for step, predicted in zip(known, rows("predicted", "strips"), strict=True):
        sample = overlay.camera_sample(step.samples)[1]
        lines, _ = overlay.predicted_edges([step.estimate], [(sample.pan, sample.tilt)], CAMERA)
        np.testing.assert_allclose(predicted, lines.ends, atol=1e-3)


def test_recorded_error_and_band_are_the_log_s(recording):
    path, log = recording
    rows = [
        row for b in chunks(path)["/errors/y"] if "Scalars:scalars" in b.schema.names for row in b["Scalars:scalars"]
    ]
    values = np.array([row.as_py() for row in rows])
    known = log["valid"]
    np.testing.assert_allclose(values[:, 0], log.error("y")[known])
    np.testing.assert_allclose(values[:, 1], 3.0 * log.sigma("y")[known])
    np.testing.assert_allclose(values[:, 2], -values[:, 1])


def test_quaternions_turn_as_their_matrices_do():
    """Half turns as well, where the scalar part is zero."""
    rng = np.random.default_rng(3)
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axes[:3] = np.eye(3)
    angles = np.concatenate([np.full(20, np.pi), rng.uniform(-np.pi, np.pi, 180)])
    c, s = np.cos(angles), np.sin(angles)
    skew = np.cross(np.eye(3)[None], axes[:, None]).swapaxes(1, 2) * -1.0
    R = (
        c[:, None, None] * np.eye(3)
        + s[:, None, None] * skew
        + (1.0 - c)[:, None, None] * axes[:, :, None] * axes[:, None]
    )
    wanted = np.column_stack([np.sin(angles / 2.0)[:, None] * axes, np.cos(angles / 2.0)])
    found = quaternions(R)
    assert np.abs(np.abs(np.sum(found * wanted, axis=1)) - 1.0).max() < 1e-12


def test_events_tell_the_story(log):
    text = [what for _, what in replay.events(log)]
    assert any("acquired" in what for what in text)
    assert any("threshold last seen" in what for what in text)
    assert any("touchdown at x = 555 m" in what for what in text)
    assert [t for t, _ in replay.events(log)] == sorted(t for t, _ in replay.events(log))


@pytest.mark.parametrize("web", [True, False])
def test_the_viewer_listens_to_this_machine_only(tmp_path, monkeypatch, web):
    seen = []

    def run(command, check):
        seen.append(command)
        return subprocess.CompletedProcess(command, 0)

    (tmp_path / "a.rrd").write_bytes(b"")
    monkeypatch.setattr(subprocess, "run", run)
    replay.open_viewer(tmp_path / "a.rrd", web=web)
    command = seen[0]
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert ("--web-viewer" in command) == web


def test_a_recording_that_cannot_be_shown_says_why(tmp_path, monkeypatch):
    with pytest.raises(replay.ReplayError, match="no such recording"):
        replay.open_viewer(tmp_path / "none.rrd")
    (tmp_path / "a.rrd").write_bytes(b"")
    monkeypatch.setattr(subprocess, "run", lambda command, check: subprocess.CompletedProcess(command, 1))
    with pytest.raises(replay.ReplayError, match="--web"):
        replay.open_viewer(tmp_path / "a.rrd")
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(replay.ReplayError, match="missing"):
        replay.open_viewer(tmp_path / "a.rrd")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display to open")
def test_a_live_view_without_a_display_says_why(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(replay.ReplayError, match="no live view"):
        replay.Recorder(tmp_path / "a.rrd", replay.Scene(CAMERA, 29.0, 1680.0), live=True)


def test_a_live_view_streams_to_this_machine_and_records(tmp_path, monkeypatch):
    """The viewer's place is taken by its own server, which needs no display."""
    from landing_sim.record import viewer

    beside = Path(sys.executable).with_name("rerun")
    stand_in = tmp_path / "rerun"
    stand_in.write_text(f'#!/bin/sh\nexec "{beside}" --serve-grpc "$@"\n')
    stand_in.chmod(0o755)
    started = []
    original = subprocess.Popen

    def popen(command, **options):
        started.append(original(command, **options))
        assert command[command.index("--bind") + 1] == "127.0.0.1"
        return started[-1]

    monkeypatch.setattr(viewer, "_program", lambda: str(stand_in))
    monkeypatch.setattr(subprocess, "Popen", popen)
    try:
        recorder = replay.Recorder(tmp_path / "a.rrd", replay.Scene(CAMERA, 29.0, 1680.0), frames_hz=2.0, live=True)
        steps = list(synthetic.fly(duration=1.2))
        for step in steps:
            recorder.add(step)
        recorder.close(build(steps, touchdown=None))
    finally:
        for process in started:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    assert {"/world/camera/image", "/errors/x", "/world/aircraft"} <= chunks(tmp_path / "a.rrd").keys()
