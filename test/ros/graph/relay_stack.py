"""A perception stack that answers with the graph's visualization topics, in the frame of its lidar.

Cubes of /ego/boxes/markers become boxes, OccupancyGrids of single classes scores.
"""

import numpy as np
import rclpy
from geometry_msgs.msg import Point
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.dataset.calibration import calibrations
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion, quaternion_from_rpy
from simbev_ros.ros.msgs.stamps import header, stamp_of
from simbev_ros.ros.msgs.world import map_from_base_link, quaternion_message
from simbev_ros.schema.scene.spec import SceneSpec

LATCHED, EVERY = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL), QoSProfile(depth=16)
CLASSES = ("road", "car", "pedestrian")


class RelayStack(Node):
    """Relays markers and occupancy grids as predictions; reports ticks as ``relay``."""

    def __init__(self) -> None:
        super().__init__("relay")
        self.spec, self.polls = None, 0
        self.odometry: dict[int, Odometry] = {}
        self.cubes: dict[int, MarkerArray] = {}
        self.missing: dict[int, int] = {}
        self.boxes = self.create_publisher(MarkerArray, "/prediction/boxes", EVERY)
        self.ready = self.create_publisher(Header, "/sync/ready", LATCHED)
        self.grids = {name: self.create_publisher(OccupancyGrid, f"/prediction/bev/{name}", EVERY) for name in CLASSES}
        self.create_subscription(String, "/world/scene", self.on_scene, LATCHED)
        self.inputs = [
            self.create_subscription(Odometry, "/ego/odom", self.on_odometry, EVERY),
            self.create_subscription(MarkerArray, "/ego/boxes/markers", self.on_cubes, EVERY),
        ]
        for name in CLASSES:
            self.inputs.append(
                self.create_subscription(OccupancyGrid, f"/ego/bev/{name}/grid", self.relay(name), EVERY)
            )
        self.create_timer(0.05, self.load, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def on_scene(self, message: String) -> None:
        self.spec = SceneSpec.model_validate_json(message.data)
        self.ego_from_lidar = calibrations(self.spec.agents[0].rig)["lidar"].ego_from_sensor

    def load(self) -> None:
        if self.spec is not None and self.polls < 10 and all(each.get_publisher_count() for each in self.inputs):
            self.polls += 1
            if self.polls == 10:
                self.report(self.spec.stamp_ns(-1))

    def report(self, stamp_ns: int) -> None:
        self.ready.publish(header(stamp_ns, f"relay:{self.spec.name}"))

    def relay(self, name: str):
        def receive(message: OccupancyGrid) -> None:
            self.grids[name].publish(message)
            self.finish(stamp_of(message.header.stamp))

        return receive

    def on_odometry(self, message: Odometry) -> None:
        self.odometry[stamp_of(message.header.stamp)] = message
        self.answer()

    def on_cubes(self, message: MarkerArray) -> None:
        self.cubes[stamp_of(message.markers[0].header.stamp)] = message
        self.answer()

    def answer(self) -> None:
        """Answer all frames whose cubes and ego pose have arrived."""
        for stamp_ns in self.odometry.keys() & self.cubes.keys():
            lidar_from_map = np.linalg.inv(map_from_base_link(self.odometry.pop(stamp_ns)) @ self.ego_from_lidar)
            message = self.cubes.pop(stamp_ns)
            for each in message.markers:
                each.header.frame_id = "ego/lidar"
                if each.type == Marker.CUBE:
                    turn(each, lidar_from_map)
            self.boxes.publish(message)
            self.finish(stamp_ns)

    def finish(self, stamp_ns: int) -> None:
        self.missing[stamp_ns] = self.missing.get(stamp_ns, 1 + len(CLASSES)) - 1
        if self.missing[stamp_ns] == 0:
            self.report(stamp_ns)


def turn(cube: Marker, frame_from_map: np.ndarray) -> None:
    """Transform a cube into another frame, upright in that frame."""
    place, turned = cube.pose.position, cube.pose.orientation
    values = [place.x, place.y, place.z], [turned.x, turned.y, turned.z, turned.w]
    frame_from_cube = frame_from_map @ matrices_from_xyz_quaternion(*map(np.array, values))
    cube.pose.position = Point(**dict(zip("xyz", frame_from_cube[:3, 3].tolist(), strict=True)))
    yaw_rad = np.arctan2(frame_from_cube[1, 0], frame_from_cube[0, 0])
    cube.pose.orientation = quaternion_message(quaternion_from_rpy(np.array([0.0, 0.0, yaw_rad])))


def main() -> None:
    rclpy.init()
    rclpy.spin(RelayStack())


if __name__ == "__main__":
    main()
