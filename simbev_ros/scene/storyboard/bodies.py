"""Moving bodies of a storyboard: where each entity is, how fast, and how it moves by itself.

Without actions an entity keeps its speed. On a lane it follows the lane, at junctions straight ahead or along its
route; elsewhere it moves straight ahead.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.opendrive.lane_places import LanePlace, RoadPoint, Roads, wrapped
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.scene.storyboard.model import Element

MAX_LANE_ANGLE_RAD = math.radians(45.0)
"""Largest angle between an entity and a lane that it follows."""
_OFF_LANE_M = 2.0
_STANDING_MPS = 1e-3


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose in the map frame.

    Attributes:
        position_m: (3,); z is NaN on the ground.
        yaw_rad: Heading.
        place: The lane that it is on, if that is known.
        pitch_rad: Pitch, downward positive.
        roll_rad: Roll.
    """

    position_m: Float64Array
    yaw_rad: float
    place: LanePlace | None = None
    pitch_rad: float = 0.0
    roll_rad: float = 0.0


@dataclass(slots=True, eq=False)
class Body:
    """One entity.

    Attributes:
        name: Its name in the storyboard.
        size_m: Length, width and height of its box.
        center_m: (2,) from its reference point to the center of its box, forward and to the left.
        kind: vehicle, pedestrian or miscellaneous.
        max_speed_mps: Its own maximum.
        is_present: Whether it is in the scene.
        position_m: (3,) its reference point, map frame.
        yaw_rad: Heading.
        pitch_rad: Pitch, downward positive.
        roll_rad: Roll.
        speed_mps: Along its heading; negative in reverse.
        acceleration_mps2: Its change.
        lateral_mps: To the left, relative to its lane.
        along_share: Part of its speed that is along its lane.
        place: Its lane; None: it moves straight ahead.
        route: Ids of the roads that it follows.
        travelled_m: Distance since the start.
        standing_s: Time since it stands; None: it moves.
        has_left_road: It has come to the end of its road.
        end_of_road_s: Time since then.
        off_road_s: Time since it is on no road.
    """

    name: str
    size_m: tuple[float, float, float]
    center_m: tuple[float, float] = (0.0, 0.0)
    kind: str = "vehicle"
    max_speed_mps: float = math.inf
    is_present: bool = True
    position_m: Float64Array = field(default_factory=lambda: np.zeros(3))
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    speed_mps: float = 0.0
    acceleration_mps2: float = 0.0
    lateral_mps: float = 0.0
    along_share: float = 1.0
    place: LanePlace | None = None
    route: tuple[str, ...] = ()
    travelled_m: float = 0.0
    standing_s: float | None = None
    has_left_road: bool = False
    end_of_road_s: float = 0.0
    off_road_s: float = 0.0

    @property
    def velocity_mps(self) -> Float64Array:
        """(2,) velocity, map frame."""
        lane_rad = self.yaw_rad - self.drift_rad
        ahead = np.array([math.cos(lane_rad), math.sin(lane_rad)])
        return self.along_mps * ahead + self.lateral_mps * np.array([-ahead[1], ahead[0]])

    @property
    def along_mps(self) -> float:
        """Speed along its lane."""
        return self.speed_mps * self.along_share

    @property
    def drift_rad(self) -> float:
        """The angle from its lane to its heading, because it moves to the side."""
        side_rad = math.atan2(self.lateral_mps, abs(self.along_mps)) if self.speed_mps else 0.0
        return math.copysign(1.0, self.speed_mps) * side_rad

    @property
    def corners_m(self) -> Float64Array:
        """(4, 2) corners of its box, map frame, counterclockwise."""
        half_m = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * np.array(self.size_m[:2]) / 2.0
        return np.asarray((half_m + self.center_m) @ self.axes + self.position_m[:2])

    @property
    def axes(self) -> Float64Array:
        """(2, 2) its forward and left directions in plan view, as rows."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.array([[cos, sin], [-sin, cos]])


class Mover:
    """Moves bodies on roads and on the ground.

    Attributes:
        roads: The roads.
        watches_roads: Whether it notes how long bodies are off the roads.
    """

    def __init__(self, roads: Roads, heights_m: Callable[[Float64Array], Float64Array] | None = None) -> None:
        """On the roads of a map; ``heights_m`` gives the (N,) heights of the ground at (N, 3) points, None: level."""
        self.roads, self._heights_m, self.watches_roads = roads, heights_m, False

    def put(self, body: Body, pose: Pose) -> None:
        """Put a body somewhere, on the lane there if it points along it."""
        body.is_present, body.lateral_mps = True, 0.0
        body.position_m, body.yaw_rad = self.on_ground(pose.position_m), wrapped(pose.yaw_rad)
        body.pitch_rad, body.roll_rad = pose.pitch_rad, pose.roll_rad
        body.place = self._lane_along(pose)
        if body.place is not None:
            self.pose_on_lane(body)

    def _lane_along(self, pose: Pose) -> LanePlace | None:
        """The lane at a pose that points along it."""
        place = pose.place or self.lane_at(pose.position_m, pose.yaw_rad)
        if place is None:
            return None
        place = LanePlace(place.road, place.lane, place.s_m, place.offset_m, self._is_along(place, pose.yaw_rad))
        turn_rad = wrapped(pose.yaw_rad - self.direction_rad(place))
        return place if abs(turn_rad) <= MAX_LANE_ANGLE_RAD else None

    def lane_at(self, position_m: Float64Array, yaw_rad: float) -> LanePlace | None:
        """The lane at a (3,) position, map frame; None off the roads."""
        point = self.roads.locate(position_m, yaw_rad)
        place = None if point is None else self.roads.place_of(point, yaw_rad)
        if point is None or place is None:
            return None
        near_m = self.roads.pose(point)[0][:2] - position_m[:2]
        outside_m = abs(place.offset_m) - self.roads.half_width_m(place)
        return place if float(np.hypot(*near_m)) < _OFF_LANE_M and outside_m < _OFF_LANE_M else None

    def _is_along(self, place: LanePlace, yaw_rad: float) -> bool:
        return math.cos(yaw_rad - self.roads.pose(RoadPoint(place.road, place.s_m, 0.0))[1]) >= 0.0

    def direction_rad(self, place: LanePlace) -> float:
        """Direction in which something moves along a lane."""
        return self.roads.pose(self.roads.point_of(place))[1] + (0.0 if place.forward else math.pi)

    def on_ground(self, position_m: Float64Array) -> Float64Array:
        """A (3,) position, at the height of the ground if its own is unknown."""
        if math.isfinite(position_m[2]):
            return position_m.copy()
        level_m = np.array([position_m[0], position_m[1], 0.0])
        height_m = 0.0 if self._heights_m is None else float(self._heights_m(level_m[None])[0])
        return np.array([position_m[0], position_m[1], height_m if math.isfinite(height_m) else 0.0])

    def pose_on_lane(self, body: Body) -> None:
        """Set the position of a body from its place, and its heading from its lateral motion."""
        assert body.place is not None
        position_m, _ = self.roads.pose(self.roads.point_of(body.place))
        body.position_m = position_m
        body.yaw_rad = wrapped(self.direction_rad(body.place) + body.drift_rad)

    def drive(self, body: Body, distance_m: float) -> None:
        """Move a body along its lane, or straight ahead, and set its pose."""
        if body.place is not None:
            try:
                following = self.roads.advance(body.place, distance_m, body.route) if distance_m else body.place
                if following is not None:
                    body.place = following
                    self.pose_on_lane(body)
                    return
            except KeyError:  # its lane ends within the road
                pass
            body.place, body.has_left_road = None, True  # the road ends: straight ahead
        moved_m = body.position_m + np.append(distance_m * body.axes[0], 0.0)
        body.position_m = self.on_ground(np.array([*moved_m[:2], math.nan])) if self._heights_m is not None else moved_m

    def note_motion(self, body: Body, before_m: Float64Array, time_s: float) -> None:
        """Update the distance and the times of a body that was somewhere else before."""
        moved_m = float(np.linalg.norm(body.position_m[:2] - before_m[:2]))
        body.travelled_m += moved_m
        if abs(body.speed_mps) >= _STANDING_MPS:
            body.standing_s = None
        else:
            body.standing_s = (body.standing_s or 0.0) + (time_s if moved_m == 0.0 else 0.0)
        if self.watches_roads:
            on_road = body.place is not None or self.lane_at(body.position_m, body.yaw_rad) is not None
            body.off_road_s = 0.0 if on_road else body.off_road_s + time_s
        body.end_of_road_s += time_s * body.has_left_road


_roads = LatestValue[Path, Roads]()
"""The roads of the latest map."""


def mover_on(network: RoadNetwork, heights_m: Callable[[Float64Array], Float64Array] | None = None) -> Mover:
    """A mover on the roads of a map; ``heights_m`` as in ``Mover``."""
    return Mover(_roads.get(network.opendrive_path, lambda: Roads(network.opendrive_path)), heights_m)


def body_of(entity: Element, blueprint: Blueprint) -> Body:
    """The body of an ``ScenarioObject``, with the size of the model that plays it."""
    center, performance = entity.body.bounding_box.center, getattr(entity.body, "performance", None)
    max_speed_mps = math.inf if performance is None else performance.max_speed_mps
    kind = {"Vehicle": "vehicle", "Pedestrian": "pedestrian"}.get(entity.body.kind, "miscellaneous")
    return Body(entity.name, blueprint.size_m, (center.x_m, center.y_m), kind, max_speed_mps, is_present=False)
