"""One process of the graph: started in its own session, stopped politely and then by force, its output in a log."""

import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import yaml

from simbev_ros.errors import DiskError, InputError, SimbevError
from simbev_ros.nodes.lifeline import SUPERVISOR_VARIABLE
from simbev_ros.nodes.main import DISK_EXIT_CODE, ERROR_MARK

_REFUSALS: Mapping[int | None, type[SimbevError]] = {InputError.exit_code: InputError, DISK_EXIT_CODE: DiskError}


class _Plain(yaml.SafeDumper):
    """Writes what several nodes share once for each: ROS reads no aliases."""

    def ignore_aliases(self, data: object) -> bool:
        return True


NodeParameters = Mapping[str, Mapping[str, object]]
"""Node name → its parameters."""


class GraphProcess:
    """A process of the graph.

    Args:
        label: What it is called, and its log.
        title: What it is, for messages.
        command: Its words.
        folder: Where its log goes.
        environment: Variables on top of the present ones.
    """

    def __init__(
        self, label: str, title: str, command: Sequence[str], folder: Path, environment: Mapping[str, str]
    ) -> None:
        self.label, self.title = label, title
        self.log = folder / f"{label}.log"
        self._read_bytes = 0
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment, SUPERVISOR_VARIABLE: str(os.getpid())},
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs; negative: killed by that signal."""
        return self._process.poll()

    @property
    def cpu_s(self) -> float:
        """User and system time so far; 0 when it has ended."""
        try:
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    @property
    def memory_mib(self) -> float:
        """Resident memory; 0 when it has ended."""
        try:
            pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        except OSError:
            return 0.0
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20

    def new_output(self) -> str:
        """What it has written since the last call."""
        with self.log.open("rb") as log:
            log.seek(self._read_bytes)
            written = log.read()
        self._read_bytes += len(written)
        return written.decode(errors="replace")

    def describe_end(self) -> str:
        """Why it ended, with the last words of its log."""
        code = self.exit_code
        reason = f"exit code {code}"
        if code is not None and code < 0:
            reason = f"killed by {signal.Signals(-code).name}"
        words = [line for line in self.log.read_text(errors="replace").splitlines() if line.strip()]
        return f"{reason}: {words[-1]}" if words else reason

    def refusal(self) -> SimbevError | None:
        """Why it ended, where that is the input's fault, this machine's or its disk's, and not its own."""
        _, mark, words = f"\n{self.log.read_text(errors='replace')}".rpartition(f"\n{ERROR_MARK}")
        kind = _REFUSALS.get(self.exit_code)
        return kind(f"{self.title}: {words.strip()}") if mark and kind else None

    def terminate(self) -> None:
        """Ask it to end."""
        if self.exit_code is None:
            self._process.send_signal(signal.SIGTERM)
            self._process.send_signal(signal.SIGCONT)  # a stopped process would never see the request

    def join(self, timeout_s: float) -> bool:
        """Wait for its end; kill it when the time is up. True if it went by itself."""
        try:
            self._process.wait(timeout_s)
            return True
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False


class NodeProcess(GraphProcess):
    """A process with one or several nodes.

    Args:
        kinds: Kind of node → nodes of that kind are called like their keys in ``parameters``.
        parameters: Parameters of each node, by name.
        folder: Where its parameter file and its log go.
        environment: Variables on top of the present ones.
    """

    def __init__(
        self, kinds: Sequence[str], parameters: NodeParameters, folder: Path, environment: Mapping[str, str]
    ) -> None:
        names = tuple(parameters)
        label = "+".join(names)
        file = folder / f"{label}.yaml"
        text = yaml.dump({name: {"ros__parameters": dict(p)} for name, p in parameters.items()}, Dumper=_Plain)
        file.write_text(text)
        nodes = [f"{kind}:{name}" for kind, name in zip(kinds, names, strict=True)]
        command = [sys.executable, "-m", "simbev_ros.nodes.main", *nodes, "--ros-args", "--params-file", str(file)]
        super().__init__(label, f"node {label}", command, folder, environment)


class StackProcess(GraphProcess):
    """A perception stack, or what starts it: it and all that it starts are stopped together.

    Args:
        command: Its words.
        folder: Where its log goes.
        environment: Variables on top of the present ones.

    Raises:
        InputError: There is no such command.
    """

    def __init__(self, command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> None:
        if shutil.which(command[0]) is None:
            raise InputError(f"evaluation.stack: there is no command {command[0]!r}")
        supervised = [sys.executable, "-m", "simbev_ros.nodes.lifeline", *command]
        super().__init__("stack", f"stack {shlex.join(command)}", supervised, folder, environment)

    def terminate(self) -> None:
        """Ask it to end."""
        self._signal(signal.SIGTERM)
        self._signal(signal.SIGCONT)

    def join(self, timeout_s: float) -> bool:
        """Wait for its end; kill what is left of it when the time is up. True if the first of it went by itself."""
        ended = super().join(timeout_s)
        self._signal(signal.SIGKILL)
        return ended

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.pid, number)
