"""Work that is spread over processes, its results in the order of the work."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import count, islice
from multiprocessing.sharedctypes import Synchronized
from typing import TypeVar

from simbev_ros.errors import SimbevError

W = TypeVar("W")
R = TypeVar("R")

_AHEAD = 4
"""How much work a process may be ahead of what the results are needed for; bounds the memory."""
_LOOK_S = 0.2
"""Time between looks at how far the work is."""

_INTERRUPTS = (signal.SIGINT, signal.SIGTERM)

_on_step: Callable[[], None] | None = None


def step() -> None:
    """Say, within the work, that one more step of it is done."""
    if _on_step is not None:
        _on_step()


def in_processes(
    work: Callable[[W], R], items: Iterable[W], jobs: int, report: Callable[[int], None] = lambda steps: None
) -> Iterator[R]:
    """Results of a picklable function, in order; what was not begun when the caller stops is not done.

    Args:
        work: Called once for each item, in one of the processes.
        items: Picklable.
        jobs: How many processes; with 1 it is called in this one.
        report: Told while it waits for results how many steps all of the work has done so far.

    Raises:
        SimbevError: A process was killed, as happens when memory runs out.
    """
    if jobs == 1:
        steps = count(1)
        _call_on_step(lambda: report(next(steps)))
        yield from map(work, items)
        return
    rest, others, done = iter(items), set(multiprocessing.active_children()), multiprocessing.Value("q", 0)
    with ProcessPoolExecutor(jobs, initializer=_set_up_worker, initargs=(done,)) as pool:
        try:
            with _held_back():  # the first of them starts the processes, which must not see it halfway
                waiting: list[Future[R]] = [pool.submit(work, item) for item in islice(rest, jobs * _AHEAD)]
            while waiting:
                while not wait([waiting[0]], _LOOK_S).done:
                    report(done.get_obj().value)  # whatever process holds the lock, or was killed with it
                result = waiting.pop(0).result()
                waiting += [pool.submit(work, item) for item in islice(rest, 1)]
                yield result
        except BrokenProcessPool:
            raise SimbevError("a process that read bags was killed; is there memory enough?") from None
        except BaseException as error:
            if not isinstance(error, Exception):  # nobody waits for what is in the making
                for worker in set(multiprocessing.active_children()) - others:
                    worker.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _held_back() -> Iterator[None]:
    """While open, interrupts wait; they come when it closes."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _set_up_worker(done: "Synchronized[int]") -> None:
    """Interrupts end it at once, whatever the parent does with them, and so does the parent's death; steps count."""
    for number in _INTERRUPTS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _INTERRUPTS)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def add() -> None:
        with done.get_lock():
            done.value += 1

    _call_on_step(add)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker has a parent"
    parent.join()
    os._exit(1)


def _call_on_step(function: Callable[[], None]) -> None:
    global _on_step
    _on_step = function
