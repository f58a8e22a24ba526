"""Joins the messages of a running graph to frames of one tick each, at most so many per second; drops all others.

Everything that is drawn together has the same tick, because boxes of one tick do not fit an image of another.
"""

from collections import deque
from collections.abc import Collection, Iterable

from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.show.rerun.live.live_frame import LiveFrame, LiveScene, Payloads
from simbev_ros.show.rerun.live.tick_rate import TickRate

MAX_LAG_TICKS = 16
"""A topic this far behind is not waited for; in lockstep at most 8 ticks are in flight."""
_UNSTAMPED = "std_msgs/msg/String"
_MAX_UNSTAMPED = 100


class FrameJoin:
    """Collects the messages of the ticks that will be drawn.

    A tick is chosen when the first message of it arrives, unless the last choice was too recent. Its frame is complete
    when each topic has sent its message for the tick, or a later one; messages of a topic arrive in order. A topic that
    is slower than the ticks contributes its latest sample, once. JSON texts, whose stamps are inside, belong to the
    next frame.

    Args:
        scene: The scene.
        topics: Topics to wait for, and whose messages are kept.
        interval_s: Minimum wall time between two chosen ticks.
    """

    def __init__(self, scene: LiveScene, topics: Iterable[Topic], interval_s: float) -> None:
        self._scene, self._interval_s = scene, interval_s
        self._streams = {topic.name: _Stream(topic) for topic in topics if topic.type != _UNSTAMPED}
        self._texts: dict[str, tuple[Topic, deque[bytes]]] = {}
        self._chosen: deque[int] = deque()
        self._newest: int | None = None
        self._chosen_s = -interval_s
        self._awaited: Collection[str] = self._streams.keys()

    def add_topic(self, topic: Topic) -> None:
        """Keep the messages of a further topic."""
        self._streams[topic.name] = stream = _Stream(topic)
        if self._newest is not None:
            stream.begin_at(self._newest)

    def await_only(self, names: Collection[str]) -> None:
        """Wait for these topics only; the others have no publishers."""
        self._awaited = names

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
        spec = self._scene.spec
        tick = spec.publishing_tick_of(stamp_ns)
        if not 0 <= tick < spec.ticks:
            return None
        self._notice(tick, now_s)
        stream = self._streams[name]
        stream.add(tick, payload, is_last=stamp_ns == spec.stamp_ns(tick))
        stream.drop(self._chosen)
        complete = None
        while self._chosen and self._is_complete(self._chosen[0]):
            complete = self._chosen.popleft()
        return None if complete is None else self._frame(complete, rate)

    def _notice(self, tick: int, now_s: float) -> None:
        """Choose a tick that has begun, unless the last choice was too recent."""
        if self._newest is None:
            for stream in self._streams.values():
                stream.begin_at(tick)
        elif tick <= self._newest:
            return
        self._newest = tick
        if now_s - self._chosen_s >= self._interval_s:
            self._chosen.append(tick)
            self._chosen_s = now_s

    def _is_complete(self, tick: int) -> bool:
        assert self._newest is not None
        oldest = self._newest - MAX_LAG_TICKS
        streams = (self._streams[name] for name in self._awaited if name in self._streams)
        return all(stream.is_settled(tick) or stream.newest < oldest for stream in streams)

    def _frame(self, tick: int, rate: TickRate) -> LiveFrame:
        taken = [Payloads(stream.topic, stream.take(tick)) for stream in self._streams.values()]
        taken += [Payloads(topic, list(texts)) for topic, texts in self._texts.values()]
        self._texts.clear()
        return LiveFrame(self._scene, tick, [each for each in taken if each.messages], rate.ticks_per_s)


class _Stream:
    """Messages of one topic that may still be drawn.

    Attributes:
        topic: The topic.
        newest: Tick of the newest message.
    """

    def __init__(self, topic: Topic) -> None:
        self.topic, self.newest = topic, -1
        self._is_whole, self._drawn = False, -1
        self._messages: dict[int, list[bytes]] = {}

    def begin_at(self, tick: int) -> None:
        """Wait for messages from this tick on; earlier ones may have been missed."""
        self.newest, self._is_whole = tick - 1, True

    def add(self, tick: int, payload: bytes, *, is_last: bool) -> None:
        """Keep a message; there are several in a tick if the sensor is faster than the ticks."""
        if tick >= self.newest:
            self.newest, self._is_whole = tick, is_last
            self._messages.setdefault(tick, []).append(payload)

    def is_settled(self, tick: int) -> bool:
        """Whether the message for a tick is there, or lost."""
        due = self._due(tick)
        return self.newest > due or (self.newest == due and self._is_whole)

    def drop(self, chosen: Iterable[int]) -> None:
        """Drop everything that belongs neither to a chosen tick nor to the newest one."""
        kept = {self.newest, *map(self._due, chosen)}
        for tick in [each for each in self._messages if each not in kept]:
            del self._messages[tick]

    def take(self, tick: int) -> list[bytes]:
        """Messages for a tick that have not been taken yet."""
        due = self._due(tick)
        if due <= self._drawn:
            return []
        self._drawn = due
        return self._messages.pop(due, [])

    def _due(self, tick: int) -> int:
        return tick - tick % self.topic.period_ticks
