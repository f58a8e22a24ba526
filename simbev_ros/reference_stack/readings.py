"""Interprets rectangles as objects: the length may lie along either side, and every kind has a cost of mismatch."""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.reference_stack.arrays import Floats, Integers, box_axes, rotate, yaw_of
from simbev_ros.reference_stack.box_fit import Rectangles
from simbev_ros.reference_stack.classes import Kinds

_MIN_WEIGHT = 0.02
"""Minimum weight of a missing part of an object, which applies where that part would be out of sight."""
_MAX_DEVIATION = 50.0
_MISSED_COLUMNS = 2.0
"""Number of rays that may just miss an object, on both sides together."""
_MIN_HALF_M = 0.3


@dataclass(frozen=True)
class Resolution:
    """Angles between neighboring rays of a lidar.

    Attributes:
        ring_rad: Vertical angle.
        column_rad: Horizontal angle.
    """

    ring_rad: float
    column_rad: float


@dataclass(frozen=True)
class Readings:
    """C rectangles with R = 2 readings each: the length is the first side or the second.

    Attributes:
        center_m: (C, 2) center of the visible part.
        ground_m: (C,) z of the ground below the cluster.
        yaw_rad: (C, R) direction of the length; which end is the front is not known.
        seen_m: (C, R, 3) length, width, height of the visible part.
        view: (C, R, 2) sine of the angle between the line of sight and length, width; 1: seen broadside.
        sensor_side: (C, R, 2) end of length and width that faces the sensor, -1 … 1; 0: both ends are visible.
        ring_gap_m: (C,) distance between neighboring rings at the cluster, which may be missing at its top.
        range_m: (C,) distance from the sensor.
        points: (C,) number of points.
        cost: (C, R, K) cost of each kind.
    """

    center_m: Floats
    ground_m: Floats
    yaw_rad: Floats
    seen_m: Floats
    view: Floats
    sensor_side: Floats
    ring_gap_m: Floats
    range_m: Floats
    points: Integers
    cost: Floats

    def in_map(self, map_from_ego: Floats) -> "Readings":
        """Transform from the ego frame to the map, given the (4, 4) pose of the ego."""
        rotation, origin_m = map_from_ego[:3, :3], map_from_ego[:3, 3]
        position_m = rotate(rotation, np.column_stack([self.center_m, self.ground_m])) + origin_m
        yaw_rad = self.yaw_rad + yaw_of(map_from_ego)
        return replace(self, center_m=position_m[:, :2], ground_m=position_m[:, 2], yaw_rad=yaw_rad)


def read_rectangles(rectangles: Rectangles, kinds: Kinds, sensor_m: Floats, resolution: Resolution) -> Readings:
    """Read rectangles seen from the (2,) position ``sensor_m``, both in one frame."""
    yaw_rad = rectangles.yaw_rad[:, None] + np.array([0.0, np.pi / 2])
    to_sensor_m = sensor_m - rectangles.center_m
    range_m = np.maximum(np.hypot(*to_sensor_m.T), 1e-3)
    along_m = np.einsum("crsi,ci->crs", box_axes(yaw_rad), to_sensor_m)
    side_m = np.stack([rectangles.side_m, rectangles.side_m[:, ::-1]], axis=1)
    top_m = np.broadcast_to(rectangles.top_m[:, None, None], (*yaw_rad.shape, 1))
    seen_m = np.concatenate([side_m, top_m], axis=2)
    view = np.sqrt(np.maximum(1.0 - (along_m / range_m[:, None, None]) ** 2, 0.0))
    column_gap_m = range_m * resolution.column_rad * _MISSED_COLUMNS
    gap_m = np.stack([column_gap_m, column_gap_m, range_m * resolution.ring_rad], axis=1)
    return Readings(
        center_m=rectangles.center_m,
        ground_m=rectangles.ground_m,
        yaw_rad=yaw_rad,
        seen_m=seen_m,
        view=view,
        sensor_side=np.clip(along_m / np.maximum(side_m / 2, _MIN_HALF_M), -1.0, 1.0),
        ring_gap_m=gap_m[:, 2],
        range_m=range_m,
        points=rectangles.points,
        cost=_cost(seen_m, view, gap_m, kinds),
    )


def _cost(seen_m: Floats, view: Floats, gap_m: Floats, kinds: Kinds) -> Floats:
    """(C, R, K) cost: excess size counts in full, missing size as far as it would be visible."""
    missing_m = kinds.seen_m - seen_m[:, :, None]
    in_view = np.concatenate([view, np.ones((*view.shape[:2], 1))], axis=2)[:, :, None]
    deviation = np.where(missing_m < 0, missing_m, np.maximum(missing_m - gap_m[:, None, None], 0.0)) / kinds.sigma_m
    weight = np.where(missing_m < 0, 1.0, np.maximum(in_view**2, _MIN_WEIGHT))
    cost: Floats = (weight * np.minimum(deviation**2, _MAX_DEVIATION)).sum(axis=3) + kinds.rarity
    return cost
