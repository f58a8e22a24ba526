"""``simbev view`` as a process: what it prints, what its page may ask for, and what is left when it has ended."""

import re
import signal
import socket
from pathlib import Path
from urllib.parse import quote
from urllib.request import urlopen

import psutil
import pytest
from view_process import redirected, running_viewer
from waiting import PATIENCE_S

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_signal_ends_it_and_leaves_nothing_behind(tmp_path: Path, number: int) -> None:
    with running_viewer(tmp_path, "--no-open") as viewer:
        assert not any("display" in line for line in viewer.lines), "none is asked for"
        servers = psutil.Process(viewer.process.pid).children(recursive=True)
        assert [server.name() for server in servers] == ["rerun"]
        assert list(viewer.temporary.iterdir()) != []
        ports = viewer.ports
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
        page_port, data_port = viewer.ports
        assert viewer.url == f"http://127.0.0.1:{page_port}/"
        with urlopen(viewer.url, timeout=PATIENCE_S) as answer:
            assert (answer.status, answer.headers.get_content_type()) == (200, "text/html")
            policy = dict(rule.split(maxsplit=1) for rule in answer.headers["Content-Security-Policy"].split("; "))
        hosts = {f"http://127.0.0.1:{data_port}", "'self'", "blob:", "data:"}
        assert set(policy["connect-src"].split()) == hosts
        assert not re.search(r"https?:|\*|wss?:", policy["default-src"])
        with socket.socket() as elsewhere, pytest.raises(ConnectionRefusedError):
            elsewhere.connect(("127.0.0.2", page_port))


def test_every_address_of_the_page_shows_the_scene_also_the_bare_and_an_old_one(tmp_path: Path) -> None:
    with running_viewer(tmp_path, "--no-open", "--bind", "0.0.0.0") as viewer:
        page_port, data_port = viewer.ports
        data = quote(f"rerun+http://127.0.0.2:{data_port}/proxy", safe="")
        shown = f"http://127.0.0.2:{page_port}/?url={data}"
        for path in ("", "/", "/index.html", "/?url=rerun%2Bhttp%3A%2F%2F127.0.0.2%3A1%2Fproxy", f"/?url={data}"):
            assert redirected(f"http://127.0.0.2:{page_port}{path}") == shown
        with urlopen(shown, timeout=PATIENCE_S) as answer:
            assert (
                f"connect-src 'self' blob: data: http://127.0.0.2:{data_port};"
                in answer.headers["Content-Security-Policy"]
            )
