"""The road network of a recorded scene, built from the map file in its bag; this needs the simulator."""

from pathlib import Path

from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.replay.replay import build_recorded_roads


def recorded_roads(path: Path) -> RoadNetwork:
    """The road network of ``recorded_map``, with the same errors."""
    return recorded_map(path)[1]


def recorded_map(path: Path) -> tuple[MapSpec, RoadNetwork]:
    """The map of the scene in a bag, and its road network, from the cache if it was built before.

    Raises:
        BagError: The map file in the bag is damaged, or larger than a map file may be.
        InputError: The roads cannot be built from it.
    """
    with SceneBag(path) as bag:
        chosen = build_recorded_roads(bag)
    return chosen, load_network(chosen)
