"""Buildings of OpenStreetMap files as tagged: lengths with units, heights, roofs, colors, and buildings in parts."""

import numpy as np
import pytest
import shapely

from simbev_ros.maps.land_features import Footprint
from simbev_ros.maps.osm.areas import Area
from simbev_ros.maps.osm.building_tags import footprint_of
from simbev_ros.maps.osm.buildings import buildings_of
from simbev_ros.maps.osm.lengths import parse_direction_rad, parse_length_m

BOX = shapely.box(0, 0, 20, 10)


@pytest.mark.parametrize(
    ("text", "length_m"),
    [
        ("12", 12.0), ("12.5 m", 12.5), ("12,5", 12.5), ("12m", 12.0), ("12 meters", 12.0), ("1200 cm", 12.0),
        ("40'", 12.192), ("40 ft", 12.192), ("40 feet", 12.192), ("6'3\"", 1.905), ("6ft3in", 1.905), ("6′ 3″", 1.905),
        ("0.5 km", 500.0), ("~12", 12.0),
        ("", 0.0), ("high", 0.0), ("-3", 0.0), ("12;14", 0.0), ("nan", 0.0), ("1e5", 0.0), ("9" * 300, 0.0),
    ],
)  # fmt: skip
def test_lengths_have_all_usual_units(text: str, length_m: float) -> None:
    assert parse_length_m(text) == pytest.approx(length_m)


@pytest.mark.parametrize(("text", "heading_deg"), [("0", 90), ("90", 0), ("NE", 45), ("w", -180), ("292.5", -202.5)])
def test_directions_are_compass_bearings(text: str, heading_deg: float) -> None:
    assert np.degrees(parse_direction_rad(text)) == pytest.approx(heading_deg)
    assert np.isnan(parse_direction_rad("up"))


@pytest.mark.parametrize(
    ("tags", "height_m", "bottom_m", "roof_height_m"),
    [
        ({"height": "20", "roof:height": "4"}, 20.0, 0.0, 4.0),
        ({"building:levels": "4"}, 13.5, 0.0, 0.0),  # 4 storeys of 3 m, and half a storey of unknown roof
        ({"building:levels": "4", "roof:levels": "1"}, 15.0, 0.0, 3.0),
        ({"height": "30", "min_height": "12"}, 30.0, 12.0, 0.0),
        ({"building:levels": "9", "building:min_level": "2"}, 28.5, 6.0, 0.0),
        ({"height": "10", "min_height": "40"}, 10.0, 9.5, 0.0),  # contradictory: a thin slab
        ({"height": "3", "roof:height": "9"}, 3.0, 0.0, 3.0),
        ({"height": "99999"}, 500.0, 0.0, 0.0),
    ],
)
def test_heights_follow_the_tags(tags: dict[str, str], height_m: float, bottom_m: float, roof_height_m: float) -> None:
    found = footprint_of(BOX, {"building": "yes", **tags})
    assert (found.height_m, found.bottom_m, found.roof_height_m) == pytest.approx((height_m, bottom_m, roof_height_m))


def test_colors_and_materials_follow_the_tags() -> None:
    tags = {"building:colour": "rgb(999,0,0)", "roof:colour": "dark_green", "building:material": "brick"}
    found = footprint_of(BOX, tags)
    assert (found.color, found.roof_color, found.wall) == (0xFF0000, 0x006400, "brick")
    found = footprint_of(BOX, {"building:colour": "no color", "roof:material": "slate", "building:material": "jelly"})
    assert (found.color, found.roof_color, found.wall) == (-1, 0x4E4A48, "")


def test_a_roof_falls_in_its_direction_or_along_the_building() -> None:
    assert footprint_of(BOX, {"roof:direction": "S"}).slope_rad == pytest.approx(np.radians(-90.0))
    assert abs(np.cos(footprint_of(BOX, {"roof:orientation": "across"}).slope_rad)) == pytest.approx(1.0)
    assert np.isnan(footprint_of(BOX, {"roof:orientation": "along"}).slope_rad)


def built(*areas: tuple[shapely.Polygon, dict[str, str]], road: shapely.Polygon | None = None) -> list[Footprint]:
    bands = np.array([] if road is None else [road], object)
    return list(buildings_of([Area(polygon, tags) for polygon, tags in areas], bands)[0])


def test_a_building_consists_of_its_parts_and_the_rest_of_its_outline() -> None:
    parts = built(
        (BOX, {"building": "office", "height": "10", "building:colour": "white"}),
        (shapely.box(0, 0, 8, 10), {"building:part": "yes", "height": "30", "roof:shape": "dome"}),
        (shapely.box(8, 0, 12, 10), {"building:part": "yes", "height": "20", "min_height": "5"}),
        (shapely.box(100, 0, 110, 10), {"building:part": "yes", "height": "30"}),
    )
    found = sorted(parts, key=lambda part: part.outline.bounds)
    assert [part.outline.bounds for part in found] == [(0, 0, 8, 10), (8, 0, 12, 10), (12, 0, 20, 10)]
    assert [(part.height_m, part.bottom_m, part.roof) for part in found] == [
        (30.0, 0.0, "dome"), (20.0, 5.0, ""), (10.0, 0.0, "")
    ]  # fmt: skip
    assert {(part.use, part.color) for part in found} == {("office", 0xFFFFFF)}


def test_parts_that_fill_their_building_leave_no_slivers() -> None:
    halves = [(shapely.box(x, 0.2, x + 10, 9.8), {"building:part": "yes"}) for x in (0, 10)]
    assert len(built((BOX, {"building": "yes"}), *halves)) == 2


def test_a_part_stands_above_a_road_only_if_it_is_high_enough() -> None:
    outline, road = shapely.box(0, 0, 40, 10), shapely.box(38, -20, 60, 20)
    for bottom, expected in (("3", 1), ("5", 2)):
        part = (shapely.box(30, 0, 44, 10), {"building:part": "yes", "height": "12", "min_height": bottom})
        assert len(built((outline, {"building": "yes"}), part, road=road)) == expected
