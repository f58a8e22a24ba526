"""Maps written in another form and read again have the same roads; OpenStreetMap files are checked with pyosmium."""

from pathlib import Path

import numpy as np
import osmium
import pytest
import shapely
import shapely.affinity

from simbev_ros.export.maps.conversion import write_map
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.statistics import statistics_of

RIVERSIDE = Path(__file__).parents[1] / "maps/data/riverside.osm"
FORMS = {".xodr": 0.95, ".net.xml": 0.98, ".osm": 0.85}
"""Suffix → smallest share of the road's area that both have in common, of what either has."""


@pytest.fixture(
    scope="module", params=[pytest.param("Blocks", marks=pytest.mark.slow), str(RIVERSIDE)], ids=["Blocks", "riverside"]
)
def network(request: pytest.FixtureRequest) -> RoadNetwork:
    return load_network(map_spec(request.param))


def road_of(network: RoadNetwork, like: RoadNetwork) -> shapely.Geometry:
    """The carriageways of a map in the map frame of another one."""
    origin_m = like.datum.map_from_geodetic(*network.datum.geodetic_from_map((0.0, 0.0, 0.0)))
    return shapely.affinity.translate(surfaces_of(network.layout).road, *origin_m[:2])


@pytest.mark.parametrize(
    "suffix", [".xodr", *(pytest.param(suffix, marks=pytest.mark.slow) for suffix in list(FORMS)[1:])]
)
def test_a_written_map_has_the_same_roads(tmp_path: Path, network: RoadNetwork, suffix: str) -> None:
    path = tmp_path / f"map{suffix}"
    write_map(network, path)
    again = load_network(map_spec(str(path)), tmp_path / "cache")
    before, after = road_of(network, network), road_of(again, network)
    assert before.intersection(after).area / before.union(after).area > FORMS[suffix]
    first, second = statistics_of(network), statistics_of(again)
    assert (second.junctions, second.crosswalks) == (first.junctions, first.crosswalks)
    assert second.signals == pytest.approx(first.signals, abs=1)
    assert second.levels == first.levels
    for kind, length_km in first.lane_km.items():
        assert second.lane_km[kind] == pytest.approx(length_km, rel=0.06, abs=0.05)


def test_an_openstreetmap_file_is_read_by_pyosmium_with_lanes_and_land(tmp_path: Path) -> None:
    network = load_network(map_spec(str(RIVERSIDE)))
    path = tmp_path / "map.osm"
    write_map(network, path)
    roads, areas, node_deg = [], {"building": 0, "natural": 0, "landuse": 0}, {}
    for item in osmium.FileProcessor(str(path)):
        if item.is_node():
            node_deg[item.id] = item.location.lat, item.location.lon
        elif item.is_way() and "highway" in item.tags:
            roads.append((dict(item.tags), [node.ref for node in item.nodes]))
        else:
            for key in areas:
                areas[key] += key in item.tags
    assert areas["building"] == len(network.features.buildings)
    assert areas["natural"] >= len(network.features.water)
    assert areas["landuse"] > 0
    widths = [tags["width:lanes"] for tags, _ in roads if tags["highway"] == "motorway"]
    assert set(widths) <= {"3.20|3.20", "3.20|3.20|3.20"}
    bridges = [(tags["layer"], len(nodes)) for tags, nodes in roads if tags.get("bridge") == "yes"]
    assert bridges and {layer for layer, _ in bridges} == {"1"}
    positions = np.array([node_deg[node] for _, nodes in roads for node in nodes])
    assert np.abs(positions - (network.datum.latitude_deg, network.datum.longitude_deg)).max() < 0.01


def test_a_name_without_a_known_form_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"map\.dwg: its name must end in \.xodr, \.net\.xml, lanelet2_map\.osm, "):
        write_map(load_network(map_spec("Blocks")), tmp_path / "map.dwg")
