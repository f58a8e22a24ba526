"""An S3 server on the loopback address that logs its requests, and can refuse some of them as a busy store does."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import put_file

BUCKET = "made-up"
_BUSY = b'<?xml version="1.0"?><Error><Code>SlowDown</Code><Message>Reduce your request rate.</Message></Error>'
_DENIED = b'<?xml version="1.0"?><Error><Code>AccessDenied</Code><Message>Access Denied</Message></Error>'

Made = tuple[str, dict[str, str], bytes]
"""Status, headers and body of an answer."""


@dataclass
class StoreServer:
    """The server, as a WSGI application around moto's.

    Attributes:
        url: Its address.
        requests: Method and path of each request, with the query.
        sent_bytes: Size of the bodies of all answers.
        refuse_every: Every Nth request is answered with 503; 0: none.
        needs_key: Whether requests without a signature are refused.
        copy_s: Time that it takes to copy an object.
        is_read_only: Whether requests that write or delete are refused.
        stand_in: Answers a request with status, headers and body in place of the store; with None, the store answers.
    """

    app: Any
    url: str = ""
    requests: list[str] = field(default_factory=list)
    sent_bytes: int = 0
    refuse_every: int = 0
    needs_key: bool = False
    is_read_only: bool = False
    copy_s: float = 0.0
    stand_in: Callable[[dict[str, Any]], Made | None] | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, environ: dict[str, Any], start_response: Any) -> Iterable[bytes]:
        with self._lock:
            self.requests.append(
                f"{environ['REQUEST_METHOD']} {environ['PATH_INFO']}?{environ.get('QUERY_STRING', '')}"
            )
            is_refused = self.refuse_every and len(self.requests) % self.refuse_every == 0
        is_denied = (self.needs_key and "HTTP_AUTHORIZATION" not in environ) or (
            self.is_read_only and environ["REQUEST_METHOD"] not in ("GET", "HEAD")
        )
        if is_refused or is_denied:
            body = _BUSY if is_refused else _DENIED
            start_response("503 Slow Down" if is_refused else "403 Forbidden", [("Content-Length", str(len(body)))])
            return [body]
        if self.stand_in is not None and (made := self.stand_in(environ)) is not None:
            status, headers, body = made
            start_response(status, [*headers.items(), ("Content-Length", str(len(body)))])
            return [body]
        if "HTTP_X_AMZ_COPY_SOURCE" in environ:
            time.sleep(self.copy_s)
        answer = list(self.app(environ, start_response))
        with self._lock:
            self.sent_bytes += sum(map(len, answer)) if environ["REQUEST_METHOD"] == "GET" else 0
        return answer

    def reset(self) -> None:
        """Forget the requests, and answer all of them from now on."""
        self.requests, self.sent_bytes, self.refuse_every = [], 0, 0
        self.needs_key = self.is_read_only = False
        self.copy_s, self.stand_in = 0.0, None

    def make_bucket(self) -> None:
        """Forget everything, and make an empty bucket."""
        self.reset()
        for path, method in (("/moto-api/reset", "POST"), (f"/{BUCKET}", "PUT")):
            urlopen(Request(self.url + path, method=method)).close()
        self.reset()


@contextmanager
def running_store() -> Iterator[StoreServer]:
    """Run a server with one empty bucket on a free port while the context is open."""
    from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import WSGIRequestHandler, make_server

    class Silent(WSGIRequestHandler):
        protocol_version = "HTTP/1.1"

        def log(self, *_: Any) -> None:
            pass

    store = StoreServer(DomainDispatcherApplication(create_backend_app))
    server = make_server("127.0.0.1", 0, store, threaded=True, request_handler=Silent)
    store.url = f"http://127.0.0.1:{server.port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield store
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def put_any_key(key: str, content: bytes) -> None:
    """Write an object with a key that no file can have."""
    from moto.core import DEFAULT_ACCOUNT_ID
    from moto.s3.models import s3_backends

    s3_backends[DEFAULT_ACCOUNT_ID]["aws"].put_object(BUCKET, key, content)


def upload(folder: Path, prefix: str) -> str:
    """Upload a folder, and return its URL."""
    for file in sorted(folder.rglob("*")):
        if file.is_file():
            put_file(file, ObjectPath(BUCKET, prefix) / str(file.relative_to(folder)))
    return str(ObjectPath(BUCKET, prefix))
