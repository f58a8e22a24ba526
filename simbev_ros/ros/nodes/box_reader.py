"""The base class of nodes that read the boxes of all agents of a scene, tick by tick."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from sensor_msgs.msg import PointCloud2

from simbev_ros.foundation.types import Table
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.joint_topics import joint_inputs
from simbev_ros.ros.msgs.qos import qos_of, rclpy_qos
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.msgs.tables import table_from_cdr
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.ros.nodes.sensor_join import SensorJoin
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState

_LIVE_PATIENCE_TICKS = 16
"""Live: ticks after which boxes still missing are no longer awaited; longer than annotators wait for their sensors."""
_BOX_COLUMNS = list(BOX_DTYPE.names or ())


class BoxReader(Participant):
    """Base of the nodes that need the boxes of all agents of a tick. In a scene with one agent they do nothing.

    A subclass advertises its topics in ``start_scene``, which must call this one, and publishes in ``process_boxes``.
    """

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._topics: dict[str, Topic] = {}
        self._subscriptions_of: dict[str, Any] = {}
        self._join: SensorJoin[WorldState, Table] = SensorJoin({})
        self._has_begun = False

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Subscribe to the boxes; subscriptions are kept for later scenes with the same topics."""
        self._topics = joint_inputs(spec)
        names = {topic.name: agent for agent, topic in self._topics.items()}
        for name in self._subscriptions_of.keys() - names.keys():
            self.inputs.remove(self._subscriptions_of[name])
            self.destroy_subscription(self._subscriptions_of.pop(name))
        for agent, topic in self._topics.items():
            if topic.name not in self._subscriptions_of:
                receive, qos = self._make_callback(agent, topic), rclpy_qos(qos_of(topic, live=self.live))
                made = self.create_subscription(PointCloud2, topic.name, receive, qos, raw=True)
                self._subscriptions_of[topic.name] = made
                self.inputs.append(made)
        periods = {agent: topic.period_ticks for agent, topic in self._topics.items()}
        self._has_begun = False
        self._join = SensorJoin(periods, _LIVE_PATIENCE_TICKS if self.live else None)
        return []

    def process_boxes(self, spec: SceneSpec, state: WorldState, boxes: Mapping[str, Table]) -> None:
        """Do the work of one recorded tick.

        Args:
            spec: The specification, which is the first agent's view.
            state: The state as the first agent sees it.
            boxes: ``BOX_DTYPE`` rows around each agent whose boxes were received, by the agent's name.
        """
        raise NotImplementedError

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether there are several agents at the tick."""
        return tick >= 0 and bool(self._topics)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Let a tick wait for its boxes."""
        if not self.is_due(spec, state.tick):
            return
        if not self._has_begun:  # a bag that is played back may lack boxes of some agents
            self._has_begun = True
            self._join.give_up(agent for agent, topic in self._topics.items() if not self._is_sent(topic))
        self._join.expect(state.tick, state)

    def _is_sent(self, topic: Topic) -> bool:
        return bool(self._subscriptions_of[topic.name].get_publisher_count())

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Report ticks without boxes; others are finished when their boxes have been processed."""
        if self.is_due(spec, state.tick):
            self._process_ready(spec)
        else:
            super().finish(spec, state)

    def _process_ready(self, spec: SceneSpec) -> None:
        """Process all ticks whose boxes are there or overdue."""
        for state, boxes in self._join.release():
            with self.meter.busy(ticks=0):
                self.process_boxes(spec, state, boxes)
            self.report_finished(spec, state.tick)

    def _make_callback(self, agent: str, topic: Topic) -> Callable[[bytes], None]:
        def receive(payload: bytes) -> None:
            spec, stamp_ns = self.spec, self.read(topic.name, partial(serialized_stamp_ns, payload, topic.type))
            if spec is None or stamp_ns is None or not self._join.is_awaited(agent, spec.tick_of(stamp_ns)):
                return
            if (boxes := self.read(topic.name, partial(_boxes_from_cdr, payload))) is not None:
                self._join.add_message(agent, spec.tick_of(stamp_ns), boxes)
                self._process_ready(spec)

        return receive


def _boxes_from_cdr(payload: bytes) -> Table:
    """(N,) ``BOX_DTYPE`` rows of a serialized message; raises ValueError if it has not all of the columns."""
    boxes: Table = table_from_cdr(payload, _BOX_COLUMNS)[_BOX_COLUMNS].astype(BOX_DTYPE)
    return boxes
