"""Times the world node on scenes with increasing numbers of actors to find how its cost grows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import MapScenes, Scenario
from simbev_ros.maps.source import known_map
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver, observe_step
from simbev_ros.production.surroundings import build_surroundings
from tools.bench.world_node_timing import SceneTiming, timed_scenes

ACTORS = (50, 150, 300, 600, 950)
"""Numbers of actors: a third are vehicles, the others pedestrians. Riders and hazard areas come on top."""


@dataclass(frozen=True, slots=True)
class WorldTiming:
    """Times of scenes of growing size on one map; processor time grows as the number of actors to the ``growth``."""

    map: str
    scenes: list[SceneTiming]
    growth: float


def timed_world(
    scenario: Scenario, map_name: str, counts: Sequence[int] = ACTORS, observer: ProductionObserver = SILENT
) -> WorldTiming:
    """Play a scene without sensors with each number of actors, and time the ticks after the warm-up.

    Args:
        scenario: The configuration of the traffic.
        map_name: A town or a map file.
        counts: Numbers of actors.
        observer: Receives the progress.

    Raises:
        InputError: The map does not exist, or has no room for that many vehicles.
    """
    specs = [draw_scenes(_with_actors(scenario, map_name, count), observer)[0] for count in counts]
    build_surroundings(specs, observer)
    with observe_step(observer, f"scenes on {specs[0].map.name}"):
        scenes = timed_scenes(specs)
    logs = np.log([(scene.vehicles + scene.people, scene.cpu_ms) for scene in scenes])
    return WorldTiming(specs[0].map.name, scenes, float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0]))


def _with_actors(scenario: Scenario, map_name: str, count: int) -> Scenario:
    vehicles = round(count / 3)
    places = {"vehicles": vehicles - 1, "pedestrians": count - vehicles, "spawn_radius_m": 10_000.0}
    timing = scenario.time.model_copy(update={"end_after_standing_s": None})
    scenes = (MapScenes(map=known_map(map_name), train=1),)
    traffic = scenario.traffic.model_copy(update=places)
    return scenario.model_copy(update={"scenes": scenes, "traffic": traffic, "rig": Rig(sensors=()), "time": timing})
