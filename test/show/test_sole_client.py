"""Servers behind gates hear this process alone, and other users of the machine are told from this one."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator

import psutil
import pytest
from waiting import PATIENCE_S

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.show import loopback
from simbev_ros.show.gate import Gate, UserGate, hidden_address
from simbev_ros.show.loopback import SoleClient

NOBODY = 65534
CLIENT = """
import os, socket, sys
host, port, uid, sent = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4].encode()
if uid:
    os.setgroups([])
    os.setgid(uid)
    os.setuid(uid)
with socket.socket() as client:
    client.settimeout(0.5)
    try:
        client.connect((host, port))
        client.sendall(sent)
        print(client.recv(100).decode() or "closed")
    except OSError as error:
        print(type(error).__name__)
"""
SERVER = """
import socket, sys
with socket.create_server((sys.argv[1], 0)) as listener:
    print(listener.getsockname()[1], flush=True)
    while True:
        connection, _ = listener.accept()
        with connection:
            connection.sendall(b"heard " + connection.recv(100))
"""
as_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")


@pytest.fixture
def server() -> Iterator[tuple[tuple[str, int], int]]:
    """Address and process of a server that answers each connection."""
    host = hidden_address()
    command = [sys.executable, "-I", "-c", SERVER, host]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield (host, int(process.stdout.readline())), process.pid
        process.kill()


def answer(address: tuple[str, int], uid: int = 0, sent: str = "you") -> str:
    """What another process, of a user (0: this one), receives at an address."""
    command = [sys.executable, "-I", "-c", CLIENT, *map(str, (*address, uid)), sent]
    return subprocess.check_output(command, text=True, timeout=PATIENCE_S).strip()


def test_other_processes_no_longer_reach_the_server(server: tuple[tuple[str, int], int]) -> None:
    address, pid = server
    assert answer(address) == "heard you"
    with SoleClient(address, pid) as client:
        assert answer(address) == "TimeoutError"
        with client.connect() as first, client.connect() as second:
            assert answer(address) == "TimeoutError"
            for each in (second, first):
                each.sendall(b"me" * 100_000)
            assert first.recv(6) == b"heard "
        assert answer(address) == "TimeoutError"


def test_the_port_of_a_closed_connection_opens_nothing(server: tuple[tuple[str, int], int]) -> None:
    address, pid = server
    with SoleClient(address, pid) as client, socket.socket() as other:
        with client.connect() as connection:
            port = connection.getsockname()[1]
            connection.sendall(b"me")
            assert connection.makefile("rb").read() == b"heard me"
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", port))
        other.settimeout(0.5)
        with pytest.raises(TimeoutError):
            other.connect(address)


def test_a_server_of_this_process_is_closed_with_its_gate() -> None:
    with socket.create_server((hidden_address(), 0)) as listener:
        address = listener.getsockname()
        with Gate("127.0.0.1", 0, address, "secret", os.getpid()):
            assert answer(address) == "TimeoutError"
    assert answer(address) == "ConnectionRefusedError"


@as_root
def test_another_user_reaches_neither_the_server_nor_its_gate_for_this_user(
    server: tuple[tuple[str, int], int],
) -> None:
    address, pid = server
    assert answer(address, NOBODY) == "heard you"
    with UserGate(address, pid) as gate:
        assert answer(gate.address) == "heard you"
        assert answer(address, NOBODY) == "TimeoutError"
        assert answer(gate.address, NOBODY) in ("closed", "ConnectionResetError")


@as_root
def test_a_user_who_was_first_is_named(server: tuple[tuple[str, int], int]) -> None:
    address, pid = server
    program = (
        f"import os, socket; os.setuid({NOBODY}); s = socket.socket(); s.connect({address}); print(flush=True); input()"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-I", "-c", program], **pipes) as early:
        assert early.stdout is not None
        early.stdout.readline()
        with pytest.raises(SimbevError, match=rf"^user {NOBODY} of this machine has connected to the viewer's server"):
            SoleClient(address, pid)
        early.communicate(b"\n")


def test_without_the_filter_the_server_is_reached_all_the_same(
    server: tuple[tuple[str, int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError

    monkeypatch.setattr(loopback, "_copied", refuse)
    address, pid = server
    with SoleClient(address, pid) as client, client.connect() as connection:
        connection.sendall(b"me")
        assert connection.makefile("rb").read() == b"heard me"


def hidden_servers(pid: int) -> list[tuple[str, int]]:
    """Addresses that a process listens at, other than those that are printed."""
    listening = [each.laddr for each in psutil.Process(pid).net_connections("tcp4") if each.status == "LISTEN"]
    return [(each.ip, each.port) for each in listening if each.ip != "127.0.0.1"]


def test_reruns_server_hears_only_its_gates() -> None:
    pytest.importorskip("rerun")
    from simbev_ros.show.rerun.server import ViewerServer

    with ViewerServer(0, "127.0.0.1", 64 << 20) as viewer:
        assert {answer(each) for each in hidden_servers(viewer.pid)} == {"TimeoutError"}


def test_foxgloves_server_hears_only_its_gate() -> None:
    foxglove = pytest.importorskip("foxglove")
    from simbev_ros.show.foxglove.server import Address, running_server

    with running_server("name", Address("127.0.0.1", 0), None, foxglove.Context()):
        assert {answer(each) for each in hidden_servers(os.getpid())} == {"TimeoutError"}
