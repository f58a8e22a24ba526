"""Loads a map: takes a MapSpec and returns its RoadNetwork.

A map is built on first use and afterwards read from a disk cache.
"""

import gc
import gzip
import logging
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from simbev_ros.cache.entries import default_cache_dir, discard_entry
from simbev_ros.cache.fingerprint import fingerprint
from simbev_ros.cache.folders import ensure_folder
from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.osm.importer import import_osm
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.plan.town import build_town
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.signals import place_signals, with_net_ids
from simbev_ros.maps.signs import place_signs
from simbev_ros.maps.source import file_of, suffix_of
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.store import NET, OPENDRIVE, SOURCE, read_datum, read_network, read_source, write_network
from simbev_ros.maps.sumo.importer import import_sumo
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import read_sumo_net

_IMPORTERS: dict[str, Callable[[Path, Path], MapParts]] = {
    ".xodr": import_opendrive,
    ".osm": import_osm,
    ".osm.xml": import_osm,
    ".net.xml": import_sumo,
}
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


def load_source(spec: MapSpec) -> bytes:
    """Load the gzipped source file of a map, even if the original is gone. Errors as of ``load_network``."""
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
    key = f"{spec.name}\n{source}\n".encode()
    make_parts = _importer_of(spec) if spec.path else partial(build_town, recipe_of(spec.name), spec.seed)
    try:
        build = partial(_build, spec, make_parts)
        with _without_garbage_collection():
            return ensure_folder("maps", spec.name, fingerprint(__name__), key, build, cache_dir)
    except Exception as error:
        error.add_note(f"while building the roads of map {spec.path or spec.name}")
        raise


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


def _importer_of(spec: MapSpec) -> Callable[[Path], MapParts]:
    """Return a function that imports a map's file into a given work folder; the file is not read before that call."""
    return lambda work: _IMPORTERS[suffix_of(spec.path)](file_of(spec), work)


def _build(spec: MapSpec, make_parts: Callable[[Path], MapParts], folder: Path) -> None:
    """Build a map and fill its cache folder."""
    work = folder / "work"
    work.mkdir()
    if spec.path:
        (folder / SOURCE).write_bytes(gzip.compress(file_of(spec).read_bytes(), mtime=0))
    parts = make_parts(work)
    for note in parts.notes:
        logging.getLogger(__name__).info("map %s: %s", spec.name, note)
    for source, name in ((parts.net, NET), (parts.opendrive, OPENDRIVE)):
        shutil.copyfile(source, folder / name)
    net = read_sumo_net(folder / NET)
    layout = assign_levels(parts.layout or layout_of(net), parts.features.water)
    signals = place_signals(net, layout)
    network = RoadNetwork(
        name=spec.name,
        lanes=net.lanes,
        junctions=net.junctions,
        signals=signals if parts.layout else with_net_ids(signals),
        datum=parts.datum,
        net_path=folder / NET,
        opendrive_path=folder / OPENDRIVE,
        layout=layout if layout.signs else replace(layout, signs=place_signs(net, layout)),
        features=parts.features,
        seed=spec.seed,
        notes=parts.notes,
    )
    write_network(network, folder)
    shutil.rmtree(work)
