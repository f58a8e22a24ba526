"""A region's plan: the warp does not fold, all uses occur, streets are connected and clear of motorways and water."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import shapely

from simbev_ros.maps.plan.draft import Draft
from simbev_ros.maps.plan.patterns.districts import DistrictsRecipe, draw_districts
from simbev_ros.maps.plan.patterns.main_roads import add_main_roads
from simbev_ros.maps.plan.patterns.region import Region, draw_region
from simbev_ros.maps.plan.patterns.street_lattice import FILL, FINE, Lattice
from simbev_ros.maps.plan.patterns.warp import draw_warp
from simbev_ros.maps.recipe import recipe_of

pytestmark = pytest.mark.slow

CELLS = 8


def draw_town(town: str, seed: int) -> Draft:
    draft = Draft()
    draw_region(pattern_of(town), draft, np.random.default_rng(seed))
    return draft


def pattern_of(town: str) -> Region:
    pattern = recipe_of(town).patterns[0]
    assert isinstance(pattern, Region)
    return pattern


@cache
def first_draft(town: str) -> Draft:
    return draw_town(town, 1)


@pytest.fixture(scope="module", params=["Town12", pytest.param("Town13", marks=pytest.mark.slow)])
def region(request: pytest.FixtureRequest) -> Draft:
    return first_draft(request.param)


@pytest.mark.parametrize("seed", range(5))
def test_a_warp_never_folds_the_plane(seed: int) -> None:
    warp = draw_warp(np.random.default_rng(seed), amplitude_m=400.0, wavelength_m=800.0)
    positions = np.random.default_rng(9).uniform(-5000.0, 5000.0, (2000, 2))
    east, north = ((warp(positions + step) - warp(positions)) / 0.01 for step in ([0.01, 0.0], [0.0, 0.01]))
    assert np.min(east[:, 0] * north[:, 1] - east[:, 1] * north[:, 0]) > 0.2


def test_every_use_gets_the_requested_number_of_cells() -> None:
    recipe = DistrictsRecipe(downtown=2, residential=5, suburb=7, industrial=3, park=2, woods=9)
    uses = list(draw_districts(recipe, CELLS, (4.2, 3.9), np.random.default_rng(3)).values())
    assert {use: uses.count(use) for use in recipe.model_dump()} == recipe.model_dump()
    assert uses.count("farmland") == CELLS**2 - 28


def test_chains_of_streets_cover_each_step_once() -> None:
    lattice = Lattice(CELLS)
    districts = draw_districts(DistrictsRecipe(), CELLS, (4.0, 4.0), np.random.default_rng(0))
    add_main_roads(lattice, districts, ((2, 2), (6, 2), (6, 6), (2, 6)), 0.3, np.random.default_rng(1))
    for cell, use in districts.items():
        if use in FILL:
            FILL[use](lattice, cell, np.random.default_rng(2))
    covered = [(min(a, b), max(a, b)) for _, chain in lattice.chains() for a, b in pairwise(chain)]
    assert sorted(covered) == sorted(lattice.steps)


def test_suburbs_have_culs_de_sac_and_are_reached_from_all_sides() -> None:
    lattice = Lattice(1)
    for a, b in (((0, 0), (FINE, 0)), ((0, 0), (0, FINE)), ((FINE, 0), (FINE, FINE)), ((0, FINE), (FINE, FINE))):
        lattice.add(a, b, "arterial")
    FILL["suburb"](lattice, (0, 0), np.random.default_rng(4))
    steps = dict(lattice.steps)
    lattice.keep_largest_part()
    assert lattice.steps == steps, "no street is cut off"
    arms = lattice.arms()
    assert sum(len(neighbors) == 1 for neighbors in arms.values()) >= 3
    for side in range(2):
        for border in (0, FINE):
            assert any(len(neighbors) == 3 for point, neighbors in arms.items() if point[side] == border)


def test_the_same_seed_gives_the_same_region_and_another_seed_another() -> None:
    first, same, other = first_draft("Town12"), draw_town("Town12", 1), draw_town("Town12", 2)
    assert [road.name for road in first.roads] == [road.name for road in same.roads]
    assert all(np.array_equal(a.line_m, b.line_m) for a, b in zip(first.roads, same.roads, strict=True))
    assert not np.array_equal(first.roads[0].line_m, other.roads[0].line_m)


def test_streets_keep_clear_of_the_motorway_and_of_water(region: Draft) -> None:
    motorway = shapely.MultiLineString(
        [r.line_m for r in region.roads if ".forward." in r.name and "exit" not in r.name]
    )
    local = ("downtown", "residential", "suburb", "industrial", "village", "track")
    lines = shapely.MultiLineString([road.line_m for road in region.roads if road.name.startswith(local)])
    assert lines.distance(motorway) > 100.0
    assert all(lines.distance(area) > 20.0 for area in region.water)


def test_roads_of_one_layer_cross_no_motorway(region: Draft) -> None:
    ways = [road for road in region.roads if ".forward." in road.name or ".backward." in road.name]
    tree = shapely.STRtree([shapely.LineString(way.line_m) for way in ways])
    for road in region.roads:
        line = shapely.LineString(road.line_m)
        crossed = [ways[index] for index in tree.query(line, predicate="crosses").tolist()]
        assert all(way.layer != road.layer for way in crossed), road.name


def test_the_motorway_has_interchanges_and_the_region_all_kinds_of_streets(region: Draft) -> None:
    assert sum(road.name.endswith("exit") for road in region.roads) >= 6
    for kind in ("avenue", "arterial", "collector", "country", "downtown", "residential", "suburb", "industrial"):
        assert any(road.name.startswith(kind) for road in region.roads), kind


def test_zones_cover_the_region_without_gaps(region: Draft) -> None:
    uses = {zone.surroundings.use for zone in region.zones}
    assert uses == {"downtown", "residential", "suburb", "industrial", "park", "woods", "farmland"}
    land = shapely.union_all([zone.area for zone in region.zones], grid_size=0.1)
    holes = sum(shapely.Polygon(ring).area for part in shapely.get_parts(land) for ring in part.interiors)
    assert land.area > 0.97 * 1e8
    assert holes < 0.001 * land.area


def test_names_are_unique_and_lines_simple(region: Draft) -> None:
    assert len({road.name for road in region.roads}) == len(region.roads)
    assert all(shapely.LineString(road.line_m).is_simple for road in region.roads)
