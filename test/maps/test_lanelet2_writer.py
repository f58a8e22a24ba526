"""Lanelet2 files of maps: read again they are the same map, and the Lanelet2 library routes on them as the map says."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from lanelet2_sample import Crossing, LaneletSample
from xodr_sample import FLAT_HEADER, geometry, lane, linked, road, section, width

from simbev_ros.export.maps.conversion import write_map
from simbev_ros.export.maps.lanelet2_file import lanelet2_of, projector_info
from simbev_ros.export.maps.lanelet2_lanes import lanelets_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.lanelet2.projector_info import datum_of_file, utm_plane
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Paint, Strip
from simbev_ros.maps.source import map_spec

NAME = "lanelet2_map.osm"
KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.SHOULDER, LaneKind.SIDEWALK)
LINE = "<line/>"


def loaded(path: Path) -> RoadNetwork:
    return load_network(map_spec(str(path)), path.parent / "cache")


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    """A Lanelet2 map with lights, stop lines, crosswalks and walkways."""
    sample = Crossing(LaneletSample())
    for arm in range(4):
        sample.lights(arm)
        sample.walkways(arm)
        sample.crosswalk(arm)
    path = tmp_path_factory.mktemp("crossing") / "crossing.osm"
    path.write_text(sample.sample.text(), encoding="utf-8")
    return loaded(path)


@pytest.fixture(scope="module")
def written(blocks: RoadNetwork, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drawn town as a Lanelet2 file."""
    path = tmp_path_factory.mktemp("blocks") / NAME
    write_map(blocks, path)
    return path


@pytest.fixture(scope="module")
def again(written: Path) -> RoadNetwork:
    return loaded(written)


@pytest.fixture(scope="module")
def crossing_file(crossing: RoadNetwork, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("written") / NAME
    write_map(crossing, path)
    return path


@pytest.fixture(scope="module")
def crossing_again(crossing_file: Path) -> RoadNetwork:
    return loaded(crossing_file)


def lanelets(network: RoadNetwork) -> dict[str, Strip]:
    """The lanelets that are written for a map, by their ids in the file."""
    return {str(number): strip for number, strip in enumerate(lanelets_of(network.layout.strips_of(*KINDS))[0], 1)}


@pytest.fixture(scope="module")
def town(blocks: RoadNetwork) -> dict[str, Strip]:
    """The lanelets for vehicles of the drawn town."""
    return {name: strip for name, strip in lanelets(blocks).items() if strip.kind is LaneKind.DRIVING}


def length_m(strip: Strip) -> float:
    return float(np.linalg.norm(np.diff(strip.center_m[:, :2], axis=0), axis=1).sum())


def relations(content: bytes) -> list[tuple[dict[str, str], list[tuple[str, str]], str]]:
    """Tags, members (role, reference) and id of each relation."""
    return [
        (
            tags_of(item),
            [(each.get("role", ""), each.get("ref", "")) for each in item.findall("member")],
            item.get("id"),
        )
        for item in ElementTree.fromstring(content).findall("relation")
    ]


def tags_of(element: ElementTree.Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.findall("tag")}


def way_tags(content: bytes) -> dict[str, dict[str, str]]:
    return {way.get("id", ""): tags_of(way) for way in ElementTree.fromstring(content).findall("way")}


def assert_all_found(points_m: list[Float64Array], found_m: list[Float64Array], tolerance_m: float) -> None:
    """The same number of points, each near one of the others."""
    assert len(points_m) == len(found_m) > 0
    gaps_m = np.linalg.norm(np.array(points_m)[:, None] - np.array(found_m)[None], axis=2)
    assert gaps_m.min(axis=1).max() < tolerance_m


def test_lanes_read_again_have_the_same_successors_lengths_speeds_and_paint(
    town: dict[str, Strip], again: RoadNetwork
) -> None:
    numbers = {strip.id: name for name, strip in town.items()}
    found = {strip.id: strip for strip in again.layout.strips_of(LaneKind.DRIVING)}
    assert found.keys() == town.keys()
    for name, strip in town.items():
        other = found[name]
        assert {*other.following} == {numbers[each] for each in strip.following}
        assert length_m(other) == pytest.approx(length_m(strip), rel=1e-3)
        assert other.speed_mps == pytest.approx(strip.speed_mps, abs=0.05 / 3.6 + 1e-9)
        assert bool(other.junction) == bool(strip.junction)
        assert (other.left_line.paint, other.right_line.paint) == (strip.left_line.paint, strip.right_line.paint)
        for side in ("left_m", "right_m"):
            lines = [shapely.LineString(getattr(each, side)[:, :2]) for each in (strip, other)]
            assert shapely.hausdorff_distance(*lines) < 0.03
        assert other.left_m[[0, -1], 2] == pytest.approx(strip.left_m[[0, -1], 2], abs=1e-3)


def test_no_successor_of_a_drawn_town_is_lost(blocks: RoadNetwork, town: dict[str, Strip]) -> None:
    for strip in town.values():
        after = blocks.lanes[strip.id.split("#")[0]].successors
        following = [each for each in after if blocks.lanes[each].kind is LaneKind.DRIVING]
        assert sorted(each.split("#")[0] for each in strip.following) == sorted(following)


def test_lights_lines_and_crosswalks_read_again_are_where_they_were(blocks: RoadNetwork, again: RoadNetwork) -> None:
    assert_all_found(*([head.position_m for head in each.signals] for each in (blocks, again)), 0.01)
    for yields in (False, True):
        lines = ([line.ends_m for line in each.layout.stop_lines if line.yields == yields] for each in (blocks, again))
        assert_all_found(*([ends_m.mean(axis=0) for ends_m in each] for each in lines), 0.01)
    centers = ([walk.outline_m.mean(axis=0) for walk in each.layout.crosswalks] for each in (blocks, again))
    assert_all_found(*centers, 0.02)
    signs = ([sign.foot_m for sign in each.layout.signs if sign.kind == "yield"] for each in (blocks, again))
    assert_all_found(*signs, 0.05)
    before, after = ({head.lane: head.position_m for head in each.signals} for each in (blocks, again))
    for lane_id, position_m in before.items():
        same = min(after, key=lambda name: float(np.linalg.norm(after[name] - position_m)))
        end_m, other_m = blocks.lanes[lane_id].centerline_m[-1], again.lanes[same].centerline_m[-1]
        assert np.linalg.norm(end_m - other_m) < 0.5, "each head stops the lane that it stopped"


def test_a_town_keeps_its_position_on_earth(blocks: RoadNetwork, written: Path, again: RoadNetwork) -> None:
    assert again.datum == blocks.datum
    node = next(node for node in ElementTree.parse(written).getroot().findall("node"))
    tags = tags_of(node)
    position = float(node.get("lat", "")), float(node.get("lon", "")), float(tags["ele"])
    local_m = float(tags["local_x"]), float(tags["local_y"])
    assert blocks.datum.map_from_geodetic(*position)[:2] == pytest.approx(local_m, abs=1e-3)


def test_a_file_is_the_same_to_the_byte_also_after_it_was_read(
    crossing: RoadNetwork, crossing_file: Path, crossing_again: RoadNetwork, tmp_path: Path
) -> None:
    write_map(crossing, tmp_path / NAME)
    assert (tmp_path / NAME).read_bytes() == crossing_file.read_bytes()
    assert lanelet2_of(loaded(tmp_path / NAME)) == lanelet2_of(crossing_again)


def test_a_lanelet2_map_read_again_has_its_lights_and_lines(crossing: RoadNetwork, crossing_again: RoadNetwork) -> None:
    both = crossing, crossing_again
    assert_all_found(*([head.position_m for head in each.signals] for each in both), 0.01)
    assert_all_found(*([line.ends_m[0] for line in each.layout.stop_lines] for each in both), 0.01)
    assert [len(each.layout.crosswalks) for each in both] == [4, 4]
    assert [len(each.layout.strips_of(LaneKind.SIDEWALK)) for each in both] == [8, 8]


def test_lanelets_have_the_tags_and_rules_that_autoware_reads(crossing: RoadNetwork) -> None:
    content = lanelet2_of(crossing)
    ways, found = way_tags(content), relations(content)
    turns = [tags["turn_direction"] for tags, _, _ in found if "turn_direction" in tags]
    assert {turn: turns.count(turn) for turn in turns} == {"straight": 6, "left": 4, "right": 4}
    subtypes = [tags["subtype"] for tags, _, _ in found if tags["type"] == "lanelet"]
    assert (subtypes.count("crosswalk"), subtypes.count("walkway")) == (4, 8)
    roads = [tags for tags, _, _ in found if tags.get("subtype") == "road"]
    assert all(tags["participant:vehicle"] == tags["one_way"] == "yes" for tags in roads)
    assert {tags["speed_limit"] for tags in roads} == {"30", "50"}
    lights = [(members, name) for tags, members, name in found if tags["subtype"] == "traffic_light"]
    users = {ref for tags, members, _ in found if tags["type"] == "lanelet" for _, ref in members}
    for members, name in lights:
        kinds = {role: ways[ref]["type"] for role, ref in members}
        assert kinds == {"refers": "traffic_light", "ref_line": "stop_line", "light_bulbs": "light_bulbs"}
        assert [role for role, _ in members].count("ref_line") == 1
        assert name in users
    names = [item.get("id") for item in ElementTree.fromstring(content) if item.get("id")]
    assert len(set(names)) == len(names), "no two elements have the same id"


def test_who_gives_way_is_told_which_lanelets_come_first(blocks: RoadNetwork, written: Path) -> None:
    found = relations(written.read_bytes())
    tags = {name: each for each, _, name in found}
    rules = [members for each, members, _ in found if each["subtype"] == "right_of_way"]
    assert len(rules) == sum(sign.kind == "yield" for sign in blocks.layout.signs)
    for members in rules:
        refs = {role: {ref for each, ref in members if each == role} for role in ("yield", "right_of_way", "refers")}
        assert refs["yield"] and refs["right_of_way"] and len(refs["refers"]) == 1
        assert refs["yield"].isdisjoint(refs["right_of_way"])
        assert all("turn_direction" in tags[name] for name in refs["yield"] | refs["right_of_way"])


def opendrive_road(folder: Path) -> RoadNetwork:
    """Two lanes forward and one back, 100 m, whose inner forward paint becomes solid at 60 m; a third one opens."""
    marks = [
        f'<roadMark sOffset="{at}" type="{kind}" color="standard" width="0.12"/>'
        for at, kind in ((0, "broken"), (60, "solid"))
    ]
    sections = [
        section(lane(1), lane(-1, inner="".join(marks)), lane(-2)),
        section(lane(1), lane(-1), lane(-2, inner=linked(-2, -2)), lane(-3, inner=width(0.0, 0.1)), s=100.0),
    ]
    path = folder / "road.xodr"
    plan = geometry(LINE, 135.0)
    path.write_text(f"<OpenDRIVE>{FLAT_HEADER}{road(plan, 135.0, sections)}</OpenDRIVE>", encoding="utf-8")
    return loaded(path)


def test_all_lanes_of_a_road_are_cut_where_paint_changes_and_share_bounds(tmp_path: Path) -> None:
    network = opendrive_road(tmp_path)
    strips, bounds = lanelets_of(network.layout.strips_of(LaneKind.DRIVING))
    starts_m = {strip.id: float(strip.left_m[0, 0]) for strip in strips}
    assert starts_m["1/0/-2#2"] == starts_m["1/0/-1#2"] == pytest.approx(60.0, abs=1.0)
    assert starts_m["1/0/1#1"] == pytest.approx(100.0)
    paints = {
        tuple(sorted(name for name, _ in bound.users)): bound.line.paint for bound in bounds if len(bound.users) == 2
    }
    assert paints["1/0/-1#1", "1/0/-2#1"] is Paint.BROKEN
    assert paints["1/0/-1#2", "1/0/-2#2"] is Paint.SOLID
    assert ("1/0/-1#1", "1/0/1#2") in paints, "oncoming lanes share the line between them"
    assert ("1/1/-2#1", "1/1/-3#1") in paints, "a lane that opens starts with no width"


@pytest.mark.parametrize(
    ("datum", "kind"),
    [
        (MapDatum(48.0, 9.0, 300.0), "LocalCartesian"),
        (MapDatum(35.9, 139.93, 0.0, utm_plane(139.93), 0.0, 0.0), "LocalCartesianUTM"),
        (MapDatum(48.0, 9.0, 0.0, heading_rad=0.3), "Local"),
    ],
)
def test_the_projector_is_the_one_that_gives_the_map_frame(datum: MapDatum, kind: str, tmp_path: Path) -> None:
    if datum.projection:
        east_m, north_m, _ = datum.map_from_geodetic(datum.latitude_deg, datum.longitude_deg, 0.0)
        datum = replace(datum, false_easting_m=east_m, false_northing_m=north_m)
    content = projector_info(datum)
    assert f"projector_type: {kind}\n".encode() in content
    (tmp_path / "map_projector_info.yaml").write_bytes(content)
    read = datum_of_file(tmp_path / NAME)
    if kind != "Local":
        assert read is not None
        position = datum.geodetic_from_map((800.0, -700.0, 5.0))
        assert read.map_from_geodetic(*position) == pytest.approx((800.0, -700.0, 5.0), abs=0.01)


def test_a_folder_with_the_projector_of_another_map_is_refused(crossing: RoadNetwork, tmp_path: Path) -> None:
    (tmp_path / "map_projector_info.yaml").write_text("projector_type: MGRS\nmgrs_grid: 54SUE\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"map_projector_info\.yaml: belongs to another map; choose a folder"):
        write_map(crossing, tmp_path / NAME)
    assert not (tmp_path / NAME).exists()


def routed(path: Path, origin: tuple[float, float, float]) -> tuple[Mapping[str, set[str]], Mapping[str, set[str]]]:
    """Lanelet → those that follow it, and those to which a car may change, as the Lanelet2 library sees it."""
    pytest.importorskip("lanelet2")
    from lanelet2 import io, projection, routing, traffic_rules

    found, errors = io.loadRobust(str(path), projection.LocalCartesianProjector(io.Origin(*origin)))
    assert not list(errors)
    rules = traffic_rules.create(traffic_rules.Locations.Germany, traffic_rules.Participants.Vehicle)
    graph = routing.RoutingGraph(found, rules)
    cars = [each for each in found.laneletLayer if rules.canPass(each)]
    after = {str(each.id): {str(other.id) for other in graph.following(each)} for each in cars}
    sides = {each.id: [graph.left(each), graph.right(each)] for each in cars}
    return after, {str(name): {str(other.id) for other in both if other} for name, both in sides.items()}


def test_the_lanelet2_library_routes_as_the_map_says(
    blocks: RoadNetwork, town: dict[str, Strip], written: Path
) -> None:
    origin = blocks.datum.latitude_deg, blocks.datum.longitude_deg, blocks.datum.altitude_m
    following, changes = routed(written, origin)
    numbers = {strip.id: name for name, strip in town.items()}
    assert following == {name: {numbers[each] for each in strip.following} for name, strip in town.items()}
    beside = {name: {strip.left, strip.right} for name, strip in town.items() if not strip.junction}
    lanes = {strip.id.split("#")[0]: strip for strip in town.values()}
    for name, others in beside.items():
        edge = town[name].road
        assert changes[name] == {
            numbers[lanes[each].id] for each in others if each in lanes and lanes[each].road == edge
        }
