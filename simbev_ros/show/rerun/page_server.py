"""Serves the viewer's page with a policy that keeps the browser from asking any other machine.

Left alone, the page loads a font, looks for a newer version of Rerun and sends statistics of its use.
"""

from errno import EACCES, EADDRINUSE
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socket import AF_INET, AF_INET6
from threading import Thread
from typing import Any, Self
from urllib.parse import parse_qs, quote

from simbev_ros.foundation.errors import InputError

_TIMEOUT_S = 30.0
_PORT_ERRORS = (EADDRINUSE, EACCES)
_KEPT_HEADERS = ("Content-Type", "Content-Encoding")
_ALL_INTERFACES = ("0.0.0.0", "::")
_PAGES = ("/", "/index.html")


class PageServer(ThreadingHTTPServer):
    """Passes the files of the viewer's page on from Rerun's own server; its bare address shows what is logged.

    Args:
        address: Address of the network interface to listen on.
        port: Port to listen on; 0: any free one.

    Attributes:
        source: Host and port of Rerun's server of the page.
        data_port: Port of the data's server, the only other one that the page may talk to.

    Raises:
        InputError: The port is taken or reserved, or the address is none of this machine.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, address: str, port: int) -> None:
        if not address:  # for sockets it means all interfaces
            raise InputError("'': must be an address of this machine", parameter="bind")
        self.address, self.source, self.data_port = address, ("", 0), 0
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

    def origins(self) -> list[str]:
        """Origins of the page by all addresses at which browsers reach this machine."""
        hosts = [self.address]
        if self.address in _ALL_INTERFACES:
            import psutil

            addresses = [each for interface in psutil.net_if_addrs().values() for each in interface]
            hosts = [each.address for each in addresses if each.family in (AF_INET, self.address_family)]
        return [origin(host, self.server_port) for host in hosts]

    def policy(self, host: str) -> str:
        """The page's content security policy, for a browser that reaches this machine as ``host``."""
        own = "'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:"
        data = origin(host, self.data_port)
        return f"default-src {own}; connect-src 'self' blob: data: {data}; frame-ancestors 'none'"

    def data_url(self, host: str) -> str:
        """Address at which Rerun sends and receives what is logged."""
        return f"rerun+{origin(host, self.data_port)}/proxy"


class _Handler(BaseHTTPRequestHandler):
    server: PageServer

    def do_GET(self) -> None:
        """Pass a file on; a page without the address of the data is sent to the one with it."""
        host = self._host()
        data_url, (path, _, query) = self.server.data_url(host), self.path.partition("?")
        if path in _PAGES and not any(each.startswith(data_url) for each in parse_qs(query).get("url", [])):
            self.send_response(302)
            self.send_header("Location", f"{origin(host, self.server.server_port)}/?url={quote(data_url, safe='')}")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        self._pass_on(host)

    def _pass_on(self, host: str) -> None:
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
        self.send_header("Content-Security-Policy", self.server.policy(host))
        self.end_headers()
        self.wfile.write(body)

    def _host(self) -> str:
        """Address by which the browser reaches this machine."""
        if self.server.address in _ALL_INTERFACES:
            return str(self.connection.getsockname()[0]).removeprefix("::ffff:")
        return self.server.address

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


def origin(host: str, port: int) -> str:
    """The origin of a web page, such as ``http://127.0.0.1:9876``."""
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
