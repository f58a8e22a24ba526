"""Places for events in the junctions of a route: where the paths of others cross it or join it."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork, paths_beyond
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.events.route_line import Place, RouteLine
from simbev_ros.schema.scene.drive_spec import Command
from simbev_ros.schema.scene.spec import WaypointSpec

_MEETS_M = 0.8
_START_M, _MIN_START_M = 25.0, 8.0  # from the stop line back to where the other starts
_CYCLIST_M = 1.15  # from the center line to a cyclist at the edge of a lane, as SUMO aligns it
_MIN_APPROACH_M = 35.0  # from the start of the route to a junction
_RING_M, _RING_EDGES = 260.0, 3
_STRAIGHT_RAD, _OPPOSITE_RAD = 0.6, 2.6


class _Junction(NamedTuple):
    """A junction of a route: its lanes before and after it, its maneuver, and the rows of its points inside."""

    entry: Lane
    exit: Lane
    command: Command
    rows: slice


class _Crossing(NamedTuple):
    """The path of a route and that of another vehicle through one junction.

    Attributes:
        junction: The junction.
        other: The other's lane before it.
        out: The other's lane after it.
        at_m: Distance along the route where they meet.
        beyond_m: Distance of this point from the other's stop line.
        angle_rad: Angle between the two there.
        towards_rad: Angle between the two before the junction.
        turn_rad: Angle by which the other turns.
    """

    junction: _Junction
    other: Lane
    out: Lane
    at_m: float
    beyond_m: float
    angle_rad: float
    towards_rad: float
    turn_rad: float


def red_light(route: RouteLine) -> Iterator[Place]:
    """Junctions with traffic lights for both, where the path of another one crosses at a steep angle."""
    signalled = {signal.lane for signal in route.network.signals}
    for way in _crossings(route):
        is_steep = 0.9 < way.angle_rad < 2.3 and 0.9 < way.towards_rad < 2.3
        if {way.junction.entry.id, way.other.id} <= signalled and is_steep and way.turn_rad < _STRAIGHT_RAD:
            yield _place(way)


def left_turn(route: RouteLine) -> Iterator[Place]:
    """Left turns across the path of those who come from the opposite direction."""
    for way in _crossings(route):
        goes_on = way.towards_rad > _OPPOSITE_RAD and way.turn_rad < _STRAIGHT_RAD
        if way.junction.command is Command.LEFT and goes_on and way.out.edge != way.junction.exit.edge:
            yield _place(way)


def merge(route: RouteLine) -> Iterator[Place]:
    """Junctions where another lane joins that of the route, except for roundabouts."""
    for way in _crossings(route):
        joins = way.out.id == way.junction.exit.id and way.angle_rad < 1.0 and way.towards_rad < _OPPOSITE_RAD
        if joins and not _is_ring(way.out, route.network):
            yield _place(way)


def roundabout(route: RouteLine) -> Iterator[Place]:
    """Entries of roundabouts, with others on the ring."""
    for way in _crossings(route):
        inside = all(_is_ring(lane, route.network) for lane in (way.junction.exit, way.other))
        if inside and not _is_ring(way.junction.entry, route.network):
            yield _place(way)


def right_turn(route: RouteLine) -> Iterator[Place]:
    """Turns to the outer side of the road, across the path of cyclists who go on at the edge of the same lane."""
    for junction in _junctions(route):
        entry = junction.entry
        side = _outer_side(entry, route.network)
        outermost = min(
            (lane.index for lane in route.network.lanes_of_edge(entry.edge) if lane.kind is LaneKind.DRIVING),
            default=-1,
        )
        turns = junction.command is (Command.RIGHT if side < 0.0 else Command.LEFT)
        if not turns or entry.index != outermost or "bicycle" not in entry.classes:
            continue
        for path in paths_beyond(entry, route.network.lanes):
            line_m = _line_m(route.network, path)
            way = _meet(route, junction, entry, _beside(line_m, side * _CYCLIST_M), path)
            if way is not None and way.turn_rad < _STRAIGHT_RAD and way.out.edge != junction.exit.edge:
                yield _place(way)


def _crossings(route: RouteLine) -> Iterator[_Crossing]:
    """Where the paths of others meet the route who start on lanes off it."""
    own = {route.network.lanes[name].edge for name in route.spec.lane}
    for junction in _junctions(route):
        inside = route.network.lanes[route.spec.lane[junction.rows.start]].junction
        for other in route.network.lanes_of(LaneKind.DRIVING):
            leads = any(route.network.lanes[name].junction == inside for name in other.successors)
            if other.junction or not leads or other.edge in own or "passenger" not in other.classes:
                continue
            for path in paths_beyond(other, route.network.lanes) if other.length_m > _MIN_START_M else ():
                way = _meet(route, junction, other, _line_m(route.network, path), path)
                if way is not None:
                    yield way


def _place(way: _Crossing) -> Place:
    """The place of a crossing."""
    back_m = min(_START_M, way.other.length_m - _MIN_START_M / 2.0)
    if way.other is way.junction.entry:
        back_m = min(_MIN_START_M, back_m)
    start = WaypointSpec(lane=way.other.id, s_m=way.other.length_m - back_m)
    return Place(way.at_m, start, (way.out.edge,), {"run_m": back_m + way.beyond_m})


def _junctions(route: RouteLine) -> Iterator[_Junction]:
    """The junctions of a route, except for those close to its start."""
    edges = np.flatnonzero(np.diff(route.in_junction.astype(np.int64)))
    for first in edges.tolist():
        is_entry = route.in_junction[first + 1] and route.station_m[first] > _MIN_APPROACH_M
        if is_entry and len(later := edges[edges > first]):
            rows = slice(first + 1, int(later[0]) + 1)
            entry, exit_lane = (route.network.lanes[route.spec.lane[row]] for row in (first, rows.stop))
            yield _Junction(entry, exit_lane, route.spec.command[(rows.start + rows.stop) // 2], rows)


def _meet(
    route: RouteLine, junction: _Junction, other: Lane, line_m: Float64Array, path: tuple[str, ...]
) -> _Crossing | None:
    """Where a route first meets the path of another one in a junction; None: they do not meet."""
    gap_m = np.linalg.norm(route.point_m[junction.rows, None, :2] - line_m[None, :, :2], axis=2)
    meets = np.flatnonzero(gap_m.min(axis=1) < _MEETS_M)
    if not len(meets):
        return None
    row = junction.rows.start + int(meets[0])
    number = min(int(gap_m[meets[0]].argmin()), len(line_m) - 2)
    yaws = np.arctan2(*np.diff(line_m[:, :2], axis=0).T[::-1])
    station_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))])
    return _Crossing(
        junction,
        other,
        route.network.lanes[path[-1]],
        at_m=float(route.station_m[row]),
        beyond_m=float(station_m[number]),
        angle_rad=_angle(float(yaws[number]), float(route.yaw_rad[row])),
        towards_rad=_angle(float(yaws[0]), float(route.yaw_rad[junction.rows.start])),
        turn_rad=_angle(float(yaws[0]), float(yaws[-1])),
    )


def _line_m(network: RoadNetwork, path: tuple[str, ...]) -> Float64Array:
    """(K, 3) line of a path's lanes inside a junction, every half meter."""
    inside = path[:-1] or path
    line_m = np.concatenate([network.lanes[name].centerline_m for name in inside])
    station_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))])
    at_m = np.linspace(0.0, station_m[-1], max(round(station_m[-1] / 0.5), 2))
    return np.column_stack([np.interp(at_m, station_m, column) for column in line_m.T])


def _beside(line_m: Float64Array, left_m: float) -> Float64Array:
    """A (K, 3) line, moved to the left."""
    ahead = np.gradient(line_m[:, :2], axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    moved_m = line_m.copy()
    moved_m[:, :2] += left_m * np.column_stack([-ahead[:, 1], ahead[:, 0]])
    return moved_m


def _angle(first_rad: float, second_rad: float) -> float:
    """Angle between two headings, 0 to pi."""
    return abs(math.remainder(first_rad - second_rad, 2.0 * math.pi))


def _outer_side(lane: Lane, network: RoadNetwork) -> float:
    """Side of a lane on which the edge of the road is: 1 to the left, as in left-hand traffic, else -1."""
    outer = [each for each in network.lanes_of_edge(lane.edge) if each.index < lane.index]
    if not outer:
        return -1.0
    ahead, beside = (
        np.diff(lane.centerline_m[:2, :2], axis=0)[0],
        (outer[-1].centerline_m - lane.centerline_m[0])[0, :2],
    )
    return 1.0 if ahead[0] * beside[1] - ahead[1] * beside[0] > 0.0 else -1.0


def _is_ring(lane: Lane, network: RoadNetwork) -> bool:
    """Whether a lane is on the ring of a roundabout: a short loop of one-way edges."""
    pending = [(lane, lane.length_m, frozenset([lane.edge]))] if _is_one_way(lane, network) else []
    while pending:
        at, length_m, edges = pending.pop()
        for path in paths_beyond(at, network.lanes):
            after = network.lanes[path[-1]]
            if after.edge == lane.edge and len(edges) >= _RING_EDGES:
                return True
            total_m = length_m + after.length_m
            if total_m < _RING_M and after.edge not in edges and _is_one_way(after, network):
                pending.append((after, total_m, edges | {after.edge}))
    return False


def _is_one_way(lane: Lane, network: RoadNetwork) -> bool:
    """Whether a road has no lanes of the other direction, whose edge has the same name with another sign."""
    other = lane.edge.removeprefix("-") if lane.edge.startswith("-") else f"-{lane.edge}"
    return not network.lanes_of_edge(other)
