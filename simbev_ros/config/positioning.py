"""GNSS receivers and IMUs of a rig, which measure the agent's own position and motion.

White noise is given as the standard deviation of a message, as in the paper; random walks are given by their growth
with time, so that they do not depend on the rate. To convert from an IMU's datasheet: the sigma of a message is the
noise density (m/s²/√Hz) times √rate_hz; the random walk of the bias (m/s²/√s, also written m/s³/√Hz) is used as is.
"""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from simbev_ros.config.base import Model
from simbev_ros.config.sensor import Sensor


class GnssVelocity(Model):
    """Velocity from the Doppler shift of the carriers; its noise is white, and not that of the fixes."""

    horizontal_noise_sigma_mps: float = Field(
        0.05, ge=0, le=100, description="standard deviation east and north, per message"
    )
    vertical_noise_sigma_mps: float = Field(0.1, ge=0, le=100, description="standard deviation upward, per message")


class Gnss(Sensor):
    """A GNSS receiver; its antenna is at the sensor's position."""

    type: Literal["gnss"]
    latitude_noise_sigma_deg: float = Field(4e-7, ge=0, le=1, description="standard deviation per fix; 1e-6° is 0.11 m")
    longitude_noise_sigma_deg: float = Field(4e-7, ge=0, le=1, description="standard deviation per fix")
    altitude_noise_sigma_m: float = Field(0.04, ge=0, le=1000, description="standard deviation per fix")
    bias_walk_horizontal_sigma_m: float = Field(
        0.0,
        ge=0,
        le=1000,
        description="standard deviation of slowly changing errors east and north (first-order Gauss-Markov)",
    )
    bias_walk_vertical_sigma_m: float = Field(
        0.0, ge=0, le=1000, description="standard deviation of the slowly changing error upward"
    )
    bias_walk_time_s: float = Field(
        60.0, gt=0, le=86_400, description="time after which the correlation of these errors has fallen to 1/e"
    )
    dropout_share: float = Field(0.0, ge=0, le=0.99, description="share of time without a fix, in random intervals")
    dropout_mean_s: float = Field(5.0, gt=0, le=3600, description="mean duration of a dropout")
    velocity: GnssVelocity | None = Field(
        None,
        description="velocity on the topics `vel` and `fix_velocity`, `{}` for the defaults; none: neither",
    )
    extended_fix: bool = Field(
        False,
        exclude_if=lambda value: not value,
        description="whether fixes are also sent as gps_msgs/GPSFix, on the topic extended_fix, with speed, track and "
        "climb if there is a velocity",
    )


def _on_each_axis(value: Any) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (value, value, value)
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ValueError(f"is {value!r}, but a number for all axes or [x, y, z] is allowed")
    return value


_Component = Annotated[float, Field(ge=-10, le=10)]
PerAxis = Annotated[tuple[_Component, _Component, _Component], BeforeValidator(_on_each_axis)]
"""Values along the sensor's x, y and z axes; a single number stands for three equal ones."""


class ImuOrientation(Model):
    """Errors of the orientation of an attitude and heading reference, by default one of the middle class.

    Slowly changing errors are first-order Gauss-Markov processes: roll and pitch, which gravity keeps in bounds, and
    the heading, which a magnetometer does, each in its time.
    """

    tilt_drift_sigma_deg: float = Field(
        0.3, ge=0, le=30, description="standard deviation of the slowly changing error of roll and of pitch"
    )
    tilt_drift_time_s: float = Field(
        20.0, gt=0, le=86_400, description="time after which its correlation has fallen to 1/e"
    )
    heading_drift_sigma_deg: float = Field(
        1.5, ge=0, le=180, description="standard deviation of the slowly changing error of the heading"
    )
    heading_drift_time_s: float = Field(
        300.0, gt=0, le=86_400, description="time after which its correlation has fallen to 1/e"
    )
    noise_sigma_deg: float = Field(0.05, ge=0, le=30, description="standard deviation about each axis, per message")


class Imu(Sensor):
    """An inertial measurement unit, the only sensor that may be faster than the ticks: a multiple of their rate."""

    type: Literal["imu"]
    accelerometer_noise_sigma_mps2: float = Field(1.7e-4, ge=0, le=100, description="standard deviation per message")
    gyroscope_noise_sigma_radps: float = Field(5.6e-6, ge=0, le=100, description="standard deviation per message")
    accelerometer_bias_mps2: PerAxis = Field((0.0, 0.0, 0.0), description="constant bias")
    gyroscope_bias_radps: PerAxis = Field((1.7e-4, 1.7e-4, 1.7e-4), description="constant bias")
    accelerometer_bias_walk_mps2_per_sqrt_s: float = Field(
        0.0,
        ge=0,
        le=10,
        description="standard deviation of the bias's change in 1 s; it grows with the square root of time",
    )
    gyroscope_bias_walk_radps_per_sqrt_s: float = Field(
        0.0, ge=0, le=10, description="standard deviation of the bias's change in 1 s"
    )
    orientation: ImuOrientation | None = Field(
        None,
        description="errors of the orientation on the topic `data`, `{}` for the defaults; none: it is exact",
    )
