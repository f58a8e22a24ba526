"""The land of OpenStreetMap files: the sea beside a coastline, and built-up land outside of mapped zones."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from osm_sample import DATUM, Point, Writer

from simbev_ros.maps.land_features import Footprint, MapFeatures
from simbev_ros.maps.osm.built_up import built_up_zones
from simbev_ros.maps.osm.coast import sea_of
from simbev_ros.maps.osm.data import OsmData, Way
from simbev_ros.maps.osm.land import features_of
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.maps.osm.roads import roads_of

EXTENT = shapely.box(-1000, -1000, 1000, 1000)
STREETS = np.array([shapely.LineString([(-500, 100), (500, 100)])], object)


def sea(*coast: Sequence[Point], tags: dict[str, str] | None = None) -> tuple[shapely.Geometry, tuple[str, ...]]:
    """The sea of a file with these ways of coastline; equal points are one node."""
    points = sorted({point for line in coast for point in line})
    tags = {"natural": "coastline"} if tags is None else tags
    ways = [Way(str(k), tuple(map(points.index, line)), tags) for k, line in enumerate(coast)]
    xy_m = np.array(points, float).reshape(-1, 2)
    return sea_of(OsmData(xy_m, {}, tuple(ways), (), ()), xy_m, EXTENT, STREETS)


def test_water_is_on_the_right_of_a_coastline_across_the_extent() -> None:
    area, notes = sea([(-2000, 0), (2000, 0)])
    assert area.equals(shapely.box(-1000, -1000, 1000, 0)) and notes == ()


def test_a_coastline_of_several_ways_that_ends_inside_goes_on_to_the_nearest_side() -> None:
    area, _ = sea([(0, -300), (700, -300)], [(-900, -500), (0, -300)])
    corners = [(-1000, -1000), (1000, -1000), (1000, -300), (0, -300), (-900, -500), (-1000, -500)]
    assert area.equals(shapely.Polygon(corners))


def test_islands_are_land_and_the_inside_of_a_reversed_ring_is_water() -> None:
    island = [(0, -600), (100, -600), (100, -500), (0, -500), (0, -600)]
    area, _ = sea([(-2000, 0), (2000, 0)], island)
    assert area.area == pytest.approx(2000 * 1000 - 100 * 100)
    bay, _ = sea(island[::-1])
    assert bay.equals(shapely.box(0, -600, 100, -500))


def test_a_sea_that_floods_the_roads_is_left_out_with_a_note() -> None:
    area, notes = sea([(2000, 0), (-2000, 0)])
    assert area.is_empty
    assert [each.rule for each in notes] == ["the sea is left out: its coastline would flood roads: reversed, or a gap"]


def test_a_file_without_coastline_has_no_sea() -> None:
    area, notes = sea([(-2000, 0), (2000, 0)], tags={"natural": "cliff"})
    assert area.is_empty and notes == ()


def use_at(features: MapFeatures, point: Point) -> str:
    at = shapely.Point(point)
    inside = [zone.surroundings.use for zone in features.zones if zone.area.contains(at)]
    return inside[-1] if inside else features.surroundings.use


def grid(writer: Writer, spacing: int, count: int) -> None:
    for k in range(count):
        for line in (
            [(k * spacing, i * spacing) for i in range(count)],
            [(i * spacing, k * spacing) for i in range(count)],
        ):
            writer.way(line, {"highway": "residential"})


def features(tmp_path: Path, writer: Writer, *points: Point) -> list[str]:
    """Land uses that a file of the writer has at points."""
    path = tmp_path / "town.osm"
    path.write_text(writer.text())
    data = read_osm(path)
    around = np.array([DATUM.map_from_geodetic(lat, lon, 0.0)[:2] for lon, lat in data.longitude_latitude_deg])
    found, _ = features_of(data, around, roads_of(data, around)[0])
    return [use_at(found, point) for point in points]


def test_land_between_the_streets_of_a_town_is_residential_and_along_a_country_road_farmland(tmp_path: Path) -> None:
    writer = Writer()
    grid(writer, 100, 6)
    writer.way([(500, 200), (1500, 260)], {"highway": "tertiary"})
    writer.ring([(110, 110), (190, 110), (190, 190), (110, 190)], {"leisure": "park"})
    writer.ring([(210, 110), (230, 110), (230, 130), (210, 130)], {"landuse": "grass"})
    at = [(250.0, 250.0), (10.0, 10.0), (1200.0, 300.0), (150.0, 150.0), (220.0, 120.0)]
    assert features(tmp_path, writer, *at) == ["residential", "residential", "farmland", "park", "park"]


def test_a_file_without_zones_is_residential_everywhere(tmp_path: Path) -> None:
    writer = Writer()
    writer.way([(0, 0), (1500, 0)], {"highway": "tertiary"})
    assert features(tmp_path, writer, (750.0, 200.0)) == ["residential"]


@pytest.mark.parametrize(
    ("height_m", "spacing_m", "use"),
    [(7.0, 50.0, "residential"), (30.0, 30.0, "downtown"), (7.0, 150.0, None)],
)
def test_dense_buildings_make_homes_and_tall_ones_a_center(height_m: float, spacing_m: float, use: str | None) -> None:
    # Houses of 12 m x 12 m: they cover 6 %, 16 % and 0.6 % of the land; floors cover 13 %, 160 % and 1.5 % of it.
    at = np.arange(-300.0, 300.1, spacing_m)
    houses = [Footprint(shapely.box(x - 6, y - 6, x + 6, y + 6), height_m) for x in at for y in at]
    zones = built_up_zones(houses, np.array([], object), EXTENT)
    uses = [zone.surroundings.use for zone in zones if zone.area.contains(shapely.Point(20, 20))]
    assert (uses[-1] if uses else None) == use
    assert not any(zone.area.contains(shapely.Point(800, 800)) for zone in zones)


def test_a_single_straight_road_has_land_on_both_sides(tmp_path: Path) -> None:
    writer = Writer()
    writer.way([(-100, 0), (100, 0)], {"highway": "residential"})
    for y in (-60, 60):
        writer.ring([(50, y - 20), (90, y - 20), (90, y + 20), (50, y + 20)], {"leisure": "park"})
    assert features(tmp_path, writer, (70.0, -60.0), (70.0, 60.0)) == ["park", "park"]
