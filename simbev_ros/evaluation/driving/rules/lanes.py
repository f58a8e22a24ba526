"""Where the ego drives: off the road, against the direction of lanes, above the speed limit.

The drivable area is the paved ground that cameras, lidars and labels see; the limits of 2 m and 0.3 m are nuPlan's.
"""

from collections import defaultdict, deque
from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons, surfaces_of

_TILE_M, _MARGIN_M = 64.0, 24.0
_LEVEL_M = 3.0  # lanes nearer in height are on the level of the ego
_OFF_ROAD_M = 0.3
_ONCOMING_M, _WINDOW_S = 2.0, 1.0
_TOLERATED_MPS = 0.5  # only for the list of infractions; scores count any excess
_AGAINST_COS = 0.5  # CARLA: more than 120 degrees from the lane's direction
_OUT_M = 0.5  # CARLA: distance of the center from the road from which the vehicle is outside of its lanes


class RoadPlaces:
    """The roads of a map, asked for the place of the ego at a moment."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._strips = network.lane_strips.strips
        self._areas = strip_polygons(self._strips)
        self._tree = shapely.STRtree(self._areas)
        self._tiles: dict[tuple[int, int, int], BaseGeometry] = {}

    def off_road_m(self, moment: Moment, points_m: Float64Array) -> Float64Array:
        """(K,) distances of (K, 2) points near the ego from the paved ground; 0 on it."""
        nearest = self._network.lane_strips.index.nearest(moment.position_m[None], np.array([moment.yaw_rad]))
        levels = {self._strips[row].level for row in [int(nearest.row[0]), *self._strips_at(moment, moment.footprint)]}
        points = shapely.points(points_m)
        return np.min([shapely.distance(self._paved(moment, level), points) for level in sorted(levels)], axis=0)

    def lane_headings(self, moment: Moment) -> Float64Array:
        """(L, 2) directions of the lanes that contain the ego's center."""
        point = shapely.Point(moment.position_m[:2])
        headings = [_heading_at(self._strips[row].center_m, point) for row in self._strips_at(moment, point)]
        return np.array(headings, np.float64).reshape(-1, 2)

    def _strips_at(self, moment: Moment, shape: BaseGeometry) -> list[int]:
        """Rows of the lanes that a shape touches in plan, at about the height of the ego."""
        rows, here_m = sorted(self._tree.query(shape, "intersects").tolist()), moment.position_m
        lines = [self._strips[row].center_m for row in rows]
        heights_m = [line_m[np.argmin(np.hypot(*(line_m[:, :2] - here_m[:2]).T)), 2] for line_m in lines]
        return [row for row, height_m in zip(rows, heights_m, strict=True) if abs(height_m - here_m[2]) < _LEVEL_M]

    def _paved(self, moment: Moment, level: int) -> BaseGeometry:
        """The paved ground of a level around the ego."""
        column, row = np.floor(moment.position_m[:2] / _TILE_M).astype(int).tolist()
        key = (level, column, row)
        if key not in self._tiles:
            corner_m = np.array([column, row]) * _TILE_M
            area = shapely.box(*(corner_m - _MARGIN_M), *(corner_m + _TILE_M + _MARGIN_M))
            surfaces = surfaces_of(self._network.layout, level, area)
            self._tiles[key] = overlay.union_all([surfaces.road, surfaces.shoulder])
            shapely.prepare(self._tiles[key])
        return self._tiles[key]

    def keeps_to_one_lane(self, moment: Moment) -> bool:
        """Whether one lane contains the whole footprint of the ego."""
        return len(self._tree.query(moment.footprint, "covered_by")) > 0

    def limit_mps(self, moment: Moment) -> float:
        """Speed limit at the ego; in junctions the highest of the lanes before, inside and behind (nuPlan)."""
        places = self._network.nearest_lane(moment.position_m[None], np.array([moment.yaw_rad]))
        lane = self._network.lanes[places.lane[0]]
        if not lane.junction:
            return lane.speed_mps
        around = [self._network.lanes[each] for each in lane.successors if each in self._network.lanes]
        return max(each.speed_mps for each in (lane, *around, *self._predecessors[lane.id]))

    @cached_property
    def _predecessors(self) -> Mapping[str, list[Lane]]:
        found: dict[str, list[Lane]] = defaultdict(list)
        for lane in self._network.lanes.values():
            if lane.kind is LaneKind.DRIVING:
                for following in lane.successors:
                    found[following].append(lane)
        return found


class LaneRule:
    """Yields where the ego leaves the road, begins to drive against lanes, or begins to exceed the limit.

    Attributes:
        driven_m: Distance driven.
        outside_m: Part of it off the road or in lanes of the other direction.
        overspeed_m: Integral of the excess over the speed limit.
        max_off_road_m: Maximum distance of a corner from the road.
        max_oncoming_m: Maximum distance driven against a lane within a second.
    """

    def __init__(self, places: RoadPlaces) -> None:
        self._places = places
        self._oncoming_m: deque[float] = deque()
        self._active: set[InfractionKind] = set()
        self.driven_m = self.outside_m = self.overspeed_m = self.max_off_road_m = self.max_oncoming_m = 0.0

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the infractions that begin."""
        corners_m = np.concatenate([moment.corners_m, moment.position_m[None, :2]])
        *off_m, center_off_m = self._places.off_road_m(moment, corners_m).tolist()
        against_m = self._against_m(moment, self._places.lane_headings(moment))
        self._oncoming_m.append(against_m)
        while len(self._oncoming_m) > max(1, round(_WINDOW_S / moment.tick_s)):
            self._oncoming_m.popleft()
        oncoming_m, excess_mps = sum(self._oncoming_m), moment.speed_mps - self._places.limit_mps(moment)
        step_m = float(np.hypot(*moment.step_m))
        self.driven_m += step_m
        self.outside_m += step_m * (center_off_m > _OUT_M or against_m > _AGAINST_COS * step_m)
        self.overspeed_m += max(excess_mps, 0.0) * moment.tick_s
        self.max_off_road_m = max(self.max_off_road_m, *off_m)
        self.max_oncoming_m = max(self.max_oncoming_m, oncoming_m)
        yield from self._begun(moment, InfractionKind.OFF_ROAD, max(off_m), _OFF_ROAD_M)
        yield from self._begun(moment, InfractionKind.WRONG_DIRECTION, oncoming_m, _ONCOMING_M)
        yield from self._begun(moment, InfractionKind.SPEED_LIMIT, excess_mps, _TOLERATED_MPS)

    def _begun(self, moment: Moment, kind: InfractionKind, value: float, limit: float) -> Iterator[Infraction]:
        """Yield an infraction if a value exceeds its limit now and did not before."""
        if value > limit and kind not in self._active:
            yield moment.infraction(kind, value)
        (self._active.add if value > limit else self._active.discard)(kind)

    @staticmethod
    def _against_m(moment: Moment, headings: AnyArray) -> float:
        """Distance of this tick against all lanes that contain the ego; 0 if it follows one of them."""
        return max(0.0, -float(np.max(headings @ moment.step_m))) if len(headings) else 0.0


def _heading_at(line_m: Float64Array, point: shapely.Point) -> Float64Array:
    """(2,) direction of an (N, 3) line where it is nearest to a point."""
    steps_m = np.diff(line_m[:, :2], axis=0)
    ends_m = np.cumsum(np.hypot(*steps_m.T))
    at_m = shapely.line_locate_point(shapely.LineString(line_m[:, :2]), point)
    step_m = steps_m[min(int(np.searchsorted(ends_m, at_m)), len(steps_m) - 1)]
    return np.asarray(step_m / max(float(np.hypot(*step_m)), 1e-9), np.float64)
