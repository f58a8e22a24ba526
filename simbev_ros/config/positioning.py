"""Sensors of the agent's own place and motion."""

from typing import Literal

from pydantic import Field

from simbev_ros.config.sensor import Sensor


class Gnss(Sensor):
    """A GNSS receiver."""

    type: Literal["gnss"]
    latitude_noise_sigma_deg: float = Field(4e-7, ge=0, le=1)
    longitude_noise_sigma_deg: float = Field(4e-7, ge=0, le=1)
    altitude_noise_sigma_m: float = Field(0.04, ge=0, le=1000)


class Imu(Sensor):
    """An inertial measurement unit."""

    type: Literal["imu"]
    accelerometer_noise_sigma_mps2: float = Field(1.7e-4, ge=0, le=100)
    gyroscope_noise_sigma_radps: float = Field(5.6e-6, ge=0, le=100)
    gyroscope_bias_radps: float = Field(1.7e-4, ge=-10, le=10)
