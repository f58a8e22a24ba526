"""A client of the Foxglove WebSocket protocol: it subscribes to every channel, and keeps what it receives."""

import json
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Self

import websocket
from waiting import PATIENCE_S, wait_until

_MESSAGE = struct.Struct("<BIQ")
_MESSAGE_DATA = 1


class FoxgloveClient:
    """A connection.

    Attributes:
        info: What the server says of itself.
        channels: Channels by topic, as they are offered now.
        messages: Stamp, ns, and bytes of each message by topic.
    """

    def __init__(self, url: str) -> None:
        self._socket = websocket.create_connection(url, subprotocols=["foxglove.sdk.v1"], timeout=PATIENCE_S)
        self.info: dict[str, Any] = json.loads(self._socket.recv())
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = {}
        self._topics: dict[int, str] = {}
        self._socket.settimeout(0.1)

    def receive_until(self, condition: Callable[[], bool], timeout_s: float = PATIENCE_S) -> None:
        """Receive until a condition holds; fail if it never does."""
        wait_until(condition, timeout_s, meanwhile=self._receive_once)

    def receive(self, seconds: float) -> None:
        """Receive for some time."""
        end_s = time.monotonic() + seconds
        self.receive_until(lambda: time.monotonic() > end_s, seconds + 20)

    def _receive_once(self) -> None:
        with suppress(websocket.WebSocketTimeoutException):
            self._take(self._socket.recv())

    def send(self, data: bytes) -> None:
        """Send a binary message."""
        self._socket.send_binary(data)

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            if data[:1] == bytes([_MESSAGE_DATA]):
                _, number, stamp_ns = _MESSAGE.unpack_from(data)
                self.messages.setdefault(self._topics[number], []).append((stamp_ns, data[_MESSAGE.size :]))
            return
        assert data, "the server has closed the connection"
        news = json.loads(data)
        if news["op"] == "advertise":
            channels = news["channels"]
            self.channels |= {channel["topic"]: channel for channel in channels}
            self._topics |= {channel["id"]: channel["topic"] for channel in channels}
            wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
            self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        elif news["op"] == "unadvertise":
            for number in news["channelIds"]:
                self.channels.pop(self._topics[number], None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()
