"""Ground truth around the ego at the time of a picture."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array, Table, UInt16Array


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth at the time of one picture.

    Attributes:
        map_from_ego: (4, 4) pose of the ego at that time.
        boxes: (N,) rows of /ego/boxes, map frame; None if there are none at that time.
        labels: (rows, columns) uint16 bird's-eye-view labels; None if there are no recent ones. Those of an earlier
            time contain only the classes that lie on the ground.
        map_from_grid: (4, 4) pose of the labels' grid: leveled_pose, along the ego's heading at the labels' stamp.
    """

    map_from_ego: Float64Array
    boxes: Table | None
    labels: UInt16Array | None
    map_from_grid: Float64Array


def leveled_pose(map_from_ego: Float64Array) -> Float64Array:
    """(4, 4) pose of the ego without its roll and pitch."""
    yaw_rad = rpy_from_rotation(map_from_ego[:3, :3])[2]
    return matrices_from_xyz_rpy(map_from_ego[:3, 3], np.array([0.0, 0.0, yaw_rad]))
