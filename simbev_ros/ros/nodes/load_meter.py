"""Measures a node's load: tick rate, time per tick and per part of its work, late ticks.

It reads the wall clock; no data depends on it.
"""

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Literal, TypeVar

from simbev_ros.foundation.threads import usable_cores

Part = Literal[
    "simulate", "receive", "place", "cast", "draw", "read back", "label", "encode", "write", "message", "send"
]
"""A part of a node's work.

``place`` updates the scene that rays are cast into, ``receive`` reads messages of other nodes, ``message`` makes
messages, ``send`` serializes them and hands them to the middleware.
"""

BUSY = "busy_ms"
"""Name of the time per tick in a reading."""

_Result = TypeVar("_Result")


def part_keys(part: Part) -> tuple[str, str]:
    """Names of a part's wall time and CPU time in a reading."""
    return f"{part} ms", f"{part} CPU ms"


def _no_parts() -> defaultdict[Part, list[float]]:
    """Wall and CPU time of each part, s."""
    return defaultdict(lambda: [0.0, 0.0])


class LoadMeter:
    """Counts a node's ticks and the time they take, between two readings; threads may time parts of the work."""

    def __init__(self) -> None:
        self._late_total = self._ignored_total = self._ticks_total = 0
        self._lock = threading.Lock()
        self._thread = threading.local()
        self._parts_s = _no_parts()
        self._reset()

    def count_late(self, ticks: int) -> None:
        """Count ticks that were due and skipped."""
        self._late += ticks

    def count_ignored(self) -> None:
        """Count a message that was malformed or came from elsewhere."""
        self._ignored += 1

    @contextmanager
    def busy(self, ticks: int = 1) -> Iterator[None]:
        """Time the work of a tick; ``ticks=0`` adds further work of a tick that has already been counted."""
        start_s = time.perf_counter()
        yield
        self._busy_s += time.perf_counter() - start_s
        self._ticks += ticks

    @contextmanager
    def part(self, name: Part) -> Iterator[None]:
        """Time a part of the work, on any thread; a part within another one does not count as the outer one."""
        before_s = getattr(self._thread, "inner_s", (0.0, 0.0))
        self._thread.inner_s = (0.0, 0.0)
        wall_s, cpu_s = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            wall_s, cpu_s = time.perf_counter() - wall_s, time.thread_time() - cpu_s
            inner_wall_s, inner_cpu_s = self._thread.inner_s
            self._thread.inner_s = (before_s[0] + wall_s, before_s[1] + cpu_s)
            with self._lock:
                part = self._parts_s[name]
                part[0] += wall_s - inner_wall_s
                part[1] += cpu_s - inner_cpu_s

    def pool(self, name: Part) -> ThreadPoolExecutor:
        """Threads, one for each usable core; their work is timed as a part of the node's work."""
        return _TimedPool(self, name)

    def discard_parts(self) -> None:
        """Forget the parts timed since the last reading, as those of a tick that does not count."""
        with self._lock:
            self._parts_s = _no_parts()

    def read(self) -> dict[str, float]:
        """Return rate, load and each part's wall and CPU time per tick since the last reading, and counts.

        Counts are those of ticks, of late ticks and of ignored messages, also in total. Wall times of threads that work
        side by side are summed up.
        """
        elapsed_s = max(time.perf_counter() - self._since_s, 1e-9)
        self._ticks_total += self._ticks
        self._late_total += self._late
        self._ignored_total += self._ignored
        load = {
            "window_s": elapsed_s,
            "rate_hz": self._ticks / elapsed_s,
            "ticks": float(self._ticks),
            "ticks_total": float(self._ticks_total),
            BUSY: 1000 * self._busy_s / max(self._ticks, 1),
            "late": float(self._late),
            "late_total": float(self._late_total),
            "ignored": float(self._ignored),
            "ignored_total": float(self._ignored_total),
        }
        if self._ticks:  # what threads still do for a tick counts for the next one
            load |= self._read_parts()
        self._reset()
        return load

    def _read_parts(self) -> dict[str, float]:
        with self._lock:
            parts_s, self._parts_s = self._parts_s, _no_parts()
        return {
            name: 1000 * time_s / self._ticks
            for part, times_s in parts_s.items()
            for name, time_s in zip(part_keys(part), times_s, strict=True)
        }

    def _reset(self) -> None:
        self._since_s = time.perf_counter()
        self._busy_s = 0.0
        self._ticks = 0
        self._late = self._ignored = 0


class _TimedPool(ThreadPoolExecutor):
    """Threads with timed work."""

    def __init__(self, meter: LoadMeter, part: Part) -> None:
        super().__init__(usable_cores())
        self._meter, self._part = meter, part

    def submit(self, fn: Callable[..., _Result], /, *args: Any, **kwargs: Any) -> Future[_Result]:
        return super().submit(self._run, fn, *args, **kwargs)

    def _run(self, function: Callable[..., _Result], *args: Any, **kwargs: Any) -> _Result:
        with self._meter.part(self._part):
            return function(*args, **kwargs)
