"""Ctrl-C and SIGTERM end the graph in order: they raise ``Interrupted`` in the main thread, once."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupted(BaseException):
    """The user asked to stop. Exit code 130."""


@contextmanager
def raising_interrupts() -> Iterator[None]:
    """While open, SIGINT and SIGTERM raise ``Interrupted``; further ones are ignored, so that the end is orderly."""

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
