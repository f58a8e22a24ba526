"""A running graph sends transforms, detections and typed messages to subscribers, and they say what its tables say."""

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from commands import Command
from scipy.spatial.transform import Rotation
from subscriber import outside_node

from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.ros.msgs.message_types import is_installed, message_class
from simbev_ros.ros.msgs.qos import LATCHED, STATE_READER, rclpy_qos
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import table_from_message

pytestmark = [
    pytest.mark.graph,
    pytest.mark.skipif(
        not all(
            map(is_installed, ("tf2_msgs/msg/TFMessage", "vision_msgs/msg/LabelInfo", "simbev_interfaces/msg/Box"))
        ),
        reason="message packages are missing, see simbev doctor",
    ),
]

TABLES = {
    "/ego/odom": "nav_msgs/msg/Odometry",
    "/ego/boxes": "sensor_msgs/msg/PointCloud2",
    "/ego/cam_front/boxes": "sensor_msgs/msg/PointCloud2",
    "/world/actors": "sensor_msgs/msg/PointCloud2",
}
ON_DEMAND = {
    "/tf": "tf2_msgs/msg/TFMessage",
    "/ego/detections": "vision_msgs/msg/Detection3DArray",
    "/ego/cam_front/detections": "vision_msgs/msg/Detection2DArray",
    "/ego/cam_front/detections/amodal": "vision_msgs/msg/Detection2DArray",
    "/ego/boxes/typed": "simbev_interfaces/msg/Boxes",
    "/world/actors/typed": "simbev_interfaces/msg/Actors",
    "/world/weather/typed": "simbev_interfaces/msg/Weather",
}
ONCE = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/world/scene/typed": "simbev_interfaces/msg/Scene",
    "/ego/bev/label_info": "vision_msgs/msg/LabelInfo",
    "/ego/cam_front/semantic/label_info": "vision_msgs/msg/LabelInfo",
}
ROWS = {
    "/ego/detections": ("/ego/boxes", "detections"),
    "/ego/cam_front/detections/amodal": ("/ego/cam_front/boxes", "detections"),
    "/ego/boxes/typed": ("/ego/boxes", "boxes"),
    "/world/actors/typed": ("/world/actors", "actors"),
}
"""Topics whose messages have an item for each row of a table: the table's topic, and the field with the items."""
_PAIRS = 5


class Listener:
    """A node that keeps the messages of all these topics, by topic and stamp in ns."""

    def __init__(self, node: Any) -> None:
        self.messages: dict[str, dict[int, Any]] = defaultdict(dict)
        for name, type_name in (TABLES | ON_DEMAND | ONCE).items():
            qos = rclpy_qos(LATCHED if name in ONCE else STATE_READER)
            node.create_subscription(message_class(type_name), name, self._keep(name), qos)

    def _keep(self, name: str) -> Callable[[Any], None]:
        def keep(message: Any) -> None:
            stamped = message.transforms[0] if hasattr(message, "transforms") else message
            self.messages[name][stamp_of(stamped.header.stamp)] = message

        return keep

    def pairs(self, table: str, other: str) -> list[tuple[Any, Any]]:
        """Messages of two topics with equal stamps."""
        first, second = self.messages[table], self.messages[other]
        return [(first[stamp_ns], second[stamp_ns]) for stamp_ns in sorted(first.keys() & second.keys())]

    def only(self, name: str) -> Any:
        """The one message of a latched topic."""
        [message] = self.messages[name].values()
        return message

    @property
    def has_enough(self) -> bool:
        """Whether every topic has sent messages that can be compared."""
        frequent = all(len(self.messages[name]) >= _PAIRS for name in TABLES | ON_DEMAND)
        return frequent and all(self.messages[name] for name in ONCE)


@pytest.fixture(scope="module")
def listener(graph: Command) -> Listener:
    """What a graph has sent to a node that subscribes to all of these topics."""
    with outside_node("listener") as (node, spin_until):
        listener = Listener(node)
        graph.wait_for(lambda: listener.has_enough, spin_until)
    return listener


def test_the_transforms_of_tf_lead_to_the_pose_of_the_odometry(listener: Listener) -> None:
    pairs = listener.pairs("/ego/odom", "/tf")
    assert len(pairs) >= _PAIRS
    for odometry, message in pairs:
        names = [(each.header.frame_id, each.child_frame_id) for each in message.transforms]
        assert names == [("map", "ego/odom"), ("ego/odom", "ego/base_link")]
        map_from_odom, odom_from_base = (
            pose_matrix(each.transform.translation, each.transform.rotation) for each in message.transforms
        )
        truth = pose_matrix(odometry.pose.pose.position, odometry.pose.pose.orientation)
        assert np.abs(map_from_odom @ odom_from_base - truth).max() < 1e-9


def pose_matrix(position: Any, turn: Any) -> np.ndarray:
    """(4, 4) pose from a position or translation and a quaternion."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    matrix[:3, 3] = position.x, position.y, position.z
    return matrix


def test_static_transforms_reach_every_sensor(listener: Listener) -> None:
    children = {each.child_frame_id: each.header.frame_id for each in listener.only("/tf_static").transforms}
    assert children["ego/cam_front_optical"] == "ego/cam_front"
    assert children["ego/cam_front"] == children["ego/gnss"] == "ego/base_link"


@pytest.mark.parametrize("name", ROWS)
def test_messages_have_the_rows_of_the_table_of_their_tick(listener: Listener, name: str) -> None:
    source, field = ROWS[name]
    pairs = listener.pairs(source, name)
    assert len(pairs) >= _PAIRS
    for message, made in pairs:
        assert [int(row.id) for row in getattr(made, field)] == table_from_message(message)["id"].tolist()


def test_names_of_labels_and_facts_of_the_scene_are_latched(listener: Listener) -> None:
    bits = {each.class_id: each.class_name for each in listener.only("/ego/bev/label_info").class_map}
    assert bits == {1 << index: name for index, name in enumerate(BEV_CLASSES)}
    tags = {each.class_id: each.class_name for each in listener.only("/ego/cam_front/semantic/label_info").class_map}
    assert (tags[14], tags[24]) == ("car", "road_line")
    assert listener.only("/world/scene/typed").name == "Blocks-0000"
