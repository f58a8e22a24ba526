"""Finds the ground below a lidar: a plane through near points, by random samples of three (RANSAC)."""

import math
from collections.abc import Sequence

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float32Array, Float64Array

_NEAR_M, _OWN_ROAD_M, _FAR_M = 3.0, 8.0, 20.0
_CELL_M = 1.0
_MIN_CELLS = 20
_SAMPLES = 300
_TOLERANCE_M, _BELOW_M = 0.12, 0.3
_MAX_TURN_DEG, _MAX_RISE_M = 3.0, 0.3
_MAX_TILT = 0.15
"""Maximum slope of the ground in the lidar's frame: about 9 degrees."""
_CLEAR_SHARE = 0.5
"""Share of the cells on the plane from which on its tilt counts."""


def ego_from_lidar_of(clouds: Sequence[Float32Array]) -> Float64Array:
    """(4, 4) pose of a lidar whose x axis points ahead, over the ground that most of its clouds show.

    Height, and pitch and roll where the plane is clear, are medians over the clouds.

    Args:
        clouds: (N, 3 or more) points, lidar frame.

    Raises:
        InputError: No cloud shows ground.
    """
    planes = [plane for plane in map(_ground_plane, clouds) if plane is not None]
    if not planes:
        raise InputError(
            "no cloud shows ground 3 to 20 m from the lidar; give its pose in sensors.yaml (--format folder)"
        )
    slopes, heights_m, shares = (np.array(each) for each in zip(*planes, strict=True))
    clear = shares >= _CLEAR_SHARE
    if not clear.any():
        return _pose(np.zeros(2), float(np.median(heights_m)))
    return _pose(np.median(slopes[clear], axis=0), float(np.median(heights_m[clear])))


def ego_from_lidar_in_frame(usual: Float64Array, cloud: Float32Array) -> Float64Array:
    """(4, 4) pose of the lidar over the ground of one frame if that is clear and near the usual one, else the usual.

    Args:
        usual: (4, 4) pose in other frames, from ``ego_from_lidar_of``.
        cloud: (N, 3 or more) points of the frame, lidar frame.
    """
    plane = _ground_plane(cloud)
    if plane is None or plane[2] < _CLEAR_SHARE:
        return usual
    found = _pose(*plane[:2])
    turn_deg = math.degrees(math.acos(min(float(found[2, :3] @ usual[2, :3]), 1.0)))
    is_near = turn_deg < _MAX_TURN_DEG and abs(found[2, 3] - usual[2, 3]) < _MAX_RISE_M
    return found if is_near else usual


def _pose(slope: Float64Array, height_m: float) -> Float64Array:
    """(4, 4) ego_from_lidar for the ground's (2,) slope ahead and to the left in the lidar's frame."""
    up = np.array([-slope[0], -slope[1], 1.0])
    up /= np.linalg.norm(up)
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= np.linalg.norm(forward)
    ego_from_lidar = np.eye(4)
    ego_from_lidar[:3, :3] = forward, np.cross(up, forward), up
    ego_from_lidar[2, 3] = height_m
    return ego_from_lidar


def _ground_plane(cloud: Float32Array) -> tuple[Float64Array, float, float] | None:
    """Slope of the ground along x and y, height of the lidar, and share of cells on the ground; None: none is seen."""
    low = _lowest_points(cloud)
    if len(low) < _MIN_CELLS:
        return None
    a, b, c = low[stream(0, "recordings.ground").integers(0, len(low), (3, _SAMPLES))]
    normal = np.cross(b - a, c - a)
    good = np.abs(normal[:, 2]) > 1e-6
    normal, a = normal[good] / normal[good][:, 2:], a[good]
    flat = np.hypot(normal[:, 0], normal[:, 1]) < _MAX_TILT
    normal, a = normal[flat], a[flat]
    if not len(normal):
        return None
    above_m = low @ normal.T - (a * normal).sum(1)
    votes = (np.abs(above_m) < _TOLERANCE_M).sum(0) - (above_m < -_BELOW_M).sum(0)
    chosen = np.abs(above_m[:, votes.argmax()]) < _TOLERANCE_M
    for _ in range(3):
        columns = np.column_stack([low[:, :2], np.ones(len(low))])
        (ahead, left, level), *_ = np.linalg.lstsq(columns[chosen], low[chosen, 2], rcond=None)
        chosen = np.abs(low[:, 2] - columns @ [ahead, left, level]) < _TOLERANCE_M
        if np.count_nonzero(chosen) < _MIN_CELLS:
            return None
    above_m = low[:, 2] - columns @ [ahead, left, level]
    road = (np.abs(above_m) < _BELOW_M) & (np.hypot(low[:, 0], low[:, 1]) < _OWN_ROAD_M)
    level += np.median(above_m[road]) if road.any() else 0.0
    return np.array([ahead, left]), -float(level), float(np.mean(chosen))


def _lowest_points(cloud: Float32Array) -> Float64Array:
    """(N, 3) the lowest point of each square meter around the lidar."""
    points = cloud[:, :3].astype(np.float64)
    distance_m = np.hypot(points[:, 0], points[:, 1])
    points = points[(distance_m > _NEAR_M) & (distance_m < _FAR_M)]
    cell = np.floor(points[:, :2] / _CELL_M).astype(np.int64) @ [1000, 1]
    order = np.lexsort((points[:, 2], cell))
    _, first = np.unique(cell[order], return_index=True)
    return points[order[first]]
