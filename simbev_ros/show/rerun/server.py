"""Runs Rerun's server, which keeps what is logged and gives it to browsers together with the viewer's page.

The server of Rerun's command is used and not that of its library, which listens on all network interfaces.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Self

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.show.access import origin
from simbev_ros.show.gate import UserGate, hidden_address
from simbev_ros.show.rerun.page_server import PageServer

LOOPBACK = "127.0.0.1"
_START_TIMEOUT_S, _END_TIMEOUT_S = 30.0, 5.0
_STEP_S = 0.05
_PR_SET_PDEATHSIG = 1
_START = f"""
import ctypes, os, signal, sys
ctypes.CDLL(None).prctl({_PR_SET_PDEATHSIG}, signal.SIGTERM)
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""
"""Program that becomes the server, which ends when this process dies for any reason."""


class ViewerServer:
    """Serves the viewer; as a context manager it ends with the context.

    Args:
        port: Port of the viewer's page; 0: any free one.
        address: Address of the network interface to listen on.
        memory_bytes: Maximum size of what is kept; beyond it, the earliest is dropped.

    Raises:
        InputError: The port is taken, or the address is none of this machine.
    """

    def __init__(self, port: int, address: str, memory_bytes: int) -> None:
        self._address, self._memory_bytes = hidden_address(), memory_bytes
        self._page = PageServer(address, port)
        self._data_port, self._source_port = (_free_port(self._address) for _ in range(2))
        self._stack = ExitStack()

    @property
    def page_url(self) -> str:
        """Address of the viewer's page."""
        return self._page.url

    @property
    def data_url(self) -> str:
        """Address to send logs to, for processes of this user."""
        return f"rerun+{origin(*self._page.data)}/proxy"

    @property
    def pid(self) -> int:
        """Id of the process that keeps the data."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Start the server.

        Raises:
            SimbevError: It does not start.
        """
        folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="simbev-view-")))
        self._stack.enter_context(self._page)
        with (folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                self._command(),
                env=_environment(folder),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,  # Ctrl-C in the terminal ends it through this process
            )
        self._stack.callback(self._end)
        try:
            self._wait_until_ready(folder / "log")
            self._page.source, self._page.data = (self._gate(port) for port in (self._source_port, self._data_port))
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def require_running(self) -> None:
        """Raise SimbevError if the server has ended by itself."""
        if (code := self._process.poll()) is not None:
            raise SimbevError(f"Rerun's server ended with exit code {code}")

    def _gate(self, port: int) -> tuple[str, int]:
        """Where this user's processes, and no others, reach a port of the server."""
        return self._stack.enter_context(UserGate((self._address, port), self.pid)).address

    def _command(self) -> list[str]:
        import rerun_cli

        server = Path(rerun_cli.__file__).with_name("rerun")
        return [
            *(sys.executable, "-I", "-c", _START, str(os.getpid()), str(server)),
            *("--serve-web", "--bind", self._address, "--port", str(self._data_port)),
            *("--web-viewer-port", str(self._source_port), "--server-memory-limit", f"{self._memory_bytes >> 20}MiB"),
        ]

    def _wait_until_ready(self, log: Path) -> None:
        deadline = time.monotonic() + _START_TIMEOUT_S
        while not all(_answers(self._address, port) for port in (self._source_port, self._data_port)):
            if self._process.poll() is not None or time.monotonic() > deadline:
                lines = log.read_text(errors="replace").strip().splitlines()
                raise SimbevError(f"Rerun's server did not start: {lines[-1] if lines else 'it says nothing'}")
            time.sleep(_STEP_S)

    def _end(self) -> None:
        self._process.terminate()
        self._process.send_signal(signal.SIGCONT)  # a stopped process would never receive the request
        try:
            self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _free_port(address: str) -> int:
    """A port on which nothing listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind((address, 0))
        return int(probe.getsockname()[1])


def _answers(address: str, port: int) -> bool:
    with suppress(OSError), socket.create_connection((address, port), timeout=1.0):
        return True
    return False


def _environment(folder: Path) -> dict[str, str]:
    """The environment, with a home whose settings switch usage statistics off."""
    settings = folder / ".config" / "rerun" / "analytics.json"
    settings.parent.mkdir(parents=True)
    settings.write_text(json.dumps({"analytics_enabled": False}))
    homes = {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder / ".config"), "XDG_DATA_HOME": str(folder / ".data")}
    return {**os.environ, **homes}
