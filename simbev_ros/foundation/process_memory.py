"""Memory policies of a whole process: how the C library treats freed memory, and what the garbage collector scans.

Only code that owns its process sets a policy: the entry point of node processes and the world and annotator
nodes, command line verbs, and benchmarks. Library classes do not, so that none of them undoes another's policy.
"""

import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager

_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD = -1, -2, -3  # from <malloc.h>
_MAX_MMAP_THRESHOLD = 32 << 20


def keep_freed_memory() -> None:
    """Let the process reuse the memory that it frees, instead of returning it to the kernel.

    Images and the CPU renderer's buffers are allocated and freed with each frame; mapping their pages again takes 7 %
    of the CPU renderer's time, and a larger share of a GPU's. Only glibc has these settings; elsewhere nothing changes.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _MAX_MMAP_THRESHOLD)
        mallopt(_TRIM_THRESHOLD, 1 << 30)
        mallopt(_TOP_PAD, 64 << 20)


def return_freed_memory() -> None:
    """Collect garbage and return freed memory to the kernel, after work that needed much more than what follows.

    Unlike the other functions it sets no policy, so any process may call it. Only glibc keeps freed memory back.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


@contextmanager
def freeze_after_loading() -> Iterator[None]:
    """Exclude all objects that exist at the end of the block from garbage collection, until the next such block.

    Maps and simulations consist of many objects that live as long as a scene; scanning them again and again would
    double the time of a world node's tick. Garbage of the scene before is collected first.
    """
    gc.unfreeze()
    yield
    gc.collect()
    gc.freeze()
