"""Converts our odometry to the velocity message that Autoware reads."""

from geometry_msgs.msg import TwistWithCovarianceStamped
from nav_msgs.msg import Odometry

_UNKNOWN = 10_000.0
"""Variance with which Autoware marks a velocity that is not measured."""
_FORWARD_VARIANCE_M2PS2, _YAW_VARIANCE_RAD2PS2 = 0.2**2, 0.1**2
"""Defaults of Autoware's vehicle_velocity_converter, for an odometry without noise, with variances of 0."""
_AXES = 6


def velocity_message(odometry: Odometry, frame: str) -> TwistWithCovarianceStamped:
    """Forward velocity and yaw rate of an odometry in a frame, as Autoware's vehicle_velocity_converter sends them."""
    message, measured = TwistWithCovarianceStamped(), odometry.twist
    message.header.stamp, message.header.frame_id = odometry.header.stamp, frame
    message.twist.twist.linear.x = measured.twist.linear.x
    message.twist.twist.angular.z = measured.twist.angular.z
    for axis in range(_AXES):
        message.twist.covariance[axis * (_AXES + 1)] = _UNKNOWN
    message.twist.covariance[0] = float(measured.covariance[0]) or _FORWARD_VARIANCE_M2PS2
    message.twist.covariance[-1] = float(measured.covariance[-1]) or _YAW_VARIANCE_RAD2PS2
    return message
