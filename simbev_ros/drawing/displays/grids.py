"""Converts one class of a bird's-eye-view grid to nav_msgs/OccupancyGrid."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.drawing.displays.messages import GRID, build, moment, pose, serialize, stamped
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.foundation.types import BoolArray, Float64Array


def occupancy_grid(
    covered: BoolArray, grid: BevGrid, stamp_ns: int, frame: str, rpy_rad: Sequence[float] | Float64Array
) -> bytes:
    """OccupancyGrid of one class, 100 where covered and 0 elsewhere.

    Its cell (0, 0) has the smallest x and y (behind and right of the ego), and x runs fastest, so the grid of (rows,
    columns) with row 0 ahead and column 0 left is rotated. The grid is level but the ego's frame is not, so the
    orientation of the origin undoes the tilt; on a level road it is the identity.

    Args:
        covered: (rows, columns) whether each cell is covered.
        grid: Geometry of the grid.
        stamp_ns: Stamp.
        frame: Name of the ego's frame, fixed to the car.
        rpy_rad: (3,) roll, pitch and yaw of the ego.
    """
    tilt_rad = np.array([rpy_rad[0], rpy_rad[1], 0.0])
    corner_m = np.array([-grid.rows, -grid.columns, 0.0]) * grid.cell_m / 2.0
    level = quaternion_from_rpy(tilt_rad) * [-1.0, -1.0, -1.0, 1.0]
    info = build(
        "nav_msgs/msg/MapMetaData",
        map_load_time=moment(stamp_ns),
        resolution=grid.cell_m,
        width=grid.rows,
        height=grid.columns,
        origin=pose((corner_m @ rotations_from_rpy(tilt_rad)).tolist(), level.tolist()),
    )
    cells = np.ascontiguousarray(covered[::-1, ::-1].T).astype(np.int8) * np.int8(100)
    return serialize(build(GRID, header=stamped(stamp_ns, frame), info=info, data=cells.reshape(-1)))
