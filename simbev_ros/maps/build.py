"""Maps on demand: a MapSpec in, a RoadNetwork out, built once and then taken from a cache on disk."""

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

from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.maps.cache import code_version, default_cache_dir, folder_of
from simbev_ros.maps.cache_ageing import discard
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.osm.importer import import_osm
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.plan.town import build_town
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.roads.levels import with_levels
from simbev_ros.maps.signals import place_signals, with_ids_of_net
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
    """The road network of a map.

    Args:
        spec: Which map.
        cache_dir: Where maps that were built once are kept; ``default_cache_dir()`` when omitted.

    Raises:
        InputError: No map has this name, its file is wrong, or the cache cannot be written.
        SimulationError: SUMO could not build the map.
    """
    return _read(spec, cache_dir, partial(read_network, seed=spec.seed))


def load_datum(spec: MapSpec, cache_dir: Path | None = None) -> MapDatum:
    """Where a map lies on Earth; for those who need no more of it. Arguments and errors as ``load_network``."""
    return _read(spec, cache_dir, read_datum)


def load_source(spec: MapSpec, cache_dir: Path | None = None) -> bytes:
    """The file that a map was made from, gzip, also when it is gone; arguments and errors as ``load_network``."""
    return _read(spec, cache_dir, read_source)


def _read(spec: MapSpec, cache_dir: Path | None, read: Callable[[Path], _T]) -> _T:
    """Read something from a map's folder; a damaged one is built again."""
    attempt = 0
    while True:
        folder = _folder(spec, cache_dir or default_cache_dir())
        try:
            return read(folder)
        except ValueError:
            attempt += 1
            if attempt == _ATTEMPTS:
                raise
            discard(folder)


def _folder(spec: MapSpec, cache_dir: Path) -> Path:
    """A map's folder in the cache. The seed changes a town's streets, and nothing in a file."""
    source = f"file {spec.sha256}" if spec.path else f"town {spec.seed}"
    key = f"{spec.name}\n{source}\n".encode()
    parts_of = _imported(spec) if spec.path else partial(build_town, recipe_of(spec.name), spec.seed)
    try:
        with _no_collection():
            return folder_of("maps", spec.name, code_version(), key, partial(_build, spec, parts_of), cache_dir)
    except Exception as error:
        error.add_note(f"while building the roads of map {spec.path or spec.name}")
        raise


@contextmanager
def _no_collection() -> Iterator[None]:
    """Without searches for garbage in cycles: a build makes millions of objects that stay, and next to no cycles."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _imported(spec: MapSpec) -> Callable[[Path], MapParts]:
    """What turns a map's file into its parts, given a folder for them; the file is looked at only then."""
    return lambda work: _IMPORTERS[suffix_of(spec.path)](file_of(spec), work)


def _build(spec: MapSpec, parts_of: Callable[[Path], MapParts], folder: Path) -> None:
    """Fill a map's folder."""
    work = folder / "work"
    work.mkdir()
    if spec.path:
        (folder / SOURCE).write_bytes(gzip.compress(file_of(spec).read_bytes(), mtime=0))
    parts = parts_of(work)
    for note in parts.notes:
        logging.getLogger(__name__).info("map %s: %s", spec.name, note)
    for source, name in ((parts.net, NET), (parts.opendrive, OPENDRIVE)):
        shutil.copyfile(source, folder / name)
    net = read_sumo_net(folder / NET)
    layout = with_levels(parts.layout or layout_of(net), parts.features.water)
    signals = place_signals(net, layout)
    network = RoadNetwork(
        name=spec.name,
        lanes=net.lanes,
        junctions=net.junctions,
        signals=signals if parts.layout else with_ids_of_net(signals),
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
