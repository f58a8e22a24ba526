"""Ends a process together with its supervisor, and one whose middleware does not come to an end."""

import ctypes
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

SUPERVISOR_VARIABLE = "SIMBEV_SUPERVISOR_PID"
"""Environment variable with the supervisor's pid, set for processes that must not outlive it."""

_MIDDLEWARE_TIMEOUT_S = 5.0
"""Time that the middleware has to end."""
_PR_SET_PDEATHSIG = 1
_SIGEV_THREAD = 2
_LIBC = ctypes.CDLL(None)


def end_with_supervisor() -> None:
    """Have the kernel send SIGTERM when the supervisor dies for any reason; exit at once if it is already dead."""
    _signal_at_end_of_supervisor(signal.SIGTERM)


def wake_at_end_of_supervisor() -> None:
    """Let this process run on when the supervisor dies, even if it is stopped; exit at once if it is already dead.

    It is for a process that notices the death by itself, and then has others to end.
    """
    _signal_at_end_of_supervisor(signal.SIGCONT)


def die_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent dies, even if it is stopped.

    It is for the time from a fork, as ``preexec_fn``, until the new program calls one of the other functions.

    Args:
        parent: The parent's pid; the process exits at once if it is already dead.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


class _SignalEvent(ctypes.Structure):
    """``struct sigevent`` of a timer that calls a function in a thread of its own."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal_number", ctypes.c_int),
        ("notification", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("reserved", ctypes.c_byte * 32),
    )


class _TimerSpec(ctypes.Structure):
    """``struct itimerspec``."""

    _fields_ = (("interval", ctypes.c_long * 2), ("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


@contextmanager
def ending_middleware(code: int) -> Iterator[None]:
    """Destroy nodes in a block, as the last thing that a process does; it exits if that does not come to an end.

    The Fast DDS of wheels waits for a callback of discovery in a loop that keeps the callback's lock (its issue 6513).

    Args:
        code: Exit code.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    with exiting_after(_MIDDLEWARE_TIMEOUT_S, code):
        yield


@contextmanager
def exiting_after(time_s: float, code: int) -> Iterator[None]:
    """Have the process exit if a block takes too long, even while native code holds Python's lock.

    A system that has no timer or thread left lets the block take its time.

    Args:
        time_s: Time that the block has, positive.
        code: Exit code.
    """
    exit_function = ctypes.cast(_LIBC._exit, ctypes.c_void_p).value
    event = _SignalEvent(value=code, notification=_SIGEV_THREAD, function=exit_function)
    timer = ctypes.c_void_p()
    if _LIBC.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
        yield
        return
    seconds, rest = divmod(time_s, 1.0)
    spec = _TimerSpec(seconds=int(seconds), nanoseconds=int(rest * 1e9))
    _LIBC.timer_settime(timer, 0, ctypes.byref(spec), None)
    try:
        yield
    finally:
        _LIBC.timer_delete(timer)


def _signal_at_end_of_supervisor(number: signal.Signals) -> None:
    supervisor = os.environ.get(SUPERVISOR_VARIABLE)
    if supervisor is None:  # started by hand or by a launch file
        return
    _LIBC.prctl(_PR_SET_PDEATHSIG, number)
    if os.getppid() != int(supervisor):
        sys.exit(1)
