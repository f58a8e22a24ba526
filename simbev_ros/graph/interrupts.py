"""Turns Ctrl-C and SIGTERM into one ``Interrupted`` exception in the main thread, so that the graph stops in order."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupted(BaseException):
    """Raised when the user asks to stop; the command ends with exit code 130."""


@contextmanager
def raising_interrupts() -> Iterator[None]:
    """Let the first SIGINT or SIGTERM raise ``Interrupted``; further ones are ignored, so that clean-up completes."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        for number in handled:
            signal.signal(number, signal.SIG_IGN)
        raise Interrupted

    handled = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, stop) for number in handled}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
