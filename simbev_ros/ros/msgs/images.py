"""Converts between arrays and messages of images and video, and makes the CameraInfo of a camera model."""

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from simbev_ros.config.modalities import IMAGE_KINDS, MODALITIES
from simbev_ros.drawing.displays.messages import build, moment, serialize
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.video import H264, VIDEO_TYPE
from simbev_ros.ros.msgs.arrays import bytes_field
from simbev_ros.ros.msgs.stamps import header

_ENCODING = {(each.dtype, each.channels): each.encoding for each in map(IMAGE_KINDS.__getitem__, MODALITIES)}


def encoding_of(image: AnyArray) -> str:
    """ROS encoding of an (H, W) or (H, W, C) array.

    Raises:
        KeyError: No encoding has this data type and number of channels.
    """
    return _ENCODING[image.dtype.name, image.shape[2] if image.ndim == 3 else 1]


def image_message(image: AnyArray, stamp_ns: int, frame: str, encoding: str | None = None) -> Image:
    """Image message from an (H, W) or (H, W, C) array, by default with the encoding of ``encoding_of``."""
    height, width = image.shape[:2]
    image = np.ascontiguousarray(image)
    message = Image(
        check_fields=True,
        header=header(stamp_ns, frame),
        height=height,
        width=width,
        encoding=encoding or encoding_of(image),
        is_bigendian=0,
        step=image.nbytes // height,
    )
    message.data = bytes_field(image)
    return message


def labels_from_image(message: Image) -> AnyArray:
    """(H, W) view of the data of a mono8 or mono16 image that ``image_message`` made."""
    kind = {"mono8": "u1", "mono16": "<u2"}[message.encoding]
    return np.frombuffer(message.data, kind).reshape(message.height, message.width)


def compressed_image_message(data: bytes, image_format: str, stamp_ns: int, frame: str) -> CompressedImage:
    """CompressedImage message from encoded bytes."""
    message = CompressedImage(check_fields=True, header=header(stamp_ns, frame), format=image_format)
    message.data = bytes_field(data)
    return message


def video_message(data: bytes, stamp_ns: int, frame: str) -> bytes:
    """Serialized CompressedVideo message of one image in H.264."""
    fields = {"timestamp": moment(stamp_ns), "frame_id": frame, "data": np.frombuffer(data, np.uint8), "format": H264}
    return serialize(build(VIDEO_TYPE, **fields))


def camera_info_message(camera: PinholeCamera, stamp_ns: int, frame: str) -> CameraInfo:
    """CameraInfo message of a camera.

    The images are distorted by the lens (``image_raw``). P belongs to a rectified image with the same K, as most
    drivers publish it. The camera is monocular, so R is the identity and the fourth column of P is zero.
    """
    matrix = camera.matrix
    is_fisheye = isinstance(camera, FisheyeCamera)
    return CameraInfo(
        header=header(stamp_ns, frame),
        height=camera.height_px,
        width=camera.width_px,
        distortion_model="equidistant" if is_fisheye else "plumb_bob",
        d=list(camera.distortion) if isinstance(camera, LensCamera | FisheyeCamera) else [0.0] * 5,
        k=matrix.ravel().tolist(),
        r=np.eye(3).ravel().tolist(),
        p=np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist(),
    )
