"""Plays a bag to the clients of a Foxglove WebSocket server: messages go over as they are in the file.

Clients with playback controls (Foxglove) can pause, seek and change the speed. For the others (Lichtblick), the bag is
played in a loop until a client uses the controls. Topics that a graph publishes for displays only are made from the
recorded messages while a client is subscribed to them.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np

from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.show.foxglove.derived import Derivation, derivations
from simbev_ros.show.foxglove.playback_clock import PlaybackClock
from simbev_ros.show.foxglove.schemas import schema_of
from simbev_ros.show.foxglove.server import TIME_PERIOD_S

if TYPE_CHECKING:
    from foxglove import Context
    from foxglove.websocket import PlaybackControlRequest, PlaybackState, WebSocketServer

_PERIOD_S = 0.01
_MAX_SPEED = 1000.0
_PATIENCE_S = 0.1
"""Time after which requests are looked at, even if messages are due; playback is then slower than asked for."""

_BURST, _BURST_PAUSE_S = 16, 0.001
"""Number of messages after which the server gets time to send them, before more than its backlog waits."""


class BagPlayer:
    """Sends the messages of subscribed topics when they are due.

    The server calls the methods ``on_…`` from threads of its own; they leave their requests in a queue.
    """

    def __init__(self, bag: SceneBag, clock: PlaybackClock, context: "Context", warn: Callable[[str], None]) -> None:
        import foxglove

        self._bag, self._clock, self._warn = bag, clock, warn
        self._warned: set[str] = set()
        self._requests: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._subscribers: dict[str, int] = {}
        self._controlled = False
        self._unpaused = 0
        self._waiting: RawMessage | None = None
        self._messages: Iterator[RawMessage] = iter(())
        self._latest: dict[str, RawMessage] = {}
        self._derived = derivations(bag)
        self._channels = {
            channel.topic: foxglove.Channel(
                channel.topic,
                schema=foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data),
                message_encoding=channel.message_encoding,
                metadata=dict(channel.metadata),
                context=context,
            )
            for channel, schema in bag.definitions()
        } | {
            name: foxglove.Channel(name, schema=schema_of(derived.type_name), message_encoding="cdr", context=context)
            for name, derived in self._derived.items()
        }

    def on_subscribe(self, _client: Any, channel: Any) -> None:
        """Count a subscriber, and send the topic's current message."""
        self._requests.put(lambda: self._subscribe(channel.topic))

    def on_unsubscribe(self, _client: Any, channel: Any) -> None:
        """Count a subscriber less."""
        self._requests.put(lambda: self._unsubscribe(channel.topic))

    def on_playback_control_request(self, request: "PlaybackControlRequest") -> "PlaybackState":
        """Play, pause or seek."""
        from foxglove.websocket import PlaybackCommand, PlaybackState, PlaybackStatus

        playing = request.playback_command == PlaybackCommand.Play
        seek_ns, speed = request.seek_time, request.playback_speed
        self._requests.put(lambda: self._control(playing, speed, seek_ns))
        return PlaybackState(
            PlaybackStatus.Playing if playing else PlaybackStatus.Paused,
            self._clock.position_ns if seek_ns is None else seek_ns,
            speed,
            seek_ns is not None,
            request.request_id,
        )

    def play(self, server: "WebSocketServer") -> None:
        """Send messages until an exception ends it."""
        before_s, told_s = time.monotonic(), 0.0
        while True:
            with suppress(Empty):
                self._requests.get(timeout=_PERIOD_S)()
                while True:
                    self._requests.get_nowait()()
            now_s = time.monotonic()
            position_ns, before_s = self._clock.advance(now_s - before_s), now_s
            self._send_until(position_ns)
            if now_s - told_s >= TIME_PERIOD_S:
                server.broadcast_time(self._clock.position_ns)
                told_s = now_s
            if self._clock.playing and self._clock.at_end:
                self._end(server)

    def _send_until(self, position_ns: int) -> None:
        patience_ends_s = time.monotonic() + _PATIENCE_S
        while (message := self._waiting or self._next()) is not None:
            self._waiting = message if message.stamp_ns > position_ns else None
            if self._waiting is not None:
                return
            self._send(message)
            if time.monotonic() > patience_ends_s:
                self._clock.seek(message.stamp_ns)
                return

    def _next(self) -> RawMessage | None:
        """The next message; None at the end of the bag, or where it is damaged."""
        try:
            return next(self._messages, None)
        except BagError as error:
            self._warn_once(f"{error}; what comes before is served")
            return None

    def _send(self, message: RawMessage) -> None:
        if message.topic in self._subscribers:
            self._log(message.topic, bytes(message.data), message.stamp_ns)
        self._latest[message.topic] = message
        for name in self._subscribers:
            derived = self._derived.get(name)
            if derived is not None and derived.sources[0] == message.topic:
                self._send_derived(derived, message.stamp_ns)

    def _send_derived(self, derived: Derivation, stamp_ns: int) -> None:
        messages = [self._latest[source] for source in derived.sources if source in self._latest]
        if len(messages) < len(derived.sources):
            return
        try:
            self._log(derived.name, derived.make(messages), stamp_ns)
        except BagError as error:
            self._warn_once(str(error))

    def _log(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Hand a message to the server; after several, leave it time to send them."""
        self._channels[topic].log(data, log_time=stamp_ns)
        self._unpaused += 1
        if self._unpaused >= _BURST:
            self._unpaused = 0
            time.sleep(_BURST_PAUSE_S)

    def _warn_once(self, line: str) -> None:
        if line not in self._warned:
            self._warned.add(line)
            self._warn(line)

    def _end(self, server: "WebSocketServer") -> None:
        """Start again, or stop there if a client has the controls."""
        from foxglove.websocket import PlaybackState, PlaybackStatus

        if not self._controlled:
            self._jump(self._clock.start_ns)
            return
        self._clock.playing = False
        state = PlaybackState(PlaybackStatus.Ended, self._clock.position_ns, self._clock.speed, False, None)
        server.broadcast_playback_state(state)

    def _control(self, playing: bool, speed: float, seek_ns: int | None) -> None:
        self._controlled = True
        self._clock.playing = playing
        if 0 < speed <= _MAX_SPEED:  # also no infinity
            self._clock.speed = speed
        if seek_ns is not None:
            self._jump(seek_ns)

    def _jump(self, stamp_ns: int) -> None:
        """Continue at a stamp; every subscribed topic shows its latest message before it."""
        self._clock.seek(stamp_ns)
        self._latest.clear()
        for topic in self._subscribers:
            self._send_current(topic)
        self._follow()

    def _subscribe(self, topic: str) -> None:
        self._subscribers[topic] = self._subscribers.get(topic, 0) + 1
        self._send_current(topic)
        self._follow()

    def _unsubscribe(self, topic: str) -> None:
        self._subscribers[topic] = self._subscribers.get(topic, 0) - 1
        if self._subscribers[topic] <= 0:
            del self._subscribers[topic]
        self._follow()

    def _follow(self) -> None:
        """Read from here on what the subscribed topics need."""
        read = {source for name in self._subscribers for source in self._sources(name)}
        self._waiting = None
        self._latest = {name: message for name, message in self._latest.items() if name in read}
        self._messages = self._bag.messages(read, from_ns=self._clock.position_ns + 1)

    def _sources(self, topic: str) -> tuple[str, ...]:
        """Recorded topics of which a topic is made."""
        return self._derived[topic].sources if topic in self._derived else (topic,)

    def _send_current(self, topic: str) -> None:
        for source in self._sources(topic):
            if (message := self._current(source)) is not None:
                self._latest[source] = message
        if (first := self._latest.get(self._sources(topic)[0])) is None:
            return
        if topic in self._derived:
            self._send_derived(self._derived[topic], first.stamp_ns)
        else:
            self._log(topic, bytes(first.data), first.stamp_ns)

    def _current(self, topic: str) -> RawMessage | None:
        """The latest message of a recorded topic up to now."""
        stamps_ns = self._bag.topics[topic].stamps_ns
        past_ns = stamps_ns[stamps_ns <= self._clock.position_ns]
        if not len(past_ns):
            return None
        stamp_ns = int(np.max(past_ns))
        try:
            return list(self._bag.messages([topic], from_ns=stamp_ns, to_ns=stamp_ns))[-1]
        except (BagError, IndexError):  # damage is reported when it is played
            return None
