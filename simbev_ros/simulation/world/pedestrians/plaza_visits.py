"""Plaza visits: from a sidewalk along a path, around the plaza with a stop, and back to a sidewalk."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land.membrane import Raster
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind

_MAX_ENTRANCE_GAP_M = 1.5  # from a sidewalk's edge to the start of a path
_END_MARGIN_M = 1.5  # closer to a sidewalk's end there is a junction
# Ranges of the three spots of a round: distance beyond the path's end, and beside it, first one side, then the other.
_ROUND_AHEAD_M = (0.5, 2.0, 0.5), (6.0, 12.0, 6.0)
_ROUND_ASIDE_M = (1.0, -4.0, -7.0), (7.0, 4.0, -1.0)
_TRIES = 1500
_MIN_SIDE_M, _MIN_COSINE = 2.0, -0.4  # of a round: length of its sides, and cosine of the angles between them
# Distance from corners at which curves replace them, and parameters of the curves.
_CORNER_CUT_M, _CURVE_PARAMETERS = 2.0, np.linspace(0.0, 1.0, 6)
_PATH_OFFSET_M = 0.2, 0.5  # offset to the right of a path's center line
_STOP_DURATION_S = 3.0, 15.0
_MIN_STOP_GAP_M = 1.2  # minimum distance between stopping pedestrians


@dataclass(frozen=True, slots=True)
class PlazaVisit:
    """A path over a plaza, from the center line of a sidewalk to that of the same or another sidewalk.

    Attributes:
        start_m: (3,) on the sidewalk, on the carriageway's plane.
        along: (2,) unit vector along the sidewalk there.
        position_m: SUMO's position on the sidewalk where the path starts.
        end_edge: Edge of the sidewalk where the path ends.
        end_position_m: SUMO's position on that sidewalk.
        corners_m: (K, 3) corners of the path; heights are roughly those of the carriageway.
        stop_corner: The pedestrian stops halfway between the corner with this index and the next one.
        stop_duration_s: Duration of the stop.
        ground: Heights of the paving.
    """

    start_m: Float64Array
    along: Float64Array
    position_m: float
    end_edge: str
    end_position_m: float
    corners_m: Float64Array
    stop_corner: int
    stop_duration_s: float
    ground: Raster

    @property
    def length_m(self) -> float:
        """Approximate length of the path."""
        return float(np.linalg.norm(np.diff(self.corners_m[:, :2], axis=0), axis=1).sum())

    @property
    def stop_position_m(self) -> Float64Array:
        """(3,) position of the stop."""
        return self.corners_m[self.stop_corner : self.stop_corner + 2].mean(axis=0)

    def path_to_stop_m(self, start_m: Float64Array) -> Float64Array:
        """(N, 3) line from a (3,) position to the stop."""
        return _round_corners(
            np.concatenate([start_m[None], self.corners_m[: self.stop_corner + 1], self.stop_position_m[None]])
        )

    @property
    def path_from_stop_m(self) -> Float64Array:
        """(N, 3) line from the stop to the end."""
        return _round_corners(np.concatenate([self.stop_position_m[None], self.corners_m[self.stop_corner + 1 :]]))


@dataclass(frozen=True, slots=True)
class _Entrance:
    """Entrance of a plaza: where a path to it leaves a sidewalk."""

    plaza: Plaza
    path_m: Float64Array  # (2, 2)
    lane: Lane
    s_m: float
    position_on_sidewalk_m: Float64Array  # (3,) on the center line of the sidewalk
    along: Float64Array

    @property
    def position_m(self) -> float:
        """SUMO's position on the sidewalk's edge."""
        return self.s_m * self.lane.sumo_s_per_m

    def path_in_m(self, offset_m: float) -> Float64Array:
        """(2, 2) path to the plaza, offset to the right of its center line."""
        ahead = (self.path_m[1] - self.path_m[0]) / np.linalg.norm(self.path_m[1] - self.path_m[0])
        return self.path_m + offset_m * np.array([ahead[1], -ahead[0]])


class PlazaVisits:
    """Draws visits to the plazas of a network; no two pedestrians stop at the same position."""

    def __init__(self, network: RoadNetwork, plazas: Sequence[Plaza]) -> None:
        """For these plazas of a network."""
        self._by_edge: dict[str, list[_Entrance]] = defaultdict(list)
        self._by_plaza: dict[int, list[_Entrance]] = defaultdict(list)
        self._stops_m: dict[int, list[Float64Array]] = defaultdict(list)
        for entrance in _find_entrances(network, plazas):
            self._by_edge[entrance.lane.edge].append(entrance)
            self._by_plaza[id(entrance.plaza)].append(entrance)

    def draw_visit(self, edge: str, min_m: float, max_m: float, rng: np.random.Generator) -> PlazaVisit | None:
        """Draw a visit that starts between two distances along an edge's sidewalk; None if no plaza can be visited."""
        entrances = [entrance for entrance in self._by_edge.get(edge, ()) if min_m <= entrance.s_m <= max_m]
        if not entrances:
            return None
        entrance = entrances[int(rng.integers(len(entrances)))]
        plaza_entrances = self._by_plaza[id(entrance.plaza)]
        exit_entrance = plaza_entrances[int(rng.integers(len(plaza_entrances)))]
        path_in_m, path_out_m = (
            each.path_in_m(side * rng.uniform(*_PATH_OFFSET_M)) for each, side in ((entrance, 1), (exit_entrance, -1))
        )
        stop_corner, stop_duration_s = len(path_in_m) + int(rng.integers(2)), float(rng.uniform(*_STOP_DURATION_S))
        stops_m = self._stops_m[id(entrance.plaza)]
        for spots_m in _propose_rounds(entrance.plaza, path_in_m, path_out_m, rng):
            visit = _assemble_visit(
                entrance,
                exit_entrance,
                np.concatenate([path_in_m, spots_m, path_out_m[::-1]]),
                stop_corner,
                stop_duration_s,
            )
            line_m = np.concatenate(
                [
                    visit.path_to_stop_m(entrance.position_on_sidewalk_m),
                    visit.path_from_stop_m,
                    exit_entrance.position_on_sidewalk_m[None],
                ]
            )
            is_apart = all(np.linalg.norm(visit.stop_position_m - other_m) > _MIN_STOP_GAP_M for other_m in stops_m)
            if is_apart and shapely.covers(entrance.plaza.free, shapely.LineString(line_m[:, :2])):
                stops_m.append(visit.stop_position_m)
                return visit
        return None


def _find_entrances(network: RoadNetwork, plazas: Sequence[Plaza]) -> list[_Entrance]:
    """The points where the plazas' paths meet sidewalks that pedestrians can leave and enter there."""
    lanes = network.lanes_of(LaneKind.SIDEWALK) if plazas else ()
    lines = np.array([shapely.LineString(lane.centerline_m[:, :2]) for lane in lanes], object)
    tree, found = shapely.STRtree(lines), []
    for plaza in plazas:
        for path_m in plaza.paths_m:
            start = shapely.Point(path_m[0])
            row = int(tree.nearest(start))
            lane, s_m = lanes[row], float(lines[row].project(start))
            offset_m = abs(lines[row].distance(start) - lane.width_m / 2.0)
            if offset_m < _MAX_ENTRANCE_GAP_M and _END_MARGIN_M < s_m < lane.length_m - _END_MARGIN_M:
                position_on_sidewalk_m, yaw_rad = network.pose_on_lane(lane.id, s_m)
                along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
                found.append(_Entrance(plaza, path_m, lane, s_m, position_on_sidewalk_m, along))
    return found


def _propose_rounds(
    plaza: Plaza, path_in_m: Float64Array, path_out_m: Float64Array, rng: np.random.Generator
) -> list[Float64Array]:
    """Proposals for a round: (3, 2) spots to walk to one after the other, without sharp turns."""
    ahead = (path_in_m[1] - path_in_m[0]) / np.linalg.norm(path_in_m[1] - path_in_m[0])
    side = rng.choice([-1.0, 1.0], _TRIES)
    offset_m = side[:, None] * rng.uniform(*_ROUND_ASIDE_M, (_TRIES, 3))
    ahead_m = rng.uniform(*_ROUND_AHEAD_M, (_TRIES, 3))
    spots_m = path_in_m[1] + ahead_m[..., None] * ahead + offset_m[..., None] * left_of(ahead)
    ends_m = [np.repeat(path_m[None], _TRIES, axis=0) for path_m in (path_in_m, path_out_m[::-1])]
    side_m = np.diff(np.concatenate([ends_m[0], spots_m, ends_m[1]], axis=1), axis=1)
    length_m = np.linalg.norm(side_m, axis=2)
    cosine = np.sum(side_m[:, 1:] * side_m[:, :-1], axis=2) / (length_m[:, 1:] * length_m[:, :-1])
    is_valid = np.all(length_m[:, 1:-1] > _MIN_SIDE_M, axis=1) & np.all(cosine > _MIN_COSINE, axis=1)
    is_valid &= shapely.contains_xy(plaza.free, spots_m[..., 0], spots_m[..., 1]).all(axis=1)
    return list(spots_m[is_valid])


def _round_corners(corner_m: Float64Array) -> Float64Array:
    """(M, D) line along (N, D) corners, with parabolas in place of the inner corners."""
    before_m, after_m = corner_m[:-2] - corner_m[1:-1], corner_m[2:] - corner_m[1:-1]
    starts_m, ends_m = (
        corner_m[1:-1]
        + side_m * np.minimum(0.5, _CORNER_CUT_M / np.maximum(np.linalg.norm(side_m, axis=1), 1e-9))[:, None]
        for side_m in (before_m, after_m)
    )
    weights = np.stack(
        [(1.0 - _CURVE_PARAMETERS) ** 2, 2.0 * _CURVE_PARAMETERS * (1.0 - _CURVE_PARAMETERS), _CURVE_PARAMETERS**2]
    )
    curves_m = np.einsum("kc,knd->ncd", weights, np.stack([starts_m, corner_m[1:-1], ends_m]))
    return np.concatenate([corner_m[:1], curves_m.reshape(-1, corner_m.shape[1]), corner_m[-1:]])


def _assemble_visit(
    entrance: _Entrance, exit_entrance: _Entrance, corners_m: Float64Array, stop_corner: int, stop_duration_s: float
) -> PlazaVisit:
    """The visit along (K, 2) corners."""
    height_m = np.linspace(entrance.position_on_sidewalk_m[2], exit_entrance.position_on_sidewalk_m[2], len(corners_m))
    return PlazaVisit(
        entrance.position_on_sidewalk_m,
        entrance.along,
        entrance.position_m,
        exit_entrance.lane.edge,
        exit_entrance.position_m,
        np.column_stack([corners_m, height_m]),
        stop_corner,
        stop_duration_s,
        entrance.plaza.ground,
    )
