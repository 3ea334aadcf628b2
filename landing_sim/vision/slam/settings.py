"""What the SLAM is told before it flies: the believed camera and mounting, and its own numbers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.types import Array

LOOKS_DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""R_CB of a camera that looks straight down, image up = body forward."""


@dataclass(frozen=True, slots=True)
class Rig:
    """The believed camera and where it sits.

    lens : as calibrated; R_CB (3, 3); p_BC (3,) [m] camera from the cg, frame B; p_BS (3,) [m] sonar from the cg, frame B
    """

    lens: Fisheye
    R_CB: Array = field(default_factory=LOOKS_DOWN.copy)
    p_BC: Array = field(default_factory=lambda: np.zeros(3))
    p_BS: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, slots=True)
class SlamSettings:
    """Lengths in shares of the height above the ground where it says so; pixels at 640 x 480 and scaled to the lens."""

    fast_threshold: int = 8  # grey levels a corner must stand out by
    coarse_points: int = 60
    fine_points: int = 320  # measured in a frame that only tracks
    keyframe_points: int = 400  # measured in a keyframe: without a cap, bundle adjustment grows with the map
    coarse_half: int = 4  # patches of 9 x 9
    fine_half: int = 5  # 11 x 11
    coarse_reach: float = 6.0  # [px of the coarse level]
    fine_reach: float = 4.0  # [px]
    correlation: float = 0.7  # below, a patch is not the one looked for
    least_points: int = 20  # fewer found: the frame is lost
    least_share: float = 0.3  # of those looked for
    keyframe_distance: float = 0.22  # [height] to the nearest keyframe
    start_parallax: float = 0.1  # [height] baseline of the first two keyframes
    parallax: float = 0.0436  # [rad] 2.5 deg between two rays of a new point
    local_frames: int = 5  # free in local bundle adjustment
    scale_frames: int = 10  # keyframes until metric scale and level are frozen
    scale_readings: int = 30  # of the sonar above bare ground, which are waited for, up to twice as many keyframes
    level_ground: bool = (
        True  # take the ground for level (it is what sonar heights mean), not the inertial unit's vertical
    )
    start_heading: float | None = (
        0.0  # [rad] psi at the first image, which is what R is named after; None: what the unit says
    )
    most_turn: float = 0.06  # [rad] a pose that differs more from the inertial unit's attitude is a mistake
    sonar_outlier: float = 0.06  # [m]
    window: int = 0  # keyframes kept; 0: all
    position_floor: float = 0.004  # [m] standard deviation that no position is better than
    loss_frames: int = 3  # failures in a row until the pose is searched for among all keyframes
    seed: int = 0

    def __post_init__(self) -> None:
        if self.window and self.window < 4:
            raise ValueError(f"slam: a sliding window needs 4 keyframes or more, not {self.window}")
        if not 4 <= self.fast_threshold <= 100:
            raise ValueError(f"slam: fast_threshold must lie in 4..100 grey levels, not {self.fast_threshold}")
