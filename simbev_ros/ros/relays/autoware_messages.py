"""Converts our odometry to the velocity and the initial pose that Autoware reads."""

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry

_UNKNOWN = 10_000.0
"""Variance with which Autoware marks a velocity that is not measured."""
_FORWARD_VARIANCE_M2PS2, _YAW_VARIANCE_RAD2PS2 = 0.2**2, 0.1**2
"""Defaults of Autoware's vehicle_velocity_converter, for an odometry without noise, with variances of 0."""
_POSITION_VARIANCE_M2, _ANGLE_VARIANCE_RAD2 = 0.1**2, 0.01**2
"""Of an initial pose: that of the simulator is exact, but filters need a variance."""


def velocity_message(odometry: Odometry, frame: str) -> TwistWithCovarianceStamped:
    """Forward velocity and yaw rate of an odometry in a frame, as Autoware's vehicle_velocity_converter sends them."""
    message, measured = TwistWithCovarianceStamped(), odometry.twist
    message.header.stamp, message.header.frame_id = odometry.header.stamp, frame
    message.twist.twist.linear.x = measured.twist.linear.x
    message.twist.twist.angular.z = measured.twist.angular.z
    forward = measured.covariance[0] or _FORWARD_VARIANCE_M2PS2
    yaw = measured.covariance[-1] or _YAW_VARIANCE_RAD2PS2
    message.twist.covariance = np.diag([forward, *[_UNKNOWN] * 4, yaw]).ravel()
    return message


def initial_pose(odometry: Odometry) -> PoseWithCovarianceStamped:
    """The pose of an odometry, from which localization starts."""
    message = PoseWithCovarianceStamped(header=odometry.header)
    message.pose.pose = odometry.pose.pose
    message.pose.covariance = np.diag([_POSITION_VARIANCE_M2] * 3 + [_ANGLE_VARIANCE_RAD2] * 3).ravel()
    return message
