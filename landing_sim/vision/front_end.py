"""The camera's front end: pixels into edge displacements, or into a pose when nothing is known yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from landing_sim.signals import CameraSample, EdgeSet, Estimate, Measurement, Sample
from landing_sim.types import Array
from landing_sim.vision.acquisition import Acquisition, AcquisitionConfig
from landing_sim.vision.believed import BelievedCamera, RunwayMap
from landing_sim.vision.prediction import PAN, SIGHT, TILT, sight_from
from landing_sim.vision.windows import EdgeConfig, Scheme, SearchConfig, WindowPlanner


@dataclass(frozen=True, slots=True)
class FrontEndConfig:
    """scheme: windows by feature, see `Scheme`. platform_angle: whether the filter is told what the encoders read or what
    was commanded (all that a system without encoders knows)."""

    scheme: str = "3L3R2T2H"
    platform_angle: Literal["encoder", "commanded"] = "encoder"
    search: SearchConfig = field(default_factory=SearchConfig)
    edges: EdgeConfig = field(default_factory=EdgeConfig)
    acquisition: AcquisitionConfig = field(default_factory=AcquisitionConfig)

    def __post_init__(self) -> None:
        Scheme.parse(self.scheme)
        if self.platform_angle not in ("encoder", "commanded"):
            raise ValueError(f"platform_angle: must be 'encoder' or 'commanded', not {self.platform_angle!r}")


SEARCHED_AT_FIRST = 100  # images: whoever has found nothing in them is on the way up again
SEARCHED_WHEN_LOST = 5  # one image in so many: a search costs many times what windows do


class RunwayFrontEnd:
    """interfaces.FrontEnd for the sensor "camera".

    While the estimate is not valid each of the first SEARCHED_AT_FIRST images is searched for the runway; later, and while
    the estimate says that it is lost, one in SEARCHED_WHEN_LOST: a measurement "pose" (x, y, H of the cg, phi, theta, psi;
    R (6, 6)), or none, with `reason` telling why. Else windows are placed by prediction: a measurement "edges" with R (n,)
    variances [px^2]; where the runway is lost they may still find the horizon.

    Holds no memory between frames but `reason`, which nothing reads back.
    """

    __slots__ = (
        "_acquisition", "_counts", "_encoder", "_names", "_planner", "_sight_of", "_unknown", "_unsaid", "_width", "reason",
        "sensor",
    )  # fmt: skip

    def __init__(self, runway: RunwayMap, camera: BelievedCamera, config: FrontEndConfig | None = None) -> None:
        config = config or FrontEndConfig()
        self.sensor = "camera"
        self.reason = ""
        self._planner = WindowPlanner(runway, camera, config.search, config.edges)
        self._acquisition = Acquisition(runway, camera, config.acquisition, config.edges)
        self._counts = Scheme.parse(config.scheme).counts
        self._encoder = config.platform_angle == "encoder"
        self._width = runway.width
        self._unknown: Array = np.diag([10.0, 2.0, 1.0, 0.01, 0.01, 0.01, 0.0, 0.0, 0.0]) ** 2  # without covariance
        self._names: tuple[str, ...] = ()
        self._sight_of: tuple[np.ndarray, Array] = np.empty((0, 2), np.int64), np.empty(0)
        self._unsaid: Array = np.empty((0, 0))  # in place of a covariance that the estimate does not have

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        """`estimate` answers for sample.t_valid.

        Raises ValueError for an estimate that is not finite or lacks one of x, y, H, phi, theta, psi.
        """
        data: CameraSample = sample.data
        pan, tilt = (data.pan, data.tilt) if self._encoder else (data.pan_cmd, data.tilt_cmd)
        believed = estimate()
        lost = believed.flags.get("lost", False)
        due = data.index % SEARCHED_WHEN_LOST == 0
        if not believed.valid and data.index >= SEARCHED_AT_FIRST and not due:
            return ()
        if not believed.valid or (lost and due):
            got = self._acquisition.acquire(data, pan, tilt)
            self.reason = got.reason
            if got.z is None or got.R is None:
                return ()
            return (Measurement("pose", sample.t_valid, sample.t_arrival, got.z, got.R),)
        if believed.names is not self._names:
            self._names, self._sight_of = believed.names, sight_of(believed.names)
            self._unsaid = np.zeros((len(believed.names), len(believed.names)))
        P = self._unsaid if believed.cov is None else believed.cov
        sight, cov, finite = sight_from(*self._sight_of, believed.mean, P, pan, tilt, self._width)
        if not finite:
            raise ValueError(f"camera front end: the estimate at t = {believed.t} s is not finite: {sight.tolist()}")
        w = self._planner.place(sight, self._unknown if believed.cov is None else cov, self._counts)
        z, variance, _, status = self._planner.measure(data.frame, w)
        edges = EdgeSet(w.feature, w.centre, w.direction, status, pan, tilt)
        return (Measurement("edges", sample.t_valid, sample.t_arrival, z, variance, edges),)


def sight_of(names: tuple[str, ...]) -> tuple[np.ndarray, Array]:
    """Entries and signs that make an estimate's states the sight, less the platform angles read: see `sight_from`.

    What is read is the true angle plus bias ("epan", "etilt") plus noise ("jpan", "jtilt"), if these are estimated.
    Raises ValueError if one of x, y, H, phi, theta, psi is not among the names.
    """
    missing = [name for name in SIGHT[:PAN] if name not in names]
    if missing:
        raise ValueError(
            f"camera front end: the estimate lacks {', '.join(missing)}; it needs {', '.join(SIGHT[:PAN])}"
        )
    errors = ((PAN, "epan"), (PAN, "jpan"), (TILT, "etilt"), (TILT, "jtilt"))
    told = [(row, name, 1.0) for row, name in enumerate(SIGHT)] + [(row, name, -1.0) for row, name in errors]
    known = [(row, names.index(name), sign) for row, name, sign in told if name in names]
    return np.array([entry[:2] for entry in known], np.int64), np.array([sign for _, _, sign in known])
