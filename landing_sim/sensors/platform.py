"""What carries the camera, part of the plant: a two-axis platform, or the airframe itself."""

from __future__ import annotations

import math
from collections.abc import Sequence

from landing_sim.jit import direct, kernel


class PanTilt:
    """Pan and tilt servos with lag, rate and range limits, inertially stabilised by rate feedback.

        pan'  = (pan_cmd - pan) / lag - k (r + tan(tilt) (p cos pan + q sin pan))
        tilt' = (tilt_cmd - tilt) / lag - k (q cos pan - p sin pan)

    limited to the rate limit; the brackets are the body's rotation about the platform's axes, which its own gyros
    measure and cancel with gain k.

    Parameters
    ----------
    lag : [s] first-order; 0 follows at once, within the rate limit
    rate_limit : [rad/s]
    pan_limit, tilt_limit : [rad] either way; |tilt| must stay below 80 degrees, where the axes fold
    stabilisation : k, 0 none .. 1 perfect
    pan, tilt : [rad] where it stands at first, and is asked to stand

    Source     Dickmanns & Schell 1992, sections 3 and 7.1 (angular rate feedback for inertial stabilisation). The paper
               gives no figures.
    """

    __slots__ = (
        "_advance",
        "_lag",
        "_rate_limit",
        "_stabilisation",
        "pan",
        "pan_cmd",
        "pan_limit",
        "pan_rate",
        "tilt",
        "tilt_cmd",
        "tilt_limit",
        "tilt_rate",
    )

    def __init__(
        self,
        lag: float = 0.08,
        rate_limit: float = math.radians(60.0),
        pan_limit: float = math.radians(60.0),
        tilt_limit: float = math.radians(45.0),
        stabilisation: float = 0.95,
        pan: float = 0.0,
        tilt: float = 0.0,
    ) -> None:
        if not (math.isfinite(lag) and lag >= 0.0 and rate_limit > 0.0 and 0.0 <= stabilisation <= 1.0):
            raise ValueError(
                "platform needs lag >= 0, rate_limit > 0 and stabilisation within 0..1; "
                f"got {lag}, {rate_limit}, {stabilisation}"
            )
        if not (0.0 < pan_limit <= math.pi and 0.0 < tilt_limit <= math.radians(80.0)):
            raise ValueError(
                f"platform limits must lie in 0..pi (pan) and 0..80 deg (tilt), got {pan_limit}, {tilt_limit}"
            )
        self._lag, self._rate_limit, self._stabilisation = float(lag), float(rate_limit), float(stabilisation)
        self.pan_limit, self.tilt_limit = float(pan_limit), float(tilt_limit)
        self.reset(pan, tilt)

    def reset(self, pan: float, tilt: float) -> None:
        """Stand still at these angles [rad]; ValueError beyond the limits."""
        if not (abs(pan) <= self.pan_limit and abs(tilt) <= self.tilt_limit):
            raise ValueError(
                f"platform cannot stand at pan {pan}, tilt {tilt} rad: limits {self.pan_limit}, {self.tilt_limit}"
            )
        self.pan = self.pan_cmd = float(pan)
        self.tilt = self.tilt_cmd = float(tilt)
        self.pan_rate = self.tilt_rate = 0.0  # [rad/s] relative to the body
        self._advance = _advance
        self.step(pan, tilt, (0.0, 0.0, 0.0), 1.0)  # moves nothing: it is compiled now
        self._advance = direct(_advance)

    def step(self, pan_cmd: float, tilt_cmd: float, w_RB_B: Sequence[float], dt: float) -> None:
        """Advance dt [s] towards the commanded angles [rad] while the body turns at w_RB_B: p, q, r [rad/s].

        Commands beyond the limits are held at the limit by the mount, as is the mount itself.
        """
        self.pan_cmd, self.tilt_cmd = pan_cmd, tilt_cmd
        p, q, r = w_RB_B
        self.pan, self.tilt, self.pan_rate, self.tilt_rate = self._advance(
            self.pan, self.tilt, pan_cmd, tilt_cmd, p, q, r, dt,
            self._lag, self._rate_limit, self._stabilisation, self.pan_limit, self.tilt_limit,
        )  # fmt: skip


class Strapdown:
    """A camera bolted to the airframe: looks along body x, raised by `tilt` [rad], whatever is commanded."""

    __slots__ = ("pan", "pan_cmd", "pan_rate", "tilt", "tilt_cmd", "tilt_rate")

    def __init__(self, tilt: float) -> None:
        if not abs(tilt) <= math.radians(80.0):
            raise ValueError(f"a strapped-down camera looks up or down by at most 80 deg, not {math.degrees(tilt):g}")
        self.pan = self.pan_cmd = self.pan_rate = self.tilt_rate = 0.0
        self.tilt = self.tilt_cmd = tilt

    def reset(self, pan: float, tilt: float) -> None:
        """Nothing moves."""

    def step(self, pan_cmd: float, tilt_cmd: float, w_RB_B: Sequence[float], dt: float) -> None:
        """Nothing moves."""


@kernel
def _advance(
    pan: float, tilt: float, pan_cmd: float, tilt_cmd: float, p: float, q: float, r: float, dt: float,
    lag: float, most: float, k: float, pan_limit: float, tilt_limit: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    # Exact for a command constant over dt, so that the lag does not depend on the step.
    follow = -math.expm1(-dt / lag) / dt if lag > 0.0 else 1.0 / dt
    ca, sa = math.cos(pan), math.sin(pan)
    wanted_pan = min(max(pan_cmd, -pan_limit), pan_limit)
    wanted_tilt = min(max(tilt_cmd, -tilt_limit), tilt_limit)
    pan_rate = (wanted_pan - pan) * follow - k * (r + math.tan(tilt) * (p * ca + q * sa))
    tilt_rate = (wanted_tilt - tilt) * follow - k * (q * ca - p * sa)
    new_pan = min(max(pan + min(max(pan_rate, -most), most) * dt, -pan_limit), pan_limit)
    new_tilt = min(max(tilt + min(max(tilt_rate, -most), most) * dt, -tilt_limit), tilt_limit)
    return new_pan, new_tilt, (new_pan - pan) / dt, (new_tilt - tilt) / dt
