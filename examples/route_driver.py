"""Drives a route by pure pursuit at 80 % of the speed limit, in lockstep.

Run it beside ``simbev run my.yaml``, with ``ego: {driver: ackermann}`` and ``drive: {}`` in the configuration.
"""

import math
from typing import Any

import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry

from simbev_ros.join import Driver

WHEELBASE_M = 2.8


def decide(inputs: dict[str, Any], scene: dict[str, Any]) -> AckermannDriveStamped:
    """Steer to the point of the route a bit ahead (Coulter, CMU-RI-TR-92-01)."""
    odometry, route, command = inputs["/ego/odom"], scene["drive"]["route"], AckermannDriveStamped()
    pose, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    yaw_rad, speed_mps = 2.0 * math.atan2(turn.z, turn.w), odometry.twist.twist.linear.x
    offsets = [math.hypot(x - pose.x, y - pose.y) for x, y in zip(route["x_m"], route["y_m"], strict=True)]
    nearest = offsets.index(min(offsets))
    ahead = min(nearest + 5 + round(0.6 * speed_mps), len(offsets) - 1)
    angle_rad = math.atan2(route["y_m"][ahead] - pose.y, route["x_m"][ahead] - pose.x) - yaw_rad
    bend = abs(math.sin(angle_rad)) / max(offsets[ahead], 1.0)
    command.drive.steering_angle = math.atan2(2.0 * WHEELBASE_M * math.sin(angle_rad), max(offsets[ahead], 1.0))
    command.drive.speed = min(0.8 * route["limit_mps"][nearest], 1.0 / max(bend, 1e-3) ** 0.5)
    command.drive.acceleration = 2.5
    return command


if __name__ == "__main__":
    rclpy.init()
    node = rclpy.create_node("route_driver")
    Driver(node, decide, {"/ego/odom": Odometry}, ("/ego/ackermann_cmd", AckermannDriveStamped))
    rclpy.spin(node)
