"""Start waypoints for the spawn poses that the configuration lists for an agent."""

import math
from collections.abc import Callable

import numpy as np

from simbev_ros.config.places import SpawnPose
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_index import LineIndex
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.schema.scene.spec import WaypointSpec

_MAX_LANE_M = 5.0


Where = Callable[..., str]
"""Takes the keys of an agent's field, and returns the words with which messages about this field begin."""


def spawn_starts(
    poses: tuple[SpawnPose, ...], blueprint: Blueprint, network: RoadNetwork, where: Where
) -> list[WaypointSpec]:
    """Starts of an agent's front bumper on lanes that it may drive on, one for each of its poses in a field.

    Raises:
        InputError: A pose is too far from every such lane.
    """
    lanes = [
        lane
        for lane in network.lanes_of(LaneKind.DRIVING)
        if not lane.junction and blueprint.sumo_class in lane.classes
    ]
    if not lanes:
        raise InputError(f"{where()}: {no_lane(blueprint, network)}")
    index = LineIndex(Polylines.from_lines([lane.centerline_m for lane in lanes]))
    return [_start(pose, blueprint, lanes, index, network.name, where(number)) for number, pose in enumerate(poses)]


def no_lane(blueprint: Blueprint, network: RoadNetwork) -> str:
    """Message that a vehicle can drive nowhere on a map."""
    return f"{blueprint.name} has no lane to drive on in map {network.name}"


def _start(
    pose: SpawnPose, blueprint: Blueprint, lanes: list[Lane], index: LineIndex, map_name: str, field: str
) -> WaypointSpec:
    """The waypoint half the vehicle's length ahead of the pose, which is that of its center."""
    pose_m = [pose.x_m, pose.y_m] if pose.z_m is None else [pose.x_m, pose.y_m, pose.z_m]
    yaw_rad = None if pose.yaw_deg is None else np.array([math.radians(pose.yaw_deg)])
    nearest = index.nearest(np.array([pose_m]), yaw_rad)
    lane_position_m = index.lines.values(nearest.parameter)[0, : len(pose_m)]
    distance_m = float(np.linalg.norm(lane_position_m - pose_m))
    if distance_m > _MAX_LANE_M:
        raise InputError(
            f"{field}: ({', '.join(f'{value:g}' for value in pose_m)}) is {distance_m:.1f} m from the "
            f"nearest lane that {blueprint.name} may start on in map {map_name}; at most {_MAX_LANE_M:g} m is allowed"
        )
    lane = lanes[int(nearest.row[0])]
    return WaypointSpec(lane=lane.id, s_m=min(float(nearest.s_m[0]) + blueprint.size_m[0] / 2.0, lane.length_m))
