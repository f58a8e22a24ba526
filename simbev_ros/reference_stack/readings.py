"""What a rectangle may be: its length lies along one side or the other, and each kind of object costs what is off."""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.reference_stack.arrays import Floats, Integers, box_axes, turned, yaw_of
from simbev_ros.reference_stack.box_fit import Rectangles
from simbev_ros.reference_stack.classes import Kinds

_LEAST_WEIGHT = 0.02
"""Of what a kind has more than is seen, where that would lie out of sight."""
_MOST_OFF = 50.0
_MISSED_COLUMNS = 2.0
"""Rays that may just miss an object, on both sides together."""
_SMALLEST_HALF_M = 0.3


@dataclass(frozen=True)
class Resolution:
    """Angles between neighbouring rays of a lidar.

    Attributes:
        ring_rad: Up and down.
        column_rad: From side to side.
    """

    ring_rad: float
    column_rad: float


@dataclass(frozen=True)
class Readings:
    """C rectangles read in both ways, R = 2: the length is the first side, or the second.

    Attributes:
        center_m: (C, 2) of what is seen.
        ground_m: (C,) z of the ground below.
        yaw_rad: (C, R) direction of the length; which end is the front is not known.
        seen_m: (C, R, 3) length, width, height of what is seen.
        view: (C, R, 2) sine of the angle between the line of sight and length, width; 1: seen broadside.
        sensor_side: (C, R, 2) at which end of length and width the sensor is, -1 … 1; 0: both ends are seen.
        ring_gap_m: (C,) between neighbouring rings there: so much may be missing at the top.
        range_m: (C,) from the sensor.
        points: (C,) how many there are.
        cost: (C, R, K) of each kind.
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
        """The same in another frame, given its (4, 4) pose."""
        rotation, origin_m = map_from_ego[:3, :3], map_from_ego[:3, 3]
        place_m = turned(rotation, np.column_stack([self.center_m, self.ground_m])) + origin_m
        yaw_rad = self.yaw_rad + yaw_of(map_from_ego)
        return replace(self, center_m=place_m[:, :2], ground_m=place_m[:, 2], yaw_rad=yaw_rad)


def read_rectangles(rectangles: Rectangles, kinds: Kinds, sensor_m: Floats, resolution: Resolution) -> Readings:
    """Both readings of rectangles seen from (2,), in the frame of both."""
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
        sensor_side=np.clip(along_m / np.maximum(side_m / 2, _SMALLEST_HALF_M), -1.0, 1.0),
        ring_gap_m=gap_m[:, 2],
        range_m=range_m,
        points=rectangles.points,
        cost=_cost(seen_m, view, gap_m, kinds),
    )


def _cost(seen_m: Floats, view: Floats, gap_m: Floats, kinds: Kinds) -> Floats:
    """(C, R, K): what is too large counts in full, what is missing as far as it would be in view."""
    missing_m = kinds.seen_m - seen_m[:, :, None]
    in_view = np.concatenate([view, np.ones((*view.shape[:2], 1))], axis=2)[:, :, None]
    off = np.where(missing_m < 0, missing_m, np.maximum(missing_m - gap_m[:, None, None], 0.0)) / kinds.sigma_m
    weight = np.where(missing_m < 0, 1.0, np.maximum(in_view**2, _LEAST_WEIGHT))
    cost: Floats = (weight * np.minimum(off**2, _MOST_OFF)).sum(axis=3) + kinds.rarity
    return cost
