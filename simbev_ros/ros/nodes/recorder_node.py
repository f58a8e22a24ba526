"""The recorder node: writes every message that a scene must have into its bag, tick by tick, in one fixed order.

Messages wait until their tick is complete, so that the bytes of a bag do not depend on the order of arrival.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from operator import index
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from simbev_ros.config.scenario import Recording
from simbev_ros.foundation.errors import DiskError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.process_memory import return_freed_memory
from simbev_ros.maps.build import load_source
from simbev_ros.recording.accounting import Accounting, Schedule, Verdict
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.canonical import canonical_cdr, text_of_string
from simbev_ros.recording.layout import (
    CONFIG_ATTACHMENT,
    LEAD_IN_ATTACHMENT,
    MAP_ATTACHMENT,
    MAP_SOURCE_ATTACHMENT,
    SCENE_ATTACHMENT,
    TRAJECTORIES_ATTACHMENT,
    scene_folder,
)
from simbev_ros.recording.lead_in import lead_in_attachment
from simbev_ros.recording.reader import RawMessage
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.derived_messages import Maker, message_makers
from simbev_ros.ros.msgs.message_types import message_class, require_installed
from simbev_ros.ros.msgs.qos import STEERING, rclpy_qos, reader_qos_of
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.transforms import serialize_transforms, static_transforms
from simbev_ros.ros.msgs.typed_topics import radar_scans, typed_topics
from simbev_ros.ros.msgs.world import actors_from_message, signals_from_message, weather_from_message
from simbev_ros.ros.nodes.graph_node import MALFORMED, GraphNode
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.trajectories import TrackRecorder, tracks_to_npz
from simbev_ros.simulation.annotation.boxes.boxes import class_of_blueprint

_REPLAYED = (topics.ACTORS, topics.SIGNALS)
_READERS: Mapping[str, Callable[[Any], object]] = {
    topics.ACTORS: actors_from_message,
    topics.SIGNALS: signals_from_message,
    topics.WEATHER: weather_from_message,
}
"""Readers of the topics that a replay is made from, which check their content."""
_LIVE_GRACE_TICKS = 40
"""Live: number of ticks after which a tick is written although messages are missing."""


class RecorderNode(GraphNode):
    """Writes one bag per scene.

    A tick is reported as finished when all its messages are in the file, the tick after the last when the bag is
    closed.
    """

    reuses_large_buffers = True

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._dataset = Path(
            self.declare_read_only("dataset", "", "Folder of the dataset into which scenes are written")
        )
        self._config = self.declare_read_only("config", "", "The configuration as YAML, attached to each bag")
        self._recording = self.declare_section("recording", Recording)
        self._subscriptions_by_topic: dict[str, Any] = {}
        self._spec: SceneSpec | None = None
        self._end: SceneEnd | None = None
        self._lead_in: list[RawMessage] = []
        self._writer: SceneBagWriter | None = None
        self._loaded_reported = False
        self.follow_scenes(self._on_scene)
        self.create_subscription(String, topics.END, self._on_end, rclpy_qos(STEERING))
        self.create_wall_timer(0.05, self._report_loaded)

    def _on_scene(self, scene_json: str, payload: bytes) -> None:
        self.close()
        self._spec = spec = SceneSpec.from_json(scene_json)
        self._end, self._lead_in, self._clock_ns = None, [], -1
        self._scores = dict[int, bytes]()
        self._loaded_reported = False
        chosen = topics.TopicFilter(self._recording.topics)
        typed = typed_topics(spec) if "messages" in self._recording.forms else radar_scans(spec)
        sent = topics.manifest(spec, compressed_images=self._recording.images == "compressed")
        all_topics = (*sent, *(each.topic for each in typed))
        self._manifest = {topic.name: topic for topic in all_topics if topic.name in chosen}
        self._makers = message_makers(spec, typed, self._manifest)
        schedules = {name: _schedule(topic) for name, topic in self._manifest.items()}
        self._accounting = Accounting(schedules, start_ns=spec.start_ns, tick_ns=spec.tick_ns, ticks=spec.ticks)
        self._waiting: defaultdict[int, defaultdict[str, list[tuple[int, memoryview]]]] = defaultdict(_message_lists)
        self._next_tick = 0
        self._tracker = TrackRecorder(spec.tick_ns, class_of_blueprint())
        self._writer = bag_writer(scene_folder(self._dataset, spec.split, spec.name), self._recording)
        self._writer.add_attachment(SCENE_ATTACHMENT, "application/json", scene_json.encode())
        config = self._last_request.config if self._last_request is not None else None
        self._writer.add_attachment(CONFIG_ATTACHMENT, "application/yaml", (config or self._config).encode())
        if spec.map.path:
            self._writer.add_attachment(MAP_SOURCE_ATTACHMENT, "application/x-bzip2", load_source(spec.map))
        for topic in self._manifest.values():
            self._writer.add_topic(topic.name, topic.type, self.offered_qos(topic), separate_chunks=topic.sensor)
        made = {name for of_source in self._makers.values() for name in of_source}
        for topic in sent:
            if topic.name not in made and (topic.name in self._manifest or topic.name in self._makers):
                self._subscribe(topic)
        self._record_own(topics.SCENE, spec.start_ns, payload)
        for name, make in self._makers.get(topics.SCENE, {}).items():
            self._record(name, spec.start_ns, memoryview(make(payload, spec.start_ns)))
        self._record_own(topics.TF_STATIC, spec.start_ns, serialize_transforms(static_transforms(spec)))

    def _subscribe(self, topic: Topic) -> None:
        """Subscribe to a topic, once; to a latched topic again for each scene, to receive its current value only."""
        if topic.name in (topics.SCENE, topics.TF_STATIC):
            return
        if topic.name in self._subscriptions_by_topic:
            if topic.period_ticks > 0:
                return
            self.destroy_subscription(self._subscriptions_by_topic[topic.name])
        require_installed(topic.type, topic.name)
        qos = rclpy_qos(reader_qos_of(topic, live=self.live))
        self._subscriptions_by_topic[topic.name] = self.create_subscription(
            message_class(topic.type), topic.name, partial(self._receive, topic), qos, raw=True
        )

    def _receive(self, topic: Topic, payload: bytes) -> None:
        """Record a message of the scene."""
        if self._spec is None:
            return
        with self.meter.part("receive"):
            try:
                message = _stamped(payload, topic, self._spec, self._makers.get(topic.name, {}))
            except MALFORMED as error:
                self.ignore(topic.name, error)
                return
            if message.stamp_ns is None or self._is_repeated(topic, message.stamp_ns):
                return
            if message.stamp_ns < self._spec.start_ns and topic.name in _REPLAYED:
                self._lead_in.append(RawMessage(topic.name, message.stamp_ns, topic.type, bytes(message.payload)))
            elif message.stamp_ns >= self._spec.start_ns:
                self._record(topic.name, message.stamp_ns, message.payload)  # the last message of a scene ends it
                for name, made in message.made.items():
                    self._record(name, message.stamp_ns, memoryview(made))

    def _is_repeated(self, topic: Topic, stamp_ns: int) -> bool:
        """Whether this is the time that a paused world has published before."""
        if topic.name != topics.CLOCK:
            return False
        before_ns, self._clock_ns = self._clock_ns, stamp_ns
        return stamp_ns == before_ns

    def _report_loaded(self) -> None:
        """Report the scene as loaded once every topic has a publisher; called by a timer until then."""
        if self._spec is None or self._loaded_reported:
            return
        if all(subscription.get_publisher_count() > 0 for subscription in self._subscriptions_by_topic.values()):
            self._loaded_reported = True
            self.report_finished(self._spec, -1)  # nothing of the lead-in is recorded

    def _record_own(self, topic: str, stamp_ns: int, payload: bytes) -> None:
        """Record a message that this node has made or checked itself."""
        if topic in self._manifest:
            self._record(topic, stamp_ns, canonical_cdr(payload, self._manifest[topic].type))

    def _record(self, topic: str, stamp_ns: int, payload: memoryview) -> None:
        """Account for a message in canonical form and write all ticks that are complete now."""
        spec = self._spec
        if spec is None or self._writer is None or topic not in self._manifest:
            return
        if self._accounting.add_message(topic, stamp_ns) is not Verdict.EXPECTED:
            return
        if topic == topics.DRIVE_SCORE:
            self._scores[stamp_ns] = bytes(payload)
        tick = spec.publishing_tick_of(stamp_ns)
        if tick < self._next_tick and self._manifest[topic].sporadic:  # its tick has already been written
            self._writer.write(topic, stamp_ns, payload)
            self._finish_after_last(spec)
            return
        self._waiting[tick][topic].append((stamp_ns, payload))
        last_tick = self._accounting.finished_tick
        if self.live:
            last_tick = max(last_tick, tick - _LIVE_GRACE_TICKS)
        self._write_until(spec, self._writer, last_tick)
        self._finish_after_last(spec)

    def _on_end(self, message: String) -> None:
        end = self.read_end(message)
        if end is not None and self._spec is not None and end.scene == self._spec.name:
            self._end = end
            self._accounting.end_at(end.tick + 1)
            self._accounting.announce(topics.EVENTS, end.events)
            self._finish_after_last(self._spec)

    def _write_until(self, spec: SceneSpec, writer: SceneBagWriter, last_tick: int) -> None:
        while self._next_tick <= last_tick:
            with self.meter.busy(), self.meter.part("write"):
                self._write_tick(writer, self._next_tick)
            self.report_finished(spec, self._next_tick)
            self._next_tick += 1

    def _write_tick(self, writer: SceneBagWriter, tick: int) -> None:
        messages = self._waiting.pop(tick, _message_lists())
        if tick == 0:
            writer.add_attachment(LEAD_IN_ATTACHMENT, "application/json", lead_in_attachment(self._lead_in))
        if messages[topics.MAP]:
            writer.add_attachment(MAP_ATTACHMENT, "application/xml", bytes(text_of_string(messages[topics.MAP][0][1])))
        entries = [
            (stamp_ns, topic, payload)
            for topic in self._manifest.values()
            for stamp_ns, payload in messages[topic.name]
        ]
        for stamp_ns, payload in messages[topics.ACTORS]:
            self._tracker.add_frame(stamp_ns, table_from_message(deserialize_message(bytes(payload), PointCloud2)))
        for stamp_ns, topic, payload in sorted(entries, key=lambda entry: entry[0]):
            writer.write(topic.name, stamp_ns, payload)
        if messages[topics.MAP]:
            return_freed_memory()  # the map of a large town passes through several copies of 50 MB

    def _finish_after_last(self, spec: SceneSpec) -> None:
        """Finish the bag if it contains the last tick and all events, which may arrive after their tick."""
        if self._writer is None or self._end is None or not self._has_last_score(spec, self._end):
            return
        if not self._accounting.is_finished:
            return
        self._add_tracks(self._writer)
        self._writer.finish(self._facts(spec))
        self._writer = self._spec = None
        self.get_logger().info(f"scene {spec.name} is recorded")
        self.report_finished(spec, self._end.tick + 1)

    def _has_last_score(self, spec: SceneSpec, end: SceneEnd) -> bool:
        """Whether the score at the end of a drive, if there is one, has arrived; it tells the number of infractions."""
        if topics.DRIVE_SCORE not in self._manifest:
            return True
        if (payload := self._scores.get(spec.stamp_ns(end.tick))) is None:
            return False
        if (infractions := self.read(topics.DRIVE_SCORE, _infractions, payload)) is not None:
            self._accounting.announce(topics.DRIVE_EVENTS, infractions)
        return True

    def _add_tracks(self, writer: SceneBagWriter) -> None:
        """Attach the actors' trajectories, which are complete when the scene is over."""
        writer.add_attachment(TRAJECTORIES_ATTACHMENT, "application/x-npz", tracks_to_npz(self._tracker.tracks()))

    def _facts(self, spec: SceneSpec) -> dict[str, str]:
        """Facts about the scene for the bag's metadata."""
        ended = f"interrupted after tick {self._next_tick - 1}" if self._end is None else self._end.reason
        report = self._accounting.report()
        contested = [name for name, account in report.topics.items() if account.is_contested]
        senders = {name: ", ".join(self._senders(name)) for name in contested}
        return {
            **report.custom_data(spec.name),
            **({"senders": json.dumps(senders)} if senders else {}),
            "ended": ended,
        }

    def _senders(self, topic: str) -> list[str]:
        """Full names of the nodes that publish a topic now."""
        found = self.get_publishers_info_by_topic(topic)
        return sorted({f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found})

    def close(self) -> None:
        """Close an unfinished bag: write all messages that have arrived and leave it marked as partial."""
        if self._writer is None or self._spec is None:
            return
        with suppress(DiskError):  # a full disk may be the reason for closing
            for tick in sorted(self._waiting):
                self._write_tick(self._writer, tick)
            self._add_tracks(self._writer)
        with suppress(DiskError):
            if self.live and self._next_tick > 0:
                self._writer.finish(self._facts(self._spec))
            else:
                self._writer.abandon(self._facts(self._spec))
        self._writer = self._spec = None


def bag_writer(path: Path, recording: Recording) -> SceneBagWriter:
    """Open the writer of a scene's bag with the configured options; raises what ``SceneBagWriter`` raises."""
    return SceneBagWriter(
        path,
        chunk_bytes=recording.chunk_kib << 10,
        zstd_level=recording.zstd_level,
        split_bytes=None if recording.split_mib is None else recording.split_mib << 20,
        sync_bytes=recording.sync_mib << 20,
        min_free_bytes=recording.min_free_mib << 20,
    )


class _Stamped(NamedTuple):
    """A message in canonical form, with its stamp, ns (None: it has none), and the messages made of it, by topic."""

    stamp_ns: int | None
    payload: memoryview
    made: Mapping[str, bytes]


def _stamped(payload: bytes, topic: Topic, spec: SceneSpec, makers: Mapping[str, Maker]) -> _Stamped:
    """Check a message of a scene, and make others of it; raises what malformed ones do."""
    message = canonical_cdr(payload, topic.type)
    if topic.name in _READERS:
        _READERS[topic.name](deserialize_message(payload, message_class(topic.type)))
    stamp_ns = spec.start_ns if topic.period_ticks == 0 else serialized_stamp_ns(message, topic.type)
    if stamp_ns is None or stamp_ns < spec.start_ns:
        return _Stamped(stamp_ns, message, {})
    return _Stamped(stamp_ns, message, {name: make(payload, stamp_ns) for name, make in makers.items()})


def _infractions(payload: bytes) -> int:
    """Number of infractions up to a score."""
    counts: dict[str, int] = parse_json(bytes(text_of_string(memoryview(payload))))["infractions"]
    if any(index(count) < 0 for count in counts.values()):
        raise ValueError("its numbers of infractions cannot be negative")
    return sum(counts.values())


def _schedule(topic: Topic) -> Schedule:
    return Schedule(0, topic.period_ticks, topic.sporadic, topic.messages_per_tick)


def _message_lists() -> defaultdict[str, list[tuple[int, memoryview]]]:
    return defaultdict(list)
