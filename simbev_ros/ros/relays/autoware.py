"""The relay for Autoware: sensing, driving and ground truth in its messages.

Run ``python -m simbev_ros.ros.relays.autoware``. The first start makes Autoware's message packages.
"""

import importlib
import sys
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.message_packages.definitions import AUTOWARE_MESSAGES
from simbev_ros.foundation.installation.message_packages.installer import install_missing, survey_packages
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.relays.autoware_messages import initial_pose, velocity_message
from simbev_ros.ros.relays.autoware_points import autoware_points
from simbev_ros.ros.relays.running import Relay, run
from simbev_ros.schema.scene.spec import SceneSpec

_RELIABLE = QoSProfile(depth=5)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class AutowareRelay(Relay):
    """Publishes what Autoware reads in a form of its own, while there are subscribers, and drives as it commands.

    Topics, which can be remapped as usual, are those of docs/guide/autoware.md. Without Autoware's message packages
    it relays the clouds, the velocity and the initial pose.

    Parameters:
        rolling: Whether the lidar is; see ``autoware_points``.
        base_frame: Frame of the velocity and of reports.
        lockstep: Whether each tick waits for a command of Autoware.
        lanelet2_map: Autoware's map, whose ids traffic lights get; by default that of the scene.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__("autoware_relay", context=context)
        self._rolling = bool(self.declare_parameter("rolling", False).value)
        self._base_frame = str(self.declare_parameter("base_frame", "base_link").value)
        waits = bool(self.declare_parameter("lockstep", False).value)
        lanelet2_map = str(self.declare_parameter("lanelet2_map", "").value)
        self._points = self.create_publisher(PointCloud2, "/sensing/lidar/top/pointcloud_raw_ex", _RELIABLE)
        self._velocity = self.create_publisher(
            TwistWithCovarianceStamped, "/sensing/vehicle_velocity_converter/twist_with_covariance", _RELIABLE
        )
        self._initial = self.create_publisher(PoseWithCovarianceStamped, "/initialpose3d", _RELIABLE)
        self._has_pose = False
        self._driving: Any = None
        self._truth: Any = None
        if all(state.is_there for state in survey_packages(AUTOWARE_MESSAGES)):
            of_package = importlib.import_module  # these modules need the packages
            parts = "simbev_ros.ros.relays.autoware_"
            self._driving = of_package(f"{parts}driving").AutowareDriving(self, self._base_frame, waits=waits)
            self._truth = of_package(f"{parts}truth").AutowareTruth(self, Path(lanelet2_map) if lanelet2_map else None)
        self.listen(PointCloud2, "/ego/lidar/points", self._on_points, qos_profile_sensor_data)
        self._odometry = self.listen(Odometry, "/ego/odom", self._on_odometry, QoSProfile(depth=100))
        self.listen(String, "/world/scene", self._on_scene, _LATCHED)

    def _on_scene(self, message: String) -> None:
        self._has_pose = False
        scene = SceneSpec.from_json(message.data)
        if self._driving is not None:
            self._driving.start_scene(scene, self._odometry)
        if self._truth is not None:
            self._truth.start_scene(scene)

    def _on_points(self, message: PointCloud2) -> None:
        if self._points.get_subscription_count():
            rows, first_ns = autoware_points(table_from_message(message), rolling=self._rolling)
            stamp_ns = stamp_of(message.header.stamp) + first_ns
            self._points.publish(message_from_table(rows, stamp_ns, message.header.frame_id))

    def _on_odometry(self, message: Odometry) -> None:
        if self._velocity.get_subscription_count():
            self._velocity.publish(velocity_message(message, self._base_frame))
        if self._driving is not None:
            self._driving.on_odometry(message)
        if not self._has_pose and self._initial.get_subscription_count():
            self._initial.publish(initial_pose(message))
            self._has_pose = True


def make_messages() -> None:
    """Make Autoware's message packages if they are missing; say in one line what is missing if that is impossible."""
    try:
        install_missing(lambda package: print(f"making {package.name}", flush=True), AUTOWARE_MESSAGES)
    except SimbevError as error:
        print(f"warning: only clouds, velocity and initial pose are relayed: {error}", file=sys.stderr)
    importlib.invalidate_caches()


if __name__ == "__main__":
    make_messages()
    run(AutowareRelay)
