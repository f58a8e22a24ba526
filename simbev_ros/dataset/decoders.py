"""Thread pools that decode messages for ``Frame.load``: one pool per process and number of threads."""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

from simbev_ros.foundation.threads import usable_cores


def decoder_pool(threads: int | None = None) -> ThreadPoolExecutor:
    """This process's pool with the given number of threads; None: one for each core that the process may use."""
    return _pool(os.getpid(), threads or usable_cores())


@lru_cache(maxsize=4)
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Pool of one process; a forked process inherits its parent's pools without their threads, so it needs its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"decoder-{process}")
