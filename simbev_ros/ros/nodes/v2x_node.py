"""The V2X node: publishes what each agent sends to the others, and what arrives at each of them."""

from collections.abc import Mapping

from simbev_ros.foundation.types import Table
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.joint_topics import V2xTopics, v2x_topics
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.world import MAP_FRAME
from simbev_ros.ros.nodes.box_reader import BoxReader
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.v2x import V2xNetwork


class V2xNode(BoxReader):
    """Carries the messages between agents. In a scene without messages it publishes nothing."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._network: V2xNetwork | None = None
        self._topics_of: dict[str, V2xTopics] = {}

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Subscribe to the boxes of all agents, and advertise the topics of their messages."""
        super().start_scene(spec)
        self._network = None if spec.v2x is None else V2xNetwork(spec, spec.v2x)
        self._topics_of = v2x_topics(spec)
        for topics in self._topics_of.values():
            for topic in topics:
                self.advertise(topic)
        self.advertise_derived(spec)
        return [topic.name for topics in self._topics_of.values() for topic in (topics.sent, topics.arrived)]

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether there are messages at the tick."""
        return self._network is not None and super().is_due(spec, tick)

    def process_boxes(self, spec: SceneSpec, state: WorldState, boxes: Mapping[str, Table]) -> None:
        """Publish the messages that are sent at a tick, and those that arrive."""
        assert self._network is not None
        exchange = self._network.exchange(state, boxes)
        for name, rows in exchange.sent.items():
            self._publish(self._topics_of[name].sent, rows, state.stamp_ns)
        for name, rows in exchange.arrived.items():
            self._publish(self._topics_of[name].arrived, rows, state.stamp_ns)

    def _publish(self, topic: Topic, rows: Table, stamp_ns: int) -> None:
        self.publish(topic.name, message_from_table(rows, stamp_ns, MAP_FRAME))
        self.publish_derived(stamp_ns, {topic.name: rows})
