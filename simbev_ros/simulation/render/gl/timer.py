"""A hook for timing the parts of a frame; it costs nothing while timing is off."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import moderngl

Timer = Callable[[str], AbstractContextManager[None]]
"""Maps the name of a part to a context manager that times it; a part may occur several times in a frame."""

_NO_CONTEXT = nullcontext()


def null_timer(part: str) -> AbstractContextManager[None]:
    """A ``Timer`` that does nothing."""
    return _NO_CONTEXT


class PartClock:
    """A ``Timer`` that sums up the cost of each part while it is on, synchronizing with OpenGL before and after."""

    def __init__(self, context: moderngl.Context) -> None:
        """Create a timer for a renderer that draws with this context; initially off."""
        self.is_on = False
        self._context = context
        self._costs_ms: dict[str, tuple[float, float]] = {}

    def __call__(self, part: str) -> AbstractContextManager[None]:
        """See ``Timer``."""
        return self._timed(part) if self.is_on else _NO_CONTEXT

    def take(self) -> dict[str, tuple[float, float]]:
        """Wall and CPU time per part since the last call, ms; resets the sums."""
        costs_ms, self._costs_ms = self._costs_ms, {}
        return costs_ms

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        self._context.finish()
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        yield
        self._context.finish()
        wall_ms, cpu_ms = self._costs_ms.get(part, (0.0, 0.0))
        self._costs_ms[part] = (
            wall_ms + 1000.0 * (time.perf_counter() - wall_s),
            cpu_ms + 1000.0 * (time.process_time() - cpu_s),
        )
