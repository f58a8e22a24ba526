"""Converts wheel odometry to messages and transforms, and its configuration to models."""

import numpy as np
from geometry_msgs.msg import PoseWithCovariance, TwistWithCovariance
from nav_msgs.msg import Odometry

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy, quaternion_from_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.world import point_message, quaternion_message, vector_message
from simbev_ros.simulation.sensors.odometry import PlanarPose, PlanarTwist

UNMEASURED_VARIANCE = 1e6
"""Variance of what wheel odometry does not measure: height, roll and pitch, and their rates."""
_PLANAR = np.ix_((0, 1, 5), (0, 1, 5))
"""Rows and columns of x, y and rotation about z in the (6, 6) covariance of a message."""


def wheel_odometry_message(
    pose: PlanarPose, twist: PlanarTwist, stamp_ns: int, odom_frame: str, base_link: str
) -> Odometry:
    """Odometry message; the pose is in the odom frame, the twist in that of base_link."""
    return Odometry(
        header=header(stamp_ns, odom_frame),
        child_frame_id=base_link,
        pose=_pose_message(pose),
        twist=_twist_message(twist),
    )


def odom_from_base_link(pose: PlanarPose) -> Float64Array:
    """(4, 4) pose of base_link in the frame in which the odometry is continuous."""
    return matrices_from_xyz_rpy(np.array([pose.x_m, pose.y_m, 0.0]), np.array([0.0, 0.0, pose.yaw_rad]))


def _pose_message(pose: PlanarPose) -> PoseWithCovariance:
    message = PoseWithCovariance(covariance=_covariance(pose.covariance))
    message.pose.position = point_message(np.array([pose.x_m, pose.y_m, 0.0]))
    message.pose.orientation = quaternion_message(quaternion_from_rpy(np.array([0.0, 0.0, pose.yaw_rad])))
    return message


def _twist_message(twist: PlanarTwist) -> TwistWithCovariance:
    message = TwistWithCovariance(covariance=_covariance(twist.covariance))
    message.twist.linear = vector_message(np.array([twist.forward_mps, twist.left_mps, 0.0]))
    message.twist.angular = vector_message(np.array([0.0, 0.0, twist.yaw_rate_radps]))
    return message


def _covariance(planar: Float64Array) -> list[float]:
    """The 36 numbers of a message's covariance from (3, 3) of x, y and rotation about z."""
    covariance = UNMEASURED_VARIANCE * np.eye(6)
    covariance[_PLANAR] = planar
    return [float(value) for value in covariance.ravel()]
