"""Turns Ctrl-C and SIGTERM into one ``Interrupted`` exception in the main thread, so that the graph stops in order."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_AGAIN_S = 0.01
"""Time until an exception that was lost is raised again."""
_HAS_TIMER = hasattr(signal, "setitimer")
"""Whether the system has the timer for that; Windows, where no graph runs, has none."""


class Interrupted(BaseException):
    """Raised when the user asks to stop; the command ends with exit code 130."""


@contextmanager
def raising_interrupts() -> Iterator[None]:
    """Let the first SIGINT or SIGTERM raise ``Interrupted``; further ones are ignored, so that clean-up completes.

    Python drops what is raised in a destructor or in a callback of C code. An interrupt that arrives there is raised
    again by a timer (SIGALRM). One that C code does not expect makes Python raise SystemError, with the interrupt as
    its cause; it is raised in place of that.
    """

    def stop(_number: int, _frame: FrameType | None) -> None:
        for number in handled:
            signal.signal(number, signal.SIG_IGN)
        raise Interrupted

    def stop_again(_number: int, _frame: FrameType | None) -> None:
        raise Interrupted

    def note_lost(unraisable: "sys.UnraisableHookArgs") -> None:
        if issubclass(unraisable.exc_type, Interrupted):
            set_timer(_AGAIN_S)
        else:
            hook_before(unraisable)

    def set_timer(time_s: float) -> None:
        if _HAS_TIMER:
            signal.setitimer(signal.ITIMER_REAL, time_s)

    handled = (signal.SIGINT, signal.SIGTERM)
    hook_before, sys.unraisablehook = sys.unraisablehook, note_lost
    before = {number: signal.signal(number, stop) for number in handled}
    if _HAS_TIMER:
        before[signal.SIGALRM] = signal.signal(signal.SIGALRM, stop_again)
    try:
        yield
    except SystemError as error:
        if isinstance(error.__cause__, Interrupted):
            raise error.__cause__ from None
        raise
    finally:
        set_timer(0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook_before


@contextmanager
def postponing_interrupts() -> Iterator[None]:
    """Let SIGINT and SIGTERM act after a short step that must not be left half done.

    Threads other than the main one are never interrupted, so nothing changes for them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    before = {
        number: signal.signal(number, lambda signal_number, _: arrived.append(signal_number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if arrived:
            signal.raise_signal(arrived[0])
