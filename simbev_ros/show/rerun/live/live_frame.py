"""Samples of one tick of a running graph, decoded when they are drawn."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from simbev_ros.dataset.content import ODOMETRY, key_of_topic
from simbev_ros.dataset.values import decode_message, in_ego_frame, value_of
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.scene.agents import AgentView


@dataclass(frozen=True, eq=False, slots=True)
class LiveScene:
    """A scene that a graph plays.

    Attributes:
        view: The scene as the agent that is shown sees it.
        run: Number of the scene among those that the viewer has shown; the same scene may be played again.
    """

    view: AgentView
    run: int


@dataclass(frozen=True, slots=True)
class Payloads:
    """Serialized messages of one topic, at least one."""

    topic: Topic
    messages: Sequence[bytes]


class LiveFrame:
    """Samples by key, with the values that ``dataset.values`` documents.

    Attributes:
        scene: The scene.
        tick: Number of the tick.
        stamp_ns: Simulated time, ns.
        ticks_per_s: Recent speed of the graph in wall time; None while it is not known.
    """

    def __init__(self, scene: LiveScene, tick: int, payloads: Sequence[Payloads], ticks_per_s: float | None) -> None:
        self.scene, self.tick, self.stamp_ns = scene, tick, scene.view.scene.stamp_ns(tick)
        self.ticks_per_s = ticks_per_s
        self._payloads: Mapping[str, Payloads] = {key_of_topic(each.topic.name, scene.view): each for each in payloads}
        self._values: dict[str, Any] = {}

    def __contains__(self, key: object) -> bool:
        return key in self._payloads

    def __iter__(self) -> Iterator[str]:
        return iter(self._payloads)

    def __getitem__(self, key: str) -> Any:
        if key not in self._values:
            topic, messages = self._payloads[key].topic, self.messages(key)
            if topic.sporadic:
                self._values[key] = [value_of(topic.type, [message]) for message in messages]
            else:
                value = value_of(topic.type, messages)
                ahead_m = self.scene.view.base_link_x_m
                self._values[key] = in_ego_frame(value, ahead_m) if key == ODOMETRY else value
        return self._values[key]

    def messages(self, key: str) -> list[Any]:
        """The messages of a key, with JPEG and PNG as they are.

        Raises:
            BagError: A message cannot be decoded.
        """
        payloads = self._payloads[key]
        return [decode_message(payloads.topic.type, memoryview(each)) for each in payloads.messages]
