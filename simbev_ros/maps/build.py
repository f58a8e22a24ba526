"""Maps on demand: a MapSpec in, a RoadNetwork out, built once and then taken from a cache on disk."""

import hashlib
import os
import shutil
import tempfile
from pathlib import Path

from simbev_ros.errors import InputError
from simbev_ros.maps import netconvert
from simbev_ros.maps.features import MapFeatures
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.signals import place_signals
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.street_plan import draw_plan, edges_xml, nodes_xml
from simbev_ros.maps.sumo_layout import layout_of
from simbev_ros.maps.sumo_net import read_sumo_net

_NET = "map.net.xml"
_OPENDRIVE = "map.xodr"


def load_network(spec: MapSpec, cache_dir: Path | None = None) -> RoadNetwork:
    """The road network of a map.

    Args:
        spec: Which map.
        cache_dir: Where nets that were built once are kept; ``default_cache_dir()`` when omitted.

    Raises:
        InputError: No map has this name, or the cache cannot be written.
        SimulationError: SUMO could not build the map.
    """
    recipe = recipe_of(spec.name)
    plan = draw_plan(recipe, spec.seed)
    folder = _built(
        spec.name,
        nodes_xml(plan, recipe),
        edges_xml(plan, recipe),
        recipe.streets.crossing_width_m,
        cache_dir or default_cache_dir(),
    )
    net = read_sumo_net(folder / _NET)
    return RoadNetwork(
        name=spec.name,
        lanes=net.lanes,
        junctions=net.junctions,
        signals=place_signals(net.lanes, net.links),
        datum=recipe.datum.datum,
        net_path=folder / _NET,
        opendrive=(folder / _OPENDRIVE).read_text(encoding="utf-8"),
        layout=layout_of(net.lanes),
        features=MapFeatures(recipe.surroundings),
        seed=spec.seed,
    )


def default_cache_dir() -> Path:
    """``$XDG_CACHE_HOME/simbev_ros``, by default ``~/.cache/simbev_ros``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "simbev_ros"


def _built(name: str, nodes: str, edges: str, crossing_width_m: float, cache_dir: Path) -> Path:
    """Folder of the net and its OpenDRIVE; its name is a hash of all that they are built from."""
    content = "\0".join((nodes, edges, repr(crossing_width_m), netconvert.fingerprint()))
    folder = cache_dir / "maps" / f"{name}-{hashlib.sha256(content.encode()).hexdigest()[:20]}"
    if folder.is_dir():
        return folder
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=folder.parent))
    except OSError as error:
        raise InputError(f"map cache {folder.parent}: cannot be written: {error.strerror}") from error
    try:
        nodes_path, edges_path = work / "map.nod.xml", work / "map.edg.xml"
        nodes_path.write_text(nodes, encoding="utf-8")
        edges_path.write_text(edges, encoding="utf-8")
        netconvert.convert(nodes_path, edges_path, crossing_width_m, work / _NET, work / _OPENDRIVE)
        _publish(work, folder)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return folder


def _publish(work: Path, folder: Path) -> None:
    """Give a finished folder its name; another process may have been first, with the same content."""
    try:
        work.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
