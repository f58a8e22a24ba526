"""Rows of /ego/boxes for tests."""

from typing import Any

import numpy as np

from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.schema.boxes import BOX_DTYPE


def box(
    x: float, y: float, z: float, *, yaw: float = 0.0, size: tuple[float, float, float] = (4, 2, 1.5), **more: Any
) -> Table:
    """(1,) row of a car with its center at a position, of unknown visibility; ``more`` sets other columns."""
    row = np.zeros(1, BOX_DTYPE)
    row["x"], row["y"], row["z"], row["yaw"] = x, y, z, yaw
    row["length"], row["width"], row["height"] = size
    row["class"], row["visibility"] = BOX_CLASSES.index("car"), np.nan
    row["lidar_points"] = row["radar_points"] = -1
    for name, value in more.items():
        row[name] = value
    return row
