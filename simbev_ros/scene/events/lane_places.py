"""Places for events along the lanes of a route, outside junctions."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.events.route_line import Place, RouteLine

_STEP_M, _FIRST_M, _LAST_M = 5.0, 60.0, 30.0  # between candidates; from the start, and before the goal
_STRAIGHT_RAD, _BEND_RAD, _BEND_M = 0.12, 0.25, 30.0
_LEADER_M, _FOLLOWER_M = 30.0, 45.0  # from the ego's start: vehicles ahead, and at most behind
_MAX_PURSUIT_M = 120.0  # from the ego's start: a vehicle that waits there until then catches up on a short route
_ROOM_M = 15.0  # of a lane before and behind a place
_CURB_GAP_M, _BODY_WIDTH_M = 0.15, 2.1
_WALKER_AHEAD_M = 4.5  # of the center of the vehicle that hides a pedestrian
_ON_SIDEWALK_M = 1.0
_MIN_START_M = 8.0  # from the start of a lane: a van's length


def beside(route: RouteLine) -> Iterator[Place]:
    """Straight places with a lane of the same direction beside."""
    for at_m in _stations(route):
        if route.is_open(at_m - 20.0, at_m + 30.0) and route.turn_rad(at_m - 40.0, at_m + 30.0) < _STRAIGHT_RAD:
            for lane in route.beside(route.lane_at(at_m)):
                start, row = route.waypoint(at_m, lane), route.row_at(at_m)
                to_route_m = (route.point_m[row] - route.network.pose_on_lane(start.lane, start.s_m)[0])[:2]
                left = np.array([-math.sin(route.yaw_rad[row]), math.cos(route.yaw_rad[row])])
                yield Place(at_m, start, route.edges_after(at_m), {"left_m": float(to_route_m @ left)})


def lane(route: RouteLine) -> Iterator[Place]:
    """Straight places in a lane next to another one, by which others can pass."""
    for at_m in _stations(route):
        is_straight = route.is_open(at_m - 25.0, at_m + 20.0) and route.turn_rad(at_m - 30.0, at_m) < _STRAIGHT_RAD
        if is_straight and any(route.beside(route.lane_at(at_m))):
            yield Place(at_m, route.waypoint(at_m))


def ahead(route: RouteLine) -> Iterator[Place]:
    """Straight places where a vehicle that leads from the start can brake."""
    yield from _led(route, lambda turn_rad: turn_rad < _STRAIGHT_RAD)


def bend(route: RouteLine) -> Iterator[Place]:
    """Bends of the road, for a vehicle that leads from the start."""
    yield from _led(route, lambda turn_rad: turn_rad > _BEND_RAD)


def behind(route: RouteLine) -> Iterator[Place]:
    """Places on open road, for a vehicle that comes from behind the ego's start."""
    start = route.waypoint(0.0)
    lanes, back_m = [route.lane_at(0.0)], start.s_m
    while (back_m < _FOLLOWER_M or lanes[-1].junction) and (before := _before(route, lanes[-1])) is not None:
        lanes.append(before)
        back_m += before.length_m
    if back_m < _FOLLOWER_M / 2.0 or lanes[-1].junction:
        return
    waypoint = start.model_copy(update={"lane": lanes[-1].id, "s_m": max(back_m - _FOLLOWER_M, _MIN_START_M)})
    via = (*([] if len(lanes) == 1 else [lanes[0].edge]), *route.edges_after(0.0))
    for at_m in _stations(route, first_m=25.0):
        if at_m < _MAX_PURSUIT_M and route.is_open(at_m, at_m + 20.0) and any(route.beside(route.lane_at(at_m))):
            yield Place(at_m, waypoint, via)


def anywhere(route: RouteLine) -> Iterator[Place]:
    """Every candidate."""
    yield from (Place(at_m) for at_m in _stations(route, first_m=30.0))


def curb(route: RouteLine) -> Iterator[Place]:
    """Straight places at the outer edge of the carriageway, with a sidewalk, where a vehicle may stand beside."""
    for at_m in _stations(route):
        own = route.lane_at(at_m)
        outer = [each for each in route.network.lanes_of_edge(own.edge) if each.index < own.index]
        walks = [each for each in outer if each.kind is LaneKind.SIDEWALK]
        near = max(outer, key=lambda each: each.index, default=None)
        if not walks or near is None or near.kind in (LaneKind.DRIVING, LaneKind.MEDIAN):
            continue
        if not route.is_open(at_m - _ROOM_M, at_m + _ROOM_M) or route.turn_rad(at_m - 35.0, at_m + 10.0) > 0.1:
            continue
        row = route.row_at(at_m)
        x_m, y_m, z_m = route.point_m[row].tolist()
        yaw_rad = math.remainder(float(route.yaw_rad[row]), 2.0 * math.pi)
        left = np.array([-math.sin(yaw_rad), math.cos(yaw_rad)])
        walk = route.waypoint(at_m + _WALKER_AHEAD_M, walks[-1])
        walk_m, _ = route.network.pose_on_lane(walk.lane, walk.s_m)
        side = math.copysign(1.0, float((walk_m[:2] - [x_m, y_m]) @ left))
        out_m = side * (own.width_m / 2.0 + _CURB_GAP_M + _BODY_WIDTH_M / 2.0)
        beyond_m = _to_far_side_m(route, own)
        goal_m = route.point_m[route.row_at(at_m + _WALKER_AHEAD_M), :2] - side * beyond_m * left
        measures = {"goal_x_m": float(goal_m[0]), "goal_y_m": float(goal_m[1]), "beyond_m": beyond_m}
        measures |= {"side": side, "ahead_m": _WALKER_AHEAD_M}
        center = (x_m + out_m * float(left[0]), y_m + out_m * float(left[1]), z_m, yaw_rad)
        yield Place(at_m, None, (), measures, center, walk)


def _stations(route: RouteLine, first_m: float = _FIRST_M) -> list[float]:
    """Distances along a route that are looked at."""
    return np.arange(first_m, route.length_m - _LAST_M, _STEP_M).tolist()


def _to_far_side_m(route: RouteLine, lane: Lane) -> float:
    """Distance from the middle of a lane to the far sidewalk."""
    edge = lane.edge.removeprefix("-") if lane.edge.startswith("-") else f"-{lane.edge}"
    lanes = [each for each in route.network.lanes_of_edge(lane.edge) if each.index > lane.index]
    lanes += [each for each in route.network.lanes_of_edge(edge) if each.kind is not LaneKind.SIDEWALK]
    return lane.width_m / 2.0 + sum(each.width_m for each in lanes) + _ON_SIDEWALK_M


def _led(route: RouteLine, is_place: Callable[[float], bool]) -> Iterator[Place]:
    """Places with a turn of some kind ahead, for a vehicle that leads from the start, if it has room there."""
    if (leader_m := _leader_m(route)) is None:
        return
    for at_m in _stations(route):
        if route.is_open(at_m, at_m + _BEND_M) and is_place(route.turn_rad(at_m, at_m + _BEND_M)):
            yield Place(at_m, route.waypoint(leader_m), route.edges_after(leader_m))


def _leader_m(route: RouteLine) -> float | None:
    """Distance along the route at which a vehicle starts that leads; None: there is no room."""
    for at_m in np.arange(_LEADER_M, 60.0, 2.0).tolist():
        if route.is_open(at_m - 6.0, at_m):
            return float(at_m)
    return None


def _before(route: RouteLine, lane: Lane) -> Lane | None:
    """The lane that leads to a lane most straight ahead."""
    before = [each for each in route.network.lanes_of(LaneKind.DRIVING) if lane.id in each.successors]
    return min(before, key=lambda each: (_kink_rad(each, lane), each.id), default=None)


def _kink_rad(first: Lane, second: Lane) -> float:
    """Angle between the start of a lane and that of the next one."""
    yaws = [math.atan2(*np.diff(each.centerline_m[:2, :2], axis=0)[0, ::-1]) for each in (first, second)]
    return abs(math.remainder(yaws[1] - yaws[0], 2.0 * math.pi))
