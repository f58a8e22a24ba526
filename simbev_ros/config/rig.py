"""The rig: which sensors an agent carries, where, and with what properties."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property, lru_cache
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.optics import Optics
from simbev_ros.errors import InputError
from simbev_ros.geometry.camera import WIDEST_RAD, LensCamera, PinholeCamera
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.types import Float64Array

Modality = Literal["rgb", "semantic", "instance", "depth", "flow"]
MODALITIES: tuple[Modality, ...] = ("rgb", "semantic", "instance", "depth", "flow")

_FIELD_OF_VIEW_DEG = 80.0

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


class Camera(Sensor, Optics):
    """A camera with up to five modalities.

    Its intrinsics are a horizontal field of view, or a focal length with all else that differs from the default.
    """

    type: Literal["camera"]
    width_px: int = Field(1600, ge=16, le=8192)
    height_px: int = Field(900, ge=16, le=8192)
    horizontal_fov_deg: float | None = Field(
        None, gt=1, lt=170, description="from edge to edge, without distortion; 80 if fx_px is not set either"
    )
    fx_px: float | None = Field(None, gt=0, le=1e6, description="focal length, instead of horizontal_fov_deg")
    fy_px: float | None = Field(None, gt=0, le=1e6, description="with fx_px; None: the same")
    cx_px: float | None = Field(None, ge=-8192, le=16384, description="with fx_px; None: (width_px - 1) / 2")
    cy_px: float | None = Field(None, ge=-8192, le=16384, description="with fx_px; None: (height_px - 1) / 2")
    distortion: tuple[Annotated[float, Field(ge=-100, le=100)], ...] = Field(
        (0.0,) * 5,
        min_length=5,
        max_length=5,
        description="k1, k2, p1, p2, k3 of plumb_bob (sensor_msgs/CameraInfo, OpenCV)",
    )
    modalities: tuple[Modality, ...] = Field(MODALITIES, min_length=1)

    @model_validator(mode="after")
    def _modalities_once(self) -> Self:
        if len(set(self.modalities)) != len(self.modalities):
            raise ValueError(f"modalities: each at most once, not {list(self.modalities)}")
        return self

    @model_validator(mode="after")
    def _one_kind_of_intrinsics(self) -> Self:
        given = [name for name in ("fx_px", "fy_px", "cx_px", "cy_px") if getattr(self, name) is not None]
        if given and self.horizontal_fov_deg is not None:
            raise ValueError(f"horizontal_fov_deg and {', '.join(given)} are set: give one or the other")
        if given and self.fx_px is None:
            raise ValueError(f"{', '.join(given)} without fx_px, which is to be set with them")
        return self

    @model_validator(mode="after")
    def _within_85_degrees(self) -> Self:
        try:
            camera = self.model
        except InputError as error:
            raise ValueError(str(error)) from None
        edges = camera.rays(np.array([[-0.5, -0.5], [self.width_px - 0.5, self.height_px - 0.5]]))[:, :2]
        if np.abs(edges).max() > math.tan(WIDEST_RAD):
            raise ValueError(
                f"fx_px {camera.fx_px:g}, fy_px {camera.fy_px:g}: a pixel of an image of {self.width_px} x "
                f"{self.height_px} would look more than 85° away from the optical axis; take a greater focal length"
            )
        return self

    @property
    def model(self) -> PinholeCamera:
        """The camera's geometry: a ``LensCamera`` if it distorts."""
        ideal = self._pinhole()
        return _lens_camera(ideal, self.distortion) if any(self.distortion) else ideal

    def _pinhole(self) -> PinholeCamera:
        width_px, height_px = self.width_px, self.height_px
        if self.fx_px is None:
            fov_deg = _FIELD_OF_VIEW_DEG if self.horizontal_fov_deg is None else self.horizontal_fov_deg
            return PinholeCamera.from_field_of_view(width_px, height_px, math.radians(fov_deg))
        return PinholeCamera(
            width_px,
            height_px,
            self.fx_px,
            self.fx_px if self.fy_px is None else self.fy_px,
            (width_px - 1) / 2.0 if self.cx_px is None else self.cx_px,
            (height_px - 1) / 2.0 if self.cy_px is None else self.cy_px,
        )


@lru_cache(maxsize=64)
def _lens_camera(ideal: PinholeCamera, distortion: tuple[float, ...]) -> LensCamera:
    """The camera with distortion; its check takes a millisecond."""
    return LensCamera(**asdict(ideal), distortion=distortion)


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
