"""Threads that decode: one pool a process, whatever process it is."""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache


def decoders(threads: int | None = None) -> ThreadPoolExecutor:
    """The process's pool of so many threads; None: one for each core that it may use."""
    return _pool(os.getpid(), threads or len(os.sched_getaffinity(0)))


@lru_cache(maxsize=4)
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """A forked process has its parent's pools, but not their threads, so it makes its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"decoder-{process}")
