"""The relay for Autoware: clouds in its point type, and velocity. Run ``python -m simbev_ros.ros.relays.autoware``."""

from geometry_msgs.msg import TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2

from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.relays.autoware_messages import velocity_message
from simbev_ros.ros.relays.autoware_points import autoware_points
from simbev_ros.ros.relays.running import Relay, run

_RELIABLE = QoSProfile(depth=5)


class AutowareRelay(Relay):
    """Publishes what Autoware reads in a form of its own, while there are subscribers.

    Topics, which can be remapped as usual: /ego/lidar/points and /ego/odom in;
    /sensing/lidar/top/pointcloud_raw_ex and /sensing/vehicle_velocity_converter/twist_with_covariance out.

    Parameters:
        rolling: Whether the lidar is; see ``autoware_points``.
        base_frame: Frame of the velocity.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__("autoware_relay", context=context)
        self._rolling = bool(self.declare_parameter("rolling", False).value)
        self._base_frame = str(self.declare_parameter("base_frame", "base_link").value)
        self._points = self.create_publisher(PointCloud2, "/sensing/lidar/top/pointcloud_raw_ex", _RELIABLE)
        self._velocity = self.create_publisher(
            TwistWithCovarianceStamped, "/sensing/vehicle_velocity_converter/twist_with_covariance", _RELIABLE
        )
        self.listen(PointCloud2, "/ego/lidar/points", self._on_points, qos_profile_sensor_data)
        self.listen(Odometry, "/ego/odom", self._on_odometry, qos_profile_sensor_data)

    def _on_points(self, message: PointCloud2) -> None:
        if self._points.get_subscription_count():
            rows, first_ns = autoware_points(table_from_message(message), rolling=self._rolling)
            stamp_ns = stamp_of(message.header.stamp) + first_ns
            self._points.publish(message_from_table(rows, stamp_ns, message.header.frame_id))

    def _on_odometry(self, message: Odometry) -> None:
        if self._velocity.get_subscription_count():
            self._velocity.publish(velocity_message(message, self._base_frame))


if __name__ == "__main__":
    run(AutowareRelay)
