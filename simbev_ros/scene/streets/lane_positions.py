"""Places on lanes where actors can start, as arrays, whatever the size of the map."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.spec import WaypointSpec
from simbev_ros.types import BoolArray, Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Places:
    """N places on some lanes.

    Attributes:
        lanes: The lanes.
        row: (N,) int64, which of the lanes each place is on.
        s_m: (N,) distance from the lane's start.
        position_m: (N, 3) map frame.
    """

    lanes: tuple[Lane, ...]
    row: Int64Array
    s_m: Float64Array
    position_m: Float64Array

    def __len__(self) -> int:
        return len(self.row)

    def within(self, center_m: Float64Array, radius_m: float) -> BoolArray:
        """(N,) whether they are no further than a radius from a (3,) point."""
        near: BoolArray = np.linalg.norm(self.position_m - center_m, axis=1) <= radius_m
        return near

    def beside(self, waypoint: WaypointSpec, distance_m: float) -> BoolArray:
        """(N,) whether they are on the lane of a waypoint and nearer to it than a distance."""
        on_lane = np.array([lane.id == waypoint.lane for lane in self.lanes], bool)[self.row]
        near: BoolArray = on_lane & (np.abs(self.s_m - waypoint.s_m) < distance_m)
        return near

    def waypoint(self, index: int) -> WaypointSpec:
        """One of them."""
        return WaypointSpec(lane=self.lanes[self.row[index]].id, s_m=float(self.s_m[index]))


def places_along(lanes: Sequence[Lane], first_m: float, spacing_m: float, end_margin_m: float = 0.0) -> Places:
    """The first place of each lane ``first_m`` from its start, then one every ``spacing_m``, clear of its end."""
    lines = Polylines.of([lane.centerline_m for lane in lanes])
    counts = np.ceil((lines.length_m - end_margin_m - first_m) / spacing_m).clip(0.0).astype(np.int64)
    row = np.repeat(np.arange(len(lanes)), counts)
    number = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    s_m: Float64Array = first_m + spacing_m * number.astype(np.float64)
    return Places(tuple(lanes), row, s_m, lines.values(lines.parameter(row, s_m)))
