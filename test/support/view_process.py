"""``simbev view`` of a made-up scene in a process of its own."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import HTTPCookieProcessor, OpenerDirector, build_opener

from made_up_scene import made_up_scene
from waiting import PATIENCE_S

_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


@dataclass(frozen=True)
class Viewer:
    """A running command.

    Attributes:
        process: The command.
        url: Address of the page.
        lines: Lines that it printed until the scene was sent.
        temporary: The folder for its temporary files.
    """

    process: "subprocess.Popen[str]"
    url: str
    lines: list[str]
    temporary: Path

    @property
    def port(self) -> int:
        """Port of the page and of the data."""
        port = urlsplit(self.url).port
        assert port is not None
        return port

    def browser(self) -> OpenerDirector:
        """A browser that has opened the printed address."""
        opener = build_opener(HTTPCookieProcessor())
        opener.open(self.url, timeout=PATIENCE_S).close()
        return opener


@contextmanager
def running_viewer(folder: Path, *options: str, ticks: int = 2) -> Iterator[Viewer]:
    """A command that shows a made-up scene, on a machine without a display."""
    temporary = folder / "temporary"
    temporary.mkdir()
    made_up_scene(folder / "Blocks-0000", ticks=ticks)
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
