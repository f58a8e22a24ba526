"""Sensor data as layouts without lens distortion and without rolling scans expect them: rectified, at the stamp.

Exporters share these functions.
"""

from functools import lru_cache

import numpy as np

from simbev_ros.dataset import Frame, columns
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.types import AnyArray, Float32Array, UInt8Array
from simbev_ros.recording.image_codecs import encode_rgb
from simbev_ros.schema.map_points import map_points

_JPEG = b"\xff\xd8\xff"
"""First bytes of a JPEG file."""


def recorded_jpeg(frame: Frame, key: str) -> bytes:
    """JPEG file of an image: as recorded, or encoded if it was recorded raw or in a video.

    Args:
        frame: The frame.
        key: Key of the image.
    """
    data = bytes(frame.messages(key)[-1].data)
    return data if data.startswith(_JPEG) else encode_rgb(frame[key])


def rectify(image: UInt8Array, camera: PinholeCamera | None) -> UInt8Array:
    """Rectify an image to a pinhole camera with the same intrinsics; black where the lens sees nothing.

    Of a fisheye, this shows less than 180°: what is further aside is lost.

    Args:
        image: (H, W, 3) image.
        camera: The camera that took it; the image of one without distortion stays as it is.

    Raises:
        InputError: OpenCV is not installed.
    """
    if not isinstance(camera, LensCamera | FisheyeCamera):
        return image
    load_extras()["pictures"].require("rectifying images of a camera with distortion")
    import cv2

    pixels = _source_pixels(camera)
    rectified = cv2.remap(image, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(rectified, np.uint8)


@lru_cache(maxsize=32)
def _source_pixels(camera: LensCamera | FisheyeCamera) -> Float32Array:
    """(H, W, 2) x and y in the distorted image of each pixel of the pinhole camera."""
    pinhole = PinholeCamera(camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)
    v, u = np.mgrid[: camera.height_px, : camera.width_px]
    pixels = camera.project(pinhole.rays(np.stack([u.ravel(), v.ravel()], axis=1)))
    return np.nan_to_num(pixels, nan=-10.0).astype(np.float32).reshape(*u.shape, 2)


def points_at_stamp(frame: Frame, key: str, calibration: Calibration) -> AnyArray:
    """(N, 3) points of a lidar's cloud, sensor frame; those of a rolling scan are moved to the stamp of the frame.

    Args:
        frame: The frame.
        key: Key of the cloud.
        calibration: Calibration of the lidar.
    """
    if not getattr(calibration.sensor, "rolling", False):
        return columns(frame[key], "x", "y", "z")
    map_from_sensor = frame.map_from_ego @ calibration.ego_from_sensor
    carrier = frame.scene.view.ego_row(frame["world/actors"])
    return apply(inverse(map_from_sensor), map_points(frame[key], map_from_sensor, carrier))
