"""What is on board: vision, estimator, what is believed, control."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.sections.bounds import NotNegative, Positive


class Vision(Section):
    """The front end."""

    windows: str = Field(
        "3L3R2T2H",
        pattern=r"^[0-9]{1,2}L[0-9]{1,2}R([0-9]{1,2}T)?[0-9]{1,2}H$",
        description="windows on left, right borderline, threshold, horizon; a lost threshold's move to the borderlines",
    )
    platform_angle: Literal["encoder", "commanded"] = Field("encoder", description="which platform angles are believed")
    edge_floor_px: float = Field(
        0.01, ge=0, le=5, description="1 sigma added to what noise makes an edge uncertain by: 0.5 is the trust of 1992"
    )


class Filter(Section):
    """The estimator."""

    kind: Literal["augmented", "plain", "split", "observer"] = Field(
        "augmented",
        description="12 states with wind and gyro bias; the paper's 12; the paper's two halves of 6; or a range observer "
        "on an unknown runway (section observer)",
    )
    factorisation: Literal["dense", "ud"] = Field(
        "dense", description="full covariance, or Bierman's sequential U-D update"
    )
    process_noise: Literal["integrated", "constant"] = Field(
        "integrated", description="eq. (9), or the constant matrix of eqs. (13), (14)"
    )
    width: Literal["known", "state", "separate"] = Field(
        "known", description="runway width: believed, estimated, or by a second filter"
    )
    believed_width_m: float | None = Field(None, gt=0, le=200, description="null = the true width")
    compensate_latency: bool = Field(True, description="apply an image at the time it was exposed")
    gate_sigma: Annotated[float, Field(gt=0, le=100)] | Literal["auto"] | None = Field(
        "auto", description="reject a window beyond this; null = no gate; auto = 4 if wind is estimated, else no gate"
    )


class Observer(Section):
    """The runway's size is not known: its change with the aircraft's own motion tells the range (filter.kind observer)."""

    ranging: Literal["gibert", "ekf"] = Field("gibert", description="high-gain observer, or extended Kalman filter")
    outputs: Literal["both", "width", "point"] = Field(
        "both",
        description="what gibert ranges with: the runway's angular width, the threshold's bearing (unobservable on the "
        "glide path), or both",
    )
    first_range_m: Positive | None = Field(
        None, description="first guess of the range to the threshold; null = what a runway 45 m wide would be at"
    )
    bandwidth_rps: float = Field(0.6, gt=0, le=5, description="of the range at first, gibert; it falls to 0.7 of that")
    attitude: Literal["inertial", "horizon"] = Field("inertial", description="where roll and pitch come from")
    trust_percent: float = Field(
        10.0, gt=0, le=100, description="the range steers nothing before its error bound has come below this"
    )


class Believed(Section):
    """How far the onboard models are from the truth."""

    aero_sigma: float = Field(
        0.08, ge=0, le=0.5, description="1 sigma of the relative error of each aerodynamic parameter"
    )
    mass_sigma: float = Field(0.03, ge=0, le=0.5, description="1 sigma of the relative error of mass and inertia")
    turbulence_mps: NotNegative | None = Field(
        None, description="reported turbulence, as the wind at 20 ft that goes with it; null = as it is"
    )
    wind_reported: bool = Field(
        False,
        description="the steady wind is known on board: where the flight begins, and, by the tower, at 33 ft; "
        "else its prior is still air",
    )
    focal_scale: float = Field(1.0, ge=0.5, le=2, description="believed over true focal length")
    encoder_sigma_deg: float = Field(
        0.03, ge=0, le=5, description="what the data sheet says of the platform's constant angle error, 1 sigma"
    )
    pointing_sigma_deg: float = Field(
        0.7, ge=0, le=5, description="how well the camera is turned to the runway at the start, 1 sigma, cut at 2"
    )


class Control(Section):
    """The controller."""

    delay_s: float = Field(0.06, ge=0, le=1, description="from a command's computation to the actuators")
    rho: float = Field(
        0.1, ge=0, le=100, description="weight of plain LQ against the prescribed eigenstructure (0 = exact)"
    )


class Doubt(Section):
    """How much of it an approach is flown on with: beyond it for longer than patience_s it is given up.

    Limits are of the estimate's own 1 sigma. Below the vehicle's decision height any approach is continued.
    """

    lateral_m: Positive = Field(1.0, description="at the threshold; further out a hundredth of the range is added")
    height_m: Positive = Field(0.7, description="on the ground; higher up two hundredths of the height are added")
    pitch_deg: Positive = Field(1.0, description="of pitch and of roll")
    blind_s: Positive = Field(2.0, description="without any edge")
    patience_s: NotNegative = Field(0.5, description="doubt for no longer is waited out")


class Guidance(Section):
    """The path that is flown, where it is not the vehicle's own."""

    glide_deg: float | None = Field(None, ge=1, le=8, description="angle of the glide path; null = the vehicle's")
    touchdown_x_m: float | None = Field(
        None, ge=100, le=2000, description="where the path ends on the runway; null = the vehicle's"
    )
    lateral_offset_m: float = Field(
        0.0, ge=-20, le=20, description="guidance takes a line this far right (+) of the centreline for it"
    )
    doubt: Doubt | None = Field(
        None, description="go around when the estimate is this uncertain; null = never for that"
    )
