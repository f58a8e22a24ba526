"""Shares of a machine for workers side by side: how many fit, and which cores and GPUs each one uses."""

import os
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.config.camera import Camera
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.graph.domain import ISOLATED_DOMAINS
from simbev_ros.production.scene_cost import SceneCost, free_memory_mib
from simbev_ros.render.gl.devices import accessible_gpus, software_request

_MEMORY_MARGIN = 1.2
"""Factor on the measured memory of a graph: later scenes may need more."""
_MIN_CORES = 0.1
"""Number of cores that a graph uses at least: the processor time of a short scene may be too little to measure."""


@dataclass(frozen=True, slots=True)
class Share:
    """What one of several workers uses.

    Attributes:
        cores: Numbers of its CPU cores; empty: all.
        rendering: Devices that render for it, in place of the configuration's; None: as configured.
    """

    cores: tuple[int, ...] = ()
    rendering: Rendering | None = None


def machine_shares(workers: int, scenario: Scenario) -> list[Share]:
    """Share out the cores that this process may use, and the GPUs that are configured.

    Hyper-threads of one core stay together. With more workers than cores, all of them use all cores.

    Args:
        workers: Number of workers.
        scenario: The configuration.

    Raises:
        RenderError: There are cameras, EGL is missing or has no device, and the configuration leaves the choice to it.
    """
    cores = sorted(os.sched_getaffinity(0), key=_topology)
    rendering = scenario.rendering
    gpus = _gpus(rendering) if scenario.rig.of_type(Camera) else ()
    is_pinned, is_assigned = 1 < workers <= len(cores), workers > 1 and len(gpus) > 1
    shares = []
    for k in range(workers):
        own = cores[len(cores) * k // workers : len(cores) * (k + 1) // workers] if is_pinned else []
        devices = gpus[k::workers] or gpus[k % len(gpus) : k % len(gpus) + 1] if is_assigned else ()
        drawing = rendering.model_copy(update={"gpus": devices}) if devices else None
        shares.append(Share(tuple(own), drawing))
    return shares


def fitting_workers(cost: SceneCost, cores: int) -> int:
    """Number of workers that a machine carries, if one of them with all cores for itself had a certain cost.

    Each worker needs a ROS domain of its own, which limits the number on large machines.

    Args:
        cost: Measured cost of a scene; its graph still runs.
        cores: Number of cores.
    """
    by_cores = round(cores / max(cost.cores, _MIN_CORES))
    by_memory = 1 + int(free_memory_mib() / max(cost.memory_mib * _MEMORY_MARGIN, 1.0))
    return max(min(by_cores, by_memory, len(ISOLATED_DOMAINS)), 1)


def _gpus(rendering: Rendering) -> tuple[int, ...]:
    """EGL's numbers of the GPUs that render."""
    if rendering.gpus != "auto":
        return rendering.gpus
    return () if software_request() else tuple(gpu.index for gpu in accessible_gpus())


def _topology(core: int) -> tuple[int, int, int]:
    """Key that sorts cores by processor and physical core."""
    folder = Path(f"/sys/devices/system/cpu/cpu{core}/topology")
    try:
        package, physical = (int((folder / name).read_text()) for name in ("physical_package_id", "core_id"))
    except (OSError, ValueError):
        return 0, core, core
    return package, physical, core
