"""Wheel odometry: the ego's motion as its wheel speed sensors and its yaw rate sensor see it.

Defaults are those of a production car: 1 % of the distance, from wear and pressure of the tires (Borenstein and Feng,
"Measurement and Correction of Systematic Odometry Errors in Mobile Robots", 1996, call it a systematic error), and a
yaw rate sensor of the stability control, with the bias of the last standstill removed.
"""

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from simbev_ros.config.sensor import Pose, Sensor


class Odometry(Sensor):
    """Wheel odometry. It describes the motion of `base_link`, so it has neither a pose nor a frame of its own.

    Speed and yaw rate have an error of scale that is constant in a scene, and the yaw rate has a bias. Both have white
    noise in each message. Position and heading are integrated at every tick, and so drift without end.
    """

    has_frame: ClassVar[bool] = False

    type: Literal["odometry"]
    speed_scale_sigma: float = Field(
        0.01, ge=0, le=0.2, description="standard deviation of the constant relative error of the speed"
    )
    speed_noise_sigma_mps: float = Field(0.02, ge=0, le=10, description="standard deviation of the speed, per message")
    distance_walk_m_per_sqrt_m: float = Field(
        0.005,
        ge=0,
        le=1,
        description="standard deviation of the driven distance after 1 m; it grows with the root of the distance",
    )
    yaw_rate_scale_sigma: float = Field(
        0.005, ge=0, le=0.2, description="standard deviation of the constant relative error of the yaw rate"
    )
    yaw_rate_bias_sigma_radps: float = Field(
        0.001, ge=0, le=1, description="standard deviation of the yaw rate's bias at the start of a scene"
    )
    yaw_rate_bias_walk_radps_per_sqrt_s: float = Field(
        2e-5, ge=0, le=1, description="standard deviation of the bias's change in 1 s"
    )
    yaw_rate_noise_sigma_radps: float = Field(
        0.002, ge=0, le=10, description="standard deviation of the yaw rate, per message"
    )
    heading_walk_rad_per_sqrt_s: float = Field(
        3e-4,
        ge=0,
        le=1,
        description="standard deviation of the integrated heading after 1 s; it grows with the root of time",
    )

    @model_validator(mode="after")
    def _has_no_pose(self) -> Self:
        if self.pose != Pose():
            raise ValueError("pose: odometry has none, it describes the motion of base_link (see frames.base_link)")
        return self
