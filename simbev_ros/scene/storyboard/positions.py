"""Positions of a storyboard in the map frame.

Headings that are relative to a lane are relative to the direction of its traffic; offsets in lanes and along lanes are
seen from the entity that they are relative to, to its left and ahead.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.opendrive.lane_places import LanePlace, RoadPoint
from simbev_ros.scene.storyboard.bodies import Body, Mover, Pose
from simbev_ros.scene.storyboard.model import Element, elements_in
from simbev_ros.scene.storyboard.trajectories import curve_of

_ON_GROUND = math.nan
_SLACK_M = 0.5
"""Distance beyond the ends of a road that counts as rounding."""
_MAX_MESSAGES = 20


class Positions:
    """Resolves positions of one storyboard."""

    def __init__(
        self,
        mover: Mover,
        bodies: Mapping[str, Body],
        datum: MapDatum,
        origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """For entities by name, on a map with a position on Earth, whose frame is at ``origin_m`` of its file."""
        self._mover, self._roads, self._bodies, self._datum = mover, mover.roads, bodies, datum
        self._origin_m = np.array(origin_m)

    def enter(self, init: Element) -> None:
        """Put the entities that ``Init`` places, those first that others are relative to.

        Raises:
            InputError: There is no such place, or it is relative to an entity that has none.
        """
        waiting = [(each.entity_ref, each.change) for each in init.global_actions if each.kind == "EntityAction"]
        waiting = [each for each in waiting if each[1].kind == "AddEntityAction"]
        privates = [(each.entity_ref, action) for each in init.privates for action in each.actions]
        waiting += [each for each in privates if each[1].kind == "TeleportAction"]
        while waiting:
            names = (_entities_in(action.position) for _, action in waiting)
            ready = (index for index, each in enumerate(names) if all(self._bodies[name].is_present for name in each))
            name, action = waiting.pop(next(ready, 0))
            self._mover.put(self._bodies[name], self.pose(action.position))

    def check(self, scenario: Element) -> None:
        """Resolve whatever is relative to no entity.

        Raises:
            InputError: Some of it does not exist; the message has a line for each.
        """
        checks = dict.fromkeys(_KINDS, self.pose) | {"Route": self.route}
        messages: dict[str, None] = {}
        for element in elements_in(scenario.storyboard):
            if element.kind in checks and not _entities_in(element):
                try:
                    checks[element.kind](element)
                except InputError as error:
                    messages[str(error)] = None
        if messages:
            raise InputError("\n".join([*messages][:_MAX_MESSAGES]))

    def pose(self, position: Element) -> Pose:
        """The pose of a ``Position`` element.

        Raises:
            InputError: There is no such road or lane.
        """
        with _named(position):
            return _KINDS[position.kind](self, position)

    def route(self, route: Element, start: LanePlace | None = None) -> tuple[str, ...]:
        """Ids of the roads over the waypoints of a ``Route`` element, by shortest paths.

        Raises:
            InputError: A waypoint is off the roads, or no road leads there.
        """
        poses = [self.pose(waypoint.position) for waypoint in route.waypoints]
        with _named(route):
            places = [*([start] if start else []), *(self._lane(pose) for pose in poses)]
            roads = [places[0].road]
            for before, after in pairwise(places):
                path = self._roads.route_between(before, self._roads.point_of(after))
                if path is None:
                    raise KeyError(f"no road leads from road {before.road} to road {after.road}")
                roads += path[1:]
            return tuple(roads)

    def _lane(self, pose: Pose) -> LanePlace:
        place = pose.place or self._mover.lane_at(pose.position_m, pose.yaw_rad)
        if place is None:
            x_m, y_m = pose.position_m[:2].tolist()
            raise KeyError(f"({x_m:.1f}, {y_m:.1f}) is on no road")
        return place

    def _world(self, position: Element) -> Pose:
        z_m = _ON_GROUND if position.z_m is None else position.z_m
        at_m = np.array([position.x_m, position.y_m, z_m]) - self._origin_m
        return Pose(at_m, position.h_rad, None, position.p_rad, position.r_rad)

    def _geo(self, position: Element) -> Pose:
        altitude_m = self._datum.altitude_m if position.altitude_m is None else position.altitude_m
        x_m, y_m, z_m = self._datum.map_from_geodetic(position.latitude_deg, position.longitude_deg, altitude_m)
        at_m = np.array([x_m, y_m, _ON_GROUND if position.altitude_m is None else z_m])
        return _oriented(Pose(at_m, 0.0), position.orientation)

    def _relative_world(self, position: Element) -> Pose:
        body = self._body(position.entity_ref)
        at_m = body.position_m + np.array([position.dx_m, position.dy_m, position.dz_m])
        return _oriented(Pose(at_m, body.yaw_rad), position.orientation)

    def _relative_object(self, position: Element) -> Pose:
        body = self._body(position.entity_ref)
        arm_m = np.array([position.dx_m, position.dy_m]) @ body.axes
        return _oriented(Pose(body.position_m + np.append(arm_m, position.dz_m), body.yaw_rad), position.orientation)

    def _road(self, position: Element) -> Pose:
        return self._on_road(RoadPoint(position.road_id, position.s_m, position.t_m), position.orientation)

    def _relative_road(self, position: Element) -> Pose:
        point = self._roads.point_of(self._place_of(position.entity_ref))
        moved = RoadPoint(point.road, point.s_m + position.ds_m, point.t_m + position.dt_m)
        return self._on_road(moved, position.orientation)

    def _on_road(self, point: RoadPoint, orientation: Element | None) -> Pose:
        at_m, heading_rad = self._roads.pose(point._replace(s_m=self._s_m(point.road, point.s_m)))
        return _oriented(Pose(at_m, heading_rad), orientation)

    def _lane_position(self, position: Element) -> Pose:
        s_m = self._s_m(position.road_id, position.s_m)
        forward = self._roads.drives_forward(position.road_id, position.lane_id, s_m)
        place = LanePlace(position.road_id, position.lane_id, s_m, position.offset_m, forward)
        return self._on_lane(place, position.orientation)

    def _s_m(self, road: str, s_m: float) -> float:
        """A distance along a road, without rounding beyond its ends; raises KeyError if it is far beyond."""
        if road not in self._roads:
            raise KeyError(f"there is no road {road}")
        length_m = self._roads.length_m(road)
        if not -_SLACK_M <= s_m <= length_m + _SLACK_M:
            raise KeyError(f"s = {s_m:g} is not on road {road}, whose s goes from 0 to {length_m:g}")
        return min(max(s_m, 0.0), length_m)

    def _relative_lane(self, position: Element) -> Pose:
        start = self._place_of(position.entity_ref)
        ahead = LanePlace(start.road, start.lane, start.s_m, 0.0, start.forward)
        if position.ds_lane_m is not None:
            moved = self._roads.advance(ahead, position.ds_lane_m)
        else:
            moved = self._roads.advance(ahead, position.ds_m or 0.0, along_s=True)
        if moved is None:
            raise KeyError(f"the lane of {position.entity_ref} ends before")
        lane = self._roads.next_lane(moved, position.d_lane)
        forward = moved.forward if lane * moved.lane > 0 else not moved.forward
        return self._on_lane(LanePlace(moved.road, lane, moved.s_m, position.offset_m, forward), position.orientation)

    def _on_lane(self, place: LanePlace, orientation: Element | None) -> Pose:
        at_m, _ = self._roads.pose(self._roads.point_of(place))
        return _oriented(Pose(at_m, self._mover.direction_rad(place), place), orientation)

    def _place_of(self, name: str) -> LanePlace:
        """The lane of an entity, by its center rather than by the lane that it is changing to."""
        body = self._body(name)
        return self._lane(Pose(body.position_m, body.yaw_rad))

    def _body(self, name: str) -> Body:
        """An entity; raises KeyError if it is not in the scene."""
        if not self._bodies[name].is_present:
            raise KeyError(f"{name} is not in the scene, so nothing can be relative to it")
        return self._bodies[name]

    def _on_route(self, position: Element) -> Pose:
        roads = self.route(position.route)
        start, place = self._lane(self.pose(position.route.waypoints[0].position)), position.place
        if (name := getattr(place, "entity_ref", None)) is not None:
            body = self._body(name)
            return _oriented(Pose(body.position_m, body.yaw_rad), position.orientation)
        moved = self._roads.advance(start, place.path_s_m, roads, along_s=True)
        if moved is None:
            raise KeyError("the route ends before")
        if (t_m := getattr(place, "t_m", None)) is not None:
            return self._on_road(RoadPoint(moved.road, moved.s_m, t_m), position.orientation)
        lane = LanePlace(moved.road, place.lane_id, moved.s_m, place.lane_offset_m, moved.forward)
        return self._on_lane(lane, position.orientation)

    def _on_trajectory(self, position: Element) -> Pose:
        pose = curve_of(position.trajectory, self.pose).pose(position.s_m)
        left = np.array([-math.sin(pose.yaw_rad), math.cos(pose.yaw_rad), 0.0])
        return _oriented(Pose(pose.position_m + position.t_m * left, pose.yaw_rad), position.orientation)


def _entities_in(element: Element) -> set[str]:
    """Names of the entities that an element refers to."""
    return {each.entity_ref for each in elements_in(element) if hasattr(each, "entity_ref")}


@contextmanager
def _named(element: Element) -> Iterator[None]:
    """Name the element about which the block raises a KeyError."""
    try:
        yield
    except KeyError as error:
        raise InputError(f"{element.origin}: {element.kind}: {error.args[0]}") from None


def _oriented(pose: Pose, orientation: Element | None) -> Pose:
    """A pose with the orientation of an element, which is relative to its own, or absolute."""
    if orientation is None:
        return pose
    yaw_rad = orientation.h_rad + (pose.yaw_rad if orientation.type == "relative" else 0.0)
    return Pose(pose.position_m, yaw_rad, pose.place, orientation.p_rad, orientation.r_rad)


_KINDS: Mapping[str, Callable[[Positions, Element], Pose]] = {
    "WorldPosition": Positions._world,
    "GeoPosition": Positions._geo,
    "RelativeWorldPosition": Positions._relative_world,
    "RelativeObjectPosition": Positions._relative_object,
    "RoadPosition": Positions._road,
    "RelativeRoadPosition": Positions._relative_road,
    "LanePosition": Positions._lane_position,
    "RelativeLanePosition": Positions._relative_lane,
    "RoutePosition": Positions._on_route,
    "TrajectoryPosition": Positions._on_trajectory,
}
