"""Distributes a rig's cameras over processes, and the machine's cores over the processes that render on the CPU."""

import os

from simbev_ros.config.rendering import Rendering
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.simulation.render.gl.devices import accessible_gpus, software_request

_CORES_FOR_TWO = 8
"""Cores per GPU with which two processes are faster than one, as one prepares a frame while the other one waits."""
_THREADS_VARIABLE = "LP_NUM_THREADS"
"""Variable with the number of threads that Mesa's llvmpipe renders with; each process reads it when it starts."""
_SLEEPING = {"__GL_YIELD": "USLEEP"}
"""NVIDIA's driver waits for the GPU in a loop that keeps a core busy; told to sleep, it needs a tenth of one."""


def camera_processes(rendering: Rendering, cameras: int) -> int:
    """Number of processes for the given number of cameras; at most one per camera.

    Raises:
        RenderError: The number depends on the GPUs, but EGL is missing or has no device.
    """
    if cameras == 0:
        return 0
    requested = _default_processes(rendering) if rendering.processes == "auto" else rendering.processes
    return min(requested, cameras)


def drawing_environment(processes: int) -> dict[str, str]:
    """Environment variables for each rendering process of a machine, unless the user has set them."""
    threads = max(usable_cores() // max(processes, 1), 1)
    variables = {_THREADS_VARIABLE: str(threads), **_SLEEPING}
    return {name: os.environ.get(name, value) for name, value in variables.items()}


def _default_processes(rendering: Rendering) -> int:
    """One process per GPU in use, two if there are cores enough to keep it busy; without a GPU one per core."""
    cores = usable_cores()
    gpus = len(rendering.gpus) if rendering.gpus != "auto" else 0 if software_request() else len(accessible_gpus())
    return gpus * (2 if cores >= _CORES_FOR_TWO * gpus else 1) or cores
