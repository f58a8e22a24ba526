"""``simbev view`` as a process: what it prints, what its page may ask for, and what is left when it has ended."""

import re
import signal
import socket
from collections.abc import Iterator, Mapping
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import quote, urlsplit
from urllib.request import HTTPCookieProcessor, build_opener

import psutil
import pytest
from view_process import Viewer, running_viewer
from waiting import PATIENCE_S

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_signal_ends_it_and_leaves_nothing_behind(tmp_path: Path, number: int) -> None:
    with running_viewer(tmp_path, "--no-open") as viewer:
        assert not any("display" in line for line in viewer.lines), "none is asked for"
        servers = psutil.Process(viewer.process.pid).children(recursive=True)
        assert [server.name() for server in servers] == ["rerun"]
        assert list(viewer.temporary.iterdir()) != []
        ports = {viewer.port, *(each.laddr.port for each in servers[0].net_connections())}
        assert len(ports) == 3
        viewer.process.send_signal(number)
        assert viewer.process.wait(PATIENCE_S) == 130
        assert viewer.process.stdout is not None
        assert "Traceback" not in viewer.process.stdout.read()
    assert not any(server.is_running() for server in servers)
    assert list(viewer.temporary.iterdir()) == []
    for port in ports:
        with socket.create_server(("127.0.0.1", port)):
            pass


def test_without_a_display_the_address_is_printed_and_its_page_asks_no_other_host(tmp_path: Path) -> None:
    with running_viewer(tmp_path) as viewer:
        assert "there is no display; open this address in a browser" in viewer.lines
        assert "2 frames sent; Ctrl-C ends the viewer" in viewer.lines
        assert viewer.url.startswith(f"http://127.0.0.1:{viewer.port}/?token=")
        with viewer.browser().open(viewer.url, timeout=PATIENCE_S) as answer:
            assert (answer.status, answer.headers.get_content_type()) == (200, "text/html")
            policy = dict(rule.split(maxsplit=1) for rule in answer.headers["Content-Security-Policy"].split("; "))
        assert "'self'" in policy["default-src"] and not re.search(r"https?:|\*|wss?:", policy["default-src"])
        with socket.socket() as elsewhere, pytest.raises(ConnectionRefusedError):
            elsewhere.connect(("127.0.0.2", viewer.port))


def test_every_address_of_the_page_shows_the_scene_also_the_bare_and_an_old_one(tmp_path: Path) -> None:
    with running_viewer(tmp_path, "--no-open", "--bind", "0.0.0.0") as viewer:
        token = viewer.url.partition("?")[2]
        for host in (f"127.0.0.2:{viewer.port}", f"localhost:{viewer.port}"):
            browser = build_opener(HTTPCookieProcessor())
            browser.open(f"http://{host}/?{token}", timeout=PATIENCE_S).close()
            data = quote(f"rerun+http://{host}/proxy", safe="")
            for path in ("", "/", "/index.html", "/?url=rerun%2Bhttp%3A%2F%2F127.0.0.2%3A1%2Fproxy", f"/?url={data}"):
                with browser.open(f"http://{host}{path}", timeout=PATIENCE_S) as answer:
                    assert answer.url == f"http://{host}/?url={data}"


READ = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages"


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Viewer]:
    with running_viewer(tmp_path_factory.mktemp("viewer"), "--no-open") as viewer:
        yield viewer


def status(viewer: Viewer, method: str, path: str, headers: Mapping[str, str], *, knows: bool = False) -> int:
    """Status of a request, of a browser that has opened the printed address or of one that has not."""
    url = urlsplit(viewer.url)
    connection = HTTPConnection("127.0.0.1", viewer.port, timeout=PATIENCE_S)
    sent = {"Host": url.netloc, **headers}
    if knows:
        jar = next(each.cookiejar for each in viewer.browser().handlers if isinstance(each, HTTPCookieProcessor))
        sent["Cookie"] = "; ".join(f"{cookie.name}={cookie.value}" for cookie in jar)
    connection.putrequest(method, path, skip_host=True)
    for name, value in sent.items():
        connection.putheader(name, value)
    connection.endheaders()
    with closing(connection):
        return connection.getresponse().status


@pytest.mark.parametrize("path", ["/", "/re_viewer_bg.wasm", READ])
@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Cookie": "simbev=x; a=b"},
        {"Cookie": "\x00;;=;\xe9"},
        {"Host": "rebound.example.com"},
        {"Host": ""},
        {"Host": "[::1"},
    ],
)
def test_who_has_not_read_the_address_gets_nothing(viewer: Viewer, path: str, headers: dict[str, str]) -> None:
    assert status(viewer, "GET", path, headers) == 403
    assert status(viewer, "GET", f"{path}?token=x", headers) == 403
    assert status(viewer, "POST", path, headers) == 403


def test_a_web_page_elsewhere_gets_nothing_even_with_the_cookie(viewer: Viewer) -> None:
    for headers in ({"Host": "rebound.example.com"}, {"Origin": "http://evil.example.com"}, {"Origin": "null"}):
        for method in ("GET", "POST"):
            assert status(viewer, method, "/", headers, knows=True) == 403
    assert status(viewer, "GET", "/", {"Origin": f"http://127.0.0.1:{viewer.port}"}, knows=True) == 302


def test_addresses_that_no_file_has_are_answered(viewer: Viewer) -> None:
    with socket.create_connection(("127.0.0.1", viewer.port), timeout=PATIENCE_S) as connection:
        token = viewer.url.partition("?")[2]
        connection.sendall(f"GET /\u00e9\u2028?{token} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        assert re.match(rb"HTTP/1.0 (404|502) ", connection.recv(1000))


def test_many_slow_downloads_keep_nobody_out_and_take_little_memory(viewer: Viewer) -> None:
    process, token = psutil.Process(viewer.process.pid), viewer.url.partition("?")[2]
    before = process.memory_info().rss
    slow = [socket.create_connection(("127.0.0.1", viewer.port), timeout=PATIENCE_S) for _ in range(40)]
    for each in slow:
        each.sendall(f"GET /re_viewer_bg.wasm?{token} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    assert all(each.recv(100).startswith(b"HTTP/1.0 200 ") for each in slow)
    with viewer.browser().open(f"http://127.0.0.1:{viewer.port}/", timeout=PATIENCE_S) as answer:
        assert answer.status == 200
    assert process.memory_info().rss - before < 100 << 20
    for each in slow:
        each.close()
