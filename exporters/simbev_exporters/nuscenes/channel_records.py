"""Rows and file names of nuScenes' layout for a channel, which ``dataset.nuscenes`` has found in a scene."""

import numpy as np

from simbev_exporters.nuscenes.taxonomy import Record, token
from simbev_ros.dataset.nuscenes.channels import Channel, Modality
from simbev_ros.export.quaternions import positive
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array

_SUFFIX: dict[Modality, str] = {"camera": ".jpg", "lidar": ".pcd.bin", "radar": ".pcd"}


def data_file(channel: Channel, stem: str, stamp_us: int) -> str:
    """Name of a data file in nuScenes' scheme."""
    return f"{stem}__{channel.name}__{stamp_us}{_SUFFIX[channel.modality]}"


def image_size_px(channel: Channel) -> tuple[int, int]:
    """Width and height of a camera's images; 0, 0 for other sensors."""
    return channel.calibration.size_px if channel.modality == "camera" else (0, 0)


def sensor_record(channel: Channel) -> Record:
    """Row of the table ``sensor``."""
    return {"token": token("sensor", channel.name), "channel": channel.name, "modality": channel.modality}


def calibration_record(channel: Channel, scene: str, pose: Float64Array) -> Record:
    """Row of the table ``calibrated_sensor`` for a scene's token, without lens distortion: images are rectified.

    Args:
        channel: The channel.
        scene: Token of the scene.
        pose: (4, 4) pose of the channel's frame in that of the table ``ego_pose``.
    """
    return {
        "token": token("calibrated_sensor", scene, channel.name),
        "sensor_token": token("sensor", channel.name),
        "translation": pose[:3, 3].tolist(),
        "rotation": positive(wxyz(quaternion_from_rpy(rpy_from_rotation(pose[:3, :3])))).tolist(),
        "camera_intrinsic": channel.calibration.intrinsics.tolist() if channel.modality == "camera" else [],
    }


def wxyz(xyzw: Float64Array) -> Float64Array:
    """(…, 4) quaternions x, y, z, w in nuScenes' order w, x, y, z."""
    return np.roll(xyzw, 1, axis=-1)
