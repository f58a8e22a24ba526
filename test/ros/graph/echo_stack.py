"""A perception stack that answers with the ground truth, except for ticks that its options exclude."""

import argparse
import sys
import time

import numpy as np
import rclpy
from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header, String
from visualization_msgs.msg import MarkerArray

from simbev_ros.ros.msgs.images import labels_from_image
from simbev_ros.ros.msgs.stamps import header, stamp_of
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.schema.scene.spec import SceneSpec

LATCHED, EVERY = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL), QoSProfile(depth=16)
CHANNELS, CLASSES = 14, ("road", "car", "pedestrian")


class EchoStack(Node):
    """Republishes boxes and labels as predictions; reports ticks as ``echo`` with ``--reports``.

    With ``--agent`` it is the stack of that agent, called ``<agent>_echo``.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__(f"{options.agent}_echo" if options.agent else "echo")
        agent, answers = options.agent or "ego", f"/{options.agent}" if options.agent else ""
        self.options, self.spec, self.polls = options, None, 0
        self.ready = self.create_publisher(Header, "/sync/ready", LATCHED)
        self.create_subscription(String, "/world/scene", self.on_scene, LATCHED)
        if options.displays:
            self.inputs = [
                self.relay(MarkerArray, f"/{agent}/boxes/markers", f"{answers}/prediction/boxes"),
                *(
                    self.relay(OccupancyGrid, f"/{agent}/bev/{name}/grid", f"{answers}/prediction/bev/{name}")
                    for name in CLASSES
                ),
            ]
        else:
            self.boxes = self.create_publisher(PointCloud2, f"{answers}/prediction/boxes", EVERY)
            self.grids = self.create_publisher(Image, f"{answers}/prediction/bev", EVERY)
            self.inputs = [
                self.create_subscription(PointCloud2, f"/{agent}/boxes", self.on_boxes, EVERY),
                self.create_subscription(Image, f"/{agent}/bev/labels", self.on_labels, EVERY),
            ]
        self.done: dict[int, int] = {}
        self.create_timer(0.05, self.load, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def on_scene(self, message: String) -> None:
        self.spec, self.polls = SceneSpec.model_validate_json(message.data), 0
        self.done.clear()

    def load(self) -> None:
        if self.spec is not None and self.polls < 10 and all(each.get_publisher_count() for each in self.inputs):
            self.polls += 1
            if self.polls == 10:
                self.report(-1)

    def report(self, tick: int) -> None:
        if self.options.reports:
            self.ready.publish(header(self.spec.stamp_ns(tick), f"{self.get_name()}:{self.spec.name}"))

    def finish(self, tick: int) -> None:
        self.done[tick] = self.done.get(tick, 0) + 1
        if self.done[tick] == len(self.inputs):
            self.report(tick)

    def skips(self, tick: int) -> bool:
        return bool(self.options.skip) and tick % self.options.skip == self.options.skip - 1

    def relay(self, kind: type, source: str, answer: str):
        publisher = self.create_publisher(kind, answer, EVERY)

        def receive(message) -> None:
            publisher.publish(message)
            first = message.markers[0] if kind is MarkerArray else message
            self.finish(self.spec.tick_of(stamp_of(first.header.stamp)))

        return self.create_subscription(kind, source, receive, EVERY)

    def on_boxes(self, message: PointCloud2) -> None:
        tick = self.spec.tick_of(stamp_of(message.header.stamp))
        if tick == self.options.die_at:
            sys.exit("out of memory")
        if tick == self.options.hang_at:
            time.sleep(1000)
        truth = table_from_message(message)
        kinds = [(name, "<f4") for name in ("length", "width", "height", "yaw", "vx", "vy", "vz", "score")]
        table = np.zeros(len(truth), [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("class", "u1"), *kinds])
        for name in set(table.dtype.names) - {"score"}:
            table[name] = truth[name]
        table["score"] = 0.5
        if tick == self.options.garble:
            self.boxes.publish(PointCloud2(header=message.header, width=3, height=1, point_step=4))
        elif not self.skips(tick):
            self.boxes.publish(message_from_table(table, stamp_of(message.header.stamp), "map"))
        self.finish(tick)

    def on_labels(self, message: Image) -> None:
        tick = self.spec.tick_of(stamp_of(message.header.stamp))
        labels = labels_from_image(message)
        layers = (labels[..., None] >> np.arange(CHANNELS, dtype=np.uint16) & 1).astype(np.uint8) * 255
        answer = Image(header=message.header, height=message.height, width=message.width, encoding=f"8UC{CHANNELS}")
        answer.step, answer.data = CHANNELS * message.width, layers.tobytes()
        if not self.skips(tick):
            self.grids.publish(answer)
        self.finish(tick)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--skip", type=int, default=0, help="leave every Nth tick unanswered")
    parser.add_argument("--agent", default="")
    parser.add_argument("--displays", action="store_true")
    parser.add_argument("--die-at", type=int, default=-1)
    parser.add_argument("--garble", type=int, default=-1, help="tick with boxes that are sent without columns")
    parser.add_argument("--hang-at", type=int, default=-1)
    parser.add_argument("--reports", action="store_true")
    rclpy.init()
    rclpy.spin(EchoStack(parser.parse_args()))


if __name__ == "__main__":
    main()
