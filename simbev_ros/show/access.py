"""Who may talk to the servers that viewers connect to: one policy for all of them. Pure.

A web page anywhere, in a browser on this machine, can send requests to ports of this machine, under a name of its own
choice (DNS rebinding); so can other users of the machine. Therefore a request must name this machine as host, and
prove by a token in its address that it comes from who has read the address.
"""

import hmac
import ipaddress
import os
import re
import secrets
import socket
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.foundation.files.whole_files import write_errors, write_whole

MAX_HEAD_BYTES = 16 << 10
"""Size of the head of a request."""
HEAD_TIMEOUT_S = 10.0
"""Time in which the head of a request must arrive."""
IDLE_TIMEOUT_S = 30.0
"""Time after which a file that nobody takes is given up."""
MAX_CONNECTIONS = 64
"""Connections at the same time; further ones are closed at once."""

_TOKEN_BYTES = 16
_HOST = re.compile(r"(?:\[([0-9A-Za-z:.%]+)\]|([0-9A-Za-z._-]+))(?::[0-9]*)?")
"""An address in brackets, or another address or name; then perhaps a port. It has no user, path or query."""


def user_token() -> str:
    """The token of this user, which no other can read; it stays the same, so that addresses can be kept.

    Raises:
        InputError: It cannot be written to the cache's folder.
    """
    path = default_cache_dir() / "token"
    if (token := _read_own(path)) is None:
        with write_errors(path):
            token = secrets.token_urlsafe(_TOKEN_BYTES)
            before = os.umask(0o077)
            try:
                write_whole(path, token.encode())
            finally:
                os.umask(before)
    return token


def _read_own(path: Path) -> str | None:
    """The token in a file that this user alone can read and write; None: there is none."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return None
    with os.fdopen(descriptor, encoding="ascii", errors="replace") as file:
        status = os.fstat(descriptor)
        text = file.read(100) if status.st_uid == os.getuid() and not status.st_mode & 0o077 else ""
    return text if len(text) >= _TOKEN_BYTES and text.isascii() and text.isprintable() else None


def has_token(target: str, token: str) -> bool:
    """Whether the target of a request, such as ``/?token=…``, has the token."""
    try:
        given = parse_qs(urlsplit(target).query).get("token", [""])[0]
    except ValueError:
        return False
    return is_equal(given, token)


def is_equal(given: str, expected: str) -> bool:
    """Compare secrets in a time that tells nothing about where they differ."""
    return hmac.compare_digest(given.encode(errors="replace"), expected.encode())


def is_own_host(host: str | None) -> bool:
    """Whether a Host header names this machine by an address, as ``localhost``, or by its own name.

    Names that others can point at this machine's addresses are refused. The port is free, for tunnels.
    """
    parts = _HOST.fullmatch(host or "")
    if parts is None:
        return False
    name = (parts[1] or parts[2]).lower()
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in {"localhost", socket.gethostname().lower()}
    return True


def is_own_origin(origin: str | None, host: str | None) -> bool:
    """Whether a request comes from no web page (None), or from one that the same server has sent."""
    return origin is None or (host is not None and origin in (f"http://{host}", f"https://{host}"))


def origin(host: str, port: int, scheme: str = "http") -> str:
    """The origin of a web page or server, such as ``http://127.0.0.1:9876``."""
    return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"
