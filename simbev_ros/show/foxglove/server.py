"""Starts a Foxglove WebSocket server at an address, and says in one line why it cannot."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.show.access import origin, user_token
from simbev_ros.show.gate import Gate, hidden_address

if TYPE_CHECKING:
    from foxglove import Context
    from foxglove.websocket import WebSocketServer

TIME_PERIOD_S = 0.1
"""Time between two messages with the current time. A client that leaves too many of them waiting is disconnected."""


class Address(NamedTuple):
    """Where a server listens: host name or address of an interface, TCP port (0: any free one), token of clients."""

    host: str
    port: int
    token: str = ""

    @property
    def url(self) -> str:
        """Address for clients."""
        return f"{origin(self.host, self.port, 'ws')}/?token={self.token}"


def require_foxglove() -> None:
    """Raise InputError if foxglove-sdk is not installed."""
    load_extras()["foxglove"].require("the server")


@contextmanager
def running_server(
    name: str, address: Address, listener: object, context: "Context", **options: Any
) -> Iterator[tuple["WebSocketServer", Address]]:
    """A server that ends with the context, and the address at which it listens.

    Args:
        name: Name that clients show.
        address: Where to listen.
        listener: Has the methods of ``ServerListener`` that the server's capabilities need.
        context: The context of the channels.
        options: Further arguments of ``foxglove.start_server``.

    Raises:
        InputError: The address or the port cannot be used.
    """
    import foxglove
    from foxglove.websocket import Capability

    foxglove.set_log_level("CRITICAL")  # it reports each client that leaves without a farewell
    try:
        server = foxglove.start_server(
            name=name,
            host=(host := hidden_address()),
            port=0,
            capabilities=[Capability.Time],
            server_listener=listener,  # type: ignore[arg-type]
            context=context,
            **options,
        )
    except RuntimeError as error:
        raise SimbevError(f"Foxglove's server did not start: {str(error).removeprefix('FoxgloveError: ')}") from None
    try:
        token = user_token()
        with Gate(address.host, address.port, (host, server.port), token, os.getpid()) as gate:
            yield server, address._replace(port=gate.port, token=token)
    finally:
        server.stop()
