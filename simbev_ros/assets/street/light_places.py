"""Where street lights belong: at stations along the lanes beside a curb, so that they run on across regions."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.street.curbs import CurbLine
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.types import Float64Array, Int64Array

_BESIDE_M = 14.0
_PLAY_M = 6.0  # a light may stand so far from its station along the curb, where that is taken
_ON_THE_RIGHT, _ON_THE_LEFT = 0.25, 0.75  # of a spacing: lights of the two sides of a street are staggered


class Lanes(NamedTuple):
    """Driving lanes of one level outside of junctions: their areas, and their lines in driving direction."""

    areas: shapely.STRtree
    lines: np.ndarray[tuple[int], np.dtype[np.object_]]

    @classmethod
    def of(cls, ground: RegionGround, level: int) -> "Lanes":
        """Those in and near a region."""
        reach_m = 2.0 * _BESIDE_M
        near = ground.network.layout.near(ground.region.area, reach_m).strips_of(LaneKind.DRIVING, level=level)
        strips = [strip for strip in near if not strip.junction]
        around = shapely.buffer(ground.region.area, reach_m, join_style="mitre")
        lines: list[BaseGeometry] = [shapely.LineString(strip.center_m[:, :2]) for strip in strips]
        return cls(shapely.STRtree(shapely.intersection(strip_polygons(strips), around)), np.array(lines, object))


def light_places(ground: RegionGround, curb: CurbLine, lanes: Lanes, spacing_m: float) -> Iterator[Int64Array]:
    """For each light that the region should have along a curb: indices of the curb's places, the best one first.

    Args:
        ground: The region's; stations of other regions are left out.
        curb: The line that lights stand on.
        lanes: Of the curb's level.
        spacing_m: Along one side of a street, about: each lane has a whole number of spacings.
    """
    if len(lanes.lines) == 0:
        return
    points = np.asarray(shapely.points(curb.place_m), object)
    place, lane = lanes.areas.query_nearest(points, max_distance=_BESIDE_M, all_matches=False)
    line = lanes.lines[lane]
    length_m, s_m = shapely.length(line), np.asarray(shapely.line_locate_point(line, points[place]))
    count = np.maximum(np.round(length_m / spacing_m), 1.0)
    phase = np.where(_is_left(line, s_m, curb.place_m[place]), _ON_THE_LEFT, _ON_THE_RIGHT)
    number = np.clip(np.round(s_m / length_m * count - phase), 0.0, count - 1.0)
    station_m = (number + phase) / count * length_m
    off_m = np.abs(s_m - station_m)
    station = shapely.get_coordinates(shapely.line_interpolate_point(line, station_m)).reshape(-1, 2)
    wanted = np.flatnonzero((off_m < _PLAY_M) & ground.owns(station))
    key = np.column_stack([lane, number])[wanted]
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    for k in np.argsort(first, kind="stable"):
        of_one = wanted[group == k]
        yield place[of_one[np.argsort(off_m[of_one], kind="stable")]]


def _is_left(
    line: np.ndarray[tuple[int], np.dtype[np.object_]], s_m: Float64Array, place_m: Float64Array
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(N,) whether (N, 2) places lie on the left of lines at stations."""
    behind_m, ahead_m = (
        shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(s_m + step_m, 0.0))).reshape(-1, 2)
        for step_m in (-0.5, 0.5)
    )
    along, off = ahead_m - behind_m, place_m - behind_m
    return np.asarray(along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0] > 0.0)
