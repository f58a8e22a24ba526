"""One class of a bird's-eye-view grid → nav_msgs/OccupancyGrid."""

from array import array

import numpy as np
from geometry_msgs.msg import Point
from nav_msgs.msg import MapMetaData, OccupancyGrid

from simbev_ros.geometry.grid import BevGrid
from simbev_ros.msgs.stamps import header, time_message
from simbev_ros.types import BoolArray


def occupancy_grid_message(covered: BoolArray, grid: BevGrid, stamp_ns: int, frame: str) -> OccupancyGrid:
    """OccupancyGrid, 100 where covered and 0 elsewhere.

    Its cell (0, 0) is the one at the smallest x and y (behind and right of the ego) and x runs fastest, so that the
    grid of (rows, columns) with row 0 ahead and column 0 left is turned.

    Args:
        covered: (rows, columns).
        grid: Its geometry, in ``frame``.
        stamp_ns: Stamp.
        frame: The ego's frame.
    """
    info = MapMetaData(
        map_load_time=time_message(stamp_ns), resolution=grid.cell_m, width=grid.rows, height=grid.columns
    )
    info.origin.position = Point(x=-grid.rows * grid.cell_m / 2.0, y=-grid.columns * grid.cell_m / 2.0)
    info.origin.orientation.w = 1.0
    cells = np.ascontiguousarray(covered[::-1, ::-1].T).astype(np.int8) * np.int8(100)
    return OccupancyGrid(header=header(stamp_ns, frame), info=info, data=array("b", cells.tobytes()))
