"""Arrays of positions on lanes at which actors can start; their cost does not depend on the map's size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.schema.scene.spec import WaypointSpec


@dataclass(frozen=True, slots=True)
class LanePositions:
    """N positions on a set of lanes.

    Attributes:
        lanes: The lanes.
        row: (N,) int64, index into ``lanes`` of each position's lane.
        s_m: (N,) distance from the lane's start.
        position_m: (N, 3) map frame.
    """

    lanes: tuple[Lane, ...]
    row: Int64Array
    s_m: Float64Array
    position_m: Float64Array

    def __len__(self) -> int:
        return len(self.row)

    def within_radius(self, center_m: Float64Array, radius_m: float) -> BoolArray:
        """(N,) whether each position is at most a radius away from a (3,) point."""
        return np.linalg.norm(self.position_m - center_m, axis=1) <= radius_m

    def on_lane_near(self, waypoint: WaypointSpec, distance_m: float) -> BoolArray:
        """(N,) whether each position is on a waypoint's lane and closer to it than a distance."""
        on_lane = np.array([lane.id == waypoint.lane for lane in self.lanes], bool)[self.row]
        return on_lane & (np.abs(self.s_m - waypoint.s_m) < distance_m)

    def waypoint(self, index: int) -> WaypointSpec:
        """Waypoint of the position with this index."""
        return WaypointSpec(lane=self.lanes[self.row[index]].id, s_m=float(self.s_m[index]))


def positions_along(
    lanes: Sequence[Lane], first_m: float, spacing_m: float, end_margin_m: float = 0.0
) -> LanePositions:
    """Sample lanes: first position ``first_m`` from each lane's start, then every ``spacing_m``, clear of its end."""
    lines = Polylines.from_lines([lane.centerline_m for lane in lanes])
    counts = np.ceil((lines.length_m - end_margin_m - first_m) / spacing_m).clip(0.0).astype(np.int64)
    row, number = ragged_indices(counts)
    s_m: Float64Array = first_m + spacing_m * number.astype(np.float64)
    return LanePositions(tuple(lanes), row, s_m, lines.values(lines.parameter(row, s_m)))
