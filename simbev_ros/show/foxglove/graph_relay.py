"""Relays the topics of a running graph to the clients of a Foxglove WebSocket server.

The relay subscribes to what clients have subscribed to, and forwards the bytes as they come. It never
holds the graph up: no publisher waits for a reader that is not reliable, and the only reliable subscriptions are those
to latched topics, which are sent once per scene.
"""

import struct
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from simbev_ros.ros.conventions.names import NamespacedNode
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.nodes.graph_node import MALFORMED
from simbev_ros.show.foxglove.relayed_topics import GraphTransforms, RelayedTopic, differences, relayed_topics
from simbev_ros.show.foxglove.schemas import begins_with_stamp, schema_of
from simbev_ros.show.foxglove.server import TIME_PERIOD_S

if TYPE_CHECKING:
    from foxglove import Context
    from foxglove.websocket import WebSocketServer

_REQUESTS_S, _DISCOVERY_S = 0.02, 0.5
_NEW_PER_DISCOVERY = 64
"""Number of topics that are offered at a time; a client with a queue full of news would be disconnected."""
_STAMPED_ARRAYS = ("visualization_msgs/msg/MarkerArray", "tf2_msgs/msg/TFMessage")


class GraphRelay:
    """Offers the topics of a node's domain, and forwards those to which clients have subscribed.

    All its work is done by the executor of its node. The server calls ``on_subscribe`` and ``on_unsubscribe`` from
    threads of its own; they leave their requests in a queue.
    """

    def __init__(self, node: NamespacedNode, context: "Context", warn: Callable[[str], None]) -> None:
        self._node, self._context, self._warn = node, context, warn
        self._requests: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._relayed: dict[str, RelayedTopic] = {}
        self._channels: dict[str, Any] = {}
        self._subscribers: dict[int, int] = {}
        self._subscriptions: dict[str, list[Any]] = {}
        self._latched: dict[str, bytes] = {}
        self._warned: set[str] = set()
        self._transforms = GraphTransforms()
        self._now_ns, self._told_s = 0, 0.0
        self.server: WebSocketServer | None = None
        self.failure: Exception | None = None
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        clock = message_class("rosgraph_msgs/msg/Clock")
        node.create_subscription(clock, topics.CLOCK, self._guarded(self._on_clock), newest, raw=True)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(String, topics.SCENE, self._guarded(self._on_scene), latched, raw=True)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_REQUESTS_S, self._guarded(self._answer), clock=steady)
        node.create_timer(_DISCOVERY_S, self._guarded(self._discover), clock=steady)

    def on_subscribe(self, _client: Any, channel: Any) -> None:
        """Subscribe to the topic of a channel, or send its latched message again."""
        self._requests.put(lambda: self._subscribe(channel.id, channel.topic))

    def on_unsubscribe(self, _client: Any, channel: Any) -> None:
        """Unsubscribe when no client is left."""
        self._requests.put(lambda: self._unsubscribe(channel.id, channel.topic))

    def _guarded(self, work: Callable[..., None]) -> Callable[..., None]:
        """Keep what a callback raises: rclpy's events executor crashes if one raises anything."""

        def call(*values: Any) -> None:
            try:
                work(*values)
            except Exception as error:
                self.failure = error

        return call

    def _answer(self) -> None:
        """Do what clients have asked for."""
        with suppress(Empty):
            while True:
                self._requests.get_nowait()()

    def _discover(self) -> None:
        """Follow topics that appear, vanish or change."""
        found, unknown = relayed_topics(self._node, self._transforms)
        gone, new = differences(self._relayed, found)
        for name in gone:
            self._unfollow(name)
            self._channels.pop(name).close()
            del self._relayed[name]
        for name in new[:_NEW_PER_DISCOVERY]:
            self._relay(found[name])
        for name, type_name in unknown.items():
            if name not in self._warned:
                self._warned.add(name)
                self._warn(f"{name} is not shown: this Python has no definition of its type {type_name}")

    def _relay(self, topic: RelayedTopic) -> None:
        import foxglove

        self._relayed[topic.name] = topic
        self._channels[topic.name] = foxglove.Channel(
            topic.name, schema=schema_of(topic.type_name), message_encoding="cdr", context=self._context
        )

    def _subscribe(self, channel: int, topic: str) -> None:
        self._subscribers[channel] = self._subscribers.get(channel, 0) + 1
        if topic not in self._channels or self._channels[topic].id() != channel:
            return  # it has vanished meanwhile
        if topic in self._latched:
            self._channels[topic].log(self._latched[topic], log_time=self._now_ns)
        if topic not in self._subscriptions:
            self._follow(self._relayed[topic])

    def _unsubscribe(self, channel: int, topic: str) -> None:
        self._subscribers[channel] = self._subscribers.get(channel, 0) - 1
        if self._subscribers[channel] <= 0:
            del self._subscribers[channel]
            if topic in self._channels and self._channels[topic].id() == channel:
                self._unfollow(topic)

    def _follow(self, topic: RelayedTopic) -> None:
        kind, receive = message_class(topic.source_type), self._guarded(lambda payload: self._forward(topic, payload))
        self._subscriptions[topic.name] = [
            self._node.create_subscription(kind, source, receive, topic.qos, raw=True) for source in topic.sources
        ]

    def _unfollow(self, topic: str) -> None:
        self._latched.pop(topic, None)
        for subscription in self._subscriptions.pop(topic, ()):
            self._node.destroy_subscription(subscription)

    def _forward(self, topic: RelayedTopic, payload: bytes) -> None:
        try:
            data = payload if topic.make is None else topic.make(payload)
            stamp_ns = self._stamp_ns(topic.source_type, payload)
        except MALFORMED as error:
            if topic.name not in self._warned:
                self._warned.add(topic.name)
                self._warn(f"ignored messages on {', '.join(topic.sources)}: {error!s:.200}")
            return
        if data is None:
            return
        if topic.name in self._channels:
            self._channels[topic.name].log(data, log_time=stamp_ns)
        if topic.is_latched:
            self._latched[topic.name] = data

    def _stamp_ns(self, type_name: str, payload: bytes) -> int:
        """Stamp of a message; of one without a stamp, the time of the graph's clock."""
        if begins_with_stamp(type_name) or type_name in _STAMPED_ARRAYS:
            with suppress(struct.error):
                return serialized_stamp_ns(payload, type_name) or self._now_ns
        return self._now_ns

    def _on_scene(self, payload: bytes) -> None:
        with suppress(*MALFORMED):  # any process can send messages
            self._transforms.start_scene(payload)

    def _on_clock(self, payload: bytes) -> None:
        try:
            stamp_ns = serialized_stamp_ns(payload, "rosgraph_msgs/msg/Clock") or 0
        except MALFORMED:
            return
        if self.server is not None:
            if stamp_ns < self._now_ns:
                self.server.clear_session()  # another scene: time starts again
            if (now_s := time.monotonic()) - self._told_s >= TIME_PERIOD_S:
                self.server.broadcast_time(stamp_ns)
                self._told_s = now_s
        self._now_ns = stamp_ns
