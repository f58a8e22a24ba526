"""Converts one class of a bird's-eye-view grid to nav_msgs/OccupancyGrid."""

from array import array

import numpy as np
from geometry_msgs.msg import Point, Pose
from nav_msgs.msg import MapMetaData, OccupancyGrid

from simbev_ros.geometry.grid import BevGrid
from simbev_ros.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.msgs.stamps import header, time_message
from simbev_ros.msgs.world import quaternion_message
from simbev_ros.types import BoolArray, Table


def occupancy_grid_message(covered: BoolArray, grid: BevGrid, stamp_ns: int, frame: str, ego: Table) -> OccupancyGrid:
    """OccupancyGrid message of one class, 100 where covered and 0 elsewhere.

    Its cell (0, 0) has the smallest x and y (behind and right of the ego), and x runs fastest, so the grid of (rows,
    columns) with row 0 ahead and column 0 left is rotated. The grid is level but the ego's frame is not, so the
    orientation of the origin undoes the tilt; on a level road it is the identity.

    Args:
        covered: (rows, columns) whether each cell is covered.
        grid: Geometry of the grid.
        stamp_ns: Stamp.
        frame: Name of the ego's frame, fixed to the car.
        ego: ``ACTOR_DTYPE`` row of the ego, shape ().
    """
    tilt_rad = np.array([ego["roll"], ego["pitch"], 0.0])
    corner_m = np.array([-grid.rows, -grid.columns, 0.0]) * grid.cell_m / 2.0
    x, y, z = (corner_m @ rotations_from_rpy(tilt_rad)).tolist()
    level = quaternion_message(quaternion_from_rpy(tilt_rad) * [-1.0, -1.0, -1.0, 1.0])
    info = MapMetaData(
        map_load_time=time_message(stamp_ns),
        resolution=grid.cell_m,
        width=grid.rows,
        height=grid.columns,
        origin=Pose(position=Point(x=x, y=y, z=z), orientation=level),
    )
    cells = np.ascontiguousarray(covered[::-1, ::-1].T).astype(np.int8) * np.int8(100)
    return OccupancyGrid(header=header(stamp_ns, frame), info=info, data=array("b", cells.tobytes()))
