"""Shares work with threads: NumPy, OpenCV, Embree and zlib leave Python's global lock while they compute."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Result = TypeVar("_Result")


CORES_VARIABLE = "SIMBEV_ROS_CORES"
"""Environment variable with the number of cores that a process and its children plan with, if they share a machine."""


def usable_cores() -> int:
    """Number of CPU cores to plan with: those that this process may use, or fewer if its parent says so."""
    allowed = getattr(os, "sched_getaffinity", None)  # not on macOS and Windows
    cores = len(allowed(0)) if allowed is not None else os.cpu_count() or 1
    return min(cores, int(os.environ.get(CORES_VARIABLE, cores)))


def start(threads: ThreadPoolExecutor | None, work: Callable[[], _Result]) -> Callable[[], _Result]:
    """Start work in a thread; the returned function waits for its result. Without threads the work is done at once."""
    if threads is not None:
        return threads.submit(work).result
    result = work()
    return lambda: result
