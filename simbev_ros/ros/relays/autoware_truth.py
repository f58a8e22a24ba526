"""Part of the relay for Autoware that publishes the ground truth in place of its perception."""

from pathlib import Path

from autoware_perception_msgs.msg import PredictedObjects, TrackedObjects, TrafficLightGroupArray
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Table
from simbev_ros.maps.lanelet2.reader import has_lanelets
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import rows_from_message
from simbev_ros.ros.relays.autoware_objects import predicted_objects, tracked_objects
from simbev_ros.ros.relays.autoware_signals import lights_message, read_light_groups, rows_of_groups
from simbev_ros.ros.relays.running import Relay
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import SIGNAL_DTYPE

_RELIABLE = QoSProfile(depth=5)


class AutowareTruth:
    """Publishes objects and traffic lights while there are subscribers.

    Args:
        node: The relay.
        lanelet2_map: The Lanelet2 file that Autoware has; None: that of the scene, if its map is one.
    """

    def __init__(self, node: Relay, lanelet2_map: Path | None) -> None:
        self._node, self._given, self._map = node, lanelet2_map, lanelet2_map
        self._rows: dict[int, list[int]] | None = None
        prefix = "/perception/object_recognition"
        self._predicted = node.create_publisher(PredictedObjects, f"{prefix}/objects", _RELIABLE)
        self._tracked = node.create_publisher(TrackedObjects, f"{prefix}/tracking/objects", _RELIABLE)
        lights = "/perception/traffic_light_recognition/traffic_signals"
        self._lights = node.create_publisher(TrafficLightGroupArray, lights, _RELIABLE)
        node.listen(PointCloud2, "/ego/boxes", self._on_boxes, qos_profile_sensor_data)
        node.listen(PointCloud2, "/world/signals", self._on_signals, qos_profile_sensor_data)

    def start_scene(self, scene: SceneSpec) -> None:
        """Take the ids of traffic lights from the map of a scene, unless a file was given."""
        own = Path(scene.map.path) if scene.map.path else None
        self._map, self._rows = self._given or own, None

    def _on_boxes(self, message: PointCloud2) -> None:
        stamp_ns = stamp_of(message.header.stamp)
        for publisher, convert in ((self._predicted, predicted_objects), (self._tracked, tracked_objects)):
            if publisher.get_subscription_count():
                publisher.publish(convert(rows_from_message(message, BOX_DTYPE), stamp_ns))

    def _on_signals(self, message: PointCloud2) -> None:
        if self._lights.get_subscription_count():
            signals = rows_from_message(message, SIGNAL_DTYPE)
            if self._rows is None:
                self._rows = self._find_rows(signals)
            self._lights.publish(lights_message(self._rows, signals, message.header.stamp))

    def _find_rows(self, signals: Table) -> dict[int, list[int]]:
        try:
            if self._map is None or not has_lanelets(self._map, self._map.suffix):
                raise InputError("no Lanelet2 file; start the relay with -p lanelet2_map:=FILE")
            rows = rows_of_groups(read_light_groups(self._map), signals)
        except InputError as error:
            self._node.get_logger().warning(f"traffic lights have no ids: {error}")
            return {}
        found = len({row for members in rows.values() for row in members})
        self._node.get_logger().info(f"{found} of {len(signals)} traffic lights are in {self._map}")
        return rows
