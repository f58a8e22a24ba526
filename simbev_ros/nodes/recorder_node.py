"""The recorder node: every message that a scene must have goes into its bag, tick by tick, in one fixed order."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from simbev_ros.msgs import topics
from simbev_ros.msgs.message_types import message_class
from simbev_ros.msgs.qos import LATCHED, qos_of, rclpy_qos
from simbev_ros.msgs.stamps import stamp_of_serialised
from simbev_ros.msgs.topics import Topic
from simbev_ros.msgs.transforms import ego_transform, serialised_transforms, static_transforms
from simbev_ros.nodes.graph_node import GraphNode
from simbev_ros.recording.accounting import Accounting, Schedule, Verdict
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, MAP_ATTACHMENT, SCENE_ATTACHMENT, scene_folder
from simbev_ros.scene.spec import SceneSpec

_LIVE_GRACE_TICKS = 40
"""Live: a tick is written, complete or not, when the clock is so far ahead of it."""


class RecorderNode(GraphNode):
    """Writes one bag a scene. A tick is reported as finished when all its messages are in the file."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._dataset = Path(self.declared("dataset", "", "Folder of the dataset that scenes are written to"))
        self._config = self.declared("config", "", "The configuration, kept as an attachment of each bag")
        self._compressed = self.declared("compressed", True, "Record the compressed image topics instead of the raw")
        self._chunk_kib = self.declared("chunk_kib", 4096, "Size of a chunk before compression, KiB")
        self._taken: dict[str, Any] = {}
        self._spec: SceneSpec | None = None
        self._writer: SceneBagWriter | None = None
        self._loaded_reported = False
        self.create_subscription(String, topics.SCENE, self._on_scene, rclpy_qos(LATCHED), raw=True)
        self.create_wall_timer(0.05, self._report_loaded)

    def _on_scene(self, payload: bytes) -> None:
        self.close()
        scene_json: str = deserialize_message(payload, String).data
        self._spec = spec = SceneSpec.model_validate_json(scene_json)
        self._loaded_reported = False
        self._manifest = topics.manifest(spec, compressed_images=self._compressed)
        schedules = {topic.name: Schedule(0, topic.period_ticks) for topic in self._manifest}
        self._accounting = Accounting(schedules, start_ns=spec.start_ns, tick_ns=spec.tick_ns, ticks=spec.ticks)
        self._waiting: defaultdict[int, dict[str, tuple[int, bytes]]] = defaultdict(dict)
        self._next_tick = 0
        self._writer = SceneBagWriter(
            scene_folder(self._dataset, spec.split, spec.name), chunk_bytes=self._chunk_kib << 10
        )
        self._writer.add_attachment(SCENE_ATTACHMENT, "application/json", scene_json.encode())
        self._writer.add_attachment(CONFIG_ATTACHMENT, "application/yaml", self._config.encode())
        for topic in self._manifest:
            self._writer.add_topic(topic.name, topic.type, qos_of(topic, live=self.live))
            self._subscribe(topic)
        self._take(topics.SCENE, spec.start_ns, payload)
        self._take(topics.TF_STATIC, spec.start_ns, serialised_transforms(static_transforms(spec)))

    def _subscribe(self, topic: Topic) -> None:
        """Take a topic, once; a latched one anew for each scene: a new reader gets its present value and no other."""
        if topic.name in (topics.SCENE, topics.TF, topics.TF_STATIC):
            return
        if topic.name in self._taken:
            if topic.period_ticks > 0:
                return
            self.destroy_subscription(self._taken[topic.name])
        qos = rclpy_qos(qos_of(topic, live=self.live))
        callback = self._callback(topic)
        self._taken[topic.name] = self.create_subscription(
            message_class(topic.type), topic.name, callback, qos, raw=True
        )

    def _callback(self, topic: Topic) -> Callable[[bytes], None]:
        def receive(payload: bytes) -> None:
            if self._spec is None:
                return
            latched = topic.period_ticks == 0
            stamp_ns = self._spec.start_ns if latched else stamp_of_serialised(payload, topic.type)
            if stamp_ns is not None and stamp_ns >= self._spec.start_ns:
                self._take(topic.name, stamp_ns, payload)
                if topic.type == "nav_msgs/msg/Odometry":
                    transform = ego_transform(deserialize_message(payload, Odometry))
                    self._take(topics.TF, stamp_ns, serialised_transforms([transform]))

        return receive

    def _report_loaded(self) -> None:
        """Report the scene as loaded once every topic has its writer; a timer tries until then."""
        if self._spec is None or self._loaded_reported:
            return
        if all(subscription.get_publisher_count() > 0 for subscription in self._taken.values()):
            self._loaded_reported = True
            self.report_finished(self._spec, -1)  # of the lead-in nothing is recorded

    def _take(self, topic: str, stamp_ns: int, payload: bytes) -> None:
        """Enter a message into the books and write all ticks that are complete now."""
        spec = self._spec
        if spec is None or self._accounting.add(topic, stamp_ns) is not Verdict.EXPECTED:
            return
        tick = spec.tick_of(stamp_ns)
        self._waiting[tick][topic] = (stamp_ns, payload)
        last_tick = self._accounting.finished_tick
        if self.live:
            last_tick = max(last_tick, tick - _LIVE_GRACE_TICKS)
        self._write_until(spec, last_tick)
        if self._next_tick == spec.ticks:
            self._finish(spec)

    def _write_until(self, spec: SceneSpec, last_tick: int) -> None:
        while self._next_tick <= last_tick:
            with self.meter.busy():
                self._write_tick(self._next_tick)
            if self._next_tick < spec.ticks - 1:
                self.report_finished(spec, self._next_tick)
            self._next_tick += 1

    def _write_tick(self, tick: int) -> None:
        assert self._writer is not None
        messages = self._waiting.pop(tick, {})
        if topics.MAP in messages:
            map_text = deserialize_message(messages[topics.MAP][1], String).data
            self._writer.add_attachment(MAP_ATTACHMENT, "application/xml", map_text.encode())
        for topic in self._manifest:
            if topic.name in messages:
                self._writer.write(topic.name, *messages[topic.name])

    def _finish(self, spec: SceneSpec) -> None:
        """Give the bag its final name; only then is the last tick reported."""
        assert self._writer is not None
        self._writer.finish(self._accounting.report().custom_data(spec.name))
        self._writer = self._spec = None
        self.report_finished(spec, spec.ticks - 1)

    def close(self) -> None:
        """Close a bag that is not finished: all that has come is written, and it stays marked as partial."""
        if self._writer is None or self._spec is None:
            return
        for tick in sorted(self._waiting):
            self._write_tick(tick)
        report = self._accounting.report()
        if self.live and self._next_tick > 0:
            self._writer.finish(report.custom_data(self._spec.name))
        else:
            self._writer.abandon(report.custom_data(self._spec.name))
        self._writer = self._spec = None
