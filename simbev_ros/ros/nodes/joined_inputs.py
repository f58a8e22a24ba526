"""The topics of which a participant needs the messages of a tick before it can finish the tick."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Generic

from simbev_ros.foundation.tick_join import Item, Message, TickJoin, all_of, at_periods
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.qos import qos_of, rclpy_qos
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.participant import Participant


class JoinedInputs(Generic[Item, Message]):
    """Subscribes to topics and joins their messages with ticks. Subscriptions are kept for later scenes that need them.

    Args:
        node: The participant; its ``inputs`` always contain the subscriptions.
        patience_ticks: Live: number of ticks after which a tick does not wait any longer.
        read: Reads a message of an input; None: it is malformed.
        proceed: Called with the scene when a message has been added.
    """

    def __init__(
        self,
        node: Participant,
        patience_ticks: int,
        read: Callable[[str, bytes], Message | None],
        proceed: Callable[[Any], None],
    ) -> None:
        self._node, self._read, self._proceed = node, read, proceed
        self._patience_ticks = patience_ticks if node.live else None
        self._topics: dict[str, Topic] = {}
        self._names: dict[str, str] = {}
        self._awaited: dict[str, int] = {}
        self._subscriptions: dict[str, Any] = {}
        self._has_begun = False
        self._join = self._new_join()

    def start_scene(self, topics: Mapping[str, Topic]) -> None:
        """Subscribe to the topics of a scene, which are named by keys; messages between their periods are dropped."""
        self._topics = {topic.name: topic for topic in topics.values()}
        for name in self._subscriptions.keys() - self._topics.keys():
            self._node.inputs.remove(self._subscriptions[name])
            self._node.destroy_subscription(self._subscriptions.pop(name))
        for key, topic in topics.items():
            if topic.name not in self._subscriptions:
                qos, receive = rclpy_qos(qos_of(topic, live=self._node.live)), partial(self._receive, key, topic)
                made = self._node.create_subscription(message_class(topic.type), topic.name, receive, qos, raw=True)
                self._subscriptions[topic.name] = made
                self._node.inputs.append(made)
        self._awaited = {key: topic.period_ticks for key, topic in topics.items()}
        self._names = {key: topic.name for key, topic in topics.items()}
        self._has_begun, self._join = False, self._new_join()

    def expect(self, tick: int, item: Item) -> None:
        """Let a tick wait for its messages; ``item`` is released with them."""
        if not self._has_begun:  # a bag that is played back may lack topics of the scene's rig
            self._has_begun = True
            for key in [key for key in self._awaited if not self._is_sent(self._names[key])]:
                del self._awaited[key]
        self._join.open(tick, item)

    def release(self) -> Iterator[tuple[int, Item, dict[str, Message]]]:
        """Release the ticks that need not wait any longer, in order, with their messages by key."""
        return self._join.release()

    def _new_join(self) -> TickJoin[Item, Message]:
        return TickJoin(all_of(at_periods(self._awaited), patience_ticks=self._patience_ticks))

    def _is_sent(self, name: str) -> bool:
        return bool(self._subscriptions[name].get_publisher_count())

    def _receive(self, key: str, topic: Topic, payload: bytes) -> None:
        spec, stamp_ns = self._node.spec, self._node.read(topic.name, serialized_stamp_ns, payload, topic.type)
        if spec is None or stamp_ns is None:
            return
        tick = spec.tick_of(stamp_ns)
        is_needed = tick >= 0 and tick % self._topics[topic.name].period_ticks == 0
        if not is_needed or self._join.is_late(tick) or self._join.has(key, tick):
            return
        if (message := self._read(key, payload)) is not None:
            self._join.add(key, tick, message)
            self._proceed(spec)
