"""Closes servers of others at the loopback interface to all but this process, and says who has connected.

Every user of a machine can connect to its loopback ports, and finds them in ``/proc/net/tcp``. A packet filter (classic
BPF, ``SO_ATTACH_FILTER`` of socket(7)) on the listening socket needs no privilege, and drops packets from all source
ports but those that this process holds.
"""

import ctypes
import os
import socket
import struct
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import NamedTuple, Self

from simbev_ros.foundation.errors import SimbevError

LOOPBACK = "127.0.0.1"
_SO_ATTACH_FILTER, _SYS_PIDFD_GETFD = 26, 438
_LOAD_WORD, _LOAD_HALF, _JUMP_IF_EQUAL, _RETURN = 0x20, 0x28, 0x15, 0x06
_SOURCE_IP, _SOURCE_PORT = 0xFFF00000 + 12, 0  # SKF_NET_OFF; other offsets count from the TCP header
_DROP, _KEEP = 0, 0xFFFFFFFF
_SYN_SENT, _LISTENING = "02", "0A"


class _Row(NamedTuple):
    """A line of the kernel's table of TCP sockets."""

    local: str
    remote: str
    state: str
    uid: int
    inode: str


class SoleClient:
    """Connects to a server that nothing else reaches from then on; the filter goes with the server.

    Where the kernel does not allow the filter, as in some containers, it only connects.

    Args:
        server: IPv4 address and port at which it listens.
        pid: Id of its process: this one, or a child.

    Raises:
        SimbevError: Another user has connected already.
    """

    def __init__(self, server: tuple[str, int], pid: int) -> None:
        self._server, self._ports, self._lock = server, set[int](), Lock()
        self._listener: socket.socket | None = None
        try:
            self._listener = _listener(server, pid)
            self._attach()
        except OSError:
            self.__exit__()
        else:
            self._refuse_strangers()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            if self._listener is not None:
                self._listener.close()  # or the port stays open after the server
                self._listener = None

    @contextmanager
    def connect(self) -> Iterator[socket.socket]:
        """A connection, which is closed with the context.

        Raises:
            OSError: The server does not answer.
        """
        with socket.socket() as client:
            client.bind((LOOPBACK, 0))
            port = int(client.getsockname()[1])
            with self._lock:
                self._ports.add(port)
                self._attach()
            try:
                client.connect(self._server)
                yield client
            finally:
                with self._lock:  # before another program can have the port
                    self._ports.discard(port)
                    self._attach()

    def _attach(self) -> None:
        """Let packets from the ports of this process pass, and no others."""
        if self._listener is None:
            return
        ports, ip = sorted(self._ports), int.from_bytes(socket.inet_aton(LOOPBACK), "big")
        program = [
            (_LOAD_WORD, 0, 0, _SOURCE_IP),
            (_JUMP_IF_EQUAL, 0, len(ports) + 1, ip),
            (_LOAD_HALF, 0, 0, _SOURCE_PORT),
        ]
        program += [(_JUMP_IF_EQUAL, len(ports) - index, 0, port) for index, port in enumerate(ports)]
        program += [(_RETURN, 0, 0, _DROP), (_RETURN, 0, 0, _KEEP)]
        code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *each) for each in program))
        packed = struct.pack("HL", len(program), ctypes.addressof(code))
        self._listener.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, packed)

    def _refuse_strangers(self) -> None:
        for row in _table():
            if row.remote == _hexadecimal(self._server) and row.state != _SYN_SENT and row.uid not in (0, os.getuid()):
                self.__exit__()
                raise SimbevError(
                    f"user {row.uid} of this machine has connected to the viewer's server; start it again"
                )


def is_own_client(connection: socket.socket) -> bool:
    """Whether a process of this user is at the other end of an accepted IPv4 connection over loopback."""
    ends = _hexadecimal(connection.getpeername()), _hexadecimal(connection.getsockname())
    return any((row.local, row.remote) == ends and row.uid == os.getuid() for row in _table())


def _table() -> Iterator[_Row]:
    for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]:
        fields = line.split()
        yield _Row(fields[1], fields[2], fields[3], int(fields[7]), fields[9])


def _hexadecimal(address: Sequence[object]) -> str:
    """An address and port as the table has them."""
    return f"{int.from_bytes(socket.inet_aton(str(address[0])), sys.byteorder):08X}:{address[1]:04X}"


def _listener(server: tuple[str, int], pid: int) -> socket.socket:
    """The socket with which a process listens.

    Raises:
        OSError: There is none, or the kernel does not give it.
    """
    rows = [each for each in _table() if each.local == _hexadecimal(server) and each.state == _LISTENING]
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):
            if str(link.readlink()) in {f"socket:[{row.inode}]" for row in rows}:
                return socket.socket(fileno=_copied(pid, int(link.name)))
    raise FileNotFoundError(server)


def _copied(pid: int, descriptor: int) -> int:
    """A copy of a file descriptor of this process or a child."""
    if pid == os.getpid():
        return os.dup(descriptor)
    process = os.pidfd_open(pid)
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if (copied := libc.syscall(_SYS_PIDFD_GETFD, process, descriptor, 0)) < 0:
            raise OSError(ctypes.get_errno(), "pidfd_getfd")
        return int(copied)
    finally:
        os.close(process)
