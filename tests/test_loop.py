"""The closed loop's clockwork, with parts that only write down what happens to them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

import numpy as np
import pytest

from landing_sim.loop import Clock, estimate_offline, simulate, whole_steps
from landing_sim.signals import CameraTruth, Command, Estimate, Measurement, Reference, Sample, Truth


def truth_at(tick: int) -> Truth:
    zero = np.zeros(3)
    return Truth(
        tick, tick * 0.005, zero, np.eye(3), zero, zero, zero, zero, 50.0, 0.0, 0.0, np.zeros(4), 0.0, zero,
        np.zeros(3, dtype=bool), 1.0,
    )  # fmt: skip


class Plant:
    dt = 0.005
    touchdown = None

    def __init__(self) -> None:
        self.tick = 0
        self.commands: list[float] = []

    def reset(self) -> Truth:
        return truth_at(0)

    def step(self, command: Command, wind_R: np.ndarray) -> None:
        self.commands.append(command.elevator)
        self.tick += 1

    def truth(self) -> Truth:
        return truth_at(self.tick)

    def camera(self) -> CameraTruth:
        return CameraTruth(np.zeros(3), np.eye(3), 0.0, 0.0)

    def fast_truth(self) -> tuple[float, float, float, float]:
        return 0.0, 0.0, 0.0, 50.0


class Air:
    def wind(self, t: float, x: float, y: float, height: float, airspeed: float) -> np.ndarray:
        return np.zeros(3)


class Eye:
    """Sends the tick at which it looked, `latency` late."""

    def __init__(self, name: str, period: float, latency: float) -> None:
        self.name, self.period, self.latency = name, period, latency

    def sense(self, truth: Truth, camera: CameraTruth) -> Sample:
        return Sample(self.name, truth.t, truth.t + self.latency, truth.tick)


class Through:
    sensor = "eye"

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        z = np.array([float(sample.data)])
        return (Measurement("tick", sample.t_valid, sample.t_arrival, z, np.ones(1)),)


class Diary:
    """An estimator whose memory is the list of what it was told."""

    def init(self, t: float) -> tuple:
        return ((), t)

    def predict(self, memory: tuple, command: Command, t: float) -> tuple:
        log, now = memory
        return (log if t <= now + 1e-12 else (*log, ("p", round(t, 4), command.elevator)), t)

    def update(self, memory: tuple, measurement: Measurement) -> tuple:
        return ((*memory[0], ("u", measurement.z[0])), memory[1])

    def read(self, memory: tuple, t: float | None = None) -> Estimate:
        return Estimate(memory[1], ("n",), np.array([float(len(memory[0]))]), None, True, {"log": memory[0]})  # type: ignore[dict-item]


class Nowhere:
    def init(self) -> None:
        return None

    def step(self, memory: None, estimate: Estimate) -> tuple[None, Reference]:
        return None, Reference("glide", 50, 0, 0, 0, 0, 0)


class Counter:
    """Commands 1, 2, 3 ... so that each can be recognised at the actuators."""

    def init(self) -> int:
        return 0

    def step(self, memory: int, estimate: Estimate, reference: Reference) -> tuple[int, Command]:
        return memory + 1, Command(elevator=float(memory + 1))


def fly(delay: int, n: int, *eyes: Eye) -> tuple[list, Plant]:
    plant = Plant()
    eyes = eyes or (Eye("eye", 0.06, 0.0),)
    run = simulate(
        Clock(0.005, 12, delay), plant, Air(), eyes, {"eye": Through()}, Diary(), Nowhere(), Counter(), Command()
    )  # fmt: skip
    return list(islice(run, n)), plant


def test_a_command_acts_after_the_computing_delay() -> None:
    _, plant = fly(12, 4)
    assert plant.commands == [0.0] * 12 + [1.0] * 12 + [2.0] * 12
    _, plant = fly(0, 3)
    assert plant.commands == [1.0] * 12 + [2.0] * 12
    _, plant = fly(5, 3)
    assert plant.commands == [0.0] * 5 + [1.0] * 12 + [2.0] * 7


def test_the_estimator_is_told_the_command_that_acts_when_it_acts() -> None:
    steps, _ = fly(5, 3)
    predictions = [entry for entry in steps[-1].estimate.flags["log"] if entry[0] == "p"]
    assert predictions == [("p", 0.025, 0.0), ("p", 0.06, 1.0), ("p", 0.085, 1.0), ("p", 0.12, 2.0)]


def test_late_samples_arrive_late_and_carry_their_time() -> None:
    steps, _ = fly(12, 5, Eye("eye", 0.06, 0.12))
    assert [len(s.samples) for s in steps] == [0, 0, 1, 1, 1]
    assert steps[2].samples[0].t_valid == 0.0
    assert steps[2].measurements[0].z[0] == 0.0


def test_a_slower_sensor_is_read_at_its_own_period() -> None:
    steps, _ = fly(12, 7, Eye("eye", 0.18, 0.0))
    assert [len(s.samples) for s in steps] == [1, 0, 0, 1, 0, 0, 1]


def test_a_reference_sensor_without_front_end_only_reaches_the_log() -> None:
    steps, _ = fly(12, 2, Eye("dgps", 0.06, 0.0))
    assert len(steps[0].samples) == 1
    assert steps[0].measurements == ()


@pytest.mark.parametrize("delay", [0, 5, 12, 17])
def test_offline_estimation_tells_the_estimator_what_it_was_told_in_flight(delay: int) -> None:
    steps, _ = fly(delay, 6)
    offline = list(estimate_offline(Clock(0.005, 12, delay), steps, {"eye": Through()}, Diary(), Command()))
    for step, estimate in zip(steps, offline):
        assert step.estimate.flags["log"] == estimate.flags["log"]


def test_periods_must_be_whole_numbers_of_steps() -> None:
    assert whole_steps(0.06, 0.005) == 12
    with pytest.raises(ValueError, match="not a whole number"):
        whole_steps(0.033, 0.005)


def test_a_sensor_faster_than_or_beside_the_cycle_is_refused() -> None:
    with pytest.raises(ValueError, match="whole number of cycles"):
        fly(12, 2, Eye("eye", 0.1, 0.0))
