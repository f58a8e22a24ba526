"""Converts the route of a drive to messages."""

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Path

from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.world import MAP_FRAME, point_message, quaternion_message
from simbev_ros.schema.scene.drive_spec import RouteSpec


def route_message(route: RouteSpec, stamp_ns: int) -> Path:
    """Path message of all points of a route, map frame; each pose points to the next one."""
    poses = [_pose(route, row) for row in range(len(route.x_m))]
    stamped = [PoseStamped(header=header(stamp_ns, MAP_FRAME), pose=pose) for pose in poses]
    return Path(header=header(stamp_ns, MAP_FRAME), poses=stamped)


def goal_message(route: RouteSpec, stamp_ns: int) -> PoseStamped:
    """PoseStamped message of the last point of a route, map frame."""
    return PoseStamped(header=header(stamp_ns, MAP_FRAME), pose=_pose(route, -1))


def _pose(route: RouteSpec, row: int) -> Pose:
    yaw_rad = float(route.yaw_rad[row])
    rotation = quaternion_message(quaternion_from_rpy(np.array([0.0, 0.0, yaw_rad])))
    return Pose(position=point_message(route.points_m[row]), orientation=rotation)
