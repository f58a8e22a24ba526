"""Ends a process with the one that supervises it. Run as a module, it is followed by the words of another command."""

import ctypes
import os
import signal
import sys

SUPERVISOR_VARIABLE = "SIMBEV_SUPERVISOR_PID"
"""Set for processes that must not outlive the one that started them."""

_PR_SET_PDEATHSIG = 1


def end_with_supervisor() -> None:
    """Get SIGTERM from the kernel when the supervisor dies, whatever kills it; end at once if it is dead already."""
    supervisor = os.environ.get(SUPERVISOR_VARIABLE)
    if supervisor is None:  # started by hand or by a launch file
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(supervisor):
        sys.exit(1)


if __name__ == "__main__":
    end_with_supervisor()
    os.execvp(sys.argv[1], sys.argv[1:])
