"""Runs a process of the graph: started in its own session, stopped by SIGTERM, then by force, with output in a log."""

import os
import re
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

from simbev_ros.foundation.errors import DiskError, GraphError, InputError, SimbevError
from simbev_ros.foundation.installation.import_order import module_command
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.conventions.names import logger_name
from simbev_ros.ros.graph.node_starter import NodeStarter, RunningProcess, describe_exit
from simbev_ros.ros.graph.plan import ProcessPlan
from simbev_ros.ros.nodes.main import DISK_EXIT_CODE, ERROR_MARK, SHORTAGE_EXIT_CODE

_REFUSALS: Mapping[int | None, type[SimbevError]] = {
    InputError.exit_code: InputError,
    DISK_EXIT_CODE: DiskError,
    SHORTAGE_EXIT_CODE: GraphError,
}


_WARNING = re.compile(r"^\[WARN\] \[[\d.]+\] \[([^\]]+)\]: (?!Error occurred at:)(.*)$", re.MULTILINE)
"""A line of a node's log, as rcl writes it, but not the one with which rclpy's executor announces an exception."""
_INFORMATION = re.compile(r"^\[INFO\] \[[\d.]+\] \[[^\]]+\]: .*\n?", re.MULTILINE)
"""A line of a node's log that reports no trouble."""


_KILLED_PATIENCE_S = 30.0
"""Time that the system has to take down a killed process, which takes seconds with gigabytes on a busy machine."""


class _Plain(yaml.SafeDumper):
    """A YAML dumper that writes no aliases, which ROS cannot read; shared values are repeated."""

    def ignore_aliases(self, data: object) -> bool:
        return True


class GraphProcess:
    """A process of the graph.

    Args:
        label: Short name.
        title: Kind and name, for messages.
        process: The process.
        log: The file of its output.
    """

    def __init__(self, label: str, title: str, process: RunningProcess, log: Path) -> None:
        self.label, self.title, self._process, self.log = label, title, process, log
        self._returned = self._warnings = 0

    @property
    def pid(self) -> int | None:
        """Process id; None before the process has been started."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code; None while the process runs, negative if a signal killed it."""
        return self._process.poll()

    @property
    def cpu_s(self) -> float:
        """User and system time up to now, s; 0 when the process does not run."""
        with suppress(psutil.NoSuchProcess):
            if (pid := self.pid) is not None:
                times = psutil.Process(pid).cpu_times()
                return float(times.user + times.system)
        return 0.0

    @property
    def memory_mib(self) -> float:
        """Resident memory, MiB; 0 when the process does not run."""
        with suppress(psutil.NoSuchProcess):
            if (pid := self.pid) is not None:
                return float(psutil.Process(pid).memory_info().rss / 2**20)
        return 0.0

    def new_output(self) -> str:
        """Return the output since the last call."""
        output = self._output()
        new = output[self._returned :]
        self._returned = len(output)
        return new

    def new_warnings(self) -> list[tuple[str, str]]:
        """Node and text of the warnings that have been logged since the last call."""
        found = [(logger_name(logger), text) for logger, text in _WARNING.findall(self._output())]
        new = found[self._warnings :]
        self._warnings = len(found)
        return new

    def describe_end(self) -> str:
        """Describe why the process ended, with the last line of its log that is more than information."""
        return describe_exit(self.exit_code, _without_information(self._output()).splitlines())

    def refusal(self) -> SimbevError | None:
        """The error to report if input, machine or disk made the process end; None if the process itself failed."""
        _, mark, words = f"\n{_without_information(self._output())}".rpartition(f"\n{ERROR_MARK}")
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
            self._process.send_signal(signal.SIGKILL)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_KILLED_PATIENCE_S)
            return False

    def _output(self) -> str:
        return self.log.read_text(errors="replace") if self.log.exists() else ""


class NodeProcess(GraphProcess):
    """A process that runs one or several nodes.

    Args:
        starter: What starts the process.
        nodes: The nodes.
        folder: Folder for its parameter file and its log.
        ros: ROS arguments of all nodes of the graph.
    """

    def __init__(self, starter: NodeStarter, nodes: ProcessPlan, folder: Path, ros: RosArguments = PLAIN) -> None:
        names = [node.ros_name(ros.namespace) for node in nodes]
        label = "+".join(name.name for name in names)
        file = folder / f"{label}.yaml"
        parameters = [{"ros__parameters": dict(node.parameters)} for node in nodes]
        full_names = [name.full for name in names]
        file.write_text(yaml.dump(dict(zip(full_names, parameters, strict=True)), Dumper=_Plain))
        words = [f"{node.kind}:{name.path}" for node, name in zip(nodes, names, strict=True)]
        log = folder / f"{label}.log"
        process = starter.start([*words, *ros.command("--params-file", str(file))], log)
        super().__init__(label, f"node {label}", process, log)


class StackProcess(GraphProcess):
    """A perception stack, a driver, or its launcher; all processes that it starts end with it.

    Args:
        starter: What starts the process.
        label: Short name.
        command: The command and its arguments.
        folder: Folder for its log.
        field: Field of the configuration that has the command.

    Raises:
        InputError: The command does not exist.
    """

    def __init__(
        self, starter: NodeStarter, label: str, command: Sequence[str], folder: Path, field: str = "evaluation.stack"
    ) -> None:
        # Debian has no command "python" but that of this installation, which has rclpy.
        path = os.pathsep.join([os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent)])
        if (program := shutil.which(command[0], path=path)) is None:
            raise InputError(f"{field}: there is no command {command[0]!r}")
        log = folder / f"{label}.log"
        is_ours = tuple(command[:2]) == (sys.executable, "-m")
        words = module_command(*command[2:]) if is_ours else (program, *command[1:])
        super().__init__(label, f"stack {shlex.join(command)}", starter.start(words, log, is_command=True), log)

    def terminate(self) -> None:
        """Ask all its processes to end."""
        if self.exit_code is None and (pid := self.pid) is not None:
            for number in (signal.SIGTERM, signal.SIGCONT):
                with suppress(ProcessLookupError):
                    os.killpg(pid, number)


def _without_information(output: str) -> str:
    """The output of a process without lines that report no trouble."""
    return _INFORMATION.sub("", output)
