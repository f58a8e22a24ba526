"""Whether the loopback interface carries messages: the processes of a graph find each other through it alone."""

import socket

from simbev_ros.foundation.errors import InputError

_ADDRESS = "127.0.0.1"
_PATIENCE_S = 2.0


def loopback_problem() -> str | None:
    """What is wrong with the loopback interface, and what to do about it; None: a message comes back."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.settimeout(_PATIENCE_S)
        try:
            own.bind((_ADDRESS, 0))
            own.sendto(b"simbev", own.getsockname())
            own.recv(16)
        except OSError as error:
            words = f"the loopback interface carries no messages to {_ADDRESS} ({error.strerror or error})"
            return f"{words}; the graph needs it: ip link set lo up"
    return None


def require_loopback() -> None:
    """Check that the loopback interface carries messages.

    Raises:
        InputError: It does not.
    """
    if problem := loopback_problem():
        raise InputError(problem)
