"""Finds where the roads of a draft meet: crossings of one layer, ends on other roads, and joins between layers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.plan.draft import DraftRoad

_SNAP_M = 10.0
_TOUCH_TOLERANCE_M = 0.01
_SHARED_TOLERANCE_M = 0.5
_MERGE_DISTANCE_M = 4.0


@dataclass(frozen=True, slots=True)
class Mark:
    """A position at which a road meets another, or ends.

    Attributes:
        road: Index of the road.
        station_m: Distance from the road's start.
        position_m: (2,) where it meets the other road, usually on its own line.
    """

    road: int
    station_m: float
    position_m: Float64Array


@dataclass
class Marks:
    """All marks of a draft, and pairs of marks at the same position.

    The first marks are the ends of roads, two per road in order.
    """

    marks: list[Mark] = field(default_factory=list)
    same_position: list[tuple[int, int]] = field(default_factory=list)

    def add(self, road: int, station_m: float, position_m: Float64Array) -> int:
        """Add a mark and return its index."""
        self.marks.append(Mark(road, station_m, position_m))
        return len(self.marks) - 1

    def join(self, first: int, second: int) -> None:
        """Declare that two marks are at the same position."""
        self.same_position.append((first, second))


def is_closed(road: DraftRoad) -> bool:
    """Whether a road ends where it starts."""
    return bool(np.allclose(road.line_m[0], road.line_m[-1]))


def extend_to_meet(roads: Sequence[DraftRoad]) -> list[DraftRoad]:
    """Extend the roads that end just short of another road of their layer up to that road."""
    lines = [shapely.LineString(road.line_m) for road in roads]
    tree = shapely.STRtree(lines)
    extended = []
    for index, road in enumerate(roads):
        line_m = road.line_m
        for end, join_m in zip((0, -1), road.joins_m, strict=True):
            point = shapely.Point(road.line_m[end])
            near = tree.query(point, predicate="dwithin", distance=_SNAP_M).tolist()
            touched = [lines[other] for other in near if other != index and roads[other].layer == road.layer]
            continues = any(
                np.linalg.norm(roads[other].line_m[[0, -1]] - line_m[end], axis=1).min() <= _SHARED_TOLERANCE_M
                for other in near
                if other != index
            )
            ends_here = join_m is None and not continues and not is_closed(road)
            if ends_here and touched and min(point.distance(line) for line in touched) > _TOUCH_TOLERANCE_M:
                nearest = min(touched, key=point.distance)
                position_m = np.array(nearest.interpolate(nearest.project(point)).coords)
                line_m = np.concatenate([position_m, line_m] if end == 0 else [line_m, position_m])
        extended.append(replace(road, line_m=line_m))
    return extended


def marks_of(roads: Sequence[DraftRoad]) -> Marks:
    """All marks of roads that have been extended to meet each other.

    Raises:
        InputError: A road joins a vertex that does not exist.
    """
    lines = [shapely.LineString(road.line_m) for road in roads]
    marks = Marks()
    for index, (road, line) in enumerate(zip(roads, lines, strict=True)):
        for station_m, position_m in _ends(road, line):
            marks.add(index, station_m, position_m)
    _mark_crossings(roads, lines, marks)
    _mark_ends_on_lines(roads, lines, marks)
    _mark_shared_vertices(roads, lines, marks)
    return marks


def nodes_of(marks: Marks) -> Int64Array:
    """Node index of each mark."""
    positions_m = np.array([mark.position_m for mark in marks.marks])
    # Merge only along one road: two parallel carriageways may be as close to each other.
    road = np.array([mark.road for mark in marks.marks])
    close = cKDTree(positions_m).query_pairs(_MERGE_DISTANCE_M, output_type="ndarray")
    close = close[road[close[:, 0]] == road[close[:, 1]]]
    pairs = np.concatenate([np.array(marks.same_position, np.int64).reshape(-1, 2), close])
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(positions_m), len(positions_m)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _ends(road: DraftRoad, line: shapely.LineString) -> Iterator[tuple[float, Float64Array]]:
    """Station of both ends of a road, and the points where they meet others."""
    for station_m, end, join_m in ((0.0, 0, road.joins_m[0]), (line.length, -1, road.joins_m[1])):
        yield station_m, road.line_m[end] if join_m is None else join_m


def _mark_crossings(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: Marks) -> None:
    """Mark where lines of one layer cross."""
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if a < b and roads[a].layer == roads[b].layer:
            for point in _points_of(overlay.intersection(lines[a], lines[b])):
                position_m = np.array([point.x, point.y])
                marks.join(
                    marks.add(a, lines[a].project(point), position_m), marks.add(b, lines[b].project(point), position_m)
                )


def _points_of(shared: shapely.Geometry) -> Iterator[shapely.Point]:
    """Single points of an intersection; where lines overlap, both ends of the overlap."""
    for piece in shapely.get_parts(shared):
        if piece.geom_type == "Point":
            yield piece
        elif piece.length > 0.0:
            yield from (shapely.Point(piece.coords[0]), shapely.Point(piece.coords[-1]))


def _mark_ends_on_lines(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: Marks) -> None:
    """Mark where a road ends on another of its layer; the marks of road ends are the first ones, two per road."""
    tree = shapely.STRtree(lines)
    for a, road in enumerate(roads):
        for end, join_m in enumerate(road.joins_m):
            point = shapely.Point(marks.marks[2 * a + end].position_m)
            if join_m is not None:
                continue
            for b in tree.query(point, predicate="dwithin", distance=_TOUCH_TOLERANCE_M).tolist():
                if b != a and roads[b].layer == road.layer:
                    marks.join(2 * a + end, marks.add(b, lines[b].project(point), marks.marks[2 * a + end].position_m))


def _mark_shared_vertices(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: Marks) -> None:
    """Mark where a line of another layer ends at a vertex, or a road joins a vertex of another."""
    owner = np.repeat(np.arange(len(roads)), [len(road.line_m) for road in roads])
    vertices_m = np.concatenate([road.line_m for road in roads])
    last = np.cumsum([len(road.line_m) for road in roads]) - 1
    is_end = np.zeros(len(vertices_m), bool)
    is_end[last] = is_end[np.concatenate([[0], last[:-1] + 1])] = True
    for first, second in sorted(cKDTree(vertices_m).query_pairs(_SHARED_TOLERANCE_M)):
        a, b = int(owner[first]), int(owner[second])
        if a != b and roads[a].layer != roads[b].layer and (is_end[first] or is_end[second]):
            marks.join(*(_vertex_mark(lines, marks, int(owner[v]), vertices_m[v]) for v in (first, second)))
    _mark_joins(roads, lines, marks, owner, vertices_m)


def _mark_joins(
    roads: Sequence[DraftRoad],
    lines: Sequence[shapely.LineString],
    marks: Marks,
    owner: Int64Array,
    vertices_m: Float64Array,
) -> None:
    """Mark where a road joins a vertex of another road beside its own end."""
    tree = cKDTree(vertices_m)
    for a, road in enumerate(roads):
        for end, join_m in enumerate(road.joins_m):
            if join_m is None:
                continue
            touched = [v for v in tree.query_ball_point(join_m, _SHARED_TOLERANCE_M) if owner[v] != a]
            if not touched:
                raise InputError(f"road {road.name}: joins_m {join_m.tolist()} is not a vertex of another road")
            for vertex in touched:
                marks.join(2 * a + end, _vertex_mark(lines, marks, int(owner[vertex]), vertices_m[vertex]))


def _vertex_mark(lines: Sequence[shapely.LineString], marks: Marks, road: int, vertex_m: Float64Array) -> int:
    return marks.add(road, lines[road].project(shapely.Point(vertex_m)), vertex_m)
