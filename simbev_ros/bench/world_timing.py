"""Timing the world node on scenes with ever more actors: how its cost grows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from simbev_ros.bench.world_node_timing import SceneTiming, timed_scenes
from simbev_ros.cli.scenes import build_surroundings, drawn_scenes
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import MapScenes, Scenario

ACTORS = (50, 150, 300, 600, 950)
"""As many are asked for: a third vehicles, the others people. Riders and hazard areas come on top."""


@dataclass(frozen=True, slots=True)
class WorldTiming:
    """Scenes of growing size on one map; ``growth`` is the exponent of the actors in the processor time."""

    map: str
    scenes: list[SceneTiming]
    growth: float


def timed_world(scenario: Scenario, map_name: str, counts: Sequence[int] = ACTORS) -> WorldTiming:
    """Play a scene on a map with each number of actors, without sensors, and time what would be recorded of it.

    Raises:
        InputError: there is no such map, or it has no room for so many vehicles.
    """
    console = Console(stderr=True)
    specs = [drawn_scenes(_with_actors(scenario, map_name, count), console)[0] for count in counts]
    build_surroundings(specs, console)
    with console.status(f"scenes on {specs[0].map.name}"):
        scenes = timed_scenes(specs)
    logs = np.log([(scene.vehicles + scene.people, scene.cpu_ms) for scene in scenes])
    return WorldTiming(specs[0].map.name, scenes, float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0]))


def _with_actors(scenario: Scenario, map_name: str, count: int) -> Scenario:
    vehicles = round(count / 3)
    places = {"vehicles": vehicles - 1, "pedestrians": count - vehicles, "spawn_radius_m": 10_000.0}
    timing = scenario.time.model_copy(update={"end_after_standing_s": None})
    scenes = (MapScenes(map=map_name, train=1),)
    traffic = scenario.traffic.model_copy(update=places)
    return scenario.model_copy(update={"scenes": scenes, "traffic": traffic, "rig": Rig(sensors=()), "time": timing})
