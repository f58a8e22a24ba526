"""How people visit plazas: from a sidewalk along a path, a round over the plaza with a halt, and back to a sidewalk."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.maps.land.membrane import Raster
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.types import Float64Array

_BESIDE_M = 1.5  # from a sidewalk's edge to where a path begins
_FROM_ENDS_M = 1.5  # nearer to a sidewalk's end there is a junction
# Three spots of a round: so far beyond the way's end and aside of it, first on one side, then on the other.
_ROUND_AHEAD_M = (0.5, 2.0, 0.5), (6.0, 12.0, 6.0)
_ROUND_ASIDE_M = (1.0, -4.0, -7.0), (7.0, 4.0, -1.0)
_TRIES = 1500
_LEAST_SIDE_M, _LEAST_COSINE = 2.0, -0.4  # of a round: length of sides, and cosine of the angles between them
_CUT_M, _CURVE = 2.0, np.linspace(0.0, 1.0, 6)  # from corners; parameters of the curves that take their place
_ASIDE_M = 0.2, 0.5  # people keep to the right of a path's middle
_HALT_S = 3.0, 15.0
_APART_M = 1.2  # between places where people halt


@dataclass(frozen=True, slots=True)
class PlazaVisit:
    """A way over a plaza, from the middle of a sidewalk to that of the same or another one.

    Attributes:
        start_m: (3,) on the sidewalk, on the carriageway's plane.
        along: (2,) unit vector along the sidewalk there.
        position_m: SUMO's position on the sidewalk where the way begins.
        far_edge: Edge of the sidewalk where it ends.
        far_position_m: SUMO's position on that.
        corners_m: (K, 3) of the way, heights about those of the carriageway.
        halt: Somebody stops on the way from the corner of this index to the next one, half way,
        halt_s: for a while.
        ground: Heights of the paving.
    """

    start_m: Float64Array
    along: Float64Array
    position_m: float
    far_edge: str
    far_position_m: float
    corners_m: Float64Array
    halt: int
    halt_s: float
    ground: Raster

    @property
    def length_m(self) -> float:
        """About that of the way."""
        return float(np.linalg.norm(np.diff(self.corners_m[:, :2], axis=0), axis=1).sum())

    @property
    def halt_m(self) -> Float64Array:
        """(3,) where somebody stops."""
        halt_m: Float64Array = self.corners_m[self.halt : self.halt + 2].mean(axis=0)
        return halt_m

    def way_there_m(self, start_m: Float64Array) -> Float64Array:
        """(N, 3) line from a (3,) place to the halt."""
        return _rounded(np.concatenate([start_m[None], self.corners_m[: self.halt + 1], self.halt_m[None]]))

    @property
    def way_back_m(self) -> Float64Array:
        """(N, 3) line from the halt to the end."""
        return _rounded(np.concatenate([self.halt_m[None], self.corners_m[self.halt + 1 :]]))


@dataclass(frozen=True, slots=True)
class _Mouth:
    """Where a way to a plaza leaves a sidewalk."""

    plaza: Plaza
    way_m: Float64Array  # (2, 2)
    lane: Lane
    s_m: float
    place_m: Float64Array  # (3,) on the middle of the sidewalk
    along: Float64Array

    @property
    def position_m(self) -> float:
        """SUMO's, on the sidewalk's edge."""
        return self.s_m * self.lane.sumo_s_per_m

    def way_in_m(self, aside_m: float) -> Float64Array:
        """(2, 2) the way to the plaza, so far to the right of its middle."""
        ahead = (self.way_m[1] - self.way_m[0]) / np.linalg.norm(self.way_m[1] - self.way_m[0])
        way_m: Float64Array = self.way_m + aside_m * np.array([ahead[1], -ahead[0]])
        return way_m


class PlazaVisits:
    """Ways over the plazas of a network; no two people halt at the same place."""

    def __init__(self, network: RoadNetwork, plazas: Sequence[Plaza]) -> None:
        """Of these plazas."""
        self._on_edge: dict[str, list[_Mouth]] = defaultdict(list)
        self._of_plaza: dict[int, list[_Mouth]] = defaultdict(list)
        self._halts_m: dict[int, list[Float64Array]] = defaultdict(list)
        for mouth in _mouths(network, plazas):
            self._on_edge[mouth.lane.edge].append(mouth)
            self._of_plaza[id(mouth.plaza)].append(mouth)

    def visit(self, edge: str, first_m: float, last_m: float, rng: np.random.Generator) -> PlazaVisit | None:
        """A visit from between two distances along an edge's sidewalk; None: there is nothing to be visited."""
        mouths = [mouth for mouth in self._on_edge.get(edge, ()) if first_m <= mouth.s_m <= last_m]
        if not mouths:
            return None
        mouth = mouths[int(rng.integers(len(mouths)))]
        others = self._of_plaza[id(mouth.plaza)]
        back = others[int(rng.integers(len(others)))]
        way_in_m, way_out_m = (each.way_in_m(side * rng.uniform(*_ASIDE_M)) for each, side in ((mouth, 1), (back, -1)))
        halt, halt_s = len(way_in_m) + int(rng.integers(2)), float(rng.uniform(*_HALT_S))
        halts_m = self._halts_m[id(mouth.plaza)]
        for spots_m in _rounds(mouth.plaza, way_in_m, way_out_m, rng):
            visit = _visit(mouth, back, np.concatenate([way_in_m, spots_m, way_out_m[::-1]]), halt, halt_s)
            line_m = np.concatenate([visit.way_there_m(mouth.place_m), visit.way_back_m, back.place_m[None]])
            apart = all(np.linalg.norm(visit.halt_m - other_m) > _APART_M for other_m in halts_m)
            if apart and shapely.covers(mouth.plaza.free, shapely.LineString(line_m[:, :2])):
                halts_m.append(visit.halt_m)
                return visit
        return None


def _mouths(network: RoadNetwork, plazas: Sequence[Plaza]) -> list[_Mouth]:
    """Where the plazas' ways meet sidewalks that people can leave and reach there."""
    lanes = network.lanes_of(LaneKind.SIDEWALK) if plazas else ()
    lines = np.array([shapely.LineString(lane.centerline_m[:, :2]) for lane in lanes], object)
    tree, found = shapely.STRtree(lines), []
    for plaza in plazas:
        for way_m in plaza.ways_m:
            place = shapely.Point(way_m[0])
            row = int(tree.nearest(place))
            lane, s_m = lanes[row], float(lines[row].project(place))
            aside_m = abs(lines[row].distance(place) - lane.width_m / 2.0)
            if aside_m < _BESIDE_M and _FROM_ENDS_M < s_m < lane.length_m - _FROM_ENDS_M:
                place_m, yaw_rad = network.pose_on_lane(lane.id, s_m)
                along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
                found.append(_Mouth(plaza, way_m, lane, s_m, place_m, along))
    return found


def _rounds(
    plaza: Plaza, way_in_m: Float64Array, way_out_m: Float64Array, rng: np.random.Generator
) -> list[Float64Array]:
    """(3, 2) spots to walk to one after the other, without a sharp turn; several proposals."""
    ahead = (way_in_m[1] - way_in_m[0]) / np.linalg.norm(way_in_m[1] - way_in_m[0])
    side = rng.choice([-1.0, 1.0], _TRIES)
    aside_m = side[:, None] * rng.uniform(*_ROUND_ASIDE_M, (_TRIES, 3))
    ahead_m = rng.uniform(*_ROUND_AHEAD_M, (_TRIES, 3))
    spots_m = way_in_m[1] + ahead_m[..., None] * ahead + aside_m[..., None] * np.array([-ahead[1], ahead[0]])
    ends_m = [np.repeat(way_m[None], _TRIES, axis=0) for way_m in (way_in_m, way_out_m[::-1])]
    side_m = np.diff(np.concatenate([ends_m[0], spots_m, ends_m[1]], axis=1), axis=1)
    length_m = np.linalg.norm(side_m, axis=2)
    cosine = np.sum(side_m[:, 1:] * side_m[:, :-1], axis=2) / (length_m[:, 1:] * length_m[:, :-1])
    fits = np.all(length_m[:, 1:-1] > _LEAST_SIDE_M, axis=1) & np.all(cosine > _LEAST_COSINE, axis=1)
    fits &= shapely.contains_xy(plaza.free, spots_m[..., 0], spots_m[..., 1]).all(axis=1)
    return list(spots_m[fits])


def _rounded(corner_m: Float64Array) -> Float64Array:
    """(M, D) a line along (N, D) corners, with parabolas instead of all but the first and the last of them."""
    before_m, after_m = corner_m[:-2] - corner_m[1:-1], corner_m[2:] - corner_m[1:-1]
    starts_m, ends_m = (
        corner_m[1:-1] + side_m * np.minimum(0.5, _CUT_M / np.maximum(np.linalg.norm(side_m, axis=1), 1e-9))[:, None]
        for side_m in (before_m, after_m)
    )
    weights = np.stack([(1.0 - _CURVE) ** 2, 2.0 * _CURVE * (1.0 - _CURVE), _CURVE**2])
    curves_m = np.einsum("kc,knd->ncd", weights, np.stack([starts_m, corner_m[1:-1], ends_m]))
    return np.concatenate([corner_m[:1], curves_m.reshape(-1, corner_m.shape[1]), corner_m[-1:]])


def _visit(mouth: _Mouth, back: _Mouth, corners_m: Float64Array, halt: int, halt_s: float) -> PlazaVisit:
    """The visit along (K, 2) corners."""
    height_m = np.linspace(mouth.place_m[2], back.place_m[2], len(corners_m))
    return PlazaVisit(
        mouth.place_m,
        mouth.along,
        mouth.position_m,
        back.lane.edge,
        back.position_m,
        np.column_stack([corners_m, height_m]),
        halt,
        halt_s,
        mouth.plaza.ground,
    )
