"""The ROS node that reads what is drawn of a running graph, as any outside node could.

It subscribes best effort, so that the graph never waits for it, and only after the first tick of a graph: before, the
graph's nodes count readers to find out whether their own readers are connected.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import String

from simbev_ros.evaluation.predictions.prediction_messages import BOX_TYPES, IMAGE_TYPE, OCCUPANCY_TYPE
from simbev_ros.foundation.errors import InputError
from simbev_ros.recording.qos import QosProfile
from simbev_ros.ros.conventions.names import ROOT, NamespacedNode, NodeName
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.qos import LATCHED, rclpy_qos
from simbev_ros.ros.msgs.sensor_topics import CameraTopics
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.graph_node import MALFORMED
from simbev_ros.schema.scene.agents import AgentView, agent_view
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.rerun.live.drawn_topics import drawn_topics
from simbev_ros.show.rerun.live.frame_join import MAX_LAG_TICKS, FrameJoin
from simbev_ros.show.rerun.live.live_frame import LiveScene
from simbev_ros.show.rerun.live.live_observer import LiveObserver
from simbev_ros.show.rerun.live.newest_frame import NewestFrame
from simbev_ros.show.rerun.live.tick_rate import TickRate

NAME = "simbev_view"
_POLL_S = 0.25
_POLLS_TO_FIND = 6
"""Discovery of a graph that runs takes about a second."""
_MAX_EVENTS = 100
_ANSWER_TYPES = {*BOX_TYPES, IMAGE_TYPE, OCCUPANCY_TYPE} - {"vision_msgs/msg/Detection3DArray"}


class GraphReader(NamespacedNode):
    """Follows the graph of its domain and namespace, and the next one: joins its messages to frames and offers these.

    Args:
        frames: Where frames go.
        rate_hz: Maximum number of frames per second of wall time.
        layers: Whether to read what is hidden until it is switched on.
        observer: Receives whether there is a graph.
        namespace: The graph's namespace.
        agent: Name of the agent that is shown; None: the first one of each scene.
    """

    def __init__(
        self,
        frames: NewestFrame,
        rate_hz: float,
        *,
        layers: bool,
        observer: LiveObserver,
        namespace: str = ROOT,
        agent: str | None = None,
    ) -> None:
        super().__init__(NodeName(NAME, graph=namespace), enable_rosout=False, start_parameter_services=False)
        self._frames, self._interval_s, self._layers, self._observer = frames, 1.0 / rate_hz, layers, observer
        self._agent = agent
        self._scene: LiveScene | None = None
        self._join: FrameJoin | None = None
        self._rate = TickRate()
        self._runs, self._last_tick, self._text = 0, 0, ""
        self._graph: frozenset[bytes] = frozenset()
        self._polls = 0
        self._reported: bool | None = None
        self._read_topics: dict[str, tuple[Topic, Any]] = {}
        self._failure: Exception | None = None
        self.create_subscription(String, topics.SCENE, self._guard(self._on_scene), rclpy_qos(LATCHED), raw=True)
        newest = rclpy_qos(_newest(1))
        self.create_subscription(ClockMessage, topics.CLOCK, self._guard(self._on_clock), newest, raw=True)
        self.create_timer(_POLL_S, self._guard(self._poll), clock=Clock(clock_type=ClockType.STEADY_TIME))

    def raise_failure(self) -> None:
        """Raise what a callback has raised."""
        if self._failure is not None:
            raise self._failure

    def _guard(self, callback: Callable[..., None]) -> Callable[..., None]:
        """A callback that raises nothing, as rclpy's events executor crashes otherwise; bad messages are ignored."""

        def call(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except MALFORMED:
                return
            except Exception as error:
                self._failure = error

        return call

    def _poll(self) -> None:
        """Notice the end of a graph and the start of another one, and topics that come and go."""
        self._notice_graph()
        self._polls += 1
        is_there = bool(self._graph)
        if is_there or self._polls >= _POLLS_TO_FIND:
            if is_there != self._reported:
                self._observer.graph_noticed(is_there)
            self._reported = is_there
        if self._join is not None and self._scene is not None:
            self._read_answers(self._join, self._scene.view)
            self._join.await_only([name for name in self._read_topics if self.count_publishers(name)])

    def _notice_graph(self) -> None:
        """Drop all subscriptions if the graph has ended or another one begins, so that its nodes do not count them."""
        graph = frozenset(bytes(each.endpoint_gid) for each in self.get_publishers_info_by_topic(topics.SCENE))
        before, self._graph = self._graph, graph
        if before and (not graph or graph - before):  # a killed graph disappears later than the next one appears
            for _, subscription in self._read_topics.values():
                self.destroy_subscription(subscription)
            self._read_topics.clear()
            self._scene, self._join, self._text = None, None, ""

    def _on_scene(self, payload: bytes) -> None:
        self._notice_graph()
        text = deserialize_message(payload, String).data
        if text != self._text:  # a latched message may come twice
            self._text = text
            self._begin_view(SceneSpec.from_json(text))

    def _begin_view(self, spec: SceneSpec) -> None:
        """Begin a scene as the agent that is shown sees it; a scene without this agent ends the viewer."""
        try:
            view = agent_view(spec, self._agent)
        except KeyError as error:
            self._failure = InputError(str(error.args[0]), parameter="agent")
            return
        self._begin(view)

    def _begin(self, view: AgentView) -> None:
        self._scene, self._join = LiveScene(view, self._runs), None
        self._runs, self._last_tick, self._rate = self._runs + 1, -view.scene.lead_in_ticks, TickRate()

    def _on_clock(self, payload: bytes) -> None:
        """Begin to read with the first tick of a scene, and again if the same scene is played once more."""
        stamp_ns = serialized_stamp_ns(payload, "rosgraph_msgs/msg/Clock")
        if self._scene is None or stamp_ns is None:
            return
        view, spec = self._scene.view, self._scene.view.scene
        tick = spec.tick_of(stamp_ns)
        if not -spec.lead_in_ticks <= tick < spec.ticks:
            return  # the scene before, or the next one
        if tick < self._last_tick - MAX_LAG_TICKS:
            self._begin(view)
        self._last_tick = tick
        self._rate.add(tick, time.monotonic())
        if self._join is None:
            self._read_scene(self._scene)

    def _read_scene(self, scene: LiveScene) -> None:
        """Subscribe to what is drawn of a scene; subscriptions are kept from scene to scene."""
        wanted = {topic.name: topic for topic in drawn_topics(scene.view, self._choose_image, layers=self._layers)}
        for name in self._read_topics.keys() - wanted.keys():
            self.destroy_subscription(self._read_topics.pop(name)[1])
        self._join = FrameJoin(scene, wanted.values(), self._interval_s)
        for topic in wanted.values():
            self._read(topic)

    def _choose_image(self, forms: CameraTopics) -> Topic:
        """The form that another node reads already, else the raw one: then the graph need not compress for us."""
        is_compressed_read = any(
            each.node_name != NAME for each in self.get_subscriptions_info_by_topic(forms.compressed.name)
        )
        return forms.compressed if is_compressed_read else forms.raw

    def _read_answers(self, join: FrameJoin, view: AgentView) -> None:
        """Subscribe to what a perception stack has begun to publish for the agent that is shown."""
        answers = "/prediction/" if view.is_ego else f"/{view.agent}/prediction/"
        for name, types in self.graph_topics():
            known = next((each for each in types if each in _ANSWER_TYPES), None)
            if name.startswith(answers) and known is not None and name not in self._read_topics:
                topic = Topic(name, known)
                join.add_topic(topic)
                self._read(topic)

    def _read(self, topic: Topic) -> None:
        if topic.name not in self._read_topics:
            depth = _MAX_EVENTS if topic.sporadic else topic.messages_per_tick
            receive = self._guard(partial(self._receive, topic))
            kind, qos = message_class(topic.type), rclpy_qos(_newest(depth))
            subscription = self.create_subscription(kind, topic.name, receive, qos, raw=True)
            self._read_topics[topic.name] = topic, subscription

    def _receive(self, topic: Topic, payload: bytes) -> None:
        if self._join is None:
            return
        if topic.type == "std_msgs/msg/String":
            self._join.add_text(topic, payload)
            return
        stamp_ns = serialized_stamp_ns(payload, topic.type)
        if stamp_ns is not None:
            frame = self._join.add(topic.name, stamp_ns, payload, time.monotonic(), self._rate)
            if frame is not None:
                self._frames.put(frame)


def _newest(depth: int) -> QosProfile:
    """Best effort, with no more messages in the queue than are needed."""
    return QosProfile(reliability="best_effort", durability="volatile", depth=depth)
