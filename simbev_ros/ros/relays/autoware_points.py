"""Converts lidar points to Autoware's point type PointXYZIRCAEDT. Pure: imports no ROS."""

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S

AUTOWARE_POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "u1"),  # 0..255
        ("return_type", "u1"),  # 1: single, strongest
        ("channel", "<u2"),  # the column `ring`
        ("azimuth", "<f4"),  # rad, from x to y
        ("elevation", "<f4"),  # rad, up
        ("distance", "<f4"),  # m
        ("time_stamp", "<u4"),  # ns from the stamp of the cloud
    ]
)
"""Row of a cloud, as autoware_point_types defines it: offsets 0 4 8 12 13 14 16 20 24 28, 32 bytes."""

_SINGLE_STRONGEST = 1


def autoware_points(points: Table, *, rolling: bool) -> tuple[Table, int]:
    """Convert the points of one turn to Autoware's point type.

    Autoware stamps a cloud with the time of its first shot and counts from there; our clouds have the stamp of the
    last one, and count back. Unless the lidar is rolling, all rays are cast at the stamp, and no point has a time.

    Args:
        points: (N,) rows of ``POINT_DTYPE``.
        rolling: Whether each column was cast at its own time, the lidar's option of this name.

    Returns:
        (N,) rows of ``AUTOWARE_POINT_DTYPE``, and the nanoseconds, ≤ 0, from our stamp to the cloud's new one.
    """
    rows = np.zeros(len(points), AUTOWARE_POINT_DTYPE)
    x, y, z = (points[axis] for axis in "xyz")
    level_m = np.hypot(x, y)
    rows["x"], rows["y"], rows["z"] = x, y, z
    rows["intensity"] = np.rint(np.clip(points["intensity"], 0.0, 1.0) * 255.0)
    rows["return_type"] = _SINGLE_STRONGEST
    rows["channel"] = points["ring"]
    rows["azimuth"], rows["elevation"] = np.arctan2(y, x), np.arctan2(z, level_m)
    rows["distance"] = np.hypot(level_m, z)
    if not rolling or len(points) == 0:
        return rows, 0
    times_ns = np.rint(points["time"].astype(np.float64) * NS_PER_S).astype(np.int64)
    first_ns = int(times_ns.min())
    rows["time_stamp"] = times_ns - first_ns
    return rows, first_ns
