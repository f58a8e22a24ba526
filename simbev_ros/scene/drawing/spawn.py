"""Places on lanes for the spawn poses that the configuration lists for the ego."""

import math

import numpy as np

from simbev_ros.config.scenario import SpawnPose
from simbev_ros.errors import InputError
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_index import LineIndex
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.scene.spec import WaypointSpec

_FARTHEST_M = 5.0


def draw_spawn(poses: tuple[SpawnPose, ...], seed: int, blueprint: Blueprint, network: RoadNetwork) -> WaypointSpec:
    """Where the front bumper of an ego starts that stands at one of the listed poses, on a lane that it may drive on.

    Raises:
        InputError: one of the poses, drawn or not, is far from every such lane.
    """
    lanes = [
        lane
        for lane in network.lanes_of(LaneKind.DRIVING)
        if not lane.junction and blueprint.sumo_class in lane.classes
    ]
    if not lanes:
        raise InputError(f"ego.blueprint: {blueprint.name} has no lane to drive on in map {network.name}")
    index = LineIndex(Polylines.of([lane.centerline_m for lane in lanes]))
    starts = [_start(number, pose, blueprint, lanes, index, network.name) for number, pose in enumerate(poses)]
    return starts[int(stream(seed, "ego.spawn").integers(len(starts)))]


def _start(
    number: int, pose: SpawnPose, blueprint: Blueprint, lanes: list[Lane], index: LineIndex, map_name: str
) -> WaypointSpec:
    """The waypoint half the ego's length ahead of the pose, which is of its middle."""
    place_m = [pose.x_m, pose.y_m] if pose.z_m is None else [pose.x_m, pose.y_m, pose.z_m]
    yaw_rad = None if pose.yaw_deg is None else np.array([math.radians(pose.yaw_deg)])
    nearest = index.nearest(np.array([place_m]), yaw_rad)
    found_m = index.lines.values(nearest.parameter)[0, : len(place_m)]
    distance_m = float(np.linalg.norm(found_m - place_m))
    if distance_m > _FARTHEST_M:
        raise InputError(
            f"ego.spawn[{number}]: ({', '.join(f'{value:g}' for value in place_m)}) is {distance_m:.1f} m from the "
            f"nearest lane that {blueprint.name} may start on in map {map_name}; at most {_FARTHEST_M:g} m is allowed"
        )
    lane = lanes[int(nearest.row[0])]
    return WaypointSpec(lane=lane.id, s_m=min(float(nearest.s_m[0]) + blueprint.size_m[0] / 2.0, lane.length_m))
