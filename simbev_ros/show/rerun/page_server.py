"""Serves the viewer's page with a policy that keeps the browser from asking any other machine.

Left alone, the page loads a font, looks for a newer version of Rerun and sends statistics of its use.
"""

import secrets
from collections.abc import Sequence
from contextlib import closing, suppress
from errno import EACCES, EADDRINUSE
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException, HTTPResponse
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BufferedReader, RawIOBase
from socket import AF_INET, AF_INET6, MSG_PEEK, SHUT_RDWR, socket
from threading import BoundedSemaphore, Lock, Thread
from typing import Any, Self
from urllib.parse import parse_qs, quote

from simbev_ros.foundation.errors import InputError
from simbev_ros.show.access import (
    IDLE_TIMEOUT_S,
    MAX_CONNECTIONS,
    has_token,
    is_equal,
    is_own_host,
    is_own_origin,
    origin,
)
from simbev_ros.show.gate import END_OF_HEAD, read_head

_PORT_ERRORS = (EADDRINUSE, EACCES)
_SENT_HEADERS = ("Content-Type", "Accept", "X-Grpc-Web", "X-User-Agent", "Grpc-Timeout", "Range")
_KEPT_HEADERS = ("content-type", "content-encoding", "grpc-status", "grpc-message", "grpc-encoding")
_PAGES = ("/", "/index.html")
_POLICY = "default-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; frame-ancestors 'none'"
_BLOCK_BYTES = 64 << 10
_MAX_FILES = 32
_MAX_CALL_BYTES = 1 << 20


class PageServer(ThreadingHTTPServer):
    """Passes the files of the viewer's page, and its calls for data, on to Rerun's own servers.

    Who has the address with the token receives a cookie, with which the browser asks for everything else.

    Args:
        address: Address of the network interface to listen on.
        port: Port to listen on; 0: any free one.

    Attributes:
        source: Host and port of Rerun's server of the page.
        data: Host and port of Rerun's server of what is logged.
        token: What must be in the address.
        cookie: What the browser then proves itself with.

    Raises:
        InputError: The port is taken or reserved, or the address is none of this machine.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, address: str, port: int) -> None:
        if not address:  # for sockets it means all interfaces
            raise InputError("'': must be an address of this machine", parameter="bind")
        self.address, self.source, self.data = address, ("", 0), ("", 0)
        self.token, self.cookie = secrets.token_urlsafe(), secrets.token_urlsafe()
        self._free, self._lock = BoundedSemaphore(MAX_CONNECTIONS), Lock()
        self._files: dict[str, tuple[int, Sequence[tuple[str, str]], bytes]] = {}
        self.address_family = AF_INET6 if ":" in address else AF_INET
        try:
            super().__init__((address, port), _Handler)
        except OSError as error:
            words = f"cannot be listened on: {error.strerror or error}".lower()
            if error.errno in _PORT_ERRORS:
                problem = f"{address}:{port} {words}; 0 takes any free port"
                raise InputError(problem, parameter="port") from None
            raise InputError(f"{address} {words}; must be an address of this machine", parameter="bind") from None
        self._thread = Thread(target=self.serve_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()

    @property
    def cookie_name(self) -> str:
        """Name of the cookie: browsers send those of all ports of a machine to each."""
        return f"simbev-{self.server_port}"

    @property
    def url(self) -> str:
        """Address of the page, with the token."""
        return f"{origin(self.address, self.server_port)}/?token={self.token}"

    def data_url(self, host: str) -> str:
        """Address of what is logged, for a browser that reaches this server as ``host``, which has a port."""
        return f"rerun+http://{host}/proxy"

    def file(self, path: str) -> tuple[int, Sequence[tuple[str, str]], bytes]:
        """Status, headers and content of a file of the page; those that are there are kept, once for all requests.

        Raises:
            OSError: Rerun's server, which takes one request at a time, does not answer.
            HTTPException, ValueError: The path is none.
        """
        with self._lock:
            if (found := self._files.get(path)) is None:
                connection = HTTPConnection(*self.source, timeout=IDLE_TIMEOUT_S)
                with closing(connection):
                    connection.request("GET", path)
                    answer = connection.getresponse()
                    found = answer.status, _kept(answer), answer.read()
                if answer.status == HTTPStatus.OK and len(self._files) < _MAX_FILES:
                    self._files[path] = found
            return found

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, unless there are too many."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of browsers that leave."""


class _Resumed(RawIOBase):
    """What a connection receives, from the head on that has been read of it."""

    def __init__(self, head: bytes, connection: socket) -> None:
        self._head, self._connection = memoryview(head), connection

    def readable(self) -> bool:
        """Say that it can be read."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer with what comes next; return the number of bytes."""
        if not self._head:
            return self._connection.recv_into(buffer)
        size = min(len(buffer), len(self._head))
        buffer[:size], self._head = self._head[:size], self._head[size:]
        return size


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    timeout = IDLE_TIMEOUT_S

    def handle(self) -> None:
        """Answer one request, whose head must arrive whole, in time and within its limit."""
        head = read_head(self.connection)
        if END_OF_HEAD in head:
            self.connection.settimeout(self.timeout)
            self.rfile = BufferedReader(_Resumed(head, self.connection))
            super().handle()

    def do_GET(self) -> None:
        """Pass a file on; a page without the address of the data is sent to the one with it."""
        if not self._is_admitted():
            return
        data_url, (path, _, query) = self.server.data_url(self.headers["Host"]), self.path.partition("?")
        if path in _PAGES and not any(each.startswith(data_url) for each in parse_qs(query).get("url", [])):
            self.send_response(302)
            self.send_header("Location", f"/?url={quote(data_url, safe='')}")
            self.send_header("Set-Cookie", f"{self.server.cookie_name}={self.server.cookie}; HttpOnly; SameSite=Strict")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        self._send_file()

    def _is_admitted(self) -> bool:
        """Whether a request names this machine and has the token, or the cookie that came for it; refuses others."""
        host = self.headers["Host"]
        cookies = SimpleCookie()
        with suppress(CookieError):
            cookies.load(self.headers.get("Cookie", ""))
        cookie = cookies.get(self.server.cookie_name)
        is_known = cookie is not None and is_equal(cookie.value, self.server.cookie)
        if is_own_host(host) and is_own_origin(self.headers["Origin"], host):
            if is_known or (self.command == "GET" and has_token(self.path, self.server.token)):
                return True
            reason = "The address lacks the token: use the one that simbev view has printed"
        else:
            reason = "This host name is not this machine's: use its address"
        self.send_error(403, reason)
        return False

    def _send_file(self) -> None:
        try:
            status, headers, body = self.server.file(self.path.partition("?")[0])
        except (OSError, HTTPException, ValueError):  # ValueError: characters that no address has
            self.send_error(502)
            return
        self._begin(status, [*headers, ("Content-Length", str(len(body))), ("Content-Security-Policy", _POLICY)])
        with suppress(OSError):  # as when the browser leaves
            self.wfile.write(body)

    def do_POST(self) -> None:
        """Pass a call of the page on to the server of the data, and its answer back until it ends."""
        if not self._is_admitted():
            return
        connection = HTTPConnection(*self.server.data)
        with closing(connection), suppress(OSError, HTTPException, ValueError):
            size = min(max(int(self.headers.get("Content-Length") or 0), 0), _MAX_CALL_BYTES)
            sent = {name: value for name in _SENT_HEADERS if (value := self.headers[name])}
            connection.request("POST", self.path, self.rfile.read(size), sent)
            Thread(target=self._end_with_browser, args=(connection.sock,), daemon=True).start()
            answer = connection.getresponse()
            self._begin(answer.status, _kept(answer))
            while block := answer.read1(_BLOCK_BYTES):
                self.wfile.write(block)

    def _begin(self, status: int, headers: Sequence[tuple[str, str]]) -> None:
        self.send_response(status)
        for name, value in headers:
            self.send_header(name, value)
        self.end_headers()

    def _end_with_browser(self, source: socket) -> None:
        """End a stream, which may be silent for hours, when the browser leaves."""
        with suppress(OSError):
            self.connection.settimeout(None)
            self.connection.recv(1, MSG_PEEK)
        with suppress(OSError):
            source.shutdown(SHUT_RDWR)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


def _kept(answer: HTTPResponse) -> list[tuple[str, str]]:
    """The headers of an answer that browsers receive."""
    return [(name, value) for name, value in answer.getheaders() if name.lower() in _KEPT_HEADERS]
