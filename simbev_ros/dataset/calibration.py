"""Calibration of a scene's sensors: extrinsics and camera models, from the rig that the bag was recorded with."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.rig import AnySensor, Rig
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL
from simbev_ros.foundation.types import Float64Array


@dataclass(frozen=True, eq=False)
class Calibration:
    """Extrinsics of one sensor and, for a camera, its intrinsics and distortion.

    Attributes:
        sensor: The sensor's settings in the rig.
        ego_from_sensor: (4, 4) pose; the sensor's frame is x forward, y left, z up, for cameras too.
        camera: Geometry of a camera with ``project`` and ``rays``; None for other sensors.
    """

    sensor: AnySensor
    ego_from_sensor: Float64Array
    camera: PinholeCamera | None

    @classmethod
    def from_sensor(cls, sensor: AnySensor) -> "Calibration":
        """Calibration of a sensor as the rig describes it."""
        return cls(sensor, sensor.pose.ego_from_sensor, sensor.model if isinstance(sensor, Camera) else None)

    def matches(self, other: "Calibration") -> bool:
        """Whether another sensor has the same pose and, if it is a camera, the same camera model."""
        return np.array_equal(self.ego_from_sensor, other.ego_from_sensor) and self.camera == other.camera

    @property
    def ego_from_optical(self) -> Float64Array:
        """(4, 4) pose of a camera's optical frame, to which images and pixels refer: x right, y down, z forward."""
        self._camera()
        return self.ego_from_sensor @ SENSOR_FROM_OPTICAL

    @property
    def intrinsics(self) -> Float64Array:
        """(3, 3) camera matrix K in pixels; pixel centers are at integers."""
        return self._camera().matrix

    @property
    def distortion(self) -> Float64Array:
        """(5,) distortion coefficients k1, k2, p1, p2, k3 (plumb_bob, OpenCV); zeros for an ideal lens.

        Of a fisheye, (4,) k1, k2, k3, k4 (equidistant, ``cv2.fisheye``).
        """
        camera = self._camera()
        return np.array(camera.distortion) if isinstance(camera, LensCamera | FisheyeCamera) else np.zeros(5)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of a camera's image, pixels."""
        camera = self._camera()
        return camera.width_px, camera.height_px

    def _camera(self) -> PinholeCamera:
        if self.camera is None:
            raise AttributeError(f"{self.sensor.name} is a {self.sensor.type}, not a camera")
        return self.camera


def calibrations(rig: Rig) -> dict[str, Calibration]:
    """Calibrations of all sensors of a rig, by sensor name."""
    return {sensor.name: Calibration.from_sensor(sensor) for sensor in rig.sensors}
