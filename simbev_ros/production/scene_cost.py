"""Cost of a scene: time, processor time, memory and GPUs, measured while its graph plays it."""

import shutil
import subprocess
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

_INTERVAL_S, _GPU_TIMEOUT_S = 20.0, 5.0
"""Interval between measurements of memory and GPUs: the kernel adds up the pages of each process, a tool starts."""


@dataclass(frozen=True, slots=True)
class SceneCost:
    """Measured cost of a scene.

    Attributes:
        wall_s: Time from the request to the finished bag.
        cpu_s: Processor time of all processes of the graph in that time.
        memory_mib: Peak memory of all processes together; pages that they share count once.
        frames: Number of recorded ticks.
        gpus: Average number of GPUs in use, by everything that ran on this machine.
    """

    wall_s: float
    cpu_s: float
    memory_mib: float
    frames: int
    gpus: float = 0.0

    @property
    def cores(self) -> float:
        """Average number of cores in use."""
        return self.cpu_s / self.wall_s


class CostMeter:
    """Measures a scene from its construction to ``cost``.

    Args:
        pids: The graph's processes.
    """

    def __init__(self, pids: Iterable[int]) -> None:
        self._began_s, self._cpu_before_s = time.monotonic(), _cpu_s(pids)
        self._next_look_s, self._memory_mib = self._began_s + _INTERVAL_S / 4.0, 0.0  # the scene is in full swing
        self._gpus: list[float] = []

    def look(self, pids: Iterable[int]) -> None:
        """Note what is in use, if the last look was a while ago; call it several times per second."""
        if time.monotonic() >= self._next_look_s:
            self._memory_mib = max(self._memory_mib, sum(map(_memory_mib, pids)))
            self._gpus.append(_busy_gpus())
            self._next_look_s = time.monotonic() + _INTERVAL_S

    def cost(self, pids: Iterable[int], frames: int) -> SceneCost:
        """The cost of the scene up to now."""
        self._next_look_s = 0.0
        pids = list(pids)
        self.look(pids)
        cpu_s = max(_cpu_s(pids) - self._cpu_before_s, 0.0)
        wall_s, gpus = max(time.monotonic() - self._began_s, 1e-3), sum(self._gpus) / len(self._gpus)
        return SceneCost(wall_s, cpu_s, self._memory_mib, frames, gpus)


def _cpu_s(pids: Iterable[int]) -> float:
    """User and system time of processes; those that have ended count for nothing."""
    total_s = 0.0
    for pid in pids:
        with suppress(psutil.Error):
            times = psutil.Process(pid).cpu_times()
            total_s += times.user + times.system
    return total_s


def _memory_mib(pid: int) -> float:
    """Memory of a process, in which each shared page counts for its fraction; 0 for one that has ended."""
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) / 1024.0
    return 0.0


def _busy_gpus() -> float:
    """Number of GPUs in use, a fraction for one that is idle at times, according to NVIDIA's tool; 0 without it."""
    command = shutil.which("nvidia-smi")
    if command is None:
        return 0.0
    with suppress(OSError, ValueError, subprocess.TimeoutExpired):
        query = [command, "--query-gpu=utilization.gpu", "--format=csv,noheader,nounits"]
        answer = subprocess.run(query, capture_output=True, text=True, timeout=_GPU_TIMEOUT_S, check=False)
        return sum(map(float, answer.stdout.split())) / 100.0
    return 0.0


def free_memory_mib() -> float:
    """Memory that further processes can have: of the machine, and of this process's control group if it has a limit."""
    free_bytes = psutil.virtual_memory().available
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        limit, used = (int((group / name).read_text()) for name in ("memory.max", "memory.current"))
        free_bytes = min(free_bytes, limit - used)
    return max(free_bytes, 0) / 2**20
