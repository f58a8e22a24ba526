"""The points of a configured route on a map, and the first agent that starts at the first of them."""

import math
from typing import Any

from simbev_ros.config.agents import Ego
from simbev_ros.config.drive import LanePoint
from simbev_ros.config.places import SpawnPose
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.spawn import Where


def routed_ego(scenario: Scenario, network: RoadNetwork) -> tuple[Ego, Where]:
    """The first agent, with the points of ``drive.route`` as its start and its route, and words for its fields.

    Raises:
        InputError: The map has no such lane.
    """
    keys, points = scenario.drive.points_on(network.name) if scenario.drive is not None else ((), ())

    def where(*field: Any) -> str:
        is_routed = points and field[:1] in (("spawn",), ("route",))
        return scenario.where("drive", *keys, *field[1:]) if is_routed else scenario.where("ego", *field)

    if not points:
        return scenario.ego, where
    poses = tuple(_pose(point, network, where("route", number)) for number, point in enumerate(points))
    return scenario.ego.model_copy(update={"spawn": poses[:1], "route": poses}), where


def _pose(point: LanePoint | SpawnPose, network: RoadNetwork, field: str) -> SpawnPose:
    if isinstance(point, SpawnPose):
        return point
    if point.lane not in network.lanes:
        raise InputError(f"{field}.lane: map {network.name} has no lane {point.lane!r}; `simbev map info` lists ids")
    position_m, yaw_rad = network.pose_on_lane(point.lane, point.s_m)
    x_m, y_m, z_m = position_m.tolist()
    return SpawnPose(x_m=x_m, y_m=y_m, z_m=z_m, yaw_deg=math.degrees(yaw_rad))
