"""How a rig's cameras are shared among processes, and the machine's cores among those that draw on the CPU."""

import os

from simbev_ros.config.rendering import Rendering
from simbev_ros.render.gl.devices import count_gpus, software_wanted

_THREADS_VARIABLE = "LP_NUM_THREADS"
"""How many threads Mesa's llvmpipe fills pixels with in each process; it reads this when it starts."""


def camera_processes(rendering: Rendering, cameras: int) -> int:
    """How many processes draw so many cameras; at most one for each.

    Raises:
        RenderError: The number of GPUs is wanted, but there is no EGL, or it has no device.
    """
    if cameras == 0:
        return 0
    wanted = _processes_here(rendering) if rendering.processes == "auto" else rendering.processes
    return min(wanted, cameras)


def drawing_environment(processes: int) -> dict[str, str]:
    """Variables for each of so many processes that draw on the same machine, unless the user has set them."""
    threads = max(_cores() // max(processes, 1), 1)
    return {_THREADS_VARIABLE: os.environ.get(_THREADS_VARIABLE, str(threads))}


def _processes_here(rendering: Rendering) -> int:
    """One for each GPU that is used, or one for each core."""
    if rendering.gpus != "auto":
        return len(rendering.gpus) or _cores()
    return (0 if software_wanted() else count_gpus()) or _cores()


def _cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0))
