"""Runs a process of the graph: started in its own session, stopped by SIGTERM, then by force, with output in a log."""

import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import psutil
import yaml

from simbev_ros.errors import DiskError, InputError, SimbevError
from simbev_ros.nodes.lifeline import SUPERVISOR_VARIABLE
from simbev_ros.nodes.main import DISK_EXIT_CODE, ERROR_MARK

_REFUSALS: Mapping[int | None, type[SimbevError]] = {InputError.exit_code: InputError, DISK_EXIT_CODE: DiskError}


class _Plain(yaml.SafeDumper):
    """A YAML dumper that writes no aliases, which ROS cannot read; shared values are repeated."""

    def ignore_aliases(self, data: object) -> bool:
        return True


NodeParameters = Mapping[str, Mapping[str, object]]
"""Parameters by node name."""


class GraphProcess:
    """A process of the graph.

    Args:
        label: Short name, also the file name of its log.
        title: Kind and name, for messages.
        command: The command and its arguments.
        folder: Folder for its log.
        environment: Variables added to the current ones.
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
        """Exit code; None while the process runs, negative if a signal killed it."""
        return self._process.poll()

    @property
    def cpu_s(self) -> float:
        """User and system time up to now, s; 0 when the process has ended."""
        with suppress(psutil.NoSuchProcess):
            times = psutil.Process(self.pid).cpu_times()
            return float(times.user + times.system)
        return 0.0

    @property
    def memory_mib(self) -> float:
        """Resident memory, MiB; 0 when the process has ended."""
        with suppress(psutil.NoSuchProcess):
            return float(psutil.Process(self.pid).memory_info().rss / 2**20)
        return 0.0

    def new_output(self) -> str:
        """Return the output since the last call."""
        with self.log.open("rb") as log:
            log.seek(self._read_bytes)
            written = log.read()
        self._read_bytes += len(written)
        return written.decode(errors="replace")

    def describe_end(self) -> str:
        """Describe why the process ended, with the last line of its log."""
        code = self.exit_code
        reason = f"exit code {code}"
        if code is not None and code < 0:
            reason = f"killed by {signal.Signals(-code).name}"
        words = [line for line in self.log.read_text(errors="replace").splitlines() if line.strip()]
        return f"{reason}: {words[-1]}" if words else reason

    def refusal(self) -> SimbevError | None:
        """The error to report if input, machine or disk made the process end; None if the process itself failed."""
        _, mark, words = f"\n{self.log.read_text(errors='replace')}".rpartition(f"\n{ERROR_MARK}")
        kind = _REFUSALS.get(self.exit_code)
        return kind(f"{self.title}: {words.strip()}") if mark and kind else None

    def terminate(self) -> None:
        """Ask the process to end."""
        if self.exit_code is None:
            self._process.send_signal(signal.SIGTERM)
            self._process.send_signal(signal.SIGCONT)  # a stopped process would never receive the request

    def join(self, timeout_s: float) -> bool:
        """Wait for the end of the process; kill it after the timeout. Return whether it ended by itself."""
        try:
            self._process.wait(timeout_s)
            return True
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False


class NodeProcess(GraphProcess):
    """A process that runs one or several nodes.

    Args:
        kinds: Kind of each node, in the order of ``parameters``.
        parameters: ROS parameters of each node, by node name.
        folder: Folder for its parameter file and its log.
        environment: Variables added to the current ones.
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
    """A perception stack or its launcher, stopped together with all processes that it starts.

    Args:
        command: The command and its arguments.
        folder: Folder for its log.
        environment: Variables added to the current ones.

    Raises:
        InputError: The command does not exist.
    """

    def __init__(self, command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> None:
        if shutil.which(command[0]) is None:
            raise InputError(f"evaluation.stack: there is no command {command[0]!r}")
        supervised = [sys.executable, "-m", "simbev_ros.nodes.lifeline", *command]
        super().__init__("stack", f"stack {shlex.join(command)}", supervised, folder, environment)

    def terminate(self) -> None:
        """Ask the whole process group to end."""
        self._signal(signal.SIGTERM)
        self._signal(signal.SIGCONT)

    def join(self, timeout_s: float) -> bool:
        """Wait for the first process to end, then kill the group; return whether that process ended by itself."""
        ended = super().join(timeout_s)
        self._signal(signal.SIGKILL)
        return ended

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.pid, number)
