"""Measures from outside what the processes of a graph hold: memory, descriptors, threads and files."""

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from simbev_ros.foundation.errors import GraphError
from simbev_ros.ros.graph.shared_memory import held_files

_KIB_PER_MIB = 1024


@dataclass(frozen=True, slots=True)
class ProcessUse:
    """Resources of one process.

    Attributes:
        memory_mib: Memory that belongs to no file, neither on disk nor in /dev/shm, MiB: heap and stacks. What several
            processes share since a fork is divided among them.
        descriptors: Number of open file descriptors.
        threads: Number of threads.
    """

    memory_mib: float
    descriptors: int
    threads: int


@dataclass(frozen=True, slots=True)
class FilesUse:
    """Content of a folder.

    Attributes:
        files: Number of files.
        size_mib: Space that they take, MiB.
    """

    files: int
    size_mib: float


@dataclass(frozen=True, slots=True)
class ResourceUse:
    """Resources of a graph at one moment.

    Attributes:
        time_s: Time since the first sample, s.
        processes: What each process holds, by label.
        shared_memory: The graph's files in /dev/shm.
        temporary: The graph's temporary files.
    """

    time_s: float
    processes: dict[str, ProcessUse]
    shared_memory: FilesUse
    temporary: FilesUse


class ResourceSampler:
    """Samples the resource use of a graph again and again.

    Args:
        folders: Folders of the graph's temporary files.

    Attributes:
        samples: All samples in order of time.
    """

    def __init__(self, folders: Sequence[Path]) -> None:
        self._folders = folders
        self._since_s = time.monotonic()
        self._shared_files: set[Path] = set()
        self.samples: list[ResourceUse] = []

    def sample(self, pids: Mapping[str, int]) -> None:
        """Take a sample of these processes, by label; raises GraphError if one of them has ended."""
        self._shared_files |= held_files(pids.values())  # it may outlast its use
        try:
            processes = {label: _process_use(pid) for label, pid in pids.items()}
        except (psutil.NoSuchProcess, ProcessLookupError, FileNotFoundError) as error:
            raise GraphError(f"a process of the graph has ended: {error}") from error
        temporary = (path for folder in self._folders for path in folder.rglob("*") if path.is_file())
        elapsed_s = time.monotonic() - self._since_s
        self.samples.append(ResourceUse(elapsed_s, processes, _files_use(self._shared_files), _files_use(temporary)))


def _process_use(pid: int) -> ProcessUse:
    process = psutil.Process(pid)
    return ProcessUse(_anonymous_mib(pid), process.num_fds(), process.num_threads())


def _anonymous_mib(pid: int) -> float:
    """``ProcessUse.memory_mib``, which psutil lacks: its USS also depends on who else has mapped the same libraries."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    kib = next(line.split()[1] for line in lines if line.startswith("Pss_Anon:"))
    return int(kib) / _KIB_PER_MIB


def _files_use(files: Iterable[Path]) -> FilesUse:
    sizes_mib = []
    for file in files:
        with suppress(FileNotFoundError):
            sizes_mib.append(file.stat().st_blocks * 512 / 2**20)
    return FilesUse(len(sizes_mib), sum(sizes_mib))
