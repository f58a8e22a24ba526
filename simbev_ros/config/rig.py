"""The rig: which sensors an agent carries, where, and with what properties."""

from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.types import Float64Array

Modality = Literal["rgb", "semantic", "instance", "depth", "flow"]
MODALITIES: tuple[Modality, ...] = ("rgb", "semantic", "instance", "depth", "flow")

_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]


class Pose(Model):
    """Pose of a sensor in the ego frame: x forward, y left, z up, origin at the ground below the box's centre."""

    x_m: float = Field(0.0, ge=-20, le=20)
    y_m: float = Field(0.0, ge=-20, le=20)
    z_m: float = Field(0.0, ge=-5, le=20)
    roll_deg: float = Field(0.0, ge=-180, le=180)
    pitch_deg: float = Field(0.0, ge=-180, le=180, description="positive looks down (REP-103)")
    yaw_deg: float = Field(0.0, ge=-180, le=180, description="positive looks left (REP-103)")

    @cached_property
    def ego_from_sensor(self) -> Float64Array:
        """(4, 4) transform; for cameras the sensor frame is the body frame (x forward), not the optical one."""
        return matrices_from_xyz_rpy(
            np.array([self.x_m, self.y_m, self.z_m]),
            np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg]),
        )


class Sensor(Model):
    """What all sensors share."""

    name: _Name
    pose: Pose = Pose()
    rate_hz: float | None = Field(None, gt=0, le=1000, description="None: at every tick")


class Camera(Sensor):
    """A pinhole camera with up to five modalities."""

    type: Literal["camera"]
    width_px: int = Field(1600, ge=16, le=8192)
    height_px: int = Field(900, ge=16, le=8192)
    horizontal_fov_deg: float = Field(80.0, gt=1, lt=170)
    modalities: tuple[Modality, ...] = Field(MODALITIES, min_length=1)

    @model_validator(mode="after")
    def _modalities_once(self) -> Self:
        if len(set(self.modalities)) != len(self.modalities):
            raise ValueError(f"modalities: each at most once, not {list(self.modalities)}")
        return self

    @property
    def model(self) -> PinholeCamera:
        """The ideal camera."""
        return PinholeCamera.from_field_of_view(self.width_px, self.height_px, np.radians(self.horizontal_fov_deg))


class Lidar(Sensor):
    """A rotating lidar, and the noise-free semantic lidar with the same rays."""

    type: Literal["lidar"]
    channels: int = Field(128, ge=1, le=1024)
    columns: int = Field(2048, ge=1, le=16384, description="firings per turn")
    range_m: float = Field(120.0, gt=0, le=1000)
    upper_fov_deg: float = Field(10.67, ge=-90, le=90)
    lower_fov_deg: float = Field(-30.67, ge=-90, le=90)
    drop_off: float = Field(0.14, ge=0, le=1, description="share of returns lost at random")
    range_noise_sigma_m: float = Field(0.01, ge=0, le=10)
    points: bool = Field(True, description="publish points (with drop-off and noise)")
    semantic_points: bool = Field(True, description="publish semantic_points (neither)")

    @model_validator(mode="after")
    def _fields_of_view(self) -> Self:
        if self.lower_fov_deg > self.upper_fov_deg:
            raise ValueError(f"lower_fov_deg {self.lower_fov_deg} is above upper_fov_deg {self.upper_fov_deg}")
        if not (self.points or self.semantic_points):
            raise ValueError("points and semantic_points are both off: the lidar would publish nothing")
        return self


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


AnySensor = Annotated[Camera | Lidar | Gnss | Imu, Field(discriminator="type")]


S = TypeVar("S", bound=Sensor)


class Rig(Model):
    """The sensors of one agent."""

    agent: _Name = "ego"
    sensors: tuple[AnySensor, ...]

    @model_validator(mode="after")
    def _names_once(self) -> Self:
        names = [sensor.name for sensor in self.sensors]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"sensors: two sensors are named {', '.join(twice)}; names must be unique")
        return self

    def of_type(self, kind: type[S]) -> Sequence[S]:
        """The sensors of one type, in order."""
        return [sensor for sensor in self.sensors if isinstance(sensor, kind)]
