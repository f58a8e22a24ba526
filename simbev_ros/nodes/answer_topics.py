"""The topics on which a perception stack answers: subscribed to as they are found, whatever their types are."""

from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from simbev_ros.errors import InputError
from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes
from simbev_ros.evaluation.predictions.prediction_messages import (
    BOX_TYPES,
    IMAGE_TYPE,
    OCCUPANCY_TYPE,
    image_scores,
    message_boxes,
    occupancy_scores,
    stamp_ns_of,
)
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.msgs.message_types import message_class
from simbev_ros.semantics import BEV_CLASSES

Answer = PredictedBoxes | ScoreGrid
_DEPTH = 64
_NS_PER_S = 1e9

TickOf = Callable[[int, str], int | None]
"""The tick of a stamp; None: the answer is to nothing here. Gets the topic for messages."""
Take = Callable[[str, int, Answer, float], None]
"""Takes topic, tick, answer, and when it came, s."""


class AnswerTopics:
    """Looks for publishers, and turns what they send into boxes and scores.

    Args:
        node: That subscribes.
        boxes_topic: Of boxes.
        grids_topic: Of scores of cells, of all classes; those of single classes are below it.
        tick_of: Tells ticks.
        take: Gets the answers.

    Attributes:
        found: Topics that are subscribed to.
    """

    def __init__(self, node: Node, boxes_topic: str, grids_topic: str, tick_of: TickOf, take: Take) -> None:
        self._node, self._tick_of, self._take = node, tick_of, take
        self._grids_topic = grids_topic
        self._classes = {f"{grids_topic}/{name}": name for name in BEV_CLASSES}
        self._types: dict[str, tuple[str, ...]] = {boxes_topic: tuple(BOX_TYPES), grids_topic: (IMAGE_TYPE,)}
        self._types |= dict.fromkeys(self._classes, (OCCUPANCY_TYPE,))
        self.found: dict[str, Any] = {}

    @property
    def words(self) -> str:
        """All names, for messages."""
        boxes, grids, *_ = self._types
        return f"{boxes}, {grids} or {grids}/<class>"

    @property
    def are_connected(self) -> bool:
        """Whether there is at least one, and each has a publisher."""
        return bool(self.found) and all(each.get_publisher_count() for each in self.found.values())

    def look(self) -> list[str]:
        """Subscribe to those that have a publisher by now; give their names.

        Raises:
            InputError: One is of a wrong type, or one whose package is not installed, or scores are said in two ways.
        """
        new = []
        for name in [each for each in self._types if each not in self.found]:
            if publishers := self._node.get_publishers_info_by_topic(name):
                kinds = {each.topic_type for each in publishers}
                reliable = all(each.qos_profile.reliability == ReliabilityPolicy.RELIABLE for each in publishers)
                self._subscribe(name, kinds, is_reliable=reliable)
                new.append(name)
        by_class = sorted(self.found.keys() & self._classes.keys())
        if by_class and self._grids_topic in self.found:
            both = f"{self._grids_topic} and {by_class[0]}"
            raise InputError(f"there are scores on {both}; allowed is one or the other")
        return new

    def _subscribe(self, name: str, kinds: set[str], *, is_reliable: bool) -> None:
        kind, *others = sorted(kinds)
        if others or kind not in self._types[name]:
            raise InputError(f"{name}: is a {' and a '.join(sorted(kinds))}; allowed: {', '.join(self._types[name])}")
        try:
            message_type = message_class(kind)
        except ModuleNotFoundError as error:
            raise InputError(f"{name}: is a {kind}, but {error.name} is not installed") from None
        reliability = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=_DEPTH, reliability=reliability)
        callback: Any = self._callback(name, kind)  # rclpy's types know of one argument only
        self.found[name] = self._node.create_subscription(message_type, name, callback, qos)

    def _callback(self, name: str, kind: str) -> Callable[[Any, Any], None]:
        def receive(message: Any, info: Any) -> None:
            stamp_ns = stamp_ns_of(message)
            if stamp_ns is None:
                return
            tick = self._tick_of(stamp_ns, name)
            if tick is not None:
                self._take(name, tick, self._answer(name, kind, message, tick), received_s(info))

        return receive

    def _answer(self, name: str, kind: str, message: Any, tick: int) -> Answer:
        source = f"{name}: tick {tick}"
        if kind in BOX_TYPES:
            return message_boxes(kind, message, tick, source)
        if kind == IMAGE_TYPE:
            return ScoreGrid(BEV_CLASSES, image_scores(message, source), source)
        return ScoreGrid((self._classes[name],), occupancy_scores(message, source)[np.newaxis], source)


def received_s(info: Any) -> float:
    """When the middleware received a message, s since 1970."""
    return float(info["received_timestamp"]) / _NS_PER_S
