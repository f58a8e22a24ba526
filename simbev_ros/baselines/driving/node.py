"""The drivers as ROS nodes: the messages of a tick in, a nav_msgs/Path with the next positions out."""

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from simbev_ros.baselines.driving.drivers import DriverKind, RouteDriver
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.join import Driver
from simbev_ros.reference_stack.messages import table_of
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.ros.msgs.stamps import header, stamp_of
from simbev_ros.ros.msgs.world import MAP_FRAME, actors_from_message, map_from_base_link, signals_from_message
from simbev_ros.schema.scene.spec import SceneSpec

_ACTORS, _SIGNALS, _BOXES = "/world/actors", "/world/signals", "/prediction/boxes"


class RouteDriverNode:
    """Drives the vehicle of an agent in lockstep.

    Args:
        node: The node.
        kind: The driver.
        agent: Name of the agent.
    """

    def __init__(self, node: Node, kind: DriverKind, agent: str) -> None:
        self._kind, self._odometry = kind, f"/{agent}/odom"
        self._driver: RouteDriver | None = None
        inputs: dict[str, Any] = {self._odometry: Odometry}
        if kind is DriverKind.TRUTH:
            inputs |= {_ACTORS: PointCloud2, _SIGNALS: PointCloud2}
        if kind is DriverKind.LEARNED:
            inputs |= {_BOXES: PointCloud2}
        self._join = Driver(node, self._decide, inputs, (f"/{agent}/planned_path", Path), load=self._load)

    def _load(self, scene: dict[str, Any]) -> None:
        """Prepare to drive a scene; boxes come with the clouds of its first lidar."""
        self._driver = RouteDriver(self._kind, scene)
        if self._kind is DriverKind.LEARNED:
            spec = SceneSpec.model_validate(scene)
            lidar = next(each for each in spec.agents[0].rig.of_type(Lidar) if each.points)
            self._join.periods = {_BOXES: spec.period_ticks(lidar.rate_hz)}

    def _decide(self, inputs: dict[str, Any], scene: dict[str, Any]) -> Path:
        if self._driver is None:
            raise RuntimeError("a scene is decided on before it is loaded")
        odometry = inputs[self._odometry]
        pose = map_from_base_link(odometry)
        twist, stamp_ns = odometry.twist.twist.linear, stamp_of(odometry.header.stamp)
        actors = actors_from_message(inputs[_ACTORS]) if _ACTORS in inputs else None
        signals = signals_from_message(inputs[_SIGNALS]) if _SIGNALS in inputs else None
        boxes = _boxes_at(stamp_ns, inputs[_BOXES]) if _BOXES in inputs else None
        where = (float(pose[0, 3]), float(pose[1, 3]), math.atan2(pose[1, 0], pose[0, 0]))
        positions_m = self._driver.positions(np.array(where), twist.x, actors, boxes, signals)
        return path_message(positions_m, stamp_ns, scene["tick_ns"])


def _boxes_at(stamp_ns: int, message: PointCloud2) -> Table:
    """The boxes of a message where they will be at a stamp if they keep their velocities."""
    boxes = table_of(message, BOX_DTYPE).copy()
    age_s = (stamp_ns - stamp_of(message.header.stamp)) / NS_PER_S
    boxes["x"] += age_s * boxes["vx"]
    boxes["y"] += age_s * boxes["vy"]
    return boxes


def path_message(positions_m: Float64Array, stamp_ns: int, tick_ns: int) -> Path:
    """Path through (K, 2) positions, map frame, the first at a stamp and then one for each tick."""
    message = Path(header=header(stamp_ns, MAP_FRAME))
    for tick, (x_m, y_m) in enumerate(positions_m.tolist()):
        pose = PoseStamped(header=header(stamp_ns + tick * tick_ns, MAP_FRAME))
        pose.pose.position.x, pose.pose.position.y = x_m, y_m
        message.poses.append(pose)
    return message
