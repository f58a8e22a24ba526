"""Vertical rays against the ground's meshes agree with Elevation, Terrain and the areas in plan."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import open3d
import pytest
import shapely
from analytic_maps import crossing, ground_tiles, hilly_road, level_street, merged, river

from simbev_ros.assets.mesh.facets import TILE_M
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.region_ground import DECK_DEPTH_M, LAND_HEIGHT_M, RegionGround
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.assets.regions.far_land import cells_of, far_land, far_tiles
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M

EXACT_M, LAND_EXACT_M = 0.02, 0.06
GROUND = (Tag.ROAD, Tag.ROAD_LINE, Tag.SIDEWALK, Tag.TERRAIN, Tag.GROUND, Tag.WATER, Tag.WALL)
HOME = Region(0, 0)


@dataclass
class BuiltRegion:
    network: RoadNetwork
    ground: RegionGround
    tiles: tuple[Tile, ...]
    mesh: Mesh

    def of_tags(self, *tags: Tag) -> Mesh:
        return triangles_of(self.mesh, np.isin(self.mesh.triangle_tag, tags))


def triangles_of(mesh: Mesh, chosen: np.ndarray) -> Mesh:
    columns = [getattr(mesh, name) for name in ("vertices", "normals", "uv", "color", "material", "tag", "part")]
    return Mesh(*columns, mesh.triangles[chosen])


@lru_cache(maxsize=8)
def build(make: Callable[[], RoadNetwork], region: Region = HOME) -> BuiltRegion:
    network = make()
    ground = RegionGround.from_network(network, region, Terrain(network))
    tiles = ground_tiles(ground)
    return BuiltRegion(network, ground, tiles, merged(tiles))


def cast(mesh: Mesh, origin_m: Float64Array, direction: tuple[float, float, float]) -> tuple[Float64Array, UInt8Array]:
    """(N,) distances, infinite where nothing is hit, and (N,) tags of the hits."""
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.vertices, mesh.triangles.astype(np.uint32))
    rays = np.column_stack([origin_m, np.tile(direction, (len(origin_m), 1))]).astype(np.float32)
    found = scene.cast_rays(rays)
    hit = np.isfinite(found["t_hit"].numpy())
    tags = np.zeros(len(rays), np.uint8)
    tags[hit] = mesh.triangle_tag[found["primitive_ids"].numpy()[hit]]
    return found["t_hit"].numpy().astype(np.float64), tags


def top_of(mesh: Mesh, xy_m: Float64Array) -> tuple[Float64Array, UInt8Array]:
    """(N,) heights and (N,) tags of the topmost surfaces."""
    distance_m, tags = cast(mesh, np.column_stack([xy_m, np.full(len(xy_m), 100.0)]), (0.0, 0.0, -1.0))
    return 100.0 - distance_m, tags


def random_positions(count: int = 40_000) -> Float64Array:
    """(count, 2) random positions in the region, many of them on the borders of tiles."""
    xy_m = np.random.default_rng(7).uniform(1e-3, 512.0 - 1e-3, (count, 2))
    xy_m[: count // 4, 0] = np.round(xy_m[: count // 4, 0] / 64.0) * 64.0
    return np.clip(xy_m, 1e-3, 512.0 - 1e-3)


def inside(area: shapely.Geometry, xy_m: Float64Array, margin_m: float = 0.02) -> np.ndarray:
    area = shapely.buffer(area, -margin_m)
    shapely.prepare(area)
    return shapely.contains_xy(area, xy_m[:, 0], xy_m[:, 1])


@pytest.mark.parametrize("make", [hilly_road, crossing, river, level_street])
def test_the_ground_has_no_holes(make: Callable[[], RoadNetwork]) -> None:
    height_m, tags = top_of(build(make).of_tags(*GROUND), random_positions())
    assert np.isfinite(height_m).all()
    assert np.isin(tags, GROUND).all()


@pytest.mark.parametrize("make", [hilly_road, crossing, river])
def test_streets_and_land_lie_at_the_heights_of_the_map(make: Callable[[], RoadNetwork]) -> None:
    case, xy_m = build(make), random_positions()
    mesh, ground, terrain = case.of_tags(*GROUND), case.ground, case.ground.terrain
    seen_m, tags = top_of(mesh, xy_m)
    under = inside(shapely.union_all(ground.decks), xy_m, -0.02)
    street = ground.streets[0]
    for area, rise_m, allowed, level in (
        (street.road, 0.0, (Tag.ROAD, Tag.ROAD_LINE), 0),
        (street.shoulder, 0.0, (Tag.GROUND,), 0),
        (street.sidewalk, CURB_HEIGHT_M, (Tag.SIDEWALK,), 0),
        (ground.streets[-1].road, 0.0, (Tag.ROAD, Tag.ROAD_LINE), len(ground.streets) - 1),
    ):
        here = inside(area, xy_m) & (~under if level == 0 else True)
        expected_m = terrain.elevation.height_m(xy_m[here], level) + rise_m
        assert np.abs(seen_m[here] - expected_m).max(initial=0.0) < EXACT_M
        assert np.isin(tags[here], allowed).all()
    land = inside(ground.land, xy_m) & ~under
    assert land.sum() > 10_000
    assert np.abs(seen_m[land] - terrain.height_m(xy_m[land]) - LAND_HEIGHT_M).max() < LAND_EXACT_M
    assert np.abs(ground.land_m(xy_m[land]) - seen_m[land]).max() < LAND_EXACT_M


def test_regions_meet_without_a_step() -> None:
    west, east = build(hilly_road, Region(-1, 0)), build(hilly_road, HOME)
    y = np.random.default_rng(3).uniform(0.0, 512.0, 5000)
    both = [
        top_of(case.of_tags(*GROUND), np.column_stack([np.full(len(y), x), y]))[0]
        for case, x in ((west, -1e-4), (east, 1e-4))
    ]
    flat = np.abs(both[0] - both[1])
    assert np.ptp(both[0]) > 1.0
    assert np.median(flat) < 1e-4
    assert (flat > 1e-3).mean() < 1e-3  # rays at a curb may fall on either side of it


def test_a_region_is_the_same_whatever_else_was_built() -> None:
    network = hilly_road()
    terrain = Terrain(network)
    RegionGround.from_network(network, Region(-1, 0), terrain)
    again = merged(ground_tiles(RegionGround.from_network(network, HOME, terrain)))
    assert again.vertices.tobytes() == build(hilly_road).mesh.vertices.tobytes()


def test_below_a_deck_there_is_its_clearance_and_no_pillar_on_the_road() -> None:
    case = build(crossing)
    y = np.linspace(236.0, 276.0, 400)
    lanes_m = np.concatenate([np.column_stack([np.full(len(y), 256.0 + side), y]) for side in (-3.3, -1.0, 1.0, 3.3)])
    up_m, tags = cast(case.mesh, np.column_stack([lanes_m, np.full(len(lanes_m), 0.05)]), (0.0, 0.0, 1.0))
    deck = inside(case.ground.decks[1], lanes_m)
    assert deck.sum() > 100
    deck_m = case.ground.road_m(lanes_m[deck], 1)
    assert (up_m[deck] + 0.05 > deck_m - DECK_DEPTH_M - EXACT_M).all()
    assert (tags[deck] == Tag.BRIDGE).all()
    assert np.isinf(up_m[~inside(case.ground.decks[1], lanes_m, -0.02)]).all()


def test_a_deck_has_a_top_a_side_and_an_underside() -> None:
    case = build(crossing)
    xy_m = np.array([[x, 256.0 + side] for x in (240.0, 256.0, 270.0) for side in (-5.0, -2.9, 0.0, 2.9, 5.0)])
    top_m, _ = top_of(case.mesh, xy_m)
    below_m, _ = cast(case.mesh, np.column_stack([xy_m, case.ground.land_m(xy_m) + 0.5]), (0.0, 0.0, 1.0))
    thickness_m = top_m - (case.ground.land_m(xy_m) + 0.5 + below_m)
    assert ((thickness_m > 0.3) & (thickness_m < DECK_DEPTH_M + 0.2)).all()
    outside_m = np.array([[256.0, 236.0, case.ground.road_m(np.array([[256.0, 256.0]]), 1)[0] + 0.5]])
    distance_m, tags = cast(case.mesh, outside_m, (0.0, 1.0, 0.0))
    assert tags[0] == Tag.BRIDGE  # the parapet
    assert distance_m[0] == pytest.approx(20.0 - 7.75 - 0.45, abs=0.02)


def test_streets_on_a_structure_are_in_tiles_of_their_level() -> None:
    case = build(crossing)
    for level in (0, 1):
        mesh = merged([tile for tile in case.tiles if tile.level == level])
        corners = mesh.vertices[mesh.triangles[mesh.triangle_tag == Tag.ROAD]].astype(np.float64)
        seen = shapely.union_all(shapely.polygons(corners[:, :, :2]), grid_size=1e-3)
        road = shapely.intersection(case.ground.streets[level].road, HOME.area)
        assert seen.symmetric_difference(road).area < 0.001 * road.area


def test_water_lies_level_between_its_banks() -> None:
    case = build(river)
    water = case.of_tags(Tag.WATER)
    assert (water.vertices[np.unique(water.triangles), 2] == np.float32(-2.5)).all()
    y = np.array([60.0, 150.0, 400.0])
    _, tags = top_of(case.mesh, np.column_stack([256.0 + 20.0 * np.sin(y / 60.0), y]))
    assert (tags == Tag.WATER).all()


def test_guard_rails_stand_beside_the_fast_road_and_not_on_it() -> None:
    case = build(crossing)
    rails = case.of_tags(Tag.GUARD_RAIL)
    xy_m = rails.vertices[np.unique(rails.triangles), :2].astype(np.float64)
    assert len(xy_m) > 500
    away_m = shapely.distance(case.ground.streets[0].area, shapely.points(xy_m))
    assert away_m.min() > 0.2
    assert away_m.max() < 1.0
    assert np.abs(xy_m[:, 1] - 256.0).max() < 10.0  # none along the slow street with sidewalks


def test_level_ground_is_not_cut_up() -> None:
    case = build(level_street)
    empty = [tile for tile in case.tiles if not (tile.mesh.tag == Tag.ROAD).any()]
    assert len(empty) == 48
    assert all(len(tile.mesh.triangles) == 2 for tile in empty)
    assert (empty[0].mesh.vertices[:, 2] == np.float32(LAND_HEIGHT_M)).all()


def test_no_gap_shows_between_loaded_land_and_the_land_beyond() -> None:
    case = build(hilly_road)
    near = [tile for tile in case.tiles if tile.origin_m[0] < 400.0]  # their border is not that of a region
    land = far_land(case.network, case.ground.terrain)
    mesh = merged([*near, *far_tiles(land, cells_of(land, near))])
    rng = np.random.default_rng(5)
    eye_m = np.column_stack([rng.uniform((20.0, 20.0), (370.0, 490.0), (4000, 2)), np.zeros(4000)])
    eye_m[:, 2] = case.ground.land_m(eye_m[:, :2]) + 1.6
    for angle_rad in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        direction = (float(np.cos(angle_rad)), float(np.sin(angle_rad)), -0.02)
        distance_m, _ = cast(mesh, eye_m, direction)
        assert np.isfinite(distance_m).all()
    border_m = np.column_stack([np.full(500, 384.5), np.linspace(0.5, 511.5, 500)])
    beyond_m, _ = top_of(mesh, border_m)
    assert np.abs(beyond_m - case.ground.terrain.height_m(border_m) - LAND_HEIGHT_M).max() < 1.5


def test_hills_rise_beyond_a_plain_around_the_map_and_its_waters() -> None:
    case = build(river)
    land = far_land(case.network, case.ground.terrain)
    count = np.array(land.height_m.shape)
    corner_m = np.array(land.first) * REGION_M + TILE_M * np.stack(np.indices(count), axis=-1)
    rise_m = land.height_m - LAND_HEIGHT_M - case.ground.terrain.far_m(corner_m.reshape(-1, 2)).reshape(count)
    outside_m = np.hypot(*np.moveaxis(np.maximum(np.abs(corner_m - REGION_M / 2.0) - REGION_M / 2.0, 0.0), -1, 0))
    water = np.pad(land.cover == 0, ((0, 1), (0, 1)), mode="edge")
    assert np.abs(rise_m[(outside_m < 250.0) | water]).max() == 0.0
    assert rise_m.min() >= 0.0 and 30.0 < rise_m.max() < 700.0
    assert np.abs(np.diff(rise_m, axis=0)).max() < TILE_M and np.abs(np.diff(rise_m, axis=1)).max() < TILE_M
    np.testing.assert_array_equal(land.height_m, far_land(case.network, case.ground.terrain).height_m)
