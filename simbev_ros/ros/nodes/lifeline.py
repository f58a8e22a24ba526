"""Ends a process together with its supervisor, however the supervisor dies."""

import ctypes
import os
import signal
import sys

SUPERVISOR_VARIABLE = "SIMBEV_SUPERVISOR_PID"
"""Environment variable with the supervisor's pid, set for processes that must not outlive it."""

_PR_SET_PDEATHSIG = 1


def end_with_supervisor() -> None:
    """Have the kernel send SIGTERM when the supervisor dies for any reason; exit at once if it is already dead."""
    _signal_at_end_of_supervisor(signal.SIGTERM)


def wake_at_end_of_supervisor() -> None:
    """Let this process run on when the supervisor dies, even if it is stopped; exit at once if it is already dead.

    It is for a process that notices the death by itself, and then has others to end.
    """
    _signal_at_end_of_supervisor(signal.SIGCONT)


def _signal_at_end_of_supervisor(number: signal.Signals) -> None:
    supervisor = os.environ.get(SUPERVISOR_VARIABLE)
    if supervisor is None:  # started by hand or by a launch file
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)
    if os.getppid() != int(supervisor):
        sys.exit(1)
