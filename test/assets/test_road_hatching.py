"""Hatching lies on roads outside the lanes that traffic uses; paint of buses lies within its lane, nothing overlaps."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.roads.curb_paint import curb_paint
from simbev_ros.assets.roads.hatching import hatched_areas, hatching
from simbev_ros.assets.roads.symbols import bus_paint, lane_symbols
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import Region
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.markings import lane_markings
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.schema.scene.map_spec import MapSpec


@pytest.fixture(scope="module", params=["Town05", "Town10HD"])
def ground(request: pytest.FixtureRequest) -> RegionGround:
    network = load_network(MapSpec(name=request.param, seed=0))
    return RegionGround.from_network(network, Region(0, 0), Terrain(network))


def test_stripes_of_a_rectangle_cross_it_at_45_degrees() -> None:
    painted = hatching(shapely.box(0.0, 0.0, 20.0, 6.0))
    inside = shapely.box(2.0, 1.0, 18.0, 5.0)
    stripes = shapely.get_parts(painted.intersection(inside))
    assert painted.area / 120.0 == pytest.approx(0.25 / 1.3, abs=0.07)  # with the outline
    assert len(stripes) > 8
    for stripe in stripes:
        x_m, y_m = shapely.get_coordinates(stripe).T
        assert np.corrcoef(x_m, y_m)[0, 1] > 0.9 or np.ptp(y_m) < 1.0


def test_hatching_lies_on_roads_outside_driving_lanes_and_crosswalks(ground: RegionGround) -> None:
    areas = np.array(list(hatched_areas(ground, 0)), object)
    strips = ground.network.layout.near(ground.region.area, 64.0).strips_of(LaneKind.DRIVING, LaneKind.BICYCLE, level=0)
    driven = shapely.union_all(strip_polygons(strips))
    streets = ground.streets[0]
    assert len(areas) > 10
    assert shapely.area(areas).min() > 0.5
    paved = shapely.union_all([streets.road, streets.shoulder])
    assert shapely.area(shapely.difference(areas, paved)).max() < 1e-3
    assert shapely.distance(areas, driven).min() > 0.2
    assert shapely.distance(areas, streets.crosswalk).min() > 0.5


def test_paint_of_buses_lies_in_the_outer_lane(ground: RegionGround) -> None:
    areas = list(bus_paint(ground, 0))
    layout = ground.network.layout.near(ground.region.area, 64.0)
    lanes = {strip.lane: strip for strip in layout.strips}
    outer = [strip for strip in layout.strips_of(LaneKind.DRIVING, level=0) if strip.right in lanes]
    outer = [strip for strip in outer if lanes[strip.right].kind is not LaneKind.DRIVING and not strip.junction]
    within = shapely.union_all(shapely.buffer(strip_polygons(outer), 0.02))
    assert areas
    assert all(within.contains(area) for area in areas)


def test_painted_areas_do_not_overlap(ground: RegionGround) -> None:
    lines = [mark.polygon for mark in lane_markings(ground.network.layout, 0, ground.region.area)]
    curbs = [area for _, areas in curb_paint(ground, 0) for area in areas if not area.is_empty]
    groups = [lines, curbs, list(lane_symbols(ground, 0)), list(bus_paint(ground, 0)), list(hatched_areas(ground, 0))]
    merged = [shapely.union_all(group) for group in groups]
    for number, later in enumerate(merged[3:], start=3):
        assert later.intersection(shapely.union_all(merged[:number])).area < 1e-3
    single = np.array([*groups[3], *groups[4]], object)
    assert shapely.area(single).sum() == pytest.approx(shapely.union_all(single).area, abs=1e-3)
