"""Subscribes to the topics of a perception stack under evaluation and decodes its messages.

The evaluator node uses it. Topics are found at run time, with any of the supported message types; boxes and grids of
scores come out with the topic, the tick and the time of reception.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

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
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs.message_types import message_class

Answer = PredictedBoxes | ScoreGrid
_DEPTH = 64

TickOf = Callable[[int], int | None]
"""Maps a stamp, ns, to a tick; None if the stamp belongs to no known tick."""
Read = Callable[[str, Callable[[], tuple[int, Answer] | None]], tuple[int, Answer] | None]
Take = Callable[[str, int, Answer, float], None]
"""Receives topic, tick, answer and time of reception, s since 1970."""


class AnswerTopics:
    """Finds publishers of answers, subscribes to them and decodes what they send into boxes and scores.

    Args:
        node: The node that subscribes.
        boxes_topic: Topic of predicted boxes.
        grids_topic: Topic of cell scores for all classes; topics of single classes are ``<grids_topic>/<class>``.
        tick_of: Finds the tick of a stamp.
        take: Called with every decoded answer.
        read: Calls a function that reads a message of a topic; returns None if it raises an error of a malformed one.

    Attributes:
        found: Subscriptions by topic.
        refused: Why there is none to a topic that has a publisher.
    """

    def __init__(self, node: Node, boxes_topic: str, grids_topic: str, tick_of: TickOf, take: Take, read: Read) -> None:
        self._node, self._tick_of, self._take, self._read = node, tick_of, take, read
        self._grids_topic = grids_topic
        self._classes = {f"{grids_topic}/{name}": name for name in BEV_CLASSES}
        self._types: dict[str, tuple[str, ...]] = {boxes_topic: tuple(BOX_TYPES), grids_topic: (IMAGE_TYPE,)}
        self._types |= dict.fromkeys(self._classes, (OCCUPANCY_TYPE,))
        self.found: dict[str, Any] = {}
        self.refused: dict[str, InputError] = {}

    @property
    def topic_names(self) -> str:
        """All possible topics, as text for messages."""
        boxes, grids, *_ = self._types
        return f"{boxes}, {grids} or {grids}/<class>"

    @property
    def are_connected(self) -> bool:
        """Whether at least one topic is found and every found topic has a publisher."""
        return bool(self.found) and all(each.get_publisher_count() for each in self.found.values())

    def subscribe_to_new(self) -> list[str]:
        """Subscribe to topics that have gained a publisher since the last call; return their names.

        One with a wrong type, or a second form of scores, may be a stranger's, so it is entered in ``refused``.
        """
        new = []
        for name in [each for each in self._types if each not in self.found]:
            if publishers := self._node.get_publishers_info_by_topic(name):
                kinds = {each.topic_type for each in publishers}
                reliable = all(each.qos_profile.reliability == ReliabilityPolicy.RELIABLE for each in publishers)
                try:
                    self._subscribe(name, kinds, is_reliable=reliable)
                except InputError as error:
                    self.refused[name] = error
                else:
                    new.append(name)
        return new

    def _subscribe(self, name: str, kinds: set[str], *, is_reliable: bool) -> None:
        others = self._classes if name == self._grids_topic else [self._grids_topic] * (name in self._classes)
        if both := sorted(self.found.keys() & set(others)):
            raise InputError(f"there are scores on {name} and {both[0]}; allowed is one or the other")
        kind = next((each for each in self._types[name] if each in kinds), None)
        if kind is None:
            raise InputError(f"{name}: is a {' and a '.join(sorted(kinds))}; allowed: {', '.join(self._types[name])}")
        try:
            message_type = message_class(kind)
        except ModuleNotFoundError as error:
            raise InputError(f"{name}: is a {kind}, but {error.name} is not installed") from None
        reliability = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=_DEPTH, reliability=reliability)
        callback: Any = self._make_callback(name, kind)  # rclpy's type stubs allow one argument only
        self.found[name] = self._node.create_subscription(message_type, name, callback, qos)

    def _make_callback(self, name: str, kind: str) -> Callable[[Any, Any], None]:
        def receive(message: Any, info: Any) -> None:
            if (answer := self._read(name, partial(self._answer, name, kind, message))) is not None:
                tick, content = answer
                self._take(name, tick, content, received_s(info))

        return receive

    def _answer(self, name: str, kind: str, message: Any) -> tuple[int, Answer] | None:
        """Tick and content of an answer; None if it belongs to no tick of this scene."""
        stamp_ns = stamp_ns_of(message)
        tick = None if stamp_ns is None else self._tick_of(stamp_ns)
        return None if tick is None else (tick, self._decode(name, kind, message, tick))

    def _decode(self, name: str, kind: str, message: Any, tick: int) -> Answer:
        source = f"tick {tick}"
        if kind in BOX_TYPES:
            return message_boxes(kind, message, tick, source)
        if kind == IMAGE_TYPE:
            return ScoreGrid(BEV_CLASSES, image_scores(message, source), source)
        return ScoreGrid((self._classes[name],), occupancy_scores(message, source)[np.newaxis], source)


def received_s(info: Any) -> float:
    """Time at which the middleware received a message, s since 1970."""
    return float(info["received_timestamp"]) / NS_PER_S
