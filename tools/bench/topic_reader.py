"""Subscribes to all sensors of a scene, as a perception stack would, so that every image is drawn and sent.

Usage: ``python -m tools.bench.topic_reader SCENE``, with a file that holds the scene's specification as JSON.
"""

import sys
from contextlib import suppress
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException

from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.qos import rclpy_qos, reader_qos_of
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.ros.nodes.lifeline import end_with_supervisor
from simbev_ros.schema.scene.spec import SceneSpec


def main() -> None:
    """Receive messages until the process or its supervisor ends."""
    end_with_supervisor()
    spec = SceneSpec.from_json(Path(sys.argv[1]).read_text(encoding="utf-8"))
    rclpy.init()
    node = rclpy.create_node("topic_reader")
    for topic in manifest(spec, compressed_images=False):
        if topic.sensor:
            qos = rclpy_qos(reader_qos_of(topic, live=True))
            node.create_subscription(message_class(topic.type), topic.name, lambda _: None, qos)
    with suppress(ExternalShutdownException):  # SIGTERM
        rclpy.spin(node)
    node.destroy_node()
    rclpy.utilities.try_shutdown()


if __name__ == "__main__":
    main()
