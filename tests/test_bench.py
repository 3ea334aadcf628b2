"""The bench: it runs, its object has what it promises, its bound is the recursion it names, start-up stays light."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "tools"))

from bench_parts import bound, flights, own_frames, where  # noqa: E402

from landing_sim import scenario, vehicle  # noqa: E402
from landing_sim.estimators import kalman, states  # noqa: E402

PROMISED = {
    *("ratio_median", "ratio_min", "ratio_max", "recorded_ratio_median", "bare_step_us", "added_steps_per_frame"),
    *("realtime_factor", "landings_per_core_minute", "baseline"),
}


def short(seconds: float = 1.5) -> tuple[scenario.Scenario, vehicle.Vehicle]:
    s = scenario.load("do128/gust", [f"time.limit_s={seconds}"])
    return s, vehicle.load(s.aircraft.model)


def test_one_repeat_prints_the_promised_object() -> None:
    program = [sys.executable, str(ROOT / "tools" / "bench.py"), "--json", "--repeats", "1"]
    short_flight = ["--set", "time.limit_s=1.92", "--skip", "memory", "--skip", "first"]
    result = subprocess.run([*program, *short_flight], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert set(found) == {"do128", "transport", "imports"}
    for name in ("do128", "transport"):
        figures = found[name]
        assert figures.keys() >= PROMISED
        assert figures["repeats"] == 1 and figures["steps"] == 384
        assert figures["ratio_median"] > figures["plant_ratio_median"] > 1.0
        assert figures["recorded_ratio_median"] > figures["ratio_median"]
        assert 1.0 < figures["bare_step_us"] < 200.0
        share = sum(part["share"] for part in figures["where"].values())
        assert share == pytest.approx(1.0)
        assert figures["where"]["plant: step"]["calls"] == figures["steps"]
    baseline = found["do128"]["baseline"]
    assert baseline["measured_share"] > 0.9 and baseline["own_frames_measured_share"] > 0.9
    assert baseline["cost_ratio"] > baseline["cost_ratio_on_our_frames"] > 1.0
    assert found["imports"].keys() >= {"numpy_cpu_s", "help_per_numpy", "check_per_numpy"}


def test_the_baselines_own_frames_show_the_same_scene() -> None:
    """Within what its drawing is known to do: edges most of a pixel outside, and a flat Earth's horizon."""
    s, v = short(1.0)
    steps: list = []
    flights.land(s, v, watch=steps.append)
    frame = next(sample.data.frame for sample in steps[-1].samples if sample.sensor == "camera")
    p_RC, R_CR = frame.poses[0]
    ours = cv2.GaussianBlur(frame.full().astype(float), (0, 0), 2.0)

    def alike(R: np.ndarray) -> float:
        """Correlation below the horizon, noise smoothed away."""
        theirs = cv2.GaussianBlur(own_frames.artist(s)(p_RC, R).astype(float), (0, 0), 2.0)
        below = np.flatnonzero(ours.mean(axis=1) < 120.0)[6:]
        return float(np.corrcoef(theirs[below].ravel(), ours[below].ravel())[0, 1])

    turn = 2.0 / s.camera.focal_px  # two pixels to the side
    aside = np.array([[1.0, 0.0, turn], [0.0, 1.0, 0.0], [-turn, 0.0, 1.0]])
    assert alike(R_CR) > 0.985 > alike(aside @ R_CR)


def test_bare_flies_the_same_trajectory_to_the_bit() -> None:
    s, v = short()
    tape = flights.tape(s, v)
    assert tape.steps == len(tape.writes)
    assert flights.fly_bare(s, v, tape).cpu > 0.0  # raises where it ends elsewhere
    first_command = next(k for k, writes in enumerate(tape.writes) if k and any(i == 0 for i, _ in writes))
    broken = flights.Tape(tape.commands, tape.writes[:first_command] + ((),) * (tape.steps - first_command), tape.end)
    with pytest.raises(RuntimeError, match="to the bit"):
        flights.fly_bare(s, v, broken)


def test_stop_watch_charges_each_part_for_itself() -> None:
    now = 0.0
    watch = where.StopWatch(clock=lambda: now)

    def take(seconds: float) -> None:
        nonlocal now
        now += seconds

    inner = watch.on("inner", lambda: take(0.25))
    outer = watch.on("outer", lambda: (take(1.0), inner(), take(2.0)))
    watch.start()
    for _ in range(5):
        outer()
        take(0.5)
    watch.stop()
    assert watch.calls == {"inner": 5, "outer": 5}
    assert watch.seconds == {"inner": 1.25, "outer": 15.0, where.LOOP: 2.5}


def test_bound_is_tichavskys_recursion() -> None:
    rng = np.random.default_rng(1)
    F = np.eye(4) + 0.2 * rng.normal(size=(4, 4))
    A, B = rng.normal(size=(2, 4, 4))
    J, Q = A @ A.T + np.eye(4), B @ B.T + np.eye(4)
    H, R = rng.normal(size=(3, 4)), np.array([0.5, 1.0, 2.0])
    D11, D12 = F.T @ np.linalg.solve(Q, F), -F.T @ np.linalg.inv(Q)
    D22 = np.linalg.inv(Q) + H.T @ np.diag(1.0 / R) @ H
    expected = D22 - D12.T @ np.linalg.solve(J + D11, D12)
    P = kalman.predict_dense(np.linalg.inv(J), F, Q, np.array([0, 4]))
    np.testing.assert_allclose(np.linalg.inv(bound.measured(P, H, R)), expected, rtol=1e-9)


def test_bound_lies_near_the_filters_own_sigma() -> None:
    """Jacobians at the truth or at an estimate 0.1 % away are nearly the same, and so are the covariances they give."""
    s, v = short(4.0)
    parts: list = []
    steps: list = []
    log = flights.land(s, v, prepare=parts.append, watch=steps.append).log
    p = parts[0]
    limit = bound.Bound(p.estimator, s.runway.width_m, p.plant.trimmed, p.clock.delay * p.clock.dt)
    sigma = [limit.add(step) for step in steps][-1]
    assert sigma is not None
    for name, i in (("x", 9), ("y", 10), ("H", 11)):
        assert sigma[i] == pytest.approx(log.sigma(name)[-1], rel=0.15)
    assert 0.8 < np.sqrt(np.mean(np.square(limit.edge_errors))) < 1.2


def test_bound_begins_with_the_filters_own_prior() -> None:
    s, v = short(0.3)
    parts: list = []
    steps: list = []
    log = flights.land(s, v, prepare=parts.append, watch=steps.append).log
    p = parts[0]
    limit = bound.Bound(p.estimator, s.runway.width_m, p.plant.trimmed, p.clock.delay * p.clock.dt)
    first = int(np.argmax(log["valid"]))
    sigma = [limit.add(step) for step in steps[: first + 1]][-1]
    believed = [log.sigma(name)[first] for name in states.NAMES[:12]]
    np.testing.assert_allclose(sigma, believed, rtol=1e-12)


def test_an_error_that_lasts_is_told_from_noise_of_its_size() -> None:
    rng = np.random.default_rng(3)
    groups = [k // 48 for k in range(48 * 400)]
    noise = rng.normal(size=len(groups))
    pulled = 0.25 + np.sqrt(1.0 - 0.25**2) * noise
    assert np.sqrt(np.mean(pulled**2)) == pytest.approx(1.0, abs=0.02)
    assert bound.lasting(list(noise), groups) == pytest.approx(1.0, abs=0.1)
    assert bound.lasting(list(pulled), groups) == pytest.approx(2.0, abs=0.1)  # sqrt(1 - 0.0625 + 48 * 0.0625)


def test_standard_error_is_that_of_independent_flights() -> None:
    """RMS of n values of variance 1 has the standard deviation 1 / sqrt(2 n), n = 5 for each of 60 flights."""
    rng = np.random.default_rng(4)
    found = [bound.standard_error(list(rng.normal(size=(60, 5))), [np.ones(5)] * 60) for _ in range(40)]
    assert np.mean(found) == pytest.approx(1.0 / np.sqrt(600.0), rel=0.1)
    # a hundred cycles of one flight that all say the same are no more than one
    same = [np.repeat(e, 100) for e in rng.normal(size=(60, 1))]
    assert bound.standard_error(same, [np.ones(100)] * 60) == pytest.approx(1.0 / np.sqrt(120.0), rel=0.4)
    assert np.isnan(bound.standard_error([np.ones(3)], [np.ones(3)]))


@pytest.mark.parametrize("arguments", [["--help"], ["check", "do128/gust"]])
def test_start_up_is_light(arguments: list[str]) -> None:
    code = f"""
import sys
from landing_sim import cli
sys.argv = ["landing-sim", *{arguments!r}]
try:
    cli.main()
except SystemExit as end:
    assert not end.code
print("\\n" + " ".join(m for m in ("rerun", "matplotlib", "control", "cv2", "jsbsim", "numba") if m in sys.modules))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == ""
