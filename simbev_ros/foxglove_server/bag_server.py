"""Plays a bag to the clients of a Foxglove WebSocket server: messages go over as they are in the file.

Clients with playback controls (Foxglove) can pause, seek and change the speed. For the others (Lichtblick), the bag is
played in a loop until a client uses the controls.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from simbev_ros.errors import BagError, InputError
from simbev_ros.foxglove_server.playback_clock import PlaybackClock
from simbev_ros.recording.reader import RawMessage, SceneBag

if TYPE_CHECKING:
    from foxglove.websocket import PlaybackControlRequest, PlaybackState, ServerListener

_PERIOD_S = 0.01
_BACKLOG = 256
"""Maximum number of messages that wait for a slow client; then the oldest are dropped for it."""
_HOST = "127.0.0.1"


def serve_bag(bag: SceneBag, port: int, on_started: Callable[[int], None]) -> None:
    """Serve a bag on the loopback interface until an exception, such as an interrupt, ends it.

    Args:
        bag: The bag.
        port: TCP port; 0: any free one.
        on_started: Called with the port once clients can connect.

    Raises:
        InputError: foxglove-sdk is not installed, the bag has no messages, or the port cannot be used.
        BagError: The bag is damaged.
    """
    try:
        import foxglove
        from foxglove.websocket import Capability
    except ImportError:
        raise InputError("foxglove-sdk is not installed: pip install 'simbev_ros[foxglove]'") from None
    start_ns, end_ns = bag.span_ns
    if end_ns == 0:
        raise BagError(f"{bag.path}: it has no messages")
    context = foxglove.Context()
    player = _BagPlayer(bag, PlaybackClock(start_ns, end_ns, start_ns), context)
    try:
        server = foxglove.start_server(
            name=bag.name,
            host=_HOST,
            port=port,
            capabilities=[Capability.Time],
            server_listener=cast("ServerListener", player),  # it has the methods that its capabilities need
            context=context,
            playback_time_range=(start_ns, end_ns),
            message_backlog_size=_BACKLOG,
        )
    except RuntimeError as error:
        raise InputError(f"port {port} of {_HOST} cannot be used: {error}; choose another one with --port") from None
    try:
        on_started(server.port)
        player.play(server)
    finally:
        server.stop()


class _BagPlayer:
    """Sends the messages of subscribed topics when they are due.

    The server calls the methods ``on_…`` from threads of its own; they leave their requests in a queue.
    """

    def __init__(self, bag: SceneBag, clock: PlaybackClock, context: Any) -> None:
        import foxglove

        self._bag, self._clock = bag, clock
        self._requests: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._subscribers: dict[str, int] = {}
        self._controlled = False
        self._waiting: RawMessage | None = None
        self._messages: Iterator[RawMessage] = iter(())
        self._channels = {
            channel.topic: foxglove.Channel(
                channel.topic,
                schema=foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data),
                message_encoding=channel.message_encoding,
                metadata=dict(channel.metadata),
                context=context,
            )
            for channel, schema in bag.definitions()
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

    def play(self, server: Any) -> None:
        """Send messages until an exception ends it."""
        before_s = time.monotonic()
        while True:
            with suppress(Empty):
                self._requests.get(timeout=_PERIOD_S)()
                while True:
                    self._requests.get_nowait()()
            now_s = time.monotonic()
            position_ns, before_s = self._clock.advance(now_s - before_s), now_s
            self._send_until(position_ns)
            server.broadcast_time(position_ns)
            if self._clock.playing and self._clock.at_end:
                self._end(server)

    def _send_until(self, position_ns: int) -> None:
        while (message := self._waiting or next(self._messages, None)) is not None:
            self._waiting = message if message.stamp_ns > position_ns else None
            if self._waiting is not None:
                return
            self._send(message)

    def _send(self, message: RawMessage) -> None:
        self._channels[message.topic].log(bytes(message.data), log_time=message.stamp_ns)

    def _end(self, server: Any) -> None:
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
        if speed > 0:
            self._clock.speed = speed
        if seek_ns is not None:
            self._jump(seek_ns)

    def _jump(self, stamp_ns: int) -> None:
        """Continue at a stamp; every subscribed topic shows its latest message before it."""
        self._clock.seek(stamp_ns)
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
        """Read the subscribed topics from here on."""
        self._waiting = None
        self._messages = self._bag.messages(set(self._subscribers), from_ns=self._clock.position_ns + 1)

    def _send_current(self, topic: str) -> None:
        stamps_ns = self._bag.topics[topic].stamps_ns
        past_ns = stamps_ns[stamps_ns <= self._clock.position_ns]
        if len(past_ns):
            stamp_ns = int(np.max(past_ns))
            for message in self._bag.messages([topic], from_ns=stamp_ns, to_ns=stamp_ns):
                self._send(message)
