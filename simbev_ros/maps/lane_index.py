"""Which lane is nearest, and how high the road is, for many points at once."""

from collections.abc import Sequence

import numpy as np
import shapely

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import Lane, RoadNetwork, Waypoints
from simbev_ros.types import Float64Array

_YAW_STEP_M = 0.05


class LaneIndex:
    """A search tree over the centre lines of some lanes, e.g. ``network.lanes_of(LaneKind.DRIVING)``."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        """Index at least one lane; walking areas have no meaningful centre line and should be left out."""
        self._ids = tuple(lane.id for lane in lanes)
        self._lines = np.array([shapely.LineString(lane.centerline_m) for lane in lanes])
        self._tree = shapely.STRtree(self._lines)

    def nearest(self, xy_m: Float64Array) -> Waypoints:
        """The nearest place on a lane for each point; of lanes equally near, the first.

        Args:
            xy_m: (N, 2) float64, map frame; distances are measured in the ground plane.
        """
        points = shapely.points(np.asarray(xy_m, np.float64).reshape(-1, 2))
        pairs = self._tree.query_nearest(points)
        pairs = pairs[:, np.lexsort(pairs[::-1])]
        _, first = np.unique(pairs[0], return_index=True)
        rows = pairs[1, first]
        lines = self._lines[rows]
        s_m: Float64Array = shapely.line_locate_point(lines, points)
        before = np.maximum(s_m - _YAW_STEP_M, 0.0)
        after = np.minimum(s_m + _YAW_STEP_M, shapely.length(lines))
        heading = _points_at(lines, after) - _points_at(lines, before)
        yaw_rad: Float64Array = np.arctan2(heading[:, 1], heading[:, 0])
        return Waypoints(_points_at(lines, s_m), yaw_rad, tuple(self._ids[row] for row in rows), s_m)


def height_m(network: RoadNetwork, xy_m: Float64Array) -> Float64Array:
    """(N,) height of the nearest lane's centre line at (N, 2) points of the map frame; 0 on maps without elevation."""
    kinds = tuple(kind for kind in LaneKind if kind is not LaneKind.WALKING_AREA)
    lanes = network.lanes_of(*kinds)
    if not any(lane.centerline_m[:, 2].any() for lane in lanes):
        return np.zeros(len(xy_m))
    return LaneIndex(lanes).nearest(xy_m).position_m[:, 2]


def _points_at(lines: np.ndarray[tuple[int, ...], np.dtype[np.object_]], s_m: Float64Array) -> Float64Array:
    """(N, 3) points on N lines, each at its own distance from the start."""
    return shapely.get_coordinates(shapely.line_interpolate_point(lines, s_m), include_z=True)
