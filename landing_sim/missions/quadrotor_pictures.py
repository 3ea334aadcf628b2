"""What a quadrotor's recording shows besides its log: the place from above, camera images and what was seen in them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from landing_sim.estimators.readings import Fresh
from landing_sim.geometry.fisheye import Fisheye
from landing_sim.missions import quadrotor_eyes as eyes
from landing_sim.missions.quadrotor_landing import Mission, scene
from landing_sim.noise import Noise
from landing_sim.record.log import FlightLog
from landing_sim.record.quadrotor_replay import Place, QuadrotorRecorder, Sight
from landing_sim.sections.quadrotor import QuadrotorScenario
from landing_sim.sensors.fisheye import FisheyeRenderer
from landing_sim.signals import CameraSample, Step
from landing_sim.types import Array
from landing_sim.world.planes import Scene

HIGH = 60.0  # [m] from where the place is looked at as if from straight above
PIXELS = 1024
AROUND = 1.6  # [m] shown around where it flies
ON = 0.03  # [m] a feature within this of a plane is on it
GROUND, RAISED = 1, 2


class Pictures:
    """Writes a recording. Images of an emulated flight are rendered for it alone."""

    def __init__(self, path: Path, s: QuadrotorScenario, mission: Mission, live: bool) -> None:
        place = scene(s)
        self._lens, self._s = eyes.lens(s), s
        self._eye = eyes.renderer(s, place, Noise(s.seed, "recorded pixels", s.run))
        self._looking = _looking(mission)
        self._period = 1.0 / s.record.frames_hz if s.record.frames_hz > 0.0 else math.inf
        self._due = 0.0 if s.record.frames_hz > 0.0 else math.inf
        self._recorder = QuadrotorRecorder(path, _place(s, mission, place), live)

    def add(self, step: Step) -> None:
        """The image of this step, if it is time for one."""
        if step.truth.t < self._due - 1e-9:
            return
        if self._looking is None:
            pixels = self._eye.image(step.camera.p_RC, step.camera.R_CR, round(1000.0 * step.truth.t))
            self._recorder.picture(step.truth.t, pixels)
        else:
            samples = [sample for sample in step.samples if isinstance(sample.data, CameraSample)]
            if not samples:
                return
            self._recorder.picture(samples[-1].t_valid, samples[-1].data.frame.full(), self._sight())
        self._due = step.truth.t + self._period

    def close(self, flown: FlightLog, other: FlightLog | None = None) -> None:
        """The log, and another's path; then the file is complete."""
        self._recorder.close(flown, other)

    def _sight(self) -> Sight | None:
        looking = self._looking
        at = None if looking is None else looking.localiser.located
        if looking is None or at is None:
            return None
        up, plane = -at.X[:, 2], np.zeros(len(at.X), np.int64)
        plane[np.abs(up) < ON] = GROUND
        way_point = None
        if looking.look is not None:
            for candidate in looking.look.candidates:
                p = candidate.point.p_R
                on = np.abs(up + p[2]) < ON
                on &= np.hypot(at.X[:, 0] - p[0], at.X[:, 1] - p[1]) < candidate.point.size[0]
                plane[on] = RAISED
            if looking.look.place is not None:
                way_point = self._lens.project((looking.look.place.p_R - at.pose.p_RC) @ at.pose.R_CR.T)
        return Sight(at.uv, at.X, plane, way_point)


def _looking(mission: Mission) -> eyes.Looking | None:
    front_end = mission.parts.front_ends.get("camera")
    inner = front_end.front_end if isinstance(front_end, Fresh) else front_end
    inner = inner.inner if isinstance(inner, eyes.While) else inner
    return inner if isinstance(inner, eyes.Looking) else None


def _place(s: QuadrotorScenario, mission: Mission, place: Scene) -> Place:
    at = np.array([(0.0, 0.0), *((box.x, box.y) for box in mission.scene_boxes)])
    if s.task == "land":
        at = np.vstack([at, [(s.path.goal_x_m, s.path.goal_y_m)]])
    low, high = at.min(axis=0) - AROUND, at.max(axis=0) + AROUND
    middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
    above = _from_above(place, middle, half)
    area = (float(middle[0] - half), float(middle[0] + half), float(middle[1] - half), float(middle[1] + half))
    return Place(above, area, tuple(box.corners() for box in mission.scene_boxes), f"{s.name}, seed {s.seed}")


def _from_above(place: Scene, middle: Array, half: float) -> np.ndarray:
    """(PIXELS, PIXELS) uint8: rows of x, columns of y, of the square of `half` its side about `middle` (2,) [m]."""
    lens = Fisheye(PIXELS, PIXELS, 0.5 * PIXELS / math.atan(half / HIGH))
    looks_down = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # up in the image is x
    seen = FisheyeRenderer(lens, place, 0.0, 0).image(np.array([*middle, -HIGH]), looks_down, 0)
    return np.ascontiguousarray(seen[::-1])
