"""Arrows and words on lanes lie within their lane, point where it leads, and can be read by its drivers."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.roads.curb_paint import curb_paint
from simbev_ros.assets.roads.symbols import arrow, country_words, in_map, lane_symbols, words
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import Region
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.schema.scene.map_spec import MapSpec


@pytest.mark.parametrize(("direction", "side"), [(1, 1.0), (0, 0.0), (-1, -1.0)])
def test_an_arrow_bends_to_the_side_that_it_points_to(direction: int, side: float) -> None:
    area = arrow(direction)
    assert area.bounds[0] == pytest.approx(-0.07, abs=0.02)
    assert 3.5 < area.bounds[2] < 5.0
    assert np.sign(round(area.centroid.y, 3)) == side
    assert area.geom_type == "Polygon"


def test_a_word_is_upright_for_drivers() -> None:
    letter = words(("L",))
    foot = letter.intersection(shapely.box(-1.0, -1.0, 0.2, 1.0))
    stem = letter.intersection(shapely.box(1.5, -1.0, 3.0, 1.0))
    assert foot.bounds[1] < -0.12  # its foot points to the right
    assert stem.bounds[1] > 0.05


def test_a_symbol_stands_in_the_frame_of_its_lane() -> None:
    north = shapely.LineString([(5.0, 0.0), (5.0, 100.0)])
    placed = in_map(arrow(1), north, 40.0)
    assert placed.bounds[1] == pytest.approx(39.93, abs=0.02)
    assert placed.centroid.x < 5.0


def test_symbols_lie_within_lanes() -> None:
    network = load_network(MapSpec(name="Blocks", seed=0))
    ground = RegionGround.from_network(network, Region(0, 0), Terrain(network))
    symbols = list(lane_symbols(ground, 0))
    strips = network.layout.near(ground.region.area, 20.0).strips_of(LaneKind.DRIVING, level=0)
    lanes = shapely.union_all(shapely.buffer(strip_polygons(strips), 0.01))
    assert len(symbols) > 10
    assert all(lanes.contains(symbol) for symbol in symbols)


def test_lines_along_curbs_lie_on_lanes_beside_sidewalks_and_clear_of_crosswalks() -> None:
    network = load_network(MapSpec(name="Blocks", seed=0))
    ground = RegionGround.from_network(network, Region(0, 0), Terrain(network))
    areas = np.concatenate([paint for _, paint in curb_paint(ground, 0)])
    areas = areas[~shapely.is_empty(areas)]
    strips = network.layout.near(ground.region.area, 20.0).strips_of(LaneKind.DRIVING, level=0)
    walk = ground.streets[0].sidewalk
    assert len(areas) > 10
    assert shapely.contains(shapely.union_all(shapely.buffer(strip_polygons(strips), 0.01)), areas).all()
    assert shapely.distance(areas, walk).min() == pytest.approx(0.25, abs=0.12)  # the outer one of two, or one
    assert shapely.distance(areas, walk).max() < 0.5
    assert shapely.distance(areas, ground.streets[0].crosswalk).min() > 1.0


def test_country_words_are_those_of_the_maps_position() -> None:
    assert country_words(load_network(MapSpec(name="Town10HD", seed=0)))["lane"][0] == ["ESCUELA"]
    assert country_words(load_network(MapSpec(name="Blocks", seed=0)))["bus"] == ["ONLY", "BUS"]


def test_the_first_word_of_several_is_the_farthest_and_long_words_fit_their_lane() -> None:
    both = words(("L", "I"))
    assert both.intersection(shapely.box(2.5, -1.0, 6.0, 1.0)).bounds[1] < -0.12  # the foot of the L
    assert both.intersection(shapely.box(-1.0, -1.0, 2.4, 1.0)).bounds[1] > -0.12  # I has none
    assert np.ptp(words(("SCHULE",), 2.6).bounds[1::2]) < 2.6
