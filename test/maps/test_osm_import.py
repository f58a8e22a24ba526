"""The OpenStreetMap importer, on a town with known coordinates (osm_sample.py), and on invalid files."""

from pathlib import Path
from xml.etree.ElementTree import parse

import numpy as np
import osmium
import pytest
import shapely
from osm_sample import DATUM, SAMPLE, Point, Writer, sample

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.network import Lane
from simbev_ros.maps.osm import import_osm
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.maps.osm.xml import read_xml
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> MapParts:
    return import_osm(SAMPLE, tmp_path_factory.mktemp("riverside"))


@pytest.fixture(scope="module")
def net(parts: MapParts) -> SumoNet:
    return read_sumo_net(parts.net)


def in_map(parts: MapParts, *points: Point) -> Float64Array:
    """(N, 2) positions of the sample's points in the map frame, via their longitude and latitude."""
    geodetic = [DATUM.geodetic_from_map(np.array([*point, 0.0])) for point in points]
    return np.array([parts.datum.map_from_geodetic(*point)[:2] for point in geodetic])


def lanes_at(parts: MapParts, net: SumoNet, point: Point, kind: LaneKind, within_m: float = 6.0) -> list[Lane]:
    point = shapely.Point(in_map(parts, point)[0])
    lanes = [lane for lane in net.lanes.values() if lane.kind is kind and not lane.junction]
    return [lane for lane in lanes if shapely.LineString(lane.centerline_m[:, :2]).distance(point) < within_m]


def test_the_sample_file_equals_the_output_of_its_script() -> None:
    assert SAMPLE.read_text(encoding="utf-8") == sample()


def test_the_same_file_gives_the_same_bytes_in_any_folder(tmp_path: Path) -> None:
    built = set()
    for number in range(3):
        work = tmp_path / ("x" * 7 * number) / "work"
        work.mkdir(parents=True)
        again = import_osm(SAMPLE, work)
        built.add((again.net.read_bytes(), again.opendrive.read_bytes()))
    assert len(built) == 1


def test_footprints_have_the_positions_of_their_coordinates(parts: MapParts) -> None:
    corners_m = in_map(parts, (-105, 46), (-50, 46), (-50, 88), (-105, 88), (-92, 57), (-64, 77))
    school = next(building for building in parts.features.buildings or () if building.outline.interiors)
    outline_m = np.concatenate([np.array(ring.coords) for ring in (school.outline.exterior, *school.outline.interiors)])
    nearest_m = np.linalg.norm(outline_m[None] - corners_m[:, None], axis=2).min(axis=1)
    assert nearest_m.max() < 0.01
    assert school.outline.area == pytest.approx(55 * 42 - 28 * 20, abs=0.5)
    assert (school.use, school.height_m) == ("public", 10.5)


def test_roads_have_the_positions_of_their_coordinates(parts: MapParts, net: SumoNet) -> None:
    field_road = shapely.LineString(in_map(parts, (18, -250), (140, -256)))
    lanes = lanes_at(parts, net, (60, -252.07), LaneKind.DRIVING)
    assert len(lanes) == 2
    for lane in lanes:
        near = [point for point in shapely.points(lane.centerline_m[:, :2]) if 0 < field_road.project(point) < 122]
        offsets_m = [point.distance(field_road) for point in near]
        assert len(near) > 0
        assert offsets_m == pytest.approx([lane.width_m / 2] * len(near), abs=0.02)


def test_the_datum_is_the_nets_own_projection(parts: MapParts) -> None:
    location = parse(parts.net).getroot().find("location")
    assert location is not None
    assert location.get("projParameter") == parts.datum.proj_string
    assert location.get("netOffset") == "0.0000,0.0000"


def test_a_bridge_over_the_motorway_is_high_enough_and_its_ramps_are_not_steep(parts: MapParts, net: SumoNet) -> None:
    crossing_m = in_map(parts, (0, 393), (0, 409))
    upper = lanes_at(parts, net, (0, 401), LaneKind.DRIVING, 4.0)
    assert len(upper) == 2
    for lane in upper:
        line_m = lane.centerline_m[np.argsort(lane.centerline_m[:, 1])]
        assert np.interp(crossing_m[:, 1], line_m[:, 1], line_m[:, 2]).min() > 6.0
    steps = [np.diff(lane.centerline_m, axis=0) for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING]
    lengths_m = [np.linalg.norm(step[:, :2], axis=1) for step in steps]
    grades = [abs(s[:, 2]) / length for s, length in zip(steps, lengths_m, strict=True)]
    assert max(g[length > 1.0].max(initial=0.0) for g, length in zip(grades, lengths_m, strict=True)) < 0.13
    assert abs(lanes_at(parts, net, (-100, 0), LaneKind.DRIVING)[0].centerline_m[:, 2]).max() < 0.01


def test_a_road_over_bridges_is_one_road(parts: MapParts, net: SumoNet) -> None:
    for point, street in (((0.0, 401.0), (155.0, 355.0)), ((0.0, -120.0), (-220.0, -75.0))):
        _, start_m, end_m = in_map(parts, point, (0, street[0]), (0, street[1]))
        for lane in lanes_at(parts, net, point, LaneKind.DRIVING, 4.0):
            assert lane.length_m > 0.8 * abs(end_m[1] - start_m[1])


def test_sidewalks_are_on_the_tagged_sides(parts: MapParts, net: SumoNet) -> None:
    assert len(lanes_at(parts, net, (-75, 0), LaneKind.SIDEWALK, 12.0)) == 2
    assert len(lanes_at(parts, net, (230, -56), LaneKind.SIDEWALK, 12.0)) == 1
    assert lanes_at(parts, net, (140, -256), LaneKind.SIDEWALK, 12.0) == []
    assert lanes_at(parts, net, (200, 409), LaneKind.SIDEWALK, 12.0) == []


def test_one_way_streets_run_one_way(parts: MapParts, net: SumoNet) -> None:
    for point, east in (((-220.0, 120.0), 1.0), ((-220.0, 220.0), -1.0), ((-100.0, 409.2), -1.0)):
        lanes = lanes_at(parts, net, point, LaneKind.DRIVING)
        assert {np.sign(lane.centerline_m[-1, 0] - lane.centerline_m[0, 0]) for lane in lanes} == {east}


def test_lanes_signals_and_bicycle_lanes_match_the_tags(parts: MapParts, net: SumoNet) -> None:
    assert len(lanes_at(parts, net, (-75, 0), LaneKind.DRIVING, 8.0)) == 4
    assert len({link.programme for link in net.links}) == 3
    assert len(lanes_at(parts, net, (0, -40), LaneKind.BICYCLE)) == 2
    limits = {round(lane.speed_mps * 3.6) for lane in lanes_at(parts, net, (300, 60), LaneKind.DRIVING)}
    assert limits == {30}


def test_rails_are_left_out_and_paths_are_for_pedestrians(parts: MapParts, net: SumoNet) -> None:
    assert [lane for lane in net.lanes.values() if lane.centerline_m[:, 1].max() < in_map(parts, (0, -335))[0, 1]] == []
    (path,) = lanes_at(parts, net, (250, 90), LaneKind.SIDEWALK)
    assert path.width_m == 2.0


def test_land_water_and_buildings_are_read(parts: MapParts) -> None:
    features = parts.features
    island, pond = (shapely.Point(point) for point in in_map(parts, (212, 44), (190, 45)))
    wet = shapely.union_all([water.area for water in features.water])
    assert wet.contains(pond) and not wet.contains(island)
    assert wet.contains(shapely.Point(in_map(parts, (300, -215))[0])), "the canal, which is a line with a width"
    uses = [
        zone.surroundings.use
        for zone in features.zones
        if zone.area.contains(shapely.Point(in_map(parts, (170, 100))[0]))
    ]
    assert uses[-1] == "park", "the smallest zone takes precedence"
    assert {building.use for building in features.buildings or ()} >= {
        "house",
        "retail",
        "industrial",
        "church",
        "barn",
    }
    outlines = [building.outline for building in features.buildings or ()]
    assert shapely.union_all(outlines).area == pytest.approx(sum(outline.area for outline in outlines), rel=1e-4)


def town(*streets: list[Point], tags: dict[str, str] | None = None) -> Writer:
    writer = Writer()
    for street in streets:
        writer.way(street, {"highway": "residential"} if tags is None else tags)
    return writer


def import_text(tmp_path: Path, text: str) -> MapParts:
    path, work = tmp_path / "town.osm", tmp_path / "work"
    path.write_text(text)
    work.mkdir()
    return import_osm(path, work)


GOOD = town([(0, 0), (100, 0)], [(100, 0), (100, 80), (0, 80), (0, 0)]).text()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<osm></osm>", "has no roads"),
        (town([(0, 0), (100, 0)], tags={"highway": "footway"}).text(), "has no roads that cars may drive on"),
        (town([(0, 0), (100, 0)], tags={"building": "yes"}).text(), "has no roads"),
        (GOOD.replace('lat="52', 'lat="152', 1), "osm:3: node 1: lat: must be degrees between -90 and 90, not '152"),
        (GOOD.replace('lon="7', 'lon="nan', 1), "town.osm:3: node 1: lon: must be degrees"),
        (GOOD.replace('<node id="2"', '<node id="1"'), "osm:4: node 1: appears twice; the other is .*osm:3"),
        (GOOD.replace('<way id="5000"', '<way id="x"'), "way: id: must be a whole number of at most 64 bits, not 'x'"),
        (GOOD.replace('<way id="5000"', f'<way id="{2**63}"'), f"way: id: .* of at most 64 bits, not '{2**63}'"),
        (GOOD[:400], "not valid XML"),
    ],
)  # fmt: skip
def test_unusable_files_are_refused_with_their_location(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        import_text(tmp_path, text)


@pytest.mark.parametrize(("first", "last"), [(1090413704220797690, 2**63 - 2), (1 - 2**63, -1)])
def test_ids_have_64_bits(tmp_path: Path, first: int, last: int) -> None:
    text = GOOD.replace('id="1"', f'id="{first}"').replace('ref="1"', f'ref="{first}"')
    text = text.replace('<way id="5000"', f'<way id="{last}"')
    path = tmp_path / "ids.osm"
    path.write_text(text)
    whole = read_xml(path).resolve()
    assert (len(whole.ways), whole.findings, str(last) in {way.id for way in whole.ways}) == (2, (), True)
    with osmium.SimpleWriter(str(tmp_path / "ids.osm.pbf")) as writer:
        for element in osmium.FileProcessor(str(path)):
            writer.add(element)
    assert read_osm(tmp_path / "ids.osm.pbf").ways == whole.ways


@pytest.mark.parametrize(
    ("stated", "kmh", "noted"),
    [
        ("3", 3, 0),
        ("5.5 mph", 9, 0),
        ("0.4", 1, 0),
        ("walk", 6, 0),
        ("DE:rural", 50, 0),
        ("fast", 50, 1),
        ("-5", 50, 1),
    ],
)
def test_a_speed_limit_is_used_or_said_to_be_ignored(tmp_path: Path, stated: str, kmh: int, noted: int) -> None:
    parts = import_text(tmp_path, town([(0, 0), (300, 0)], tags={"highway": "primary", "maxspeed": stated}).text())
    lanes = [lane for lane in read_sumo_net(parts.net).lanes.values() if lane.kind is LaneKind.DRIVING]
    assert {round(lane.speed_mps * 3.6) for lane in lanes if not lane.junction} == {kmh}
    assert sum("maxspeed that is not a number" in finding.rule for finding in parts.findings) == noted


def test_cut_off_roads_are_shortened_and_disconnected_ones_keep_their_place_with_a_note(tmp_path: Path) -> None:
    writer = town([(0, 0), (200, 0), (200, 80)], [(0, 0), (0, 90)], [(500, 500), (560, 500)])
    writer.way([(0, 200), (300, 200)], {"highway": "footway"})
    parts = import_text(tmp_path, writer.text().replace('<nd ref="1"/>', '<nd ref="1"/><nd ref="77"/>', 1))
    assert set(sentences_of("sample.xodr", parts.findings)) >= {
        "a node of a way is missing: the way is shortened",
        "roads are in 2 parts that are not connected, each with traffic of its own (0.06 of 0.43 km are outside the "
        "largest)",
        "a footpath that no road reaches is left out",
    }
    net = read_sumo_net(parts.net)
    assert len(lanes_at(parts, net, (530, 500), LaneKind.DRIVING)) == 2
    assert [lane for lane in net.lanes.values() if lane.kind is LaneKind.SIDEWALK and lane.width_m == 2.0] == []


@pytest.mark.parametrize(
    ("tags", "width_m", "lanes"),
    [({"lanes": "1"}, 2.5, 2), ({"lanes": "1", "oneway": "yes"}, 3.2, 1), ({"lanes": "2"}, 3.2, 2)],
)
def test_both_directions_of_a_road_with_one_lane_have_room_for_cars(
    tmp_path: Path, tags: dict[str, str], width_m: float, lanes: int
) -> None:
    street = {"highway": "residential", **tags}
    writer = town([(0, 0), (100, 0), (100, 80)], [(100, 80), (0, 80), (0, 0)], tags=street)
    net = read_sumo_net(import_text(tmp_path, writer.text()).net)
    driving = [lane for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING and not lane.junction]
    assert {lane.width_m for lane in driving} == {width_m}
    walks = [lane for lane in net.lanes.values() if lane.kind is LaneKind.SIDEWALK]
    assert {lane.width_m for lane in walks} == ({2.2} if lanes == 2 else {2.2, 3.2}), "beside no lane they are wider"
    assert len({lane.edge for lane in driving}) == len({lane.edge.lstrip("-") for lane in driving}) * lanes


def test_a_road_beside_a_longer_footpath_is_the_map(tmp_path: Path) -> None:
    writer = town([(0, 0), (650, 0)], tags={"highway": "primary", "oneway": "yes", "lanes": "3"})
    writer.way([(0, 60), (450, 70), (900, 60)], {"highway": "footway"})
    parts = import_text(tmp_path, writer.text())
    assert len(lanes_at(parts, read_sumo_net(parts.net), (300, 0), LaneKind.DRIVING, 8.0)) == 3
    assert "a footpath that no road reaches is left out" in sentences_of("sample.xodr", parts.findings)


def test_a_way_without_length_is_not_a_road(tmp_path: Path) -> None:
    text = GOOD.replace("</osm>", ' <way id="7"><nd ref="1"/><nd ref="1"/><tag k="highway" v="primary"/></way></osm>')
    assert len(read_sumo_net(import_text(tmp_path, text).net).junctions) >= 2


def heights_at(parts: MapParts, *points: Point) -> list[list[float]]:
    """Heights, in ascending order, of the driving lanes that pass each point."""
    lanes = [lane for lane in read_sumo_net(parts.net).lanes.values() if lane.kind is LaneKind.DRIVING]
    positions = [shapely.Point(position) for position in in_map(parts, *points)]
    lines = [shapely.LineString(lane.centerline_m) for lane in lanes]
    return [
        sorted({round(line.interpolate(line.project(point)).z, 1) for line in lines if line.distance(point) < 3.0})
        for point in positions
    ]


def test_roads_on_three_layers_pass_above_each_other(tmp_path: Path) -> None:
    writer, road = Writer(), {"highway": "primary"}
    writer.way([(-300, 0), (300, 0)], road)
    writer.way([(0, -300), (0, 300)], {**road, "bridge": "yes", "layer": "1"})
    writer.way([(-300, -300), (300, 300)], {**road, "bridge": "viaduct", "layer": "2"})
    writer.way([(-300, 0), (-300, -300), (0, -300)], road)
    parts = import_text(tmp_path, writer.text())
    ((low, middle, high),) = heights_at(parts, (0, 0))
    assert low == 0.0 and middle >= 5.9 and high - middle >= 5.9


def test_underpasses_and_long_tunnels_dip_below_the_roads_that_they_cross(tmp_path: Path) -> None:
    writer, road = Writer(), {"highway": "primary"}
    writer.way([(-300, 0), (300, 0)], road)
    writer.way([(0, -300), (0, -30)], road)
    writer.way([(0, -30), (0, 30)], {**road, "tunnel": "yes"})
    writer.way([(0, 30), (0, 300), (300, 0)], road)
    writer.way([(0, -300), (-200, -250)], road)
    writer.way([(-200, -250), (-200, 250)], {**road, "tunnel": "yes", "layer": "-2"})
    writer.way([(-200, 250), (0, 300)], road)
    parts = import_text(tmp_path, writer.text())
    for place, depth_m in (((0, 0), 6.2), ((-200, 0), 9.0)):
        low, high = heights_at(parts, place)[0]
        assert (low, high) == (pytest.approx(-depth_m, abs=0.2), 0.0)
    assert heights_at(parts, (-200, -160), (0, -250)) == [[pytest.approx(-4.5, abs=0.2)], [0.0]], "half way down"
    layout = assign_levels(layout_of(read_sumo_net(parts.net)))
    inside = shapely.union_all([shapely.LineString(strip.center_m) for strip in layout.strips if strip.tunnel])
    places = in_map(parts, (0, 0), (0, 100), (-200, -200), (-200, 0), (-200, 200))
    assert [inside.distance(shapely.Point(place)) < 8.0 for place in places] == [True, False, True, True, True]
    assert {strip.level for strip in layout.strips if not strip.tunnel} == {0}, "no bridges above tunnels"


def test_streams_pass_below_roads_without_bridges_and_steps_are_left_out(tmp_path: Path) -> None:
    writer = town([(0, 0), (300, 0)], [(300, 0), (300, 200)])
    writer.way([(100, -80), (100, 80)], {"waterway": "stream"})
    writer.way([(0, 0), (0, 60), (300, 60)], {"highway": "steps"})
    parts = import_text(tmp_path, writer.text())
    wet = shapely.union_all([water.area for water in parts.features.water])
    bank, road = (shapely.Point(point) for point in in_map(parts, (100, 40), (100, 0)))
    assert wet.contains(bank) and wet.distance(road) > 5.0
    assert heights_at(parts, (150, 60)) == [[]]


def test_a_river_flows_above_a_tunnel(tmp_path: Path) -> None:
    writer, road = Writer(), {"highway": "primary"}
    writer.way([(0, -400), (0, -250)], road)
    writer.way([(0, -250), (0, 250)], {**road, "tunnel": "yes"})
    writer.way([(0, 250), (0, 400), (300, 400), (300, -400), (0, -400)], {**road, "bridge": "yes", "layer": "1"})
    writer.way([(-80, -30), (80, -30), (80, 30), (-80, 30), (-80, -30)], {"natural": "water"})
    parts = import_text(tmp_path, writer.text())
    ((depth_m,),) = heights_at(parts, (0, 0))
    (water,) = parts.features.water
    assert water.area.area == pytest.approx(160.0 * 60.0, rel=0.02), "without a causeway"
    assert depth_m + 5.6 < water.surface_m, "the roof is below the surface"
