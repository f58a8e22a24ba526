"""Positions of a storyboard in the map frame.

Headings that are relative to a lane are relative to the direction of its traffic; offsets in lanes and along lanes are
seen from the entity that they are relative to, to its left and ahead.
"""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.opendrive.lane_places import LanePlace, RoadPoint
from simbev_ros.scene.storyboard.bodies import Body, Mover, Pose
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.scene.storyboard.trajectories import curve_of

_ON_GROUND = math.nan


class Positions:
    """Resolves positions of one storyboard."""

    def __init__(self, mover: Mover, bodies: Mapping[str, Body], datum: MapDatum) -> None:
        """For the entities of a scene, by name; ``datum`` is the map's position on Earth."""
        self._mover, self._roads, self._bodies, self._datum = mover, mover.roads, bodies, datum

    def pose(self, position: Element) -> Pose:
        """The pose of a ``Position`` element.

        Raises:
            InputError: There is no such road or lane.
        """
        try:
            return _KINDS[position.kind](self, position)
        except KeyError as error:
            raise InputError(f"{position.origin}: {position.kind}: {error.args[0]}") from None

    def route(self, route: Element, start: LanePlace | None = None) -> tuple[str, ...]:
        """Ids of the roads over the waypoints of a ``Route`` element, by shortest paths.

        Raises:
            InputError: A waypoint is off the roads, or no road leads there.
        """
        poses = [self.pose(waypoint.position) for waypoint in route.waypoints]
        places = [*([start] if start else []), *(self._lane(pose) for pose in poses)]
        roads = [places[0].road]
        for before, after in pairwise(places):
            path = self._roads.route_between(before, self._roads.point_of(after))
            if path is None:
                raise InputError(f"route {route.name!r}: no road leads from road {before.road} to road {after.road}")
            roads += path[1:]
        return tuple(roads)

    def _lane(self, pose: Pose) -> LanePlace:
        place = pose.place or self._mover.lane_at(pose.position_m, pose.yaw_rad)
        if place is None:
            x_m, y_m = pose.position_m[:2].tolist()
            raise InputError(f"({x_m:.1f}, {y_m:.1f}) is on no road")
        return place

    def _world(self, position: Element) -> Pose:
        z_m = _ON_GROUND if position.z_m is None else position.z_m
        at_m = np.array([position.x_m, position.y_m, z_m])
        return Pose(at_m, position.h_rad, None, position.p_rad, position.r_rad)

    def _geo(self, position: Element) -> Pose:
        altitude_m = self._datum.altitude_m if position.altitude_m is None else position.altitude_m
        x_m, y_m, z_m = self._datum.map_from_geodetic(position.latitude_deg, position.longitude_deg, altitude_m)
        at_m = np.array([x_m, y_m, _ON_GROUND if position.altitude_m is None else z_m])
        return _oriented(Pose(at_m, 0.0), position.orientation)

    def _relative_world(self, position: Element) -> Pose:
        body = self._bodies[position.entity_ref]
        at_m = body.position_m + np.array([position.dx_m, position.dy_m, position.dz_m])
        return _oriented(Pose(at_m, body.yaw_rad), position.orientation)

    def _relative_object(self, position: Element) -> Pose:
        body = self._bodies[position.entity_ref]
        arm_m = np.array([position.dx_m, position.dy_m]) @ body.axes
        return _oriented(Pose(body.position_m + np.append(arm_m, position.dz_m), body.yaw_rad), position.orientation)

    def _road(self, position: Element) -> Pose:
        if position.road_id not in self._roads:
            raise KeyError(f"there is no road {position.road_id}")
        return self._on_road(RoadPoint(position.road_id, position.s_m, position.t_m), position.orientation)

    def _relative_road(self, position: Element) -> Pose:
        point = self._roads.point_of(self._place_of(position.entity_ref))
        moved = RoadPoint(point.road, point.s_m + position.ds_m, point.t_m + position.dt_m)
        return self._on_road(moved, position.orientation)

    def _on_road(self, point: RoadPoint, orientation: Element | None) -> Pose:
        at_m, heading_rad = self._roads.pose(point)
        return _oriented(Pose(at_m, heading_rad), orientation)

    def _lane_position(self, position: Element) -> Pose:
        if position.road_id not in self._roads:
            raise KeyError(f"there is no road {position.road_id}")
        lane = int(position.lane_id)
        forward = self._roads.drives_forward(position.road_id, lane, position.s_m)
        place = LanePlace(position.road_id, lane, position.s_m, position.offset_m, forward)
        return self._on_lane(place, position.orientation)

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
        body = self._bodies[name]
        return self._lane(Pose(body.position_m, body.yaw_rad))

    def _on_route(self, position: Element) -> Pose:
        roads = self.route(position.route)
        start, place = self._lane(self.pose(position.route.waypoints[0].position)), position.place
        if (name := getattr(place, "entity_ref", None)) is not None:
            body = self._bodies[name]
            return _oriented(Pose(body.position_m, body.yaw_rad), position.orientation)
        moved = self._roads.advance(start, place.path_s_m, roads, along_s=True)
        if moved is None:
            raise KeyError("the route ends before")
        if (t_m := getattr(place, "t_m", None)) is not None:
            return self._on_road(RoadPoint(moved.road, moved.s_m, t_m), position.orientation)
        lane = LanePlace(moved.road, int(place.lane_id), moved.s_m, place.lane_offset_m, moved.forward)
        return self._on_lane(lane, position.orientation)

    def _on_trajectory(self, position: Element) -> Pose:
        pose = curve_of(position.trajectory, self.pose).pose(position.s_m)
        left = np.array([-math.sin(pose.yaw_rad), math.cos(pose.yaw_rad), 0.0])
        return _oriented(Pose(pose.position_m + position.t_m * left, pose.yaw_rad), position.orientation)


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
