"""Green medians have no curb across them at a region's border, and trees along their middle."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.assets.regions.build import build_region
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.surroundings import SurroundingsRecipe

LANE = '<lane id="{}" type="{}"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>'
ROAD = """<OpenDRIVE><road id="1" length="200" junction="-1"><link/><planView>
<geometry s="0" x="-100" y="40" hdg="0" length="200"><line/></geometry></planView>
<lanes><laneSection s="0"><left>{left}</left><center><lane id="0" type="none"/></center><right>{right}</right>
</laneSection></lanes></road></OpenDRIVE>"""
CURB_M, MEDIAN_M = 0.15, 6.0


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> list[Tile]:
    """Two regions of a dual carriageway along y = 40, whose median is 6 m wide."""
    folder = tmp_path_factory.mktemp("median")
    sides = ["".join(LANE.format(s * k, kind) for k, kind in ((1, "median"), (2, "driving"))) for s in (1, -1)]
    (folder / "dual.xodr").write_text(ROAD.format(left=sides[0], right=sides[1]))
    network = load_network(map_spec(str(folder / "dual.xodr")), folder)
    recipe = SurroundingsRecipe(use="residential", building_density=0.0, tree_spacing_m=8.0, plant_density=0.9)
    network = replace(network, features=replace(network.features, surroundings=recipe))
    terrain = Terrain(network)
    return [tile for region in regions_of(network.layout) for tile in build_region(network, region, terrain).tiles]


def triangles_m(tiles: list[Tile], tag: Tag) -> Float64Array:
    """(T, 3, 3) triangles of a tag over the median, map frame."""
    found = [tile.mesh.vertices[tile.mesh.triangles[tile.mesh.triangle_tag == tag]] + tile.origin_m for tile in tiles]
    corners_m: Float64Array = np.concatenate(found)
    middle_m = corners_m[..., :2].mean(axis=1)
    return corners_m[(np.abs(middle_m[:, 1] - 40.0) < MEDIAN_M / 2.0) & (np.abs(middle_m[:, 0]) < 100.0)]


def test_the_lawn_of_a_median_is_as_wide_at_the_border_of_a_region_as_elsewhere(tiles: list[Tile]) -> None:
    lawn = shapely.union_all(shapely.polygons(triangles_m(tiles, Tag.TERRAIN)[..., :2]), grid_size=0.001)
    for x_m in (-60.0, 0.0, 60.0):
        window = shapely.box(x_m - 1.0, 30.0, x_m + 1.0, 50.0)
        assert shapely.intersection(lawn, window).area == pytest.approx(2.0 * (MEDIAN_M - 2.0 * CURB_M), abs=0.01), x_m


def test_trees_stand_along_the_middle_of_a_median(tiles: list[Tile]) -> None:
    corners_m = triangles_m(tiles, Tag.VEGETATION).reshape(-1, 3)
    feet_m = corners_m[corners_m[:, 2] < 0.0]
    assert len(np.unique(np.round(feet_m[:, 0] / 4.0))) > 8
    assert np.abs(feet_m[:, 1] - 40.0).max() < 0.5
    assert np.abs(feet_m[:, 0]).max() < 90.0, "clear of the ends"
