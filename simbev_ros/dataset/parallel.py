"""Parallel work over bags: a picklable function is mapped over items in a pool of workers, with results in order.

The pools are ``Processes`` on this machine, and ``production.cluster.ray_task_pool.RayTaskPool`` on the nodes of a
cluster.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count, islice
from multiprocessing.sharedctypes import Synchronized
from typing import Protocol, TypeVar

from simbev_ros.foundation.errors import SimbevError

W = TypeVar("W")
R = TypeVar("R")

_QUEUED_PER_PROCESS = 4
"""Items per process that are submitted before their results are consumed; bounds the memory."""
_POLL_S = 0.2
"""Time between two reports of the progress."""

_INTERRUPTS = (signal.SIGINT, signal.SIGTERM)
_HAS_MASKS = hasattr(signal, "pthread_sigmask")
"""Whether signals can be blocked, which Windows cannot."""

_on_step: Callable[[], None] | None = None


def report_step() -> None:
    """Report from within the work that one more step is done, such as one frame."""
    if _on_step is not None:
        _on_step()


def call_on_step(function: Callable[[], None]) -> None:
    """Let ``report_step`` call a function from now on."""
    global _on_step
    _on_step = function


class Pool(Protocol):
    """Workers over which work is spread."""

    def map(
        self, work: Callable[[W], R], items: Sequence[W], report: Callable[[int], None] = lambda steps: None
    ) -> Iterator[R]:
        """Map a picklable function over items and yield its results in order.

        Items that have not been started when the caller stops iterating are not processed.

        Args:
            work: Called once for each item, in one of the workers; again if a worker on another machine is lost.
            items: Picklable arguments of ``work``.
            report: Called while results are awaited, with the number of steps done so far by all workers together.

        Raises:
            SimbevError: Workers were killed, as happens when memory runs out.
        """


@dataclass(frozen=True, slots=True)
class Processes:
    """A pool of processes on this machine.

    Attributes:
        workers: Number of processes; with 1, or a single item, the work is done in the calling process.
    """

    workers: int = 1

    def map(
        self, work: Callable[[W], R], items: Sequence[W], report: Callable[[int], None] = lambda steps: None
    ) -> Iterator[R]:
        """See ``Pool``."""
        return map_in_processes(work, items, min(self.workers, max(len(items), 1)), report)


OWN_PROCESS = Processes(1)


def map_in_processes(
    work: Callable[[W], R], items: Iterable[W], workers: int, report: Callable[[int], None] = lambda steps: None
) -> Iterator[R]:
    """Map a picklable function over items in processes and yield its results in order.

    Items that have not been started when the caller stops iterating are not processed.

    Args:
        work: Called once for each item, in one of the processes.
        items: Picklable arguments of ``work``.
        workers: Number of processes; with 1, ``work`` is called in the calling process.
        report: Called while results are awaited, with the number of steps done so far by all processes together.

    Raises:
        SimbevError: A process was killed, as happens when memory runs out.
    """
    if workers == 1:
        steps = count(1)
        call_on_step(lambda: report(next(steps)))
        yield from map(work, items)
        return
    rest, existing_children, done = iter(items), set(multiprocessing.active_children()), multiprocessing.Value("q", 0)
    with ProcessPoolExecutor(workers, initializer=_set_up_worker, initargs=(done,)) as pool:
        try:
            with _interrupts_blocked():  # the first submit starts the processes; no interrupt may hit them halfway
                waiting: list[Future[R]] = [
                    pool.submit(work, item) for item in islice(rest, workers * _QUEUED_PER_PROCESS)
                ]
            while waiting:
                while not wait([waiting[0]], _POLL_S).done:
                    report(done.get_obj().value)  # without the lock: a process may have been killed holding it
                result = waiting.pop(0).result()
                waiting += [pool.submit(work, item) for item in islice(rest, 1)]
                yield result
        except BrokenProcessPool:
            raise SimbevError("a process that read bags was killed; there may not be enough memory") from None
        except BaseException as error:
            if not isinstance(error, Exception):  # the results in progress are not needed any more
                for worker in set(multiprocessing.active_children()) - existing_children:
                    worker.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block interrupts while the context is open; pending ones are delivered when it closes."""
    if not _HAS_MASKS:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _set_up_worker(done: "Synchronized[int]") -> None:
    """Set up a worker process: an interrupt or the parent's death ends it at once, and its steps are counted."""
    for number in _INTERRUPTS:
        signal.signal(number, signal.SIG_DFL)
    if _HAS_MASKS:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _INTERRUPTS)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def count_step() -> None:
        with done.get_lock():
            done.value += 1

    call_on_step(count_step)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker has a parent"
    parent.join()
    os._exit(1)
