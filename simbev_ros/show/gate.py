"""Stands before a server of another project and lets those requests through that ``show.access`` admits.

The server behind it listens at a loopback address that is drawn at random, so that no web page can guess it, and
receives nothing from other programs (``show.loopback``).
"""

import fcntl
import os
import secrets
import socket
import threading
import time
from contextlib import ExitStack, suppress
from typing import Self

from simbev_ros.foundation.errors import InputError
from simbev_ros.show.access import HEAD_TIMEOUT_S, MAX_CONNECTIONS, MAX_HEAD_BYTES, has_token, is_own_host
from simbev_ros.show.loopback import SoleClient, is_own_client

_SPLICE_BYTES = 1 << 20
_VERSIONS = (b"HTTP/1.0", b"HTTP/1.1")
END_OF_HEAD = b"\r\n\r\n"


def hidden_address() -> str:
    """A loopback address, one of 16 million, for a server behind a gate."""
    return "127." + ".".join(str(1 + secrets.randbelow(254)) for _ in range(3))


class Gate:
    """Passes admitted connections on to a server; ends with its context.

    Args:
        host: Name or address of the interface to listen on.
        port: Port to listen on; 0: any free one.
        server: Address and port of the server.
        token: What ``token`` in the address of a request must be.
        pid: Id of the server's process: this one, or a child.

    Attributes:
        port: Port that it listens on.

    Raises:
        InputError: The address or the port cannot be used.
        SimbevError: Another user of the machine has connected to the server already.
    """

    def __init__(self, host: str, port: int, server: tuple[str, int], token: str, pid: int) -> None:
        self._token = token
        self._free = threading.BoundedSemaphore(MAX_CONNECTIONS)
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        try:
            family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0][0]
            self._listener = socket.create_server((host, port), family=family, backlog=MAX_CONNECTIONS)
        except OSError as error:
            problem = f"{port} of {host} cannot be used: {error.strerror}; choose another one, or another address"
            raise InputError(problem, parameter="port") from None
        self.port = int(self._listener.getsockname()[1])
        self._server = SoleClient(server, pid)

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, name="gate", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._close(self._listener)
        with self._lock:
            connections = [*self._open]
        for connection in connections:
            self._close(connection)
        self._server.__exit__()

    def _accept(self) -> None:
        with suppress(OSError):  # the listener has been closed
            while True:
                client, _ = self._listener.accept()
                if self._free.acquire(blocking=False):
                    threading.Thread(target=self._serve, args=(client,), name="gate", daemon=True).start()
                else:
                    client.close()

    def _serve(self, client: socket.socket) -> None:
        with ExitStack() as held:
            held.callback(self._free.release)
            held.callback(self._note_closed, client)
            with self._lock:
                self._open.add(client)
            with suppress(OSError):
                if (request := self._admit(client)) is None:
                    return
                server = held.enter_context(self._server.connect())
                server.sendall(request)
                client.settimeout(None)
                back = threading.Thread(target=_pump, args=(server, client), name="gate", daemon=True)
                back.start()
                _pump(client, server)
                back.join()

    def _admit(self, client: socket.socket) -> bytes | None:
        """What the server receives first; None: the client has been refused."""
        refusal, request = self._judge(read_head(client))
        if not refusal:
            return request
        body = f"{refusal}\n".encode()
        client.sendall(
            b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\nConnection: close\r\n"
            + f"Content-Length: {len(body)}\r\n\r\n".encode()
            + body
        )
        return None

    def _judge(self, head: bytes) -> tuple[str, bytes]:
        """Why a request is refused (empty: it is not), and what the server receives: it never sees the token."""
        line, _, rest = head.partition(b"\r\n")
        words, lines = line.split(b" "), rest.partition(END_OF_HEAD)[0].split(b"\r\n")
        is_plain = not any(b"\r" in each or b"\n" in each for each in (line, *lines))  # which end lines for some
        is_request = len(words) == 3 and words[0].isalpha() and words[2] in _VERSIONS
        if END_OF_HEAD not in head or not is_request or not is_plain:
            return "not a request", b""
        headers = [each.split(b":", 1) for each in lines if b":" in each]
        hosts = [value.strip().decode("latin-1") for name, value in headers if name.strip().lower() == b"host"]
        if len(hosts) != 1 or not is_own_host(hosts[0]):
            return "this host name is not this machine's; use its address", b""
        if not has_token(words[1].decode("latin-1"), self._token):
            return "the address lacks the token; use the address that `simbev view` has printed", b""
        return "", b" ".join((words[0], b"/", words[2])) + b"\r\n" + rest

    def _note_closed(self, client: socket.socket) -> None:
        with self._lock:
            self._open.discard(client)
        client.close()

    @staticmethod
    def _close(connection: socket.socket) -> None:
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)  # wakes the threads that wait for it
        connection.close()


class UserGate(Gate):
    """Passes connections of this user's processes on to a server, whatever they send.

    Args:
        server: Address and port of the server.
        pid: Id of the server's process: this one, or a child.

    Attributes:
        address: Where it listens.

    Raises:
        SimbevError: Another user of the machine has connected to the server already.
    """

    def __init__(self, server: tuple[str, int], pid: int) -> None:
        super().__init__(host := hidden_address(), 0, server, "", pid)
        self.address = (host, self.port)

    def _admit(self, client: socket.socket) -> bytes | None:
        return b"" if is_own_client(client) else None


def read_head(client: socket.socket) -> bytes:
    """The head of a request, and what came with it; cut off at the limit.

    Raises:
        OSError: It does not arrive in time.
    """
    head, deadline_s = b"", time.monotonic() + HEAD_TIMEOUT_S
    while END_OF_HEAD not in head and len(head) < MAX_HEAD_BYTES:
        client.settimeout(max(deadline_s - time.monotonic(), 0.001))
        if not (more := client.recv(4096)):
            break
        head += more
    return head


def _pump(source: socket.socket, target: socket.socket) -> None:
    """Pass on what one side sends until it ends; the bytes stay in the kernel."""
    read_end, write_end = os.pipe()
    with suppress(OSError):  # beyond what the user may have in pipes, it stays small
        fcntl.fcntl(write_end, fcntl.F_SETPIPE_SZ, _SPLICE_BYTES)
    try:
        with suppress(OSError):
            while count := os.splice(source.fileno(), write_end, _SPLICE_BYTES):
                while count:
                    count -= os.splice(read_end, target.fileno(), count)
    finally:
        os.close(read_end)
        os.close(write_end)
        for each in (source, target):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
