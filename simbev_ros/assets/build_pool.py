"""Builds independent parts of the cache in parallel on all cores."""

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from typing import TypeVar

from simbev_ros.foundation.threads import usable_cores

_ENDED = 1
W = TypeVar("W")
R = TypeVar("R")


def build_in_processes(work: Callable[[W], R], items: Sequence[W]) -> Iterator[tuple[int, R]]:
    """Build items in processes; any error or interrupt ends them all and leaves no partial files.

    Args:
        work: Builds an item: a function of a module, or a partial of one.
        items: What is built.

    Yields:
        Index of an item and its result, in the order in which they are ready.

    Raises:
        BrokenProcessPool: A process was killed, as happens when memory runs out.
    """
    workers = min(len(items), usable_cores())
    if workers <= 1:
        yield from enumerate(map(work, items))
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_set_up_worker) as pool:
        try:
            indices = {pool.submit(partial(_work_in_worker, work), item): index for index, item in enumerate(items)}
            for done in as_completed(indices):
                yield indices[done], done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _set_up_worker() -> None:
    """Set up a worker process: it ignores Ctrl-C, which the parent handles, and ends on SIGTERM or with the parent."""
    gc.disable()  # arrays and polygons form no reference cycles, and searching for them takes an eighth of the time
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise SystemExit(_ENDED)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker has a parent"
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)


def _work_in_worker(work: Callable[[W], R], item: W) -> R:
    """Build one item in a worker: SIGTERM cleans up temporary files first if there may be any, else ends at once."""
    try:
        signal.signal(signal.SIGTERM, _end)
        result = work(item)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        return result
    except SystemExit:
        os._exit(_ENDED)  # the pool would continue with the next item
