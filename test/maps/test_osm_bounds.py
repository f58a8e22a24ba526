"""Parts of OpenStreetMap files: chosen by bounds, or chosen where a file is too large; and what bags keep of them."""

from pathlib import Path

import numpy as np
import osmium
import pytest
import shapely
from osm_sample import DATUM, SAMPLE, Writer
from pydantic import ValidationError

from simbev_ros.config.map_files import parse_bounds
from simbev_ros.config.scenario import MapScenes
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.unpacking import bunzip2
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network, load_source
from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.osm import import_osm
from simbev_ros.maps.osm.box import Box, densest_box
from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.extract import write_osm
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.maps.osm.road_rules import road_tags
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.map_spec import MapSpec

CENTER = (7.4960, 52.2480, 7.5035, 52.2530)
"""Crosses main streets, the river, the pond's neighborhood and areas of the sample."""


def roads(data: OsmData) -> list[shapely.LineString]:
    degrees = data.longitude_latitude_deg
    return [shapely.LineString(degrees[list(way.nodes)]) for way in data.ways if road_tags(way.tags)]


def test_roads_end_exactly_at_the_bounds() -> None:
    whole, part = roads(read_osm(SAMPLE)), roads(read_osm(SAMPLE, Box.of_bounds(CENTER)))
    expected = shapely.union_all(shapely.intersection(whole, shapely.box(*CENTER)))
    assert shapely.union_all(part).length == pytest.approx(expected.length, rel=1e-6)
    assert shapely.hausdorff_distance(shapely.union_all(part), expected) < 1e-8
    assert expected.length < 0.5 * shapely.union_all(whole).length


def test_buildings_and_areas_near_the_bounds_stay_whole() -> None:
    bounds = (7.5025, 52.2515, 7.5040, 52.2525)
    whole, part = read_osm(SAMPLE), read_osm(SAMPLE, Box.of_bounds(bounds))

    def outlines(data: OsmData) -> list[shapely.Polygon]:
        degrees = data.longitude_latitude_deg
        return [shapely.Polygon(degrees[list(way.nodes)]) for way in data.ways if "building" in way.tags]

    inside = [outline for outline in outlines(whole) if outline.intersects(shapely.box(*bounds))]
    kept = {outline.wkb for outline in outlines(part)}
    assert len(inside) > 3
    assert {outline.wkb for outline in inside} <= kept
    far = [outline for outline in outlines(whole) if outline.distance(shapely.box(*bounds)) > 0.0045]
    assert far and not kept & {outline.wkb for outline in far}
    assert [area.tags["natural"] for area in part.multipolygons if "natural" in area.tags] == ["water"], (
        "not the school"
    )


def test_a_street_that_leaves_and_returns_becomes_two_streets(tmp_path: Path) -> None:
    writer = Writer()
    writer.way([(0, 0), (100, 0), (100, 500), (200, 500), (200, 0), (300, 0)], {"highway": "residential"})
    path = tmp_path / "town.osm"
    path.write_text(writer.text())
    corners = [DATUM.geodetic_from_map(np.array([*point, 0.0])) for point in ((-50, -50), (250, 200))]
    box = Box(corners[0][1], corners[0][0], corners[1][1], corners[1][0])
    lengths_m = [shapely.length(line) * 111_300 for line in roads(read_osm(path, box))]
    assert len(lengths_m) == 2
    first, second = roads(read_osm(path, box))
    assert first.coords[-1][1] == second.coords[0][1] == pytest.approx(box.north, abs=1e-9)
    assert second.coords[-1][0] == pytest.approx(box.east, abs=1e-9)


def pbf_of(path: Path, source: Path) -> Path:
    with osmium.SimpleWriter(path) as writer:
        for element in osmium.FileProcessor(source):
            writer.add(element)
    return path


def test_pbf_with_bounds_reads_like_xml_with_bounds(tmp_path: Path) -> None:
    box = Box.of_bounds(CENTER)
    data, other = read_osm(pbf_of(tmp_path / "town.osm.pbf", SAMPLE), box), read_osm(SAMPLE, box)
    of = {way.id: way for way in other.ways if not road_tags(way.tags)}
    ways = [way for way in data.ways if not road_tags(way.tags)]
    # Areas around the part of which no corner is near are not found in a PBF.
    assert {way.id for way in ways} == {way.id for way in of.values() if way.id in {way.id for way in ways}}
    assert all(way.tags == of[way.id].tags for way in ways) and len(ways) >= len(of) - 3
    assert shapely.hausdorff_distance(shapely.union_all(roads(data)), shapely.union_all(roads(other))) < 2e-7
    assert [area.tags for area in data.multipolygons] == [area.tags for area in other.multipolygons]


def test_an_extract_reads_as_it_was_written(tmp_path: Path) -> None:
    part = read_osm(SAMPLE, Box.of_bounds(CENTER))
    write_osm(tmp_path / "extract.osm", part)
    again = read_osm(tmp_path / "extract.osm")
    assert np.array_equal(again.longitude_latitude_deg, part.longitude_latitude_deg)
    assert (again.ways, again.node_tags) == (part.ways, part.node_tags)
    assert again.multipolygons == part.multipolygons
    assert again.left_hand == part.left_hand


def test_the_stored_extract_builds_the_same_roads_without_the_file(tmp_path: Path) -> None:
    path = pbf_of(tmp_path / "town.osm.pbf", SAMPLE)
    spec = map_spec(str(path), bounds=CENTER)
    network = load_network(spec)
    extract = tmp_path / "extract.osm"
    extract.write_bytes(bunzip2(load_source(spec), 1 << 20))
    path.unlink()
    again = load_network(map_spec(str(extract)), tmp_path)
    assert again.opendrive == network.opendrive
    assert again.datum == network.datum
    assert again.features.zones == network.features.zones and again.features.zones
    assert [each.outline.wkb for each in again.features.buildings or ()] == [
        each.outline.wkb for each in network.features.buildings or ()
    ]


def test_maps_of_different_parts_have_different_names_and_whole_maps_keep_theirs() -> None:
    whole = map_spec(str(SAMPLE))
    part, other = map_spec(str(SAMPLE), bounds=CENTER), map_spec(str(SAMPLE), bounds=(7.49, 52.24, 7.5, 52.25))
    assert len({whole.name, part.name, other.name}) == 3
    assert part.name.startswith("riverside-")
    assert MapSpec.model_validate_json(part.model_dump_json()) == part


def test_bounds_across_the_antimeridian(tmp_path: Path) -> None:
    degrees = [(179.998, -16.8), (-179.998, -16.8), (-179.99, -16.8)]
    nodes = "".join(f'<node id="{k + 1}" lon="{x}" lat="{y}"/>' for k, (x, y) in enumerate(degrees))
    way = '<way id="1"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="highway" v="primary"/></way>'
    path = tmp_path / "taveuni.osm"
    path.write_text(f"<osm>{nodes}{way}</osm>")
    data = read_osm(path, Box.of_bounds((179.999, -16.9, -179.995, -16.7)))
    assert data.longitude_latitude_deg[list(data.ways[0].nodes), 0].tolist() == [179.999, -179.998, -179.995]
    assert data.left_hand


@pytest.mark.parametrize(
    ("bounds", "problem"),
    [
        ((7.0, 52.0, 7.5, 52.3), r"bounds: span 34 x 33 km; at most 30 km are read"),
        ((8.0, 52.0, 8.1, 52.1), "has no roads within the bounds"),
    ],
)
def test_unusable_bounds_are_refused(tmp_path: Path, bounds: tuple[float, float, float, float], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        import_osm(SAMPLE, tmp_path, bounds)


def test_only_openstreetmap_files_have_bounds() -> None:
    with pytest.raises(InputError, match=r"bounds: only OpenStreetMap files .* not Town01"):
        map_spec("Town01", bounds=CENTER)


@pytest.mark.parametrize("text", ["1,2,3", "1,5,2,4", "a,b,c,d", "0,0,0,1", "200,1,201,2", "nan,1,2,3"])
def test_impossible_bounds_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"must be west,south,east,north in degrees, with south below north"):
        parse_bounds(text)
    with pytest.raises(ValidationError, match="bounds"):
        MapScenes.model_validate({"map": "a.osm", "train": 1, "bounds": text.split(",")})


def grid_town(writer: Writer, origin: tuple[float, float], size: int) -> None:
    x, y = origin
    for k in range(size):
        writer.way([(x + 80 * j, y + 80 * k) for j in range(size)], {"highway": "residential"})
        writer.way([(x + 80 * k, y + 80 * j) for j in range(size)], {"highway": "residential"})


def test_of_a_file_that_is_too_large_the_densest_part_is_read(tmp_path: Path) -> None:
    writer = Writer()
    grid_town(writer, (0, 0), 3)
    grid_town(writer, (60_000, 0), 5)
    writer.way([(160, 0), (60_000, 0)], {"highway": "primary"})
    path = tmp_path / "two_towns.osm"
    path.write_text(writer.text())
    (tmp_path / "work").mkdir()
    parts = import_osm(path, tmp_path / "work")
    (note,) = (note for note in sentences_of("sample.xodr", parts.findings) if "densest" in note)
    assert note.startswith("its roads span 60 km and are 64 km long; at most 30 km and 4000 km are read")
    bounds = parse_bounds(note.split("bounds ")[1].split(";")[0])
    latitude, longitude, _ = DATUM.geodetic_from_map(np.array([60_160.0, 160.0, 0.0]))
    assert shapely.box(*bounds).contains(shapely.Point(longitude, latitude)), "the larger town"
    assert parts.extract is not None
    data = read_osm(parts.extract)
    extent_m = np.ptp(data.longitude_latitude_deg, axis=0) * 111_320 * [np.cos(np.radians(latitude)), 1.0]
    assert 20_000 < extent_m[0] < 30_100


def brute_force_weight(degrees: Float64Array, weight: Float64Array, side_m: float) -> float:
    """The greatest weight in a square with a corner at any two positions, near the equator."""
    low = [(x, y) for x in degrees[:, 0] for y in degrees[:, 1]]
    side_deg = side_m / 111_320.0
    boxes = [((degrees >= corner) & (degrees <= np.add(corner, side_deg))).all(axis=1) for corner in low]
    return float(max(weight[inside].sum() for inside in boxes))


@pytest.mark.parametrize("seed", range(5))
def test_the_densest_box_is_nearly_the_best_that_brute_force_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    degrees = np.concatenate([rng.uniform(-0.4, 0.4, (40, 2)), rng.normal((0.2, -0.1), 0.05, (30, 2))])
    weight = rng.uniform(0.5, 1.5, len(degrees))
    box = densest_box(degrees, weight, 1e9)
    assert max(box.size_m) <= 30_001.0
    assert weight[box.contains(degrees)].sum() >= 0.85 * brute_force_weight(degrees, weight, 30_000.0)


def test_the_densest_box_keeps_within_its_weight_and_is_not_misled_by_far_positions() -> None:
    rng = np.random.default_rng(1)
    degrees = np.concatenate([rng.uniform(50.0, 50.1, (4000, 2)), [[-80.0, -80.0]]])
    box = densest_box(degrees, np.ones(4001), 1000.0)
    assert 500 < np.count_nonzero(box.contains(degrees)) <= 1100
