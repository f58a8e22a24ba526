"""Measures a node's load: tick rate, time per tick, dropped ticks. It reads the wall clock; no data depends on it."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class LoadMeter:
    """Counts a node's ticks and the time they take, between two readings."""

    def __init__(self) -> None:
        self._dropped_total = self._ignored_total = 0
        self._reset()

    def count_dropped(self, ticks: int) -> None:
        """Count ticks that were due and skipped."""
        self._dropped += ticks

    def count_ignored(self) -> None:
        """Count a message that was malformed or came from elsewhere."""
        self._ignored_total += 1

    @contextmanager
    def busy(self, ticks: int = 1) -> Iterator[None]:
        """Time the work of a tick; ``ticks=0`` adds further work of a tick that has already been counted."""
        start_s = time.perf_counter()
        yield
        self._busy_s += time.perf_counter() - start_s
        self._ticks += ticks

    def read(self) -> dict[str, float]:
        """Return rate, load and drops since the last reading, and the totals of drops and of ignored messages."""
        elapsed_s = max(time.perf_counter() - self._since_s, 1e-9)
        self._dropped_total += self._dropped
        load = {
            "rate_hz": self._ticks / elapsed_s,
            "ticks": float(self._ticks),
            "busy_ms": 1000 * self._busy_s / max(self._ticks, 1),
            "dropped": float(self._dropped),
            "dropped_total": float(self._dropped_total),
            "ignored_total": float(self._ignored_total),
        }
        self._reset()
        return load

    def _reset(self) -> None:
        self._since_s = time.perf_counter()
        self._busy_s = 0.0
        self._ticks = 0
        self._dropped = 0
