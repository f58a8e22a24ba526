"""Reads KITTI's layout for object detection, which is documented in the devkit of that benchmark.

``velodyne``, ``calib``, ``image_2`` and ``label_2`` in a folder such as ``training``; the last two may be missing.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from simbev_ros.baselines.boxes import BOX_DTYPE
from simbev_ros.baselines.recordings.recording import (
    Labels,
    RecordedFrame,
    RecordedImage,
    RecordedSweep,
    class_numbers,
    require_matrix,
    require_possible,
    require_rigid,
)
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.input_file import is_file, is_folder, read_small_file
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import Float64Array

CAMERA = "image_2"
_COLUMNS = 4
_MAX_BYTES = 1 << 20
_LABEL_WORDS = 15
_UNLABELED = "DontCare"


def kitti_frames(folder: Path) -> list[RecordedFrame]:
    """The frames of a folder: ``training`` if it is that of both.

    Raises:
        InputError: It has no clouds.
    """
    folder = folder / "training" if is_folder(folder / "training/velodyne") else folder
    clouds = sorted(folder.glob("velodyne/*.bin"))
    if not clouds:
        raise InputError(f"{folder}: has no velodyne/*.bin; give KITTI's folder training or testing")
    return [_frame(folder, cloud) for cloud in clouds]


def _frame(folder: Path, cloud: Path) -> RecordedFrame:
    name, calibration = cloud.stem, folder / f"calib/{cloud.stem}.txt"
    labels, image = folder / f"label_2/{name}.txt", folder / f"{CAMERA}/{name}.png"

    def images() -> list[RecordedImage]:
        if not is_file(image):
            return []
        return [RecordedImage(CAMERA, image, *read_calibration(calibration))]

    return RecordedFrame(
        name=name,
        title=f"KITTI {folder.name} {name}",
        sweeps=[RecordedSweep(cloud, _COLUMNS)],
        index=0,
        images=images,
        labels=partial(read_labels, labels, calibration) if is_file(labels) else None,
    )


def read_calibration(path: Path) -> tuple[Float64Array, Float64Array, Float64Array]:
    """The (3, 3) matrix of the left color camera, (4, 4) optical_from_lidar, and (3,) the reference camera in it.

    Raises:
        InputError: The file is missing or damaged.
    """
    with foreign_content(path):
        lines = read_small_file(path, _MAX_BYTES).decode().splitlines()
        words = {name.strip(): numbers.split() for name, _, numbers in (line.partition(":") for line in lines)}
        shapes = {"P2": (3, 4), "R0_rect": (3, 3), "Tr_velo_to_cam": (3, 4)}
        missing = [name for name in shapes if name not in words]
        if missing:
            raise InputError(f"{path}: has no {', '.join(missing)}")
        rows = {name: np.array(words[name], np.float64).reshape(shape) for name, shape in shapes.items()}
        rectified, camera_from_lidar = np.eye(4), np.eye(4)
        rectified[:3, :3], camera_from_lidar[:3] = rows["R0_rect"], rows["Tr_velo_to_cam"]
        matrix, optical_from_lidar = require_matrix(rows["P2"][:, :3]), rectified @ camera_from_lidar
        reference_m: Float64Array = np.linalg.inv(matrix) @ rows["P2"][:, 3]
        optical_from_lidar[:3, 3] += reference_m
        return matrix, require_rigid(optical_from_lidar), reference_m


def read_labels(path: Path, calibration: Path) -> Labels:
    """The labels of an image in the lidar's frame. Raises InputError if a file is damaged."""
    _, reference_from_lidar, reference_m = read_calibration(calibration)
    reference_from_lidar[:3, 3] -= reference_m
    numbers_of, lidar_from_reference = class_numbers("kitti"), inverse(reference_from_lidar)
    rows, unlabeled = [np.zeros(0, BOX_DTYPE)], []
    with foreign_content(path):
        for name, values in _label_rows(read_small_file(path, _MAX_BYTES).decode()):
            if name == _UNLABELED:
                unlabeled.append(values[3:7])
            elif name in numbers_of:
                rows.append(_box(numbers_of[name], values, lidar_from_reference))
        boxes = require_possible(np.concatenate(rows))
        return Labels(boxes, True, np.array(unlabeled, np.float64).reshape(-1, 4))


def _label_rows(text: str) -> Iterator[tuple[str, Float64Array]]:
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if words and len(words) < _LABEL_WORDS:
            raise ValueError(f"line {number} has {len(words)} words, not {_LABEL_WORDS}")
        if words:
            yield words[0], np.array(words[1:_LABEL_WORDS], np.float64)


def _box(label: int, values: Float64Array, lidar_from_reference: Float64Array) -> np.ndarray:
    """(1,) ``BOX_DTYPE`` of a line; the camera's y axis points down, and a position is that of the lower face."""
    height, width, length, x, y, z, rotation_y = values[7:14]
    box = np.zeros(1, BOX_DTYPE)
    box["x"], box["y"], box["z"] = (lidar_from_reference @ [x, y - height / 2.0, z, 1.0])[:3]
    box["length"], box["width"], box["height"], box["class"] = length, width, height, label
    ahead = lidar_from_reference[:2, :3] @ [np.cos(rotation_y), 0.0, -np.sin(rotation_y)]
    box["yaw"] = np.arctan2(ahead[1], ahead[0])
    return box
