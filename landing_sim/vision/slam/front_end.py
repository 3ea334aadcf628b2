"""The SLAM among the sensors: images and sonar readings in, measurements "position" out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.signals import Estimate, Measurement, Sample
from landing_sim.vision.slam.pose import Pose
from landing_sim.vision.slam.slam import UNSCALED, Located, Slam


class SlamFrontEnd:
    """interfaces.FrontEnd for the sensor "camera": a measurement "position", z (3,) x, y, z of the cg in R.

    R (3,) are variances from the pose's covariance and `position_floor`. Where there is none, `slam.reason` says why, and
    `slam.status` may be "lost". `located` is what the latest image showed and where it was taken, for the landing-place
    detector; None where that is not known.
    Asks the estimate for phi, theta, psi at the image's time, and for x, y, H where it flags "localised" or no map has been
    begun. Holds the map: it is never rewound.

    added : [m] standard deviation of noise, from `noise`, put on every position that is handed out: rendered images and a
        perfectly known lens make far better positions than a real camera would. The tracking itself does not see it.
    """

    __slots__ = ("_added", "_noise", "located", "sensor", "slam")

    def __init__(self, slam: Slam, added: float = 0.0, noise: NoiseStream | None = None) -> None:
        """Raises ValueError for added noise without a stream."""
        if not added >= 0.0 or (added > 0.0 and noise is None):
            raise ValueError(f"slam: {added} m of added noise need a standard deviation >= 0 and a noise stream")
        self.sensor = "camera"
        self.slam = slam
        self.located: Located | None = None
        self._added, self._noise = added, noise

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        """Raises ValueError for an estimate without attitude."""
        believed = estimate()
        euler = np.array([believed[name] for name in ("phi", "theta", "psi")])
        p_said = None
        if believed.valid and (self.slam.status == "starting" or believed.flags.get("localised", False)):
            p_said = np.array([believed["x"], believed["y"], -believed["H"]])
        self.located = located = self.slam.image(sample.t_valid, sample.data.frame.full(), euler, p_said)
        if located is None:
            return ()
        variance = np.diag(located.cov) + self.slam.settings.position_floor**2
        if self._noise is not None and self._added > 0.0:
            off = self._added * self._noise.normal(3)
            pose = Pose(located.pose.R_CR, located.pose.p_RC + off)
            self.located = located = replace(located, pose=pose, p_RB=located.p_RB + off)
        if not located.metric:
            variance = variance + (UNSCALED * located.p_RB[2]) ** 2
        return (Measurement("position", sample.t_valid, sample.t_arrival, located.p_RB, variance),)


class SonarToSlam:
    """interfaces.FrontEnd for the sensor "sonar": hands the readings to the map, which takes its scale from them."""

    __slots__ = ("sensor", "slam")

    def __init__(self, slam: Slam) -> None:
        self.sensor = "sonar"
        self.slam = slam

    def process(self, sample: Sample, estimate: Callable[[], Estimate]) -> tuple[Measurement, ...]:
        self.slam.sonar(sample.t_valid, float(sample.data))
        return ()
