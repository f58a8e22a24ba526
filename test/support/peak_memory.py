"""Peak memory of a call, for tests that show that something is refused before it is unpacked."""

import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager

import pyarrow as pa

MIB = 1 << 20


@contextmanager
def at_most(mib: int) -> Iterator[None]:
    """Assert that Python, numpy and Arrow allocate at most a number of MiB at once within the block."""
    pool = pa.proxy_memory_pool(pa.default_memory_pool())
    before = pa.default_memory_pool()
    pa.set_memory_pool(pool)
    tracemalloc.start()
    try:
        yield
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        pa.set_memory_pool(before)
    assert peak <= mib * MIB, f"{peak / MIB:.0f} MiB"
    assert (pool.max_memory() or 0) <= mib * MIB, f"{(pool.max_memory() or 0) / MIB:.0f} MiB in Arrow"
