"""Recordings of real sensors: what the readers of all layouts give, and boxes that move between its frames.

Frames of reference: ``lidar`` is that of the cloud's points; ``ego`` has its origin on the ground, x ahead, y to the
left and z upward from the ground, and serves as the level frame of the models; ``map`` is any fixed frame.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.baselines.boxes import DETECTED_CLASSES
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array, Table

OTHER_CLASS = 255
"""Class of a labeled object that no model predicts: a prediction there is neither right nor wrong."""
_ALMOST_RIGID, _MAX_POSITION_M, _MAX_FOCAL_PX = 1e-3, 1e7, 1e6


class RecordedSweep(NamedTuple):
    """A turn of the lidar.

    Attributes:
        path: Its file.
        columns: Number of float32 of each point in it, if it ends in ``.bin``.
        stamp_ns: Its stamp; 0 if unknown.
        map_from_lidar: (4, 4) pose of the lidar; None: unknown.
    """

    path: Path
    columns: int
    stamp_ns: int = 0
    map_from_lidar: Float64Array | None = None


class RecordedImage(NamedTuple):
    """An undistorted image.

    Attributes:
        camera: Name of the camera.
        path: Its file.
        matrix: (3, 3) intrinsic matrix; pixel centers are at integers.
        optical_from_lidar: (4, 4) transform at the times of cloud and image.
        reference_m: (3,) origin of labels' positions, optical frame; in KITTI, that is another camera.
    """

    camera: str
    path: Path
    matrix: Float64Array
    optical_from_lidar: Float64Array
    reference_m: Float64Array = np.zeros(3)


class Labels(NamedTuple):
    """Labels of a frame.

    Attributes:
        boxes: (N,) ``baselines.boxes.BOX_DTYPE`` in the lidar's frame, upright; ``OTHER_CLASS`` for other classes.
        only_in_image: Whether nothing is labeled that the first image does not show.
        unlabeled_px: (M, 4) left, top, right and bottom of parts of that image in which nothing is labeled.
    """

    boxes: Table
    only_in_image: bool = False
    unlabeled_px: Float64Array = np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A cloud with what belongs to it.

    Attributes:
        name: Unique name, which files are called after.
        title: What pictures say it is.
        sweeps: All sweeps with known poses in the same map frame, by ascending stamp, its own among them.
        index: Index of its own sweep.
        images: Reads which images it has.
        labels: Reads its labels; None: it has none.
        ego_from_lidar: (4, 4); None: unknown, so the ground has to be found.
    """

    name: str
    title: str
    sweeps: Sequence[RecordedSweep]
    index: int
    images: Callable[[], Sequence[RecordedImage]]
    labels: Callable[[], Labels] | None = None
    ego_from_lidar: Float64Array | None = None

    @property
    def sweep(self) -> RecordedSweep:
        """Its own sweep."""
        return self.sweeps[self.index]


def boxes_in_frame(boxes: Table, target_from_source: Float64Array) -> Table:
    """Upright boxes in another frame, whose z axis may be tilted a little; they are upright there."""
    rotation, moved = target_from_source[:3, :3], boxes.copy()
    center = np.stack([boxes["x"], boxes["y"], boxes["z"]], 1) @ rotation.T + target_from_source[:3, 3]
    moved["x"], moved["y"], moved["z"] = center.T
    ahead = rotation[:2, :2] @ np.stack([np.cos(boxes["yaw"]), np.sin(boxes["yaw"])])
    moved["yaw"] = np.arctan2(ahead[1], ahead[0])
    moved["vx"], moved["vy"] = rotation[:2, :2] @ np.stack([boxes["vx"], boxes["vy"]])
    return moved


def require_possible(boxes: Table) -> Table:
    """The boxes, whose numbers are those of real objects. Raises ValueError if one is not."""
    limits = dict.fromkeys(("x", "y", "z", "yaw"), (-1e5, 1e5)) | dict.fromkeys(("length", "width", "height"), (0, 100))
    for name, (low, high) in limits.items():
        wrong = boxes[name][~((boxes[name] >= low) & (boxes[name] <= high))]
        if len(wrong):
            raise ValueError(f"a box has a {name} of {wrong[0]:g}; allowed are {low:g} to {high:g}")
    return boxes


def require_rigid(transform: Float64Array) -> Float64Array:
    """The (4, 4) transform. Raises ValueError if it is not a rotation and a translation."""
    rotation = transform[:3, :3]
    is_rotation = np.isfinite(transform).all() and np.abs(rotation @ rotation.T - np.eye(3)).max() < _ALMOST_RIGID
    if not is_rotation or np.linalg.det(rotation) < 0 or np.abs(transform).max() > _MAX_POSITION_M:
        raise ValueError("a transform is not a rotation and a translation")
    return transform


def require_matrix(matrix: Float64Array) -> Float64Array:
    """The (3, 3) matrix of a camera. Raises ValueError if it is not that of an undistorted one."""
    is_usual = np.isfinite(matrix).all() and matrix[0, 0] > 0 < matrix[1, 1] and np.array_equal(matrix[2], [0, 0, 1])
    if not is_usual or np.abs(matrix).max() > _MAX_FOCAL_PX:
        raise ValueError("a camera's matrix is not fx 0 cx, 0 fy cy, 0 0 1")
    return matrix


def class_numbers(layout: str) -> dict[str, int]:
    """Numbers of classes by their names in a layout, ``OTHER_CLASS`` for those that no model predicts."""
    table: dict[str, Any] = load_table("simbev_ros.baselines.recordings", "class_names.yaml")[layout]
    return {name: BOX_CLASSES.index(ours) if ours in DETECTED_CLASSES else OTHER_CLASS for name, ours in table.items()}


def path_below(folder: Path, name: Any) -> Path:
    """Path of a file that data name. Raises ValueError if the name is none, or leads out of the folder."""
    if not isinstance(name, str) or PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
        raise ValueError(f"{name!r:.80} is not the name of a file in {folder}")
    return folder / name
