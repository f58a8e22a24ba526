"""Watches a running graph over ROS: requests scenes, follows the finished ticks of every node and its diagnostics."""

import math
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import get_args

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header, String

from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.conventions.diagnostics import hardware_id
from simbev_ros.ros.conventions.names import NamespacedNode, NodeName, ros_name
from simbev_ros.ros.graph.joining_advice import JoiningAdvice, OutsidePublisher
from simbev_ros.ros.graph.pace_watch import PaceWatch
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.qos import LATCHED, STEERING, rclpy_qos
from simbev_ros.ros.msgs.signing import Signer, content_of, signed_json
from simbev_ros.ros.nodes.graph_node import MALFORMED
from simbev_ros.ros.nodes.load_meter import BUSY, Part, part_keys
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.reports import Report, read_report, subscribe_to_reports
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.request import SceneRequest, SceneStop
from simbev_ros.schema.scene.spec import SceneSpec

SUPERVISOR = "supervisor"
"""Name of this node."""
_PATIENCE_S, _ADVICE_PERIOD_S = 10.0, 1.0
"""Time without progress after which advice is given, and time between two looks for reasons."""
_SILENCE_S, _SILENCE_TIMEOUT_S = 0.05, 1.0
"""Time without change after which nobody comes or goes any more, and the longest wait for it."""
_TIMES = (BUSY, *(key for part in get_args(Part) for key in part_keys(part)))
"""Names of the times in a node's diagnostics."""


class _Load:
    """Times of a node, summed over all ticks that it has reported."""

    def __init__(self) -> None:
        self._ticks, self._total_ms = 0.0, dict.fromkeys(_TIMES, 0.0)

    def add(self, values: Mapping[str, str]) -> None:
        """Add the values of a report; raises KeyError or ValueError if they are none."""
        ticks = float(values["ticks"])
        added_ms = {name: ticks * float(values.get(name, 0.0)) for name in _TIMES}
        if not all(map(math.isfinite, (ticks, *added_ms.values()))):
            raise ValueError("times must be finite")
        self._ticks += ticks
        for name, time_ms in added_ms.items():
            self._total_ms[name] += time_ms

    def mean_ms(self) -> dict[str, float]:
        """Times per tick."""
        return {name: time_ms / max(self._ticks, 1.0) for name, time_ms in self._total_ms.items()}


class GraphMonitor:
    """A ROS node in the supervising process.

    Args:
        domain: ROS domain of the graph.
        nodes: Names of simbev's own nodes, which also send diagnostics; all of one graph.
        participants: Names of all nodes that report finished ticks to the world, including outside nodes.
        signer: Signs requests, and checks that messages come from the graph's nodes.
        ros: ROS arguments of all nodes of the graph.
        writers: Names of the nodes that report one tick more than a scene has, when their files are closed.
        pace: Watches whether the graph keeps its pace.

    Attributes:
        behind_world: Ticks finished by the participants.
        world: Ticks finished by the world node.
        writers: Ticks finished by the nodes that write files.
        end: How the current scene ends; set just before its last tick.
    """

    def __init__(
        self,
        domain: int,
        nodes: Iterable[NodeName],
        participants: Iterable[str],
        signer: Signer,
        ros: RosArguments = PLAIN,
        *,
        writers: Iterable[str] = (),
        pace: PaceWatch | None = None,
    ) -> None:
        self._names_by_id = {hardware_id(node): node.name for node in nodes}
        self._nodes = tuple(self._names_by_id.values())
        self._signer, self._requests = signer, 0
        participants = tuple(participants)
        self._outside = frozenset(participants) - frozenset(self._nodes)
        self.behind_world = LockstepWindow(participants, window_ticks=1, outside=self._outside)
        self.world = LockstepWindow(["world"], window_ticks=1)
        self.writers = LockstepWindow(writers, window_ticks=1)
        self._pace = pace or PaceWatch()
        self.end: SceneEnd | None = None
        self._joining = JoiningAdvice(self._outside, domain, ros_name(topics.READY, ros.namespace))
        self._advised: set[str] = set()
        self._next_advice_s = 0.0
        self._scene = ""
        self._spec: SceneSpec | None = None
        self._world_ns = -math.inf
        self._loads = {name: _Load() for name in self._nodes}
        self._heard_s = dict.fromkeys(self._nodes, time.monotonic())
        self._progress_s = time.monotonic()
        self._context = Context()
        rclpy.init(
            args=ros.for_nodes,
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = NamespacedNode(NodeName(SUPERVISOR, graph=ros.namespace), context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._request = self._node.create_publisher(String, topics.REQUEST, rclpy_qos(LATCHED))
        self._stop = self._node.create_publisher(String, topics.STOP, rclpy_qos(LATCHED))
        self._node.create_subscription(String, topics.END, self._on_end, rclpy_qos(STEERING))
        subscribe_to_reports(self._node, self._on_ready, self._outside)
        self._node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, 64)

    def request(self, request: SceneRequest) -> None:
        """Ask the world node to play a scene."""
        self._start_scene(request.spec)
        self._joining.start_scene(request.spec)
        self._pace.start_scene(NS_PER_S / request.spec.tick_ns)
        self._scene, self.end = request.spec.name, None
        self._progress_s = time.monotonic()
        self._heard_s = dict.fromkeys(self._nodes, self._progress_s)
        self._requests += 1
        request = request.model_copy(update={"number": self._requests})
        self._request.publish(String(data=signed_json(request, self._signer)))

    def stop(self, reason: str) -> None:
        """Ask the world node to end the scene with its next tick, for a reason in words."""
        stop = SceneStop(number=self._requests, reason=reason)
        self._stop.publish(String(data=signed_json(stop, self._signer)))

    def release(self, participant: str, reason: str) -> None:
        """Let the scene go on without a participant, for a reason in words."""
        self.behind_world.release(participant)
        self._progress_s = time.monotonic()
        stop = SceneStop(number=self._requests, reason=reason, without=participant)
        self._stop.publish(String(data=signed_json(stop, self._signer)))

    def _start_scene(self, spec: SceneSpec) -> None:
        """Expect the reports of a scene's first ticks."""
        self._spec, self._world_ns = spec, -math.inf
        for each in (self.behind_world, self.world, self.writers):
            each.start_scene(spec)

    def spin(self, duration_s: float) -> None:
        """Handle messages for a given time."""
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)

    def silent_nodes(self, timeout_s: float) -> list[str]:
        """Names of the nodes that hold up the graph.

        These are own nodes that have sent nothing for ``timeout_s``; else, if no report has counted for that
        long, the participants that are furthest behind.
        """
        now_s = time.monotonic()
        unheard = [name for name, heard_s in self._heard_s.items() if now_s - heard_s > timeout_s]
        if unheard or now_s - self._progress_s <= timeout_s:
            return unheard
        world_tick, others_tick = self.world.finished_by_all(), self.behind_world.finished_by_all()
        if others_tick is None or (world_tick is not None and others_tick < world_tick):
            behind = self.behind_world.laggards()
            return [name for name in behind if name not in self._nodes] or behind  # own nodes report: they wait
        return [] if world_tick is not None else ["world"]

    def advice(self, silent: Iterable[str]) -> list[str]:
        """Sentences about what participants from outside should change, of nodes that hold up the graph."""
        waiting = {name: self.behind_world.finished_tick(name) for name in silent if name in self._outside}
        return self._joining.advice(waiting, self._outside_publishers()) if waiting else []

    def new_advice(self) -> list[str]:
        """What has not been returned yet: advice, and that the graph falls behind; call it often."""
        now_s = time.monotonic()
        if now_s < self._next_advice_s:
            return []
        self._next_advice_s = now_s + _ADVICE_PERIOD_S
        if (slow := self._pace.news()) is not None:
            return [slow]
        new = [words for words in self.advice(self.silent_nodes(_PATIENCE_S)) if words not in self._advised]
        self._advised.update(new)
        return new

    def _outside_publishers(self) -> list[OutsidePublisher]:
        """The publishers of reports in nodes that are not of the graph."""
        return [
            OutsidePublisher(
                publisher.node_name,
                publisher.topic_type,
                is_reliable=publisher.qos_profile.reliability != ReliabilityPolicy.BEST_EFFORT,
                is_latched=publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            )
            for publisher in self._node.get_publishers_info_by_topic(topics.READY)
            if publisher.node_name not in self._nodes
        ]

    def note_computing(self, names: Iterable[str]) -> None:
        """Count it as a sign of life, and as progress, that own nodes are computing while a scene loads."""
        for name in names:
            if name in self._heard_s:
                self._heard_s[name] = self._progress_s = time.monotonic()

    def load_ms(self, names: Iterable[str]) -> dict[str, float]:
        """Times per tick as ``LoadMeter.read`` names them, summed over nodes and averaged since the graph started."""
        total_ms: Counter[str] = Counter()
        for name in names:
            total_ms.update(self._loads[name].mean_ms())
        return dict(total_ms)

    def close(self) -> None:
        """Leave the ROS graph."""
        self._executor.shutdown()
        self._await_silence()
        self._node.destroy_node()
        self._context.shutdown()

    def _await_silence(self) -> None:
        """Wait until the ends of nodes have been heard: the middleware may hang that ends in a callback of discovery.

        See ``lifeline.ending_middleware``; this process may have more to do.
        """
        before, end_s = [""], time.monotonic() + _SILENCE_TIMEOUT_S
        while (names := sorted(self._node.get_node_names())) != before and time.monotonic() < end_s:
            before = names
            time.sleep(_SILENCE_S)

    def _on_ready(self, message: Header) -> None:
        try:
            report = read_report(message, self._signer, self._outside)
        except MALFORMED:  # the world node logs it
            self._joining.note_unknown(message.frame_id)
            return
        self._notice_restart(report)
        published_tick = self.world.finished_by_all()
        everybody = (self.behind_world, self.world, self.writers)
        counts = [each.record_report(report, published_tick) for each in everybody]
        if any(counts):
            self._progress_s = time.monotonic()
        self._note_sign_of_life(report.node)
        if report.node in self._outside:
            self._joining.note_report(report, message.frame_id)

    def _notice_restart(self, report: Report) -> None:
        """Begin again if the world reports an earlier tick than before, which means that the scene was reset."""
        if report.node != "world" or report.scene != self._scene or self._spec is None:
            return
        if report.stamp_ns < self._world_ns:
            self._start_scene(self._spec)
        self._world_ns = report.stamp_ns

    def _on_end(self, message: String) -> None:
        with suppress(*MALFORMED):
            end = content_of(SceneEnd, message.data, self._signer)
            if end.scene == self._scene:
                self.end = end

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            with suppress(KeyError, ValueError):  # others may use the topic, too
                name = self._names_by_id[status.hardware_id]
                self._note_sign_of_life(name)
                values = {entry.key: entry.value for entry in status.values}
                self._loads[name].add(values)
                self._pace.add(name, values)

    def _note_sign_of_life(self, name: str) -> None:
        if name in self._heard_s:
            self._heard_s[name] = time.monotonic()
