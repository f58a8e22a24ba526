"""Maps without sidewalks have footways on the verges of slow roads, in the net alone; others stay as they are."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import shapely
import xodr_sample as xodr
from lanelet2_sample import Crossing, LaneletSample
from osm_sample import Writer

from simbev_ros.maps import builder
from simbev_ros.maps.build import load_network
from simbev_ros.maps.findings import WALKED_VERGES
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import TownRecipe
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.store import read_network
from simbev_ros.scene.streets.walks import WalkGraph
from simbev_ros.schema.scene.map_spec import MapSpec

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


def hamlet(folder: Path, monkeypatch: pytest.MonkeyPatch, **lane: object) -> RoadNetwork:
    """A town of a street, a lane from its middle over a crossroads to a stream, and a country road."""
    farm_track = {"like": "farm_track", **lane}
    roads = {
        "street": ("street", [[-150, 0], [150, 0]]),
        "lane": (farm_track, [[0, 0], [0, 300]]),
        "cross_lane": (farm_track, [[-100, 150], [100, 150]]),
        "country_road": ("country_road", [[150, 0], [400, 0]]),
    }
    recipe = TownRecipe.model_validate(
        {
            "name": "Hamlet",
            "datum": {"latitude_deg": 0, "longitude_deg": 0, "altitude_m": 0},
            "patterns": [
                {"pattern": "road", "name": name, "road": road, "points_m": points_m}
                for name, (road, points_m) in roads.items()
            ],
            "surroundings": {"use": "farmland"},
            "water": [{"line_m": [[-150, 230], [150, 230]], "width_m": 8, "below_land_m": 2.0}],
        }
    )
    monkeypatch.setattr(builder, "recipe_of", lambda _: recipe)
    folder.mkdir()
    builder.build_map(MapSpec(name=recipe.name), folder)
    return read_network(folder, 0)


def test_people_of_a_town_walk_on_the_verges_of_lanes_but_not_over_its_streams_and_beside_fast_roads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = hamlet(tmp_path / "walked", monkeypatch, sidewalk_m=1.5, verge=True)
    walked = shapely.union_all([shapely.LineString(lane.centerline_m[:, :2]) for lane in WalkGraph(network).sidewalks])
    for x_m, y_m, is_walked in ((0, 75, True), (50, 150, True), (0, 185, False), (0, 260, False), (250, 0, False)):
        assert shapely.dwithin(walked, shapely.Point(x_m, y_m), 5.0) == is_walked
    assert max(WalkGraph(network).component_length_m().values()) > 800.0, "from the street onto the lanes"
    bare = hamlet(tmp_path / "bare", monkeypatch)
    kinds = Counter(strip.kind for strip in network.layout.strips)
    assert kinds == Counter(strip.kind for strip in bare.layout.strips), "verges are not paved"
    assert len(network.layout.crosswalks) == len(bare.layout.crosswalks)
    roads = [shapely.union_all(strip_polygons(each.layout.strips)) for each in (network, bare)]
    assert shapely.symmetric_difference(*roads).area < 0.01 * roads[1].area
    assert shapely.intersection(network.verges, roads[0]).area < 0.01 * network.verges.area
    assert shapely.dwithin(network.verges, shapely.Point(0, 75), 3.0)
    assert bare.verges.is_empty


def test_the_net_of_a_town_says_which_walks_are_unpaved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    town = hamlet(tmp_path / "town", monkeypatch, sidewalk_m=1.5, verge=True)
    imported = built(tmp_path, "hamlet.net.xml", town.net_path.read_text(encoding="utf-8"))
    assert shapely.intersection(imported.verges, town.verges).area > 0.9 * town.verges.area > 0.0
    assert WALKED_VERGES in {finding.rule for finding in imported.findings}


def test_people_of_town07_walk_where_the_ego_drives(map_cache: Path) -> None:
    network = load_network(map_spec("Town07"), map_cache)
    walks = shapely.STRtree([shapely.LineString(lane.centerline_m[:, :2]) for lane in WalkGraph(network).sidewalks])
    starts_m = network.waypoints(24.0).position_m
    near = np.unique(walks.query(shapely.points(starts_m[:, :2]), predicate="dwithin", distance=60.0)[0])
    assert len(near) > 0.9 * len(starts_m)
