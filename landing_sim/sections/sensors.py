"""The true camera and the other sensors."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from landing_sim.config import Section
from landing_sim.sections.bounds import NotNegative, Positive


class Platform(Section):
    """The two-axis camera mount."""

    lag_s: NotNegative = Field(0.08, description="time constant of its servo")
    rate_limit_dps: Positive = Field(60.0, description="fastest it turns")
    stabilisation: float = Field(0.95, ge=0, le=1, description="inertial rate feedback: 0 none, 1 perfect")
    encoder_bias_deg: float = Field(0.03, ge=-5, le=5, description="constant error of both angle readings")
    encoder_noise_deg: NotNegative = Field(0.005, description="1 sigma, each reading")
    encoder_skew_s: float = Field(0.0, ge=0, le=1, description="angle readings are older than the image by this")


class Camera(Section):
    """The true camera."""

    width_px: int = Field(512, ge=64, le=4096, description="image width")
    height_px: int = Field(512, ge=64, le=4096, description="image height")
    focal_px: float = Field(2000.0, ge=50, le=50000, description="focal length in pixels")
    blur_px: float = Field(0.7, ge=0.3, le=20, description="optical blur, 1 sigma, the pixel's own aperture included")
    noise_dn: float = Field(4.0, ge=0, le=100, description="noise of a pixel, 1 sigma in grey levels")
    gain: float = Field(1.0, gt=0, le=20, description="factor on all grey levels before they clip at 255")
    exposure_s: float = Field(0.0, ge=0, le=0.1, description="shutter time, centred on the time stamp: motion blur")
    period_s: Positive = Field(0.06, description="time between frames")
    latency_s: float = Field(0.0, ge=0, le=2, description="age of an image when the computer gets it")
    renderer: Literal["exact", "line_aa", "line_8"] = Field(
        "exact", description="edges where they belong, or OpenCV's own fill, which grows them (a negative control)"
    )
    platform: Platform = Field(Platform(), description="pan and tilt")


class Gyro(Section):
    """Rate gyros, three axes."""

    bias_dps: float = Field(0.1, ge=0, le=20, description="1 sigma of the constant bias of an axis, drawn per run")
    noise_dps: float = Field(0.1, ge=0, le=20, description="1 sigma of a sample")


class Airspeed(Section):
    """True airspeed from the air data computer."""

    noise_mps: float = Field(0.5, ge=0, le=20, description="1 sigma of a sample")


class InertialUnit(Section):
    """Inertial reference unit: attitude, rates and velocity over the ground. Biases are drawn per run."""

    attitude_bias_deg: float = Field(0.05, ge=0, le=5, description="1 sigma of the constant error of roll and of pitch")
    heading_bias_deg: float = Field(0.3, ge=0, le=10, description="1 sigma of the constant error of true heading")
    velocity_bias_sigma_mps: float = Field(0.1, ge=0, le=10, description="1 sigma of the constant error of each axis")
    velocity_bias_mps: tuple[float, float, float] | None = Field(
        None, description="this error instead of a drawn one: along the runway, right, down"
    )
    attitude_noise_deg: float = Field(0.01, ge=0, le=5, description="1 sigma of a sample")
    rate_noise_dps: float = Field(0.02, ge=0, le=5, description="1 sigma of a sample")
    velocity_noise_mps: float = Field(0.02, ge=0, le=5, description="1 sigma of a sample")


class FlowAngles(Section):
    """Vanes for angle of attack and sideslip."""

    noise_deg: float = Field(0.2, ge=0, le=10, description="1 sigma of a sample")
    bias_deg: float = Field(0.1, ge=0, le=10, description="1 sigma of the constant bias of a vane, drawn per run")


class OpticFlow(Section):
    """Visual motion sensors, six photoreceptors in a row each, strapped down, looking ahead at the field."""

    angles_deg: tuple[Annotated[float, Field(ge=2, le=90)], ...] = Field(
        (), max_length=8, description="where they look, below the body's forward axis; none = no such sensors"
    )
    spacing_deg: float = Field(0.1, ge=0.02, le=2, description="between two receptors")
    acceptance_deg: float = Field(0.1, ge=0.02, le=2, description="of one, at half height")
    rate_hz: Positive = Field(250.0, description="of sampling")
    noise_dn: NotNegative = Field(0.25, description="1 sigma of a sample's grey level")
    contrast: float = Field(0.1, gt=0, le=0.3, description="of the field: rms a decade of wavelengths")
    mounting_error_deg: float = Field(0.0, ge=-5, le=5, description="all look this much further down than believed")
    slowest_dps: Positive = Field(0.5, description="slower flow is invalid")
    fastest_dps: Positive = Field(10.0, description="faster flow is invalid")
    lowest_m: NotNegative = Field(30.0, description="believed height of the cg below which flow is invalid")
    floor_dps: Positive = Field(0.1, description="a flow's sigma, as believed, is this")
    share: NotNegative = Field(0.02, description="and this share of it")
    unsteady_dps3: NotNegative = Field(
        10.0, description="and what its change within an edge's passage, so curved (rms), makes the mean differ by"
    )


class Sensors(Section):
    """Sensors other than the camera."""

    gyro: Gyro = Field(Gyro(), description="rate gyros")
    airspeed: Airspeed = Field(Airspeed(), description="airspeed")
    inertial: InertialUnit = Field(InertialUnit(), description="inertial reference unit, used by filter.kind observer")
    flow_angles: FlowAngles = Field(FlowAngles(), description="vanes, used by filter.kind observer")
    optic_flow: OpticFlow = Field(OpticFlow(), description="visual motion sensors, not used by filter.kind observer")
