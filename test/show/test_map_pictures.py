"""Tests of map pictures: everything at its position, north up, higher surfaces on top."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.land_features import Footprint, MapFeatures, Water, Zone
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.statistics import statistics_of
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.show.maps.map_plan import MapPlan, palette
from simbev_ros.show.maps.orthophoto import orthophoto


def sheet(x_m: float, y_m: float, half_m: float, z_m: float, color: tuple[int, int, int]) -> Mesh:
    a, b, c, d = ([x_m + u * half_m, y_m + v * half_m, z_m] for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return Mesh.flat(np.array([[a, b, c], [a, c, d]]), material=Material.PLAIN, tag=Tag.OTHER, color=color)


def test_an_orthophoto_shows_the_topmost_surface_at_its_position() -> None:
    origin_m = np.array([1000.0, 2000.0, 5.0])
    meshes = [sheet(0, 0, 50, 0, (0, 90, 0)), sheet(20, 30, 6, 0.5, (90, 0, 0)), sheet(20, 30, 9, 0.2, (0, 0, 90))]
    picture = orthophoto([Tile(origin_m, Mesh.merge(meshes), {})], origin_m[:2], 100.0, 200)
    # 2 pixels per meter, row 0 in the north, column 0 in the west
    strongest = {
        (row, column): int(np.argmax(picture[row, column])) for row, column in ((40, 140), (40, 156), (100, 100))
    }
    assert strongest == {(40, 140): 0, (40, 156): 2, (100, 100): 1}
    reds = np.argwhere(np.argmax(picture, axis=2) == 0)
    assert reds.min(axis=0).tolist() == [28, 128] and reds.max(axis=0).tolist() == [51, 151]


def test_an_orthophoto_has_shadows_on_the_side_away_from_the_sun() -> None:
    meshes = [sheet(0, 0, 50, 0, (90, 90, 90)), sheet(0, 0, 5, 10, (90, 90, 90))]
    picture = orthophoto([Tile(np.zeros(3), Mesh.merge(meshes), {})], np.zeros(2), 100.0, 200).astype(int)
    south_east, north_west = picture[114, 112].sum(), picture[86, 88].sum()
    assert south_east < 0.75 * north_west
    assert picture[5, 5].sum() == pytest.approx(north_west, abs=3)


def strip(name: str, start_m: tuple[float, float], end_m: tuple[float, float], z_m: float, level: int) -> Strip:
    line_m = np.array([[*start_m, z_m], [*end_m, z_m]])
    along = (line_m[1] - line_m[0])[:2] / np.linalg.norm(line_m[1] - line_m[0])
    aside_m = 4.0 * np.array([-along[1], along[0], 0.0])
    return Strip(name, name, LaneKind.DRIVING, line_m + aside_m, line_m - aside_m, speed_mps=13.0, level=level)


def crossing() -> RoadNetwork:
    """A map with a road from west to east, another one that crosses over it, and all kinds of land."""
    strips = (strip("a", (-90, 0), (90, 0), 0.0, 0), strip("b", (0, -90), (0, 90), 6.0, 1))
    lanes = {s.lane: Lane(s.lane, s.lane, 0, s.kind, s.center_m, 8.0, 13.0, "", ()) for s in strips}
    park = Zone(shapely.box(20, 20, 80, 80), SurroundingsRecipe(use="park"))
    features = MapFeatures(
        SurroundingsRecipe(use="farmland"),
        zones=(park,),
        water=(Water(shapely.box(-80, -80, -20, -20), -1.0),),
        buildings=(Footprint(shapely.box(40, -60, 70, -40), 8.0),),
    )
    layout = Layout(strips, (), (), ())
    nowhere = MapDatum(0.0, 0.0, 0.0)
    return RoadNetwork("crossing", lanes, {}, (), nowhere, None, None, layout, features, 0)  # type: ignore[arg-type]


def test_a_plan_shows_land_water_buildings_and_roads_at_their_positions() -> None:
    picture = MapPlan(crossing(), np.zeros(2), 200.0, 200).picture()
    colors = palette()
    positions = {"park": (150, 50), "water": (50, 150), "building": (155, 150), "road": (60, 100), "farmland": (30, 30)}
    for name, (column, row) in positions.items():
        assert picture[row, column] == pytest.approx(np.array(colors[name]), abs=12), name
    casing = picture[100, 92:108]
    assert casing.min() < 200, "the upper road's edge is drawn over the lower road"


def test_statistics_count_lanes_and_crossings_at_two_levels() -> None:
    figures = statistics_of(crossing())
    assert (figures.width_m, figures.depth_m) == (180.0, 180.0)
    assert figures.lane_km == {"driving": pytest.approx(0.36)}
    assert (figures.two_level_crossings, figures.levels, figures.prescribed_buildings) == (1, 2, 1)
    assert (figures.lowest_m, figures.highest_m) == (0.0, 6.0)
