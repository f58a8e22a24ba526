"""Starts a Foxglove WebSocket server at an address, and says in one line why it cannot."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import load_extras

if TYPE_CHECKING:
    from foxglove import Context
    from foxglove.websocket import WebSocketServer

TIME_PERIOD_S = 0.1
"""Time between two messages with the current time. A client that leaves too many of them waiting is disconnected."""


class Address(NamedTuple):
    """Where a server listens: host name or address of an interface, and TCP port; 0: any free one."""

    host: str
    port: int

    @property
    def url(self) -> str:
        """Address for clients."""
        return f"ws://[{self.host}]:{self.port}" if ":" in self.host else f"ws://{self.host}:{self.port}"


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
            host=address.host,
            port=address.port,
            capabilities=[Capability.Time],
            server_listener=listener,  # type: ignore[arg-type]
            context=context,
            **options,
        )
    except RuntimeError as error:
        reason = str(error).removeprefix("FoxgloveError: ")
        problem = f"{address.port} of {address.host} cannot be used: {reason}; choose another one, or another address"
        raise InputError(problem, parameter="port") from None
    try:
        yield server, address._replace(port=server.port)
    finally:
        server.stop()
