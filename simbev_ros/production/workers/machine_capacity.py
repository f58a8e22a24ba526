"""Capacity of a machine for workers side by side: how many fit, and which GPUs and cores each one uses.

Cores are not reserved: where one graph waits, another computes. On 16 cores two graphs that could use all of them made
18 % more frames than two with eight cores each, and four made 9 % more than with four each. But with many workers each
one needs few processes and threads, which cost time to start and memory.
"""

import math
from typing import Literal

from simbev_ros.config.camera import Camera
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.production.scene_cost import SceneCost, free_memory_mib
from simbev_ros.ros.graph.domain import ISOLATED_DOMAINS
from simbev_ros.simulation.render.gl.devices import accessible_gpus, software_request

MEMORY_MARGIN = 1.2
"""Factor on the measured memory of a graph: later scenes may need more."""
_CORES_OF_SHARE = 2
"""Factor on a worker's share of the cores."""
_MIN_CORES, _MAX_CORES = 0.1, 3.0
"""Bounds of the cores that a graph is counted with. Short scenes are too short to measure; and alone, graphs use more
cores than they need, with many idle moments: on 16 cores one graph made 8.5 frames/s of the paper's rig with 10.6 cores
busy, four made 15.0."""


def share_gpus(workers: int, scenario: Scenario) -> list[Rendering | None]:
    """For each worker the devices that it renders on, in place of the configured ones; None: as configured.

    Args:
        workers: Number of workers.
        scenario: The configuration.

    Raises:
        RenderError: There are cameras, EGL is missing or has no device, and the configuration leaves the choice to it.
    """
    gpus = _gpus(scenario.rendering) if scenario.sensors_of_type(Camera) else ()
    if workers == 1 or len(gpus) < 2:
        return [None] * workers
    shares = (gpus[k::workers] or gpus[k % len(gpus) : k % len(gpus) + 1] for k in range(workers))
    return [scenario.rendering.model_copy(update={"gpus": share}) for share in shares]


def cores_of_worker(workers: int, cores: int) -> int:
    """Number of cores that each of some workers on a machine with ``cores`` of them plans its graph with."""
    return min(math.ceil(_CORES_OF_SHARE * cores / workers), cores)


def fitting_workers(cost: SceneCost, cores: int) -> int:
    """Number of workers that a machine carries, if one of them with all cores for itself had a certain cost.

    Each worker needs a ROS domain of its own, which limits the number on large machines.

    Args:
        cost: Measured cost of a scene; its graph still runs.
        cores: Number of cores.
    """
    by_cores = round(cores / min(max(cost.cores, _MIN_CORES), _MAX_CORES))
    by_memory = 1 + int(free_memory_mib() / max(cost.memory_mib * MEMORY_MARGIN, 1.0))
    return max(min(by_cores, by_memory, len(ISOLATED_DOMAINS)), 1)


def expected_speedup(workers: int | Literal["auto"] | None, cost: SceneCost, cores: int) -> float:
    """Factor by which workers side by side on one machine are faster than one graph: at most until its cores are busy.

    Measured on 16 cores: 1.55 where this says 1.5 (two workers, a graph that kept 10.6 cores busy alone); with a graph
    of 5.3 cores 1.8, 2.5 and 2.9 where it says 2.0, 3.0 and 3.0 (two, four and eight workers).

    Args:
        workers: Number of workers; ``auto``: ``fitting_workers``; None: one.
        cost: Measured cost of a scene.
        cores: Number of cores.
    """
    number = fitting_workers(cost, cores) if workers == "auto" else workers or 1
    return min(number, max(cores / max(cost.cores, _MIN_CORES), 1.0))


def _gpus(rendering: Rendering) -> tuple[int, ...]:
    """EGL's numbers of the GPUs that render."""
    if rendering.gpus != "auto":
        return rendering.gpus
    return () if software_request() else tuple(gpu.index for gpu in accessible_gpus())
