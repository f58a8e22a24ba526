"""Reads a folder of clouds, with poses and cameras if ``sensors.yaml`` in it says what they are."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError, field_validator

from simbev_ros.baselines.recordings.clouds import CLOUD_READERS, read_numbers
from simbev_ros.baselines.recordings.recording import (
    RecordedFrame,
    RecordedImage,
    RecordedSweep,
    path_below,
    require_rigid,
)
from simbev_ros.config.base import Model, first_problem
from simbev_ros.config.sensor import Pose
from simbev_ros.config.yaml_file import YamlFile
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError, foreign_content
from simbev_ros.foundation.files.input_file import is_file, path_exists, read_small_file
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.foundation.units import NS_PER_S

SENSORS_FILE = "sensors.yaml"
_IMAGES = (".jpg", ".jpeg", ".png")
_MAX_BYTES = 64 << 20
_MAX_STAMP_S = 1e10
_KITTI_COLUMNS, _TUM_COLUMNS = 12, 8

_Row = tuple[float, float, float, float]


class LidarFiles(Model):
    """Files of the lidar in a folder."""

    clouds: str = Field(".", description="folder of the clouds")
    columns: int = Field(4, ge=3, le=64, description="float32 numbers of a point in .bin files: x, y, z, intensity, …")
    pose: Pose | None = Field(None, description="pose of the lidar above the ground; none: it is found in the clouds")
    poses: str | None = Field(
        None,
        description="text file with the lidar's pose for each cloud in the order of names, from which earlier sweeps "
        "are used: 3 × 4 numbers (KITTI), or stamp in s, x y z qx qy qz qw (TUM)",
    )
    rate_hz: float = Field(10.0, gt=0, le=1000, description="clouds per second, where poses have no stamps")


class CameraFiles(Model):
    """Files and calibration of a camera in a folder; its images are called as the clouds, and are undistorted."""

    images: str = Field(description="folder of the images")
    fx_px: float = Field(gt=0, le=1e6, description="horizontal focal length")
    fy_px: float | None = Field(None, gt=0, le=1e6, description="vertical focal length; none: fx_px")
    cx_px: float = Field(ge=-8192, le=16384, description="principal point in x")
    cy_px: float = Field(ge=-8192, le=16384, description="principal point in y")
    optical_from_lidar: tuple[_Row, _Row, _Row] = Field(
        description="3 × 4 numbers: rotation and translation from the lidar to x right, y down, z ahead"
    )

    @field_validator("optical_from_lidar")
    @classmethod
    def _is_rigid(cls, rows: tuple[_Row, _Row, _Row]) -> tuple[_Row, _Row, _Row]:
        require_rigid(np.array([*rows, (0, 0, 0, 1)], np.float64))
        return rows

    def image(self, name: str, path: Path) -> RecordedImage:
        """An image of this camera."""
        matrix = np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px or self.fx_px, self.cy_px], [0, 0, 1]])
        return RecordedImage(name, path, matrix, np.array([*self.optical_from_lidar, (0, 0, 0, 1)], np.float64))


class Sensors(Model):
    """Content of ``sensors.yaml``; paths are relative to its folder."""

    lidar: LidarFiles = LidarFiles()
    cameras: dict[Annotated[str, Field(pattern=r"^\w{1,40}$")], CameraFiles] = Field({}, description="by name")


def folder_frames(folder: Path) -> list[RecordedFrame]:
    """The clouds of a folder in the order of their names.

    Raises:
        InputError: There are none, or ``sensors.yaml`` or a file that it names is damaged.
    """
    sensors = read_sensors(folder / SENSORS_FILE) if path_exists(folder / SENSORS_FILE) else Sensors()
    with foreign_content(folder / SENSORS_FILE):
        place = path_below(folder, sensors.lidar.clouds)
        cameras = {name: _images_by_stem(path_below(folder, each.images)) for name, each in sensors.cameras.items()}
        poses = None if sensors.lidar.poses is None else path_below(folder, sensors.lidar.poses)
    clouds = [path for path in sorted(place.glob("*")) if path.suffix.lower() in CLOUD_READERS]
    if not clouds:
        raise InputError(f"{place}: has no clouds; files that are read end in {', '.join(CLOUD_READERS)}")
    twice = next((b for a, b in pairwise(clouds) if a.stem == b.stem), None)
    if twice is not None:
        raise InputError(f"{twice}: another cloud has this name with another ending")
    sweeps = _sweeps(clouds, poses, sensors.lidar)
    ego_from_lidar = None if sensors.lidar.pose is None else sensors.lidar.pose.ego_from_sensor

    def images(stem: str) -> Sequence[RecordedImage]:
        there = {name: each for name, each in sensors.cameras.items() if stem in cameras[name]}
        return [each.image(name, cameras[name][stem]) for name, each in there.items()]

    def frame(index: int, cloud: Path) -> RecordedFrame:
        there = (sweeps[index : index + 1], 0) if poses is None else (sweeps, index)
        title = f"{folder.resolve().name} {cloud.stem}"
        return RecordedFrame(cloud.stem, title, *there, partial(images, cloud.stem), ego_from_lidar=ego_from_lidar)

    return [frame(index, cloud) for index, cloud in enumerate(clouds)]


def read_sensors(path: Path) -> Sensors:
    """Read ``sensors.yaml``. Raises InputError if it is invalid; the message names line, field and what is allowed."""
    file = YamlFile(path)
    try:
        return Sensors.model_validate(file.data)
    except ValidationError as error:
        raise InputError(f"{path}:{file.line_of(error.errors()[0]['loc']) or 1}: {first_problem(error)}") from None
    except FOREIGN_ERRORS as error:
        raise InputError(f"{path}: {first_problem(error)}") from None


def read_poses(path: Path, rate_hz: float) -> tuple[Float64Array, Int64Array]:
    """(N, 4, 4) poses and (N,) ascending stamps in ns of a file of KITTI's or TUM's form.

    Raises:
        InputError: The file is missing or damaged.
    """
    with foreign_content(path):
        rows = read_numbers(read_small_file(path, _MAX_BYTES))
        if rows.shape[1] not in (_KITTI_COLUMNS, _TUM_COLUMNS) or not np.isfinite(rows).all():
            raise ValueError(f"its lines have {rows.shape[1]} numbers; allowed are 12 (KITTI) or 8 (TUM), finite")
        if rows.shape[1] == _KITTI_COLUMNS:
            poses = np.tile(np.eye(4), (len(rows), 1, 1))
            poses[:, :3] = rows.reshape(-1, 3, 4)
            stamps_s = np.arange(len(rows)) / rate_hz
        else:
            norm = np.linalg.norm(rows[:, 4:], axis=1, keepdims=True)
            if not ((norm > 0.5) & (norm < 2.0)).all():
                raise ValueError("a rotation is not a unit quaternion")
            poses, stamps_s = matrices_from_xyz_quaternion(rows[:, 1:4], rows[:, 4:] / norm), rows[:, 0]
        if (np.diff(stamps_s) <= 0).any() or np.abs(stamps_s).max() > _MAX_STAMP_S:
            raise ValueError(f"stamps must ascend, up to {_MAX_STAMP_S:g} s")
        for pose in poses:
            require_rigid(pose)
        return poses, np.rint(stamps_s * NS_PER_S).astype(np.int64)


def _sweeps(clouds: Sequence[Path], poses: Path | None, lidar: LidarFiles) -> list[RecordedSweep]:
    if poses is None:
        return [RecordedSweep(cloud, lidar.columns) for cloud in clouds]
    matrices, stamps_ns = read_poses(poses, lidar.rate_hz)
    if len(matrices) != len(clouds):
        raise InputError(f"{poses}: has {len(matrices)} poses, but there are {len(clouds)} clouds")
    rows = zip(clouds, stamps_ns.tolist(), matrices, strict=True)
    return [RecordedSweep(cloud, lidar.columns, stamp_ns, pose) for cloud, stamp_ns, pose in rows]


def _images_by_stem(folder: Path) -> Mapping[str, Path]:
    found = {path.stem: path for path in sorted(folder.glob("*")) if path.suffix.lower() in _IMAGES and is_file(path)}
    if not found:
        raise InputError(f"{folder}: has no images; files that are read end in {', '.join(_IMAGES)}")
    return found
