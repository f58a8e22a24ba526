"""Roads and static scenes of maps, loaded or built ahead so that the nodes of a graph find them in the cache."""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from simbev_ros.assets.actors.catalog import build_models
from simbev_ros.assets.regions.region_pool import build_regions
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.config.camera import Camera
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Region, regions_of
from simbev_ros.production.events import MapNoted, RegionBuilt, SurroundingsEnded, SurroundingsStarted
from simbev_ros.production.observer import SILENT, ProductionObserver, observe_step
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec


def load_roads(spec: MapSpec, observer: ProductionObserver = SILENT) -> RoadNetwork:
    """Load or build the road network of a map and report the map's notes.

    Raises:
        InputError: The map's file cannot be read or used.
    """
    with observe_step(observer, f"roads of {spec.name}"):
        network = load_network(spec)
    for note in network.notes:
        observer.notify(MapNoted(spec.name, note))
    return network


def build_surroundings(specs: Sequence[SceneSpec], observer: ProductionObserver = SILENT) -> None:
    """Fill the cache with the static scene around each scene's route, and with models of actors.

    Raises:
        InputError: The cache cannot be written.
    """
    with observe_step(observer, "vehicles and people"):
        build_models(coarser=any(agent.rig.of_type(Camera) for spec in specs for agent in spec.agents))
    for map_spec in dict.fromkeys(spec.map for spec in specs):
        network = load_network(map_spec)
        seen = [regions_of(network.layout, loaded_reach(spec, network)) for spec in specs if spec.map == map_spec]
        build_missing_regions(map_spec, network, tuple(dict.fromkeys(chain.from_iterable(seen))), observer)


def build_missing_regions(
    spec: MapSpec,
    network: RoadNetwork,
    regions: Sequence[Region],
    observer: ProductionObserver = SILENT,
    cache_dir: Path | None = None,
) -> None:
    """Build the regions of a map that are not in the cache yet, on all cores; one process at a time does so.

    Args:
        spec: The map.
        network: Its roads.
        regions: The regions that are needed.
        observer: Receives the progress.
        cache_dir: The cache; None: the user's.

    Raises:
        InputError: The cache cannot be written.
    """
    cache = StaticCache(spec, network, cache_dir)
    if not cache.missing(regions):
        return
    with cache.building():
        missing = cache.missing(regions)  # another process may have built them meanwhile
        if not missing:
            return
        observer.notify(SurroundingsStarted(spec.name, len(missing)))
        try:
            build_regions(spec, missing, cache_dir, lambda: observer.notify(RegionBuilt()))
        finally:
            observer.notify(SurroundingsEnded())
