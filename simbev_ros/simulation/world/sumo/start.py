"""Starts SUMO in this process with the options of all scenes."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from simbev_ros.simulation.world.sumo.libsumo_import import libsumo

_FILES = ("net-file", "route-files", "additional-files")
_OPTIONS = {
    "lateral-resolution": "0.8",
    "pedestrian.model": "striping",
    "pedestrian.striping.dawdling": "0",
    "pedestrian.striping.walkingarea-detail": "20",
    "time-to-teleport": "-1",
    "time-to-impatience": "20",
    "collision.action": "none",
    "intermodal-collision.action": "none",
    "max-depart-delay": "0",
    "threads": "1",
    "xml-validation": "never",
    "no-step-log": "true",
    "no-warnings": "true",
    "duration-log.disable": "true",
}
_MAX_SEED = 2**31 - 1


def start_sumo(
    files: Sequence[Path], tick_s: float, seed: int, speeds_mps: Mapping[str, float], closed_lanes: Iterable[str]
) -> None:
    """Load a network and its traffic, and insert everything at time 0; arguments as for ``SumoTraffic``."""
    own = {"step-length": f"{tick_s:.3f}", "seed": str(seed % _MAX_SEED)}
    options = {**_OPTIONS, **dict(zip(_FILES, map(str, files), strict=True)), **own}
    libsumo.start(["sumo", *(argument for name, value in options.items() for argument in (f"--{name}", value))])
    for lane, speed_mps in speeds_mps.items():
        libsumo.lane.setMaxSpeed(lane, speed_mps)
    for lane in closed_lanes:
        libsumo.lane.setDisallowed(lane, ["all"])
    libsumo.simulationStep()
