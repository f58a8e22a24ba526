"""Loads a map: takes a MapSpec and returns its RoadNetwork.

A map is built on first use and afterwards read from a disk cache. The planner and the importers are only imported when
something has to be built: they take longer to load than a built map does.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

from simbev_ros.foundation.cache.entries import default_cache_dir, discard_entry
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.foundation.cache.folders import ensure_folder
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.process_memory import return_freed_memory
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.maps.store import read_datum, read_network, read_source, read_tunnels
from simbev_ros.schema.scene.map_spec import MapSpec

_ATTEMPTS = 3
_T = TypeVar("_T")


def load_network(spec: MapSpec, cache_dir: Path | None = None) -> RoadNetwork:
    """Load the road network of a map, building it first if the cache does not hold it yet.

    Args:
        spec: The map to load.
        cache_dir: Cache folder for built maps; ``default_cache_dir()`` when omitted.

    Raises:
        InputError: No map has this name, its file is invalid, or the cache cannot be written.
        SimulationError: SUMO could not build the map.
    """
    return _read(spec, cache_dir, partial(read_network, seed=spec.seed))


def load_datum(spec: MapSpec, cache_dir: Path | None = None) -> MapDatum:
    """Load only the geodetic datum of a map, without its network. Arguments and errors as for ``load_network``."""
    return _read(spec, cache_dir, read_datum)


def load_tunnels(spec: MapSpec, cache_dir: Path | None = None) -> Tunnels:
    """Load only the tunnels of a map, without its network. Arguments and errors as for ``load_network``."""
    return _read(spec, cache_dir, read_tunnels)


def load_source(spec: MapSpec) -> bytes:
    """Load the bzip2-compressed source file of a map, even if the original is gone. Errors as for ``load_network``.

    Of an OpenStreetMap file of which only a part was read it is an extract, from which the same map can be built.
    """
    return _read(spec, None, read_source)


def _read(spec: MapSpec, cache_dir: Path | None, read: Callable[[Path], _T]) -> _T:
    """Read from a map's cache folder; rebuild the folder if it is damaged."""
    attempt = 0
    while True:
        folder = _folder(spec, cache_dir or default_cache_dir())
        try:
            return read(folder)
        except ValueError:
            attempt += 1
            if attempt == _ATTEMPTS:
                raise
            discard_entry(folder)


def _folder(spec: MapSpec, cache_dir: Path) -> Path:
    """Return a map's cache folder. The seed is part of the key only for towns: imported files do not use it."""
    source = f"file {spec.sha256}" if spec.path else f"town {spec.seed}"
    part = "" if spec.bounds is None else f"bounds {spec.bounds}\n"
    key = f"{spec.name}\n{source}\n{part}".encode()
    try:
        return ensure_folder("maps", spec.name, fingerprint(__name__), key, partial(_build, spec), cache_dir)
    except Exception as error:
        error.add_note(f"while building the roads of map {spec.path or spec.name}")
        raise


def _build(spec: MapSpec, folder: Path) -> None:
    """Build a map and fill its cache folder."""
    from simbev_ros.maps.builder import build_map

    with _without_garbage_collection():
        build_map(spec, folder)
    return_freed_memory()


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Disable cyclic garbage collection: a build creates millions of long-lived objects and almost no cycles."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
