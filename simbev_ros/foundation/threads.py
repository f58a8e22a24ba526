"""Shares work with threads: NumPy, OpenCV, Embree and zlib leave Python's global lock while they compute."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Result = TypeVar("_Result")


def usable_cores() -> int:
    """Number of CPU cores that this process may use; those of the machine where the system has no such limit."""
    allowed = getattr(os, "sched_getaffinity", None)  # not on macOS and Windows
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def start(threads: ThreadPoolExecutor | None, work: Callable[[], _Result]) -> Callable[[], _Result]:
    """Start work in a thread; the returned function waits for its result. Without threads the work is done at once."""
    if threads is not None:
        return threads.submit(work).result
    result = work()
    return lambda: result
