"""Starts SUMO in this process with the options of all scenes."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.units import NS_PER_S
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
_NS_PER_MS = NS_PER_S // 1000
_MAX_SPEED_ERROR = 0.03


def sumo_step_ns(tick_ns: int) -> int:
    """Length on SUMO's clock of one tick: SUMO counts whole milliseconds.

    At 30 Hz these are 33 ms, so all traffic is 1 % slower than SUMO's speeds; at 60 Hz 17 ms, and it is 2 % faster.

    Raises:
        SimulationError: Speeds would be wrong by more than 3 %.
    """
    step_ns = round(tick_ns / _NS_PER_MS) * _NS_PER_MS
    if abs(step_ns - tick_ns) > _MAX_SPEED_ERROR * tick_ns:
        raise SimulationError(f"tick_ns: {tick_ns} is too far from the whole milliseconds that SUMO counts")
    return step_ns


def start_sumo(
    files: Sequence[Path], step_s: float, seed: int, speeds_mps: Mapping[str, float], closed_lanes: Iterable[str]
) -> None:
    """Load a network and its traffic, and insert everything at time 0; arguments as for ``SumoTraffic``."""
    own = {"step-length": f"{step_s:.3f}", "seed": str(seed % _MAX_SEED)}
    options = {**_OPTIONS, **dict(zip(_FILES, map(str, files), strict=True)), **own}
    libsumo.start(["sumo", *(argument for name, value in options.items() for argument in (f"--{name}", value))])
    for lane, speed_mps in speeds_mps.items():
        libsumo.lane.setMaxSpeed(lane, speed_mps)
    for lane in closed_lanes:
        libsumo.lane.setDisallowed(lane, ["all"])
    libsumo.simulationStep()
