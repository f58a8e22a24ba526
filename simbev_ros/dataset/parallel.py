"""Work that is spread over processes, its results in the order of the work."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import islice
from typing import TypeVar

W = TypeVar("W")
R = TypeVar("R")

_AHEAD = 4
"""How much work a process may be ahead of what the results are needed for; bounds the memory."""


def in_processes(work: Callable[[W], R], items: Iterable[W], jobs: int) -> Iterator[R]:
    """Results of a picklable function, in order; what was not begun when the caller stops is not done.

    Args:
        work: Called once for each item, in one of the processes.
        items: Picklable.
        jobs: How many processes; with 1 it is called in this one.
    """
    if jobs == 1:
        yield from map(work, items)
        return
    rest = iter(items)
    with ProcessPoolExecutor(jobs) as pool:
        waiting: list[Future[R]] = [pool.submit(work, item) for item in islice(rest, jobs * _AHEAD)]
        try:
            while waiting:
                result = waiting.pop(0).result()
                waiting += [pool.submit(work, item) for item in islice(rest, 1)]
                yield result
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
