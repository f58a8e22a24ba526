"""A hook to time the parts of a frame. While nobody times, it costs nothing."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import moderngl

Timer = Callable[[str], AbstractContextManager[None]]
"""From the name of a part to what is entered before and left after it; a part may come several times in a frame."""

_NOTHING = nullcontext()


def untimed(part: str) -> AbstractContextManager[None]:
    """The timer that does nothing."""
    return _NOTHING


class PartClock:
    """A timer that adds up what each part costs while it is on, waiting for OpenGL before and after."""

    def __init__(self, context: moderngl.Context) -> None:
        """For a renderer that draws with this context; off at first."""
        self.is_on = False
        self._context = context
        self._costs_ms: dict[str, tuple[float, float]] = {}

    def __call__(self, part: str) -> AbstractContextManager[None]:
        """A ``Timer``."""
        return self._timed(part) if self.is_on else _NOTHING

    def take(self) -> dict[str, tuple[float, float]]:
        """By part, wall and processor time in ms since this was last called."""
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
