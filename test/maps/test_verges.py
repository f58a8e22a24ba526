"""Maps without sidewalks have footways on the verges of slow roads, in the net alone; others stay as they are."""

from pathlib import Path

import numpy as np
import pytest
import shapely
import xodr_sample as xodr
from lanelet2_sample import Crossing, LaneletSample
from osm_sample import Writer

from simbev_ros.maps.build import load_network
from simbev_ros.maps.findings import WALKED_VERGES
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.streets.walks import WalkGraph

STREET = {"highway": "unclassified"}


def built(folder: Path, name: str, text: str) -> RoadNetwork:
    (folder / name).write_text(text, encoding="utf-8")
    return load_network(map_spec(str(folder / name)), folder / "cache")


def lanelets(walkways: bool) -> str:
    crossing = Crossing(LaneletSample())
    for arm in range(4):
        crossing.lights(arm)
        if walkways:
            crossing.walkways(arm)
    return crossing.sample.text()


def streets(tags: dict[str, str], side: dict[str, str] | None = None) -> str:
    writer = Writer()
    writer.way([(-190, 10), (10, 10), (210, 10)], tags)
    writer.way([(10, 10), (10, 210)], tags if side is None else side)
    return writer.text()


def road(speed_kmh: float, *kinds: str, rule: str = "RHT", more: str = "") -> str:
    speed = f'<type s="0" type="town"><speed max="{speed_kmh}" unit="km/h"/></type>'
    widths = {"driving": 3.5, "parking": 2.0, "sidewalk": 2.0}
    lanes = [xodr.lane(-number, kind, inner=xodr.width(widths[kind])) for number, kind in enumerate(kinds, 1)]
    lanes.append(xodr.lane(1))
    section = xodr.section(*lanes)
    return xodr.xodr(xodr.straight_road(sections=section, more=speed + more, attributes=f'rule="{rule}"'))


@pytest.mark.parametrize(
    ("name", "text", "walked_m"),
    [
        ("lanelets.osm", lanelets(walkways=False), 400.0),
        ("streets.osm", streets(STREET), 900.0),
        ("streets.osm", streets({"highway": "residential", "sidewalk": "no"}), 900.0),
        ("road.xodr", road(50, "driving"), 199.0),
        ("road.xodr", road(50, "driving", "parking"), 199.0),
        ("road.xodr", road(50, "driving", rule="LHT"), 199.0),
    ],
)
def test_people_walk_beside_slow_roads_of_a_map_without_sidewalks(
    tmp_path: Path, name: str, text: str, walked_m: float
) -> None:
    network = built(tmp_path, name, text)
    assert sum(lane.length_m for lane in WalkGraph(network).sidewalks) >= walked_m
    used = strip_polygons(network.layout.strips_of(LaneKind.DRIVING, LaneKind.PARKING))
    beside_m = shapely.distance(network.verges, used)
    assert shapely.intersection(network.verges, shapely.union_all(used)).area < 0.1 * network.verges.area
    assert beside_m.min() < 0.5
    assert {strip.kind for strip in network.layout.strips} <= {LaneKind.DRIVING, LaneKind.PARKING}
    assert not network.layout.crosswalks, "nothing is painted"
    assert WALKED_VERGES in {finding.rule for finding in network.findings}
    approach = {lane.id for lane in network.lanes_of(LaneKind.DRIVING) if not lane.junction}
    assert all(successor in network.lanes for name in approach for successor in network.lanes[name].successors)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lanelets.osm", lanelets(walkways=True)),
        ("streets.osm", streets(STREET, {"highway": "residential"})),
        ("streets.osm", streets({"highway": "trunk"})),
        ("streets.osm", streets({**STREET, "bridge": "yes"})),
        ("road.xodr", road(50, "driving", "sidewalk")),
        ("road.xodr", road(80, "driving")),
        ("road.xodr", road(50, "driving", more='<objects><bridge id="1" s="0" length="100"/></objects>')),
    ],
)
def test_maps_with_sidewalks_fast_roads_and_bridges_have_no_walked_verges(tmp_path: Path, name: str, text: str) -> None:
    network = built(tmp_path, name, text)
    assert network.verges.is_empty
    assert WALKED_VERGES not in {finding.rule for finding in network.findings}


def test_a_marked_crossing_of_openstreetmap_stays_painted(tmp_path: Path) -> None:
    text = streets(STREET)
    middle = 'id="2"'
    node = text[text.index(f"<node {middle}") :].splitlines()[0]
    tagged = node.replace("/>", '><tag k="highway" v="crossing"/><tag k="crossing" v="zebra"/></node>')
    network = built(tmp_path, "streets.osm", text.replace(node, tagged))
    assert tagged in text.replace(node, tagged)
    junctions_m = np.array([junction.center_m[:2] for junction in network.junctions.values()])
    for crosswalk in network.layout.crosswalks:
        middle_m = crosswalk.outline_m[:, :2].mean(axis=0)
        assert np.linalg.norm(junctions_m - middle_m, axis=1).min() < 15.0
    assert network.layout.crosswalks
