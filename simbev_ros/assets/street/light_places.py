"""Positions of street lights: at stations along the lanes beside a curb, so that rows continue across regions."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.street.curbs import CurbLine
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons

_BESIDE_M = 14.0
_MAX_OFFSET_M = 6.0  # maximum distance of a light from its station along the curb, if the station is occupied
_ON_THE_RIGHT, _ON_THE_LEFT = 0.25, 0.75  # in spacings: lights on the two sides of a street are staggered


class Lanes(NamedTuple):
    """Driving lanes of one level outside of junctions: areas, and center lines in driving direction."""

    areas: shapely.STRtree
    lines: np.ndarray[tuple[int], np.dtype[np.object_]]

    @classmethod
    def of_level(cls, ground: RegionGround, level: int) -> "Lanes":
        """Collect the lanes of a level in and near a region."""
        reach_m = 2.0 * _BESIDE_M
        near = ground.network.layout.near(ground.region.area, reach_m).strips_of(LaneKind.DRIVING, level=level)
        strips = [strip for strip in near if not strip.junction]
        around = shapely.buffer(ground.region.area, reach_m, join_style="mitre")
        lines: list[BaseGeometry] = [shapely.LineString(strip.center_m[:, :2]) for strip in strips]
        return cls(shapely.STRtree(overlay.intersection(strip_polygons(strips), around)), np.array(lines, object))

    def against_rad(self, xy_m: Float64Array) -> Float64Array:
        """(N,) headings against the traffic of the lane that is nearest to each of (N, 2) points; not without lanes."""
        points = np.asarray(shapely.points(xy_m), object)
        lines = self.lines[self.areas.nearest(points)]
        s_m = np.asarray(shapely.line_locate_point(lines, points))
        behind_m, ahead_m = (
            shapely.get_coordinates(shapely.line_interpolate_point(lines, np.maximum(s_m + step_m, 0.0)))
            for step_m in (-1.0, 1.0)
        )
        along = (ahead_m - behind_m).reshape(-1, 2)
        return np.asarray(np.arctan2(-along[:, 1], -along[:, 0]))


def light_positions(ground: RegionGround, curb: CurbLine, lanes: Lanes, spacing_m: float) -> Iterator[Int64Array]:
    """For each light of the region along a curb, yield indices of candidate positions of the curb, the best one first.

    Args:
        ground: Ground of the region; stations of other regions are left out.
        curb: Line that the lights stand on.
        lanes: Lanes of the curb's level.
        spacing_m: Approximate spacing on one side of a street; each lane has a whole number of spacings.
    """
    if len(lanes.lines) == 0:
        return
    points = np.asarray(shapely.points(curb.position_m), object)
    position_index, lane = lanes.areas.query_nearest(points, max_distance=_BESIDE_M, all_matches=False)
    line = lanes.lines[lane]
    length_m, s_m = shapely.length(line), np.asarray(shapely.line_locate_point(line, points[position_index]))
    count = np.maximum(np.round(length_m / spacing_m), 1.0)
    phase = np.where(_is_left(line, s_m, curb.position_m[position_index]), _ON_THE_LEFT, _ON_THE_RIGHT)
    number = np.clip(np.round(s_m / length_m * count - phase), 0.0, count - 1.0)
    station_m = (number + phase) / count * length_m
    off_m = np.abs(s_m - station_m)
    station = shapely.get_coordinates(shapely.line_interpolate_point(line, station_m)).reshape(-1, 2)
    wanted = np.flatnonzero((off_m < _MAX_OFFSET_M) & ground.owns(station))
    key = np.column_stack([lane, number])[wanted]
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    for k in np.argsort(first, kind="stable"):
        of_light = wanted[group == k]
        yield position_index[of_light[np.argsort(off_m[of_light], kind="stable")]]


def _is_left(
    line: np.ndarray[tuple[int], np.dtype[np.object_]], s_m: Float64Array, position_m: Float64Array
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(N,) whether (N, 2) points lie on the left of (N,) lines at stations."""
    behind_m, ahead_m = (
        shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(s_m + step_m, 0.0))).reshape(-1, 2)
        for step_m in (-0.5, 0.5)
    )
    along, off = ahead_m - behind_m, position_m - behind_m
    return np.asarray(along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0] > 0.0)
