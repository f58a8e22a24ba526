"""Times how the building of a city grows with its area: an OpenStreetMap file, repeated side by side."""

import multiprocessing
import resource
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import osmium
from osmium.osm import mutable

from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.maps.build import load_network
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.maps.region import REGION_M, Reach, regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.statistics import busiest_position, statistics_of

_REACH_M = 400.0
_KIB_PER_MIB = 1024.0


class Building(NamedTuple):
    """Extent and lanes of a map that was built, and what it took: processor time, peak memory, and netconvert's."""

    area_km2: float
    lane_km: float
    roads_cpu_s: float
    surroundings_cpu_s_per_km2: float
    peak_mib: float
    netconvert_mib: float


@dataclass(frozen=True, slots=True)
class CityTiming:
    """A city, repeated to several areas, and what each takes."""

    city: str
    buildings: list[Building]

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table, one for each area."""
        return [
            (
                f"{each.area_km2:.1f}",
                f"{each.lane_km:.0f}",
                f"{each.roads_cpu_s:.0f}",
                f"{each.roads_cpu_s / each.area_km2:.1f}",
                f"{each.surroundings_cpu_s_per_km2:.0f}",
                f"{each.peak_mib:.0f}",
                f"{each.netconvert_mib:.0f}",
            )
            for each in self.buildings
        ]


def timed_city(city: Path, sides: Sequence[int], advance: Callable[[], None] = lambda: None) -> CityTiming:
    """Build a city's roads, and its surroundings around its busiest place, at several areas, each in a process.

    Args:
        city: An OpenStreetMap file.
        sides: Of each area, how often the city is repeated to the east and to the north.
        advance: Called after each area.

    Raises:
        InputError: The file cannot be read, or has no roads for cars.
    """
    buildings = []
    for side in sides:
        with tempfile.TemporaryDirectory(prefix="simbev_city-") as folder, _one_process() as process:
            path = Path(folder) / "city.osm.pbf"
            repeat_city(city, side, path)
            buildings.append(process.submit(_build, str(path), Path(folder) / "cache").result())
        advance()
    return CityTiming(city.name, buildings)


def repeat_city(city: Path, side: int, target: Path) -> None:
    """Write a PBF in which a city stands ``side`` times to the east and to the north.

    Relations keep only their ways.

    Args:
        city: An OpenStreetMap file.
        side: Number of repetitions in each direction.
        target: The file to write; it must not exist.

    Raises:
        InputError: The file cannot be read.
    """
    read_osm(city)  # its messages are better
    nodes, ways, relations = _objects(city)
    place_deg = np.array([(node["lon"], node["lat"]) for node in nodes])
    size_deg = np.ptp(place_deg, axis=0)
    rows = [{each["id"]: row for row, each in enumerate(objects, 1)} for objects in (nodes, ways)]
    tiles = [(k, divmod(k, side) * size_deg) for k in range(side**2)]
    with osmium.SimpleWriter(str(target)) as writer:
        for k, shift_deg in tiles:
            for row, node in enumerate(nodes, 1):
                place = (place_deg[row - 1] + shift_deg).tolist()
                writer.add_node(mutable.Node(id=row + k * len(nodes), location=place, tags=node["tags"]))
        for k, _ in tiles:
            for row, way in enumerate(ways, 1):
                members = [rows[0][each] + k * len(nodes) for each in way["nodes"] if each in rows[0]]
                writer.add_way(mutable.Way(id=row + k * len(ways), nodes=members, tags=way["tags"]))
        for k, _ in tiles:
            for row, area in enumerate(relations, 1):
                parts = [("w", rows[1][i] + k * len(ways), role) for i, role in area["ways"] if i in rows[1]]
                writer.add_relation(mutable.Relation(id=row + k * len(relations), members=parts, tags=area["tags"]))


def _objects(city: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]:
    """The nodes, ways and relations of a file."""
    nodes, ways, relations = [], [], []
    for each in osmium.FileProcessor(str(city)):
        own = {"id": each.id, "tags": dict(each.tags)}
        if isinstance(each, osmium.osm.Node):
            nodes.append({**own, "lon": each.lon, "lat": each.lat})
        elif isinstance(each, osmium.osm.Way):
            ways.append({**own, "nodes": [node.ref for node in each.nodes]})
        elif isinstance(each, osmium.osm.Relation):
            relations.append({**own, "ways": [(m.ref, m.role) for m in each.members if m.type == "w"]})
    return nodes, ways, relations


def _one_process() -> ProcessPoolExecutor:
    """A new process, with memory of its own."""
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))


def _build(path: str, cache_dir: Path) -> Building:
    """Build a map in this process."""
    spec, start_s = map_spec(path), _cpu_s()
    network = load_network(spec, cache_dir)
    roads_s = _cpu_s() - start_s
    x_m, y_m = busiest_position(network).tolist()
    regions = regions_of(network.layout, Reach((x_m, y_m), _REACH_M))
    start_s, cache = _cpu_s(), StaticCache(spec, network, cache_dir)
    for region in regions:
        cache.region(region)
    around_s = _cpu_s() - start_s
    peaks_mib = [
        resource.getrusage(who).ru_maxrss / _KIB_PER_MIB for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    ]
    built = statistics_of(network)
    area_km2, lane_km = built.width_m * built.depth_m / 1e6, built.lane_km["driving"]
    return Building(area_km2, lane_km, roads_s, around_s / (len(regions) * (REGION_M / 1000.0) ** 2), *peaks_mib)


def _cpu_s() -> float:
    """Processor time of this process and of those that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)
