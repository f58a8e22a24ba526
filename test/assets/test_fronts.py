"""Terraces stand wall to wall, centers are closed, and what is fixed to fronts stays within its building's space."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely

from simbev_ros.assets.architecture.fittings import find_front, fittings
from simbev_ros.assets.architecture.kinds import build, load_kinds
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.walls import draw_wall
from simbev_ros.assets.land.blocks import Block, Frontage, blocks_of
from simbev_ros.assets.land.rows import build_rows
from simbev_ros.assets.land.town import lay_out_town
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import Region
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.schema.scene.map_spec import MapSpec

PLOTS = {
    "terrace": (6.0, 7.0),
    "town_house": (9.0, 6.0),
    "apartments": (15.0, 14.0),
    "office": (18.0, 30.0),
    "shop": (12.0, 5.0),
}


@pytest.mark.parametrize("kind", PLOTS)
def test_fittings_stay_in_front_of_their_building(kind: str) -> None:
    plot = Plot(PLOTS[kind][0], 9.0, PLOTS[kind][1])
    for seed in range(8):
        rng = stream(seed, "test")
        building = build(kind, plot, draw_wall("brick", rng), rng)
        low_m, high_m = Mesh.merge(fittings(find_front(building, plot), rng)[0]).bounds_m
        assert low_m[1] >= -load_kinds()[kind].front_m - 0.15
        assert max(-low_m[0], high_m[0]) <= plot.width_m / 2.0 + 0.05
        assert high_m[1] < 0.11


def test_the_front_of_a_shop_is_measured() -> None:
    plot = Plot(12.0, 9.0, 14.0)
    rngs = [stream(seed, "test") for seed in range(24)]
    fronts = [find_front(build("apartments", plot, draw_wall("brick", rng), rng), plot) for rng in rngs]
    assert {round(front.shop_m, 2) for front in fronts} == {0.0, 3.9}
    assert all(9.0 < front.top_m < 20.0 for front in fronts)


def test_names_of_shops_are_part_of_the_building_and_projecting_signs_are_signs() -> None:
    plot = Plot(18.0, 9.0, 14.0)
    rng = stream(0, "test")
    building = build("shop", plot, draw_wall("brick", rng), rng)
    mesh = Mesh.merge(fittings(find_front(building, plot), stream(1, "test"))[0])
    signs = mesh.tag == Tag.TRAFFIC_SIGN
    names = (mesh.tag == Tag.BUILDING) & (mesh.material == Material.PLAIN)
    assert signs.any()
    assert names.any()
    assert (mesh.vertices[names, 2] > 3.0).all()


def test_houses_of_a_terrace_continue_the_front_and_the_eaves_before_them() -> None:
    network = load_network(MapSpec(name="Blocks", seed=0))
    recipe = SurroundingsRecipe(
        use="residential", building_density=1.0, building_setback_m={"uniform": [0.5, 4.0]}, building_style="brick"
    )
    ground = RegionGround.from_network(network, Region(0, 0), Terrain(network))
    yard = Yard(ground, TileBuilder(), Claims(), shapely.Point())
    land = shapely.box(150.0, 150.0, 350.0, 200.0)
    block = Block(land, recipe, (Frontage(shapely.LineString([(150.0, 150.0), (350.0, 150.0)]), walk=True),))
    sites = build_rows(yard, block, lambda height_m, rng: "terrace", stream(5, "test"))
    assert len(sites) > 20
    joined = [
        (left, right)
        for left, right in itertools.pairwise(sites)
        if right.origin_m[0] - left.origin_m[0] < 0.5 * (left.plot.width_m + right.plot.width_m) + 0.2
    ]
    assert len(joined) > 0.6 * len(sites)
    for left, right in joined:
        np.testing.assert_allclose(left.origin_m[1], right.origin_m[1], atol=1e-6)
        assert left.plot.height_m == right.plot.height_m
    assert len({site.setback_m for site in sites}) > 1


def test_most_of_a_center_is_built_along_the_back_of_its_sidewalks_which_stay_free() -> None:
    network = load_network(MapSpec(name="Blocks", seed=0))
    recipe = SurroundingsRecipe(
        use="downtown", building_density=0.95, building_setback_m=0.3, building_height_m={"uniform": [9, 20]}
    )
    ground = RegionGround.from_network(network, Region(0, 0), Terrain(network))
    yard = Yard(ground, TileBuilder(), Claims(), shapely.Point())
    blocks = [replace(block, recipe=recipe) for block in blocks_of(ground, [(recipe, ground.region.area)], yard.fast)]
    blocks = [block for block in blocks if 5_000.0 < block.land.area < 30_000.0]
    for block in blocks:
        lay_out_town(yard, block)
    built = shapely.union_all(yard.walls)
    lines = [line for block in blocks for line in block.frontage if not line.beyond]
    stations = [np.stack(line.stations(1.0), axis=1) for line in lines if line.length_m > 40.0]
    position_m, along = np.moveaxis(np.concatenate(stations), 1, 0)
    fronted = shapely.contains_xy(built, position_m + 5.0 * left_of(along))
    assert len(fronted) > 300
    assert fronted.mean() > 0.8
    assert shapely.area(shapely.intersection(built, ground.streets[0].area)) == 0.0
