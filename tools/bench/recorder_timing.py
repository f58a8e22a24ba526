"""Times the recorder node, which receives the messages of a scene through DDS as fast as lockstep permits."""

import os
import struct
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header, String

from simbev_ros.config.scenario import RecordedTopics, Recording
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.graph.domain import DomainLock
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.graph.node_starter import NodeStarter
from simbev_ros.ros.graph.plan import NodePlan
from simbev_ros.ros.graph.process import NodeProcess
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.qos import LATCHED, qos_of, rclpy_qos
from simbev_ros.ros.msgs.signing import Signer
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.world import record_message
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.reports import read_report
from simbev_ros.scene.ending import DURATION, SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE

_WINDOW_TICKS = 3
_PATIENCE_S = 60.0
_STAMP, _STAMP_AT = struct.Struct("<iI"), 4


@dataclass(frozen=True, slots=True)
class RecorderTiming:
    """One scene, from its first tick until its bag is closed and on the disk.

    Attributes:
        payload_mb: Size of all messages.
        wall_s: Wall time.
        cpu_s: Processor time of the recorder's process.
        sender_cpu_s: Processor time of the sending process.
    """

    payload_mb: float
    wall_s: float
    cpu_s: float
    sender_cpu_s: float


def timed_recorder(spec: SceneSpec, recording: Recording, tick: Mapping[str, bytes], folder: Path) -> RecorderTiming:
    """Send a scene to a recorder node, which runs in a process of its own.

    Args:
        spec: The scene; only the topics in ``tick`` and those that a replay needs are sent and recorded.
        recording: Settings of the recorder; its choice of topics is ignored.
        tick: For each topic the serialized message to send at every tick: little-endian CDR that begins with a header.
        folder: Folder for the dataset.

    Raises:
        SimbevError: The recorder has ended, or is silent.
    """
    recording = recording.model_copy(update={"topics": RecordedTopics(include=tuple(tick))})
    with DomainLock() as lock, tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as scratch:
        environment = graph_environment(lock.domain)
        os.environ.update(environment)
        parameters = {"dataset": str(folder.resolve()), "config": "", "recording": recording.model_dump_json()}
        starter = NodeStarter(["recorder"], Path(scratch), environment)
        recorder = NodeProcess(starter, (NodePlan("recorder", "recorder", parameters),), Path(scratch))
        rclpy.init(domain_id=lock.domain, signal_handler_options=SignalHandlerOptions.NO)
        node = Node("sender")
        try:
            return _Sender(node, spec, recording, tick, recorder).timing()
        finally:
            node.destroy_node()
            rclpy.shutdown()
            recorder.terminate()
            recorder.join(_PATIENCE_S)
            starter.close()


class _Sender:
    """Replaces all nodes with recorded topics."""

    def __init__(
        self, node: Node, spec: SceneSpec, recording: Recording, tick: Mapping[str, bytes], recorder: NodeProcess
    ) -> None:
        self._spec, self._recorder = spec, recorder
        self._lockstep = LockstepWindow(["recorder"], _WINDOW_TICKS)
        self._lockstep.start_scene(spec)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        node.create_subscription(Header, topics.READY, self._on_ready, rclpy_qos(LATCHED))
        actors = np.zeros(100, ACTOR_DTYPE)
        actors["id"] = EGO_ID + np.arange(len(actors))
        tables = {topics.ACTORS: actors, topics.SIGNALS: np.zeros(100, SIGNAL_DTYPE)}
        state = {name: serialize_message(message_from_table(table, 0, "map")) for name, table in tables.items()}
        self._tick = {name: bytearray(message) for name, message in {**state, **tick}.items()}
        self._publishers: dict[str, Any] = {topics.END: node.create_publisher(String, topics.END, rclpy_qos(LATCHED))}
        for topic in topics.manifest(spec, compressed_images=recording.images == "compressed"):
            if topic.name in topics.REPLAY_TOPICS or topic.name in tick:
                qos = rclpy_qos(qos_of(topic, live=False))
                self._publishers[topic.name] = node.create_publisher(message_class(topic.type), topic.name, qos)

    def timing(self) -> RecorderTiming:
        """Send the scene and time it."""
        spec = self._spec
        self._publishers[topics.MAP].publish(String())
        self._publishers[topics.SCENE].publish(String(data=spec.model_dump_json()))
        self._wait_until(0)
        wall_s, cpu_s, recorder_cpu_s, payload_bytes = time.perf_counter(), time.process_time(), self._recorder.cpu_s, 0
        for tick in range(spec.ticks):
            self._wait_until(tick)
            if tick == spec.ticks - 1:
                end = SceneEnd(scene=spec.name, tick=tick, reason=DURATION)
                self._publishers[topics.END].publish(String(data=end.model_dump_json()))
            payload_bytes += self._send(spec.stamp_ns(tick))
        self._wait_until(spec.ticks + _WINDOW_TICKS)  # the recorder finishes one more tick when the bag is closed
        return RecorderTiming(
            payload_bytes / 1e6,
            time.perf_counter() - wall_s,
            self._recorder.cpu_s - recorder_cpu_s,
            time.process_time() - cpu_s,
        )

    def _send(self, stamp_ns: int) -> int:
        """Send one tick and return its size in bytes."""
        self._publishers[topics.WEATHER].publish(record_message(self._spec.weather.model_dump(), stamp_ns))
        for name, message in self._tick.items():
            _STAMP.pack_into(message, _STAMP_AT, *divmod(stamp_ns, NS_PER_S))
            self._publishers[name].publish(bytes(message))
        return sum(len(message) for message in self._tick.values())

    def _wait_until(self, tick: int) -> None:
        """Wait until lockstep permits a tick and every topic has a subscriber."""
        deadline_s = time.monotonic() + _PATIENCE_S
        while not self._lockstep.may_start(tick) or any(
            p.get_subscription_count() == 0 for p in self._publishers.values()
        ):
            self._executor.spin_once(timeout_sec=0.1)
            if self._recorder.exit_code is not None:
                raise self._recorder.refusal() or SimbevError(f"recorder: {self._recorder.describe_end()}")
            if time.monotonic() > deadline_s:
                raise SimbevError(f"recorder: silent for {_PATIENCE_S:g} s before tick {tick}")

    def _on_ready(self, message: Header) -> None:
        self._lockstep.record_report(read_report(message, Signer(None), ()))
