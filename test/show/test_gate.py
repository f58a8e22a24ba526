"""The gate before a server lets those through who name this machine and have the token, and passes on all bytes."""

import os
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import PATIENCE_S, wait_until

from simbev_ros.foundation.errors import InputError
from simbev_ros.show import gate as gates
from simbev_ros.show.access import MAX_HEAD_BYTES, has_token, is_own_host, is_own_origin, user_token
from simbev_ros.show.gate import Gate, hidden_address
from simbev_ros.show.rerun.page_server import PageServer


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server((hidden_address(), 0)) as listener:
        listener.settimeout(PATIENCE_S)
        yield listener


@pytest.fixture
def gate(server: socket.socket) -> Iterator[Gate]:
    with Gate("127.0.0.1", 0, server.getsockname(), "secret", os.getpid()) as gate:
        yield gate


def connect(gate: Gate, head: str) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", gate.port), timeout=PATIENCE_S)
    client.sendall(head.encode())
    return client


ADMITTED = "GET /any?token=secret HTTP/1.1\r\nHost: localhost:1\r\nUpgrade: websocket\r\n\r\n"


def test_the_server_sees_the_request_without_the_token_and_both_sides_stream(gate: Gate, server: socket.socket) -> None:
    with connect(gate, f"{ADMITTED}early") as client, server.accept()[0] as inside:
        inside.settimeout(PATIENCE_S)
        expected = b"GET / HTTP/1.1\r\nHost: localhost:1\r\nUpgrade: websocket\r\n\r\nearly"
        assert inside.recv(1000) == expected
        data = os.urandom(5 << 20)
        threading.Thread(target=inside.sendall, args=(data,)).start()
        assert client.makefile("rb").read(len(data)) == data
        client.close()
        assert inside.recv(1) == b""


@pytest.mark.parametrize(
    "head",
    [
        ADMITTED.replace("secret", "Secret"),
        ADMITTED.replace("HTTP/1.1\r\nHost", "token=secret\r\nHost"),
        ADMITTED.replace("?token=secret", ""),
        ADMITTED.replace("localhost:1", "evil.example.com"),
        ADMITTED.replace("Host: localhost:1\r\n", ""),
        ADMITTED.replace("Host:", "Host: localhost\r\nHost:"),
        ADMITTED.replace("localhost:1", "[::1"),
        ADMITTED.replace("/any", "//[::1"),
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        "\r\n\r\n",
        "x" * 20_000,
    ],
)
def test_others_are_refused_and_the_server_hears_nothing(gate: Gate, server: socket.socket, head: str) -> None:
    with connect(gate, head) as client:
        assert client.recv(1000).startswith(b"HTTP/1.1 403 ")
    server.settimeout(0.05)
    with pytest.raises(TimeoutError):
        server.accept()


@pytest.mark.parametrize(
    "host", ["evil@localhost", "evil\\@[::1]", "[::1]evil", "localhost/evil", "::1", "localhost:x", ""]
)
def test_a_host_header_is_a_name_and_a_port_alone(host: str) -> None:
    assert not is_own_host(host)


def test_too_many_connections_are_closed_and_slow_ones_given_up(
    gate: Gate, server: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gates, "HEAD_TIMEOUT_S", 1.0)
    silent = [connect(gate, "GET") for _ in range(gates.MAX_CONNECTIONS)]
    wait_until(lambda: len(gate._open) == len(silent))
    with connect(gate, "") as late:
        assert late.recv(1) == b""
    assert all(each.recv(1) == b"" for each in silent)
    with connect(gate, ADMITTED), server.accept()[0] as inside:
        assert inside.recv(3) == b"GET"
    for each in silent:
        each.close()


@pytest.mark.parametrize(
    "head", ["GET / HTTP/1.1\r\nHost: localhost\r\n", f"GET / HTTP/1.1\r\nX: {'a' * MAX_HEAD_BYTES}\r\n\r\n"]
)
def test_the_page_gives_up_slow_and_long_heads(monkeypatch: pytest.MonkeyPatch, head: str) -> None:
    monkeypatch.setattr(gates, "HEAD_TIMEOUT_S", 1.0)
    with PageServer("127.0.0.1", 0) as page:
        client = socket.create_connection(page.server_address, timeout=PATIENCE_S)

        def is_given_up() -> bool:
            try:
                client.send(b"a")  # which ends no line
                return client.recv(1, socket.MSG_DONTWAIT) == b""
            except BlockingIOError:
                return False
            except ConnectionError:
                return True

        client.sendall(head.encode())
        wait_until(is_given_up)
        client.close()


def test_the_page_takes_a_call_that_comes_in_pieces() -> None:
    with PageServer("127.0.0.1", 0) as page, socket.create_server(("127.0.0.1", 0)) as data:
        data.settimeout(PATIENCE_S)
        page.data = data.getsockname()
        client = socket.create_connection(page.server_address, timeout=PATIENCE_S)
        head = f"POST /a HTTP/1.1\r\nHost: localhost\r\nCookie: {page.cookie_name}={page.cookie}\r\n"
        client.sendall(head.encode())
        client.sendall(b"Content-Length: 10\r\n\r\nearly")
        client.sendall(b" late")
        inside, _ = data.accept()
        inside.settimeout(PATIENCE_S)
        received = b""
        while not received.endswith(b"\r\n\r\nearly late"):
            received += (more := inside.recv(1000))
            assert more
        inside.close()
        client.close()


def test_a_taken_port_is_named(gate: Gate) -> None:
    with pytest.raises(InputError, match=rf"^port: {gate.port} of 127.0.0.1 cannot be used: Address already in use"):
        Gate("127.0.0.1", gate.port, ("127.0.0.1", 1), "", os.getpid())


def test_hosts_tokens_and_origins() -> None:
    own = ["localhost", "LOCALHOST:80", "127.0.0.1:9090", "[::1]:1", "192.0.2.7", socket.gethostname()]
    assert all(map(is_own_host, own))
    assert not any(
        map(is_own_host, [None, "", "a.example", "localhost.a.example", "127.0.0.1.nip.io", "@", "[", ":80"])
    )
    assert has_token("/?a=b&token=t", "t") and not any(
        has_token(each, "t") for each in ("/", "/?token=", "//[?token=t")
    )
    assert is_own_origin(None, "a") and is_own_origin("http://a:1", "a:1")
    assert not any(is_own_origin(each, "a:1") for each in ("null", "http://a", "http://b:1", ""))


def test_the_users_token_stays_and_others_cannot_read_or_choose_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    token, file = user_token(), tmp_path / "simbev_ros/token"
    assert user_token() == token and file.stat().st_mode & 0o777 == 0o600
    file.chmod(0o644)
    assert user_token() != token, "others may have read it"
    file.write_text("short")
    assert len(user_token()) >= 16
