"""Serves the viewer's page with a policy that keeps the browser from asking any other machine.

Left alone, the page loads a font, looks for a newer version of Rerun and sends statistics of its use.
"""

from errno import EACCES, EADDRINUSE
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socket import AF_INET, AF_INET6
from threading import Thread
from typing import Any, Self

from simbev_ros.foundation.errors import InputError

_TIMEOUT_S = 30.0
_PORT_ERRORS = (EADDRINUSE, EACCES)
_KEPT_HEADERS = ("Content-Type", "Content-Encoding")


class PageServer(ThreadingHTTPServer):
    """Passes the files of the viewer's page on from Rerun's own server.

    Args:
        address: Address of the network interface to listen on.
        port: Port to listen on; 0: any free one.

    Attributes:
        source: Host and port of Rerun's server of the page.
        data_origin: The only other server that the page may talk to, such as ``http://127.0.0.1:9876``.

    Raises:
        InputError: The port is taken or reserved, or the address is none of this machine.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, address: str, port: int) -> None:
        if not address:  # for sockets it means all interfaces
            raise InputError("'': must be an address of this machine", parameter="bind")
        self.source, self.data_origin = ("", 0), ""
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
    def policy(self) -> str:
        """The page's content security policy."""
        own = "'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:"
        return f"default-src {own}; connect-src 'self' blob: data: {self.data_origin}; frame-ancestors 'none'"


class _Handler(BaseHTTPRequestHandler):
    server: PageServer

    def do_GET(self) -> None:
        """Pass a file on."""
        connection = HTTPConnection(*self.server.source, timeout=_TIMEOUT_S)
        try:
            connection.request("GET", self.path)
            answer = connection.getresponse()
            body = answer.read()
        except OSError:
            self.send_error(502)
            return
        finally:
            connection.close()
        self.send_response(answer.status)
        for name in _KEPT_HEADERS:
            if value := answer.getheader(name):
                self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", self.server.policy)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""
