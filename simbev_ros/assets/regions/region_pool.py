"""Builds the regions that are missing in the cache, in parallel on all cores."""

from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache, partial
from pathlib import Path

from simbev_ros.assets.build_pool import build_in_processes
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.foundation.errors import SimulationError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Region
from simbev_ros.schema.scene.map_spec import MapSpec


def build_regions(spec: MapSpec, regions: Sequence[Region], cache_dir: Path | None, built: Callable[[], None]) -> None:
    """Build regions into the cache. Any error or interrupt stops all workers and leaves no partial files.

    Args:
        spec: Specification of the map.
        regions: Regions to build.
        cache_dir: Cache directory of maps and regions; None for the default.
        built: Called after each region that has been built.

    Raises:
        InputError: The cache cannot be written.
        SimulationError: A worker process was killed, as happens when memory runs out.
    """
    try:
        for _ in build_in_processes(partial(_build, spec, cache_dir), regions):
            built()
    except BrokenProcessPool:
        raise SimulationError(
            f"map {spec.name}: a process that built its surroundings was killed; is there enough memory? "
            "Regions that were already built are kept"
        ) from None


def _build(spec: MapSpec, cache_dir: Path | None, region: Region) -> None:
    """Build one region in the current process."""
    try:
        _cache(spec, cache_dir).region(region)
    except Exception as error:
        error.add_note(f"while building region {region.column}_{region.row} of map {spec.path or spec.name}")
        raise


@lru_cache(maxsize=1)
def _cache(spec: MapSpec, cache_dir: Path | None) -> StaticCache:
    return StaticCache(spec, load_network(spec, cache_dir), cache_dir)
