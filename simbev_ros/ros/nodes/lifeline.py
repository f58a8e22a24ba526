"""Ends a process together with its supervisor, however the supervisor dies."""

import ctypes
import os
import signal
import sys

SUPERVISOR_VARIABLE = "SIMBEV_SUPERVISOR_PID"
"""Environment variable with the supervisor's pid, set for processes that must not outlive it."""

_PR_SET_PDEATHSIG = 1
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


def _signal_at_end_of_supervisor(number: signal.Signals) -> None:
    supervisor = os.environ.get(SUPERVISOR_VARIABLE)
    if supervisor is None:  # started by hand or by a launch file
        return
    _LIBC.prctl(_PR_SET_PDEATHSIG, number)
    if os.getppid() != int(supervisor):
        sys.exit(1)
