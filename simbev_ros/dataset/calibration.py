"""Where the sensors of a scene sit and how its cameras see, from the rig that the bag was recorded with."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.rig import AnySensor, Rig
from simbev_ros.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.geometry.transforms import SENSOR_FROM_OPTICAL
from simbev_ros.types import Float64Array


@dataclass(frozen=True, eq=False)
class Calibration:
    """One sensor.

    Attributes:
        sensor: Its settings.
        ego_from_sensor: (4, 4) pose; the sensor's frame is x forward, y left, z up, also a camera's.
        camera: Geometry of a camera: ``project`` and ``rays``; None for other sensors.
    """

    sensor: AnySensor
    ego_from_sensor: Float64Array
    camera: PinholeCamera | None

    @classmethod
    def of(cls, sensor: AnySensor) -> "Calibration":
        """That of a rig's sensor."""
        return cls(sensor, sensor.pose.ego_from_sensor, sensor.model if isinstance(sensor, Camera) else None)

    def is_like(self, other: "Calibration") -> bool:
        """Whether another sensor of this name sits at the same place and sees alike."""
        return np.array_equal(self.ego_from_sensor, other.ego_from_sensor) and self.camera == other.camera

    @property
    def ego_from_optical(self) -> Float64Array:
        """(4, 4) pose of a camera's optical frame: x right, y down, z forward. That of images and pixels."""
        self._camera()
        ego_from_optical: Float64Array = self.ego_from_sensor @ SENSOR_FROM_OPTICAL
        return ego_from_optical

    @property
    def intrinsics(self) -> Float64Array:
        """(3, 3) matrix K of a camera, pixels, centres of pixels at integers."""
        return self._camera().matrix

    @property
    def distortion(self) -> Float64Array:
        """(5,) k1, k2, p1, p2, k3 of a camera's lens (plumb_bob, OpenCV); zeros without distortion."""
        camera = self._camera()
        return np.array(camera.distortion) if isinstance(camera, LensCamera) else np.zeros(5)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of a camera's image."""
        camera = self._camera()
        return camera.width_px, camera.height_px

    def _camera(self) -> PinholeCamera:
        if self.camera is None:
            raise AttributeError(f"{self.sensor.name} is a {self.sensor.type}, not a camera")
        return self.camera


def calibrations(rig: Rig) -> dict[str, Calibration]:
    """Those of a rig, by the sensors' names."""
    return {sensor.name: Calibration.of(sensor) for sensor in rig.sensors}
