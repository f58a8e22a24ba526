"""Joins the messages of a running graph to frames of one tick each, at a limited rate; drops all others.

Everything that is drawn together has the same tick, because boxes of one tick do not fit an image of another.
"""

from collections import deque
from collections.abc import Collection, Iterable, Mapping

from simbev_ros.foundation.tick_join import TickJoin
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.show.rerun.live.live_frame import LiveFrame, LiveScene, Payloads
from simbev_ros.show.rerun.live.tick_rate import TickRate

MAX_LAG_TICKS = 16
"""A topic that is late by this number of ticks is not waited for; in lockstep at most 8 ticks are in flight."""
_UNSTAMPED = "std_msgs/msg/String"
_MAX_UNSTAMPED = 100


class FrameJoin:
    """Collects the messages of the ticks that will be drawn.

    A tick is chosen when the first message of it arrives, unless the last choice was too recent. Its frame is complete
    when each topic has sent its message for the tick, or a later one; messages of a topic arrive in order. A topic that
    is slower than the ticks contributes its latest sample, once. JSON texts, with their stamps inside, belong to the
    next frame.

    Args:
        scene: The scene.
        topics: Topics to wait for, with messages that are kept.
        interval_s: Minimum wall time between two chosen ticks.
    """

    def __init__(self, scene: LiveScene, topics: Iterable[Topic], interval_s: float) -> None:
        self._scene, self._interval_s = scene, interval_s
        self._topics = {topic.name: topic for topic in topics if topic.type != _UNSTAMPED}
        self._texts: dict[str, tuple[Topic, deque[bytes]]] = {}
        self._join: TickJoin[None, list[bytes]] = TickJoin(
            lambda _, tick: all(self._is_settled(name, tick) for name in self._awaited),
            newest=True,
            sample_of=self._due,
        )
        self._first: dict[str, int] = {}
        self._unfinished: dict[str, int] = {}
        self._newest: int | None = None
        self._chosen_s = -interval_s
        self._awaited: Collection[str] = self._topics.keys()

    def add_topic(self, topic: Topic) -> None:
        """Keep the messages of a further topic."""
        self._topics[topic.name] = topic
        if self._newest is not None:
            self._first[topic.name] = self._newest

    def await_only(self, names: Collection[str]) -> None:
        """Wait for these topics only; the others have no publishers."""
        self._awaited = [name for name in names if name in self._topics]

    def add_text(self, topic: Topic, payload: bytes) -> None:
        """Keep a message without a stamp in its header for the next frame: all of a sporadic topic, else the newest."""
        count = _MAX_UNSTAMPED if topic.sporadic else 1
        self._texts.setdefault(topic.name, (topic, deque(maxlen=count)))[1].append(payload)

    def add(self, name: str, stamp_ns: int, payload: bytes, now_s: float, rate: TickRate) -> LiveFrame | None:
        """Add a message; return the newest frame that it completes, if it completes one.

        Args:
            name: The topic.
            stamp_ns: Stamp of the message, ns.
            payload: The serialized message.
            now_s: Wall time, s.
            rate: Speed of the graph, for the frame.
        """
        spec = self._scene.view.scene
        tick = spec.publishing_tick_of(stamp_ns)
        if not 0 <= tick < spec.ticks:
            return None
        self._notice(tick, now_s)
        self._join.add(name, tick, [*(self._join.message(name, tick) or ()), payload])
        if stamp_ns == spec.stamp_ns(tick):
            self._unfinished.pop(name, None)
        else:  # there are several messages in a tick if the sensor is faster than the ticks
            self._unfinished[name] = tick
        for complete, _, messages in self._join.release():
            return self._frame(complete, messages, rate)
        return None

    def _notice(self, tick: int, now_s: float) -> None:
        """Choose a tick that has begun, unless the last choice was too recent."""
        if self._newest is None:
            self._first = dict.fromkeys(self._topics, tick)
        elif tick <= self._newest:
            return
        self._newest = tick
        if now_s - self._chosen_s >= self._interval_s:
            self._join.open(tick, None)
            self._chosen_s = now_s

    def _due(self, name: str, tick: int) -> int:
        return tick - tick % self._topics[name].period_ticks

    def _is_settled(self, name: str, tick: int) -> bool:
        """Whether the message of a topic for a tick is there, lost, or of a topic that has fallen silent."""
        assert self._newest is not None
        due, first, newest = self._due(name, tick), self._first[name], self._join.newest(name)
        if due < first or (first - 1 if newest is None else newest) < self._newest - MAX_LAG_TICKS:
            return True
        return self._join.is_past(name, due) or (newest == due and self._unfinished.get(name) != due)

    def _frame(self, tick: int, messages: Mapping[str, list[bytes]], rate: TickRate) -> LiveFrame:
        taken = [Payloads(topic, messages[name]) for name, topic in self._topics.items() if name in messages]
        taken += [Payloads(topic, list(texts)) for topic, texts in self._texts.values()]
        self._texts.clear()
        return LiveFrame(self._scene, tick, taken, rate.ticks_per_s)
