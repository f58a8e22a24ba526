"""``simbev view`` as a process: what it prints, what its page may ask for, and what is left when it has ended."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs, urlsplit
from urllib.request import urlopen

import psutil
import pytest
from made_up_scene import made_up_scene

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")

_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


@dataclass(frozen=True)
class Viewer:
    """A running command.

    Attributes:
        process: The command.
        url: Address of the page.
        lines: What it has printed until the scene was sent.
        temporary: The folder for its temporary files.
    """

    process: "subprocess.Popen[str]"
    url: str
    lines: list[str]
    temporary: Path

    @property
    def ports(self) -> list[int]:
        """Ports of the page and of the data."""
        (data,) = parse_qs(urlsplit(self.url).query)["url"]
        return [port for port in (urlsplit(self.url).port, urlsplit(data).port) if port is not None]


@contextmanager
def running(folder: Path, *options: str) -> Iterator[Viewer]:
    """A command that shows a made-up scene, on a machine without a display."""
    temporary = folder / "temporary"
    temporary.mkdir()
    made_up_scene(folder / "Blocks-0000", ticks=2)
    environment = {name: value for name, value in os.environ.items() if name not in _DISPLAYS}
    process = subprocess.Popen(
        [sys.executable, "-m", "simbev_ros.cli.main", "view", str(folder / "Blocks-0000"), "--port", "0", *options],
        env={**environment, "TMPDIR": str(temporary), "COLUMNS": "200"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    try:
        lines = []
        for line in process.stdout:
            lines.append(line.strip())
            if "Ctrl-C ends the viewer" in line:
                break
        (url,) = (line.removeprefix("viewer: ") for line in lines if line.startswith("viewer: "))
        yield Viewer(process, url, lines, temporary)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_and_leaves_nothing_behind(tmp_path: Path, number: int) -> None:
    with running(tmp_path) as viewer:
        servers = psutil.Process(viewer.process.pid).children(recursive=True)
        assert [server.name() for server in servers] == ["rerun"]
        assert list(viewer.temporary.iterdir()) != []
        viewer.process.send_signal(number)
        assert viewer.process.wait(10) == 130
        assert viewer.process.stdout is not None
        assert "Traceback" not in viewer.process.stdout.read()
    assert not any(server.is_running() for server in servers)
    assert list(viewer.temporary.iterdir()) == []
    for port in viewer.ports:
        with socket.create_server(("127.0.0.1", port)):
            pass


def test_without_a_display_the_address_is_printed_and_its_page_asks_no_other_host(tmp_path: Path) -> None:
    with running(tmp_path) as viewer:
        assert "there is no display; open this address in a browser" in viewer.lines
        assert "2 frames sent; Ctrl-C ends the viewer" in viewer.lines
        page_port, data_port = viewer.ports
        assert re.match(rf"http://127\.0\.0\.1:{page_port}/\?url=", viewer.url)
        with urlopen(viewer.url, timeout=10) as answer:
            assert (answer.status, answer.headers.get_content_type()) == (200, "text/html")
            policy = dict(rule.split(maxsplit=1) for rule in answer.headers["Content-Security-Policy"].split("; "))
        hosts = {f"http://127.0.0.1:{data_port}", "'self'", "blob:", "data:"}
        assert set(policy["connect-src"].split()) == hosts
        assert not re.search(r"https?:|\*|wss?:", policy["default-src"])
        with socket.socket() as elsewhere, pytest.raises(ConnectionRefusedError):
            elsewhere.connect(("127.0.0.2", page_port))


def test_a_display_is_not_asked_for_with_no_open(tmp_path: Path) -> None:
    with running(tmp_path, "--no-open") as viewer:
        assert not any("display" in line for line in viewer.lines)
