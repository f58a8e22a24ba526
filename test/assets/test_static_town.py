from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import shapely

from simbev_ros.assets.build import build_static_scene
from simbev_ros.assets.building_sites import choose_sites, erect
from simbev_ros.assets.claims import Claims
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.static_cache import load_static_scene
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.assets.tiles import TILE_M
from simbev_ros.assets.town_plan import plan_town
from simbev_ros.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.surface import crossing_polygons, road_surface
from simbev_ros.semantics import Tag

SPEC = MapSpec(name="Blocks", seed=0)
GROUND_TAGS = (Tag.ROAD, Tag.ROAD_LINE, Tag.SIDEWALK, Tag.TERRAIN, Tag.GROUND, Tag.WATER)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def network(cache: Path) -> RoadNetwork:
    return load_network(SPEC, cache)


@pytest.fixture(scope="module")
def scene(network: RoadNetwork) -> StaticScene:
    return build_static_scene(network, recipe_of("Blocks").surroundings, seed=0)


@pytest.fixture(scope="module")
def town(scene: StaticScene) -> Mesh:
    """All that is seen, in the map frame."""
    return Mesh.merged([_in_map(tile.mesh, tile.origin_m) for tile in scene.tiles])


def _in_map(mesh: Mesh, origin_m: np.ndarray) -> Mesh:
    map_from_tile = np.eye(4)
    map_from_tile[:3, 3] = origin_m
    return mesh.transformed(map_from_tile)


def _triangles_in_plan(mesh: Mesh, chosen: np.ndarray) -> np.ndarray:
    corners = mesh.vertices[mesh.triangles[chosen]].astype(np.float64)[:, :, :2]
    polygons = shapely.polygons(corners)
    return polygons[shapely.area(polygons) > 1e-6]


def _bytes(scene: StaticScene) -> bytes:
    parts = [repr(scene.street_lights).encode()]
    for tile in scene.tiles:
        for name, mesh in {"": tile.mesh, **tile.surfaces}.items():
            parts += [name.encode(), *(getattr(mesh, field.name).tobytes() for field in fields(Mesh))]
    return b"".join(parts)


def test_asphalt_covers_the_road_surface_and_nothing_else(town: Mesh, network: RoadNetwork) -> None:
    road = road_surface(network)
    asphalt = shapely.union_all(_triangles_in_plan(town, town.triangle_tag == Tag.ROAD), grid_size=1e-4)
    assert asphalt.symmetric_difference(road).area < 0.001 * road.area
    assert (town.vertices[town.tag == Tag.ROAD, 2] == 0.0).all()


def test_paint_lies_just_above_the_road_and_inside_it(town: Mesh, network: RoadNetwork) -> None:
    chosen = town.triangle_tag == Tag.ROAD_LINE
    paint = shapely.union_all(_triangles_in_plan(town, chosen), grid_size=1e-4)
    assert paint.area > 500.0
    assert paint.difference(road_surface(network).buffer(0.002)).area < 1e-3
    heights_m = town.vertices[town.tag == Tag.ROAD_LINE, 2]
    assert ((heights_m > 0.002) & (heights_m < 0.01)).all()


def test_crosswalk_surfaces_are_the_crossings(scene: StaticScene, network: RoadNetwork) -> None:
    areas = [_in_map(tile.surfaces["crosswalk"], tile.origin_m) for tile in scene.tiles if "crosswalk" in tile.surfaces]
    mesh = Mesh.merged(areas)
    covered = shapely.union_all(_triangles_in_plan(mesh, np.full(len(mesh.triangles), True)), grid_size=1e-4)
    crossings = shapely.union_all(list(crossing_polygons(network)))
    assert covered.symmetric_difference(crossings).area < 0.001 * crossings.area


def test_nothing_stands_on_the_road(town: Mesh, network: RoadNetwork) -> None:
    tags, lowest_m = town.triangle_tag, town.vertices[town.triangles, 2].min(axis=1)
    road = road_surface(network).buffer(-0.01)
    shapely.prepare(road)
    low = ~np.isin(tags, GROUND_TAGS) & (lowest_m < 2.5)
    assert not shapely.intersects(road, _triangles_in_plan(town, low)).any()
    assert not shapely.intersects(road, _triangles_in_plan(town, tags == Tag.BUILDING)).any()


def test_the_middle_of_every_sidewalk_is_free_to_walk(town: Mesh, network: RoadNetwork) -> None:
    lines = [lane.centerline_m[:, :2] for lane in network.lanes.values() if lane.kind is LaneKind.SIDEWALK]
    walks = shapely.union_all([shapely.LineString(line).buffer(0.3, cap_style="flat") for line in lines])
    shapely.prepare(walks)
    heights_m = town.vertices[town.triangles, 2]
    in_the_way = ~np.isin(town.triangle_tag, GROUND_TAGS) & (heights_m.min(axis=1) < 2.0)
    assert not shapely.intersects(walks, _triangles_in_plan(town, in_the_way)).any()


def test_buildings_stand_apart_in_plan(network: RoadNetwork) -> None:
    recipe = recipe_of("Blocks").surroundings
    sites = choose_sites(plan_town(network, recipe, 0), recipe, 0, Claims())
    rng = np.random.default_rng(0)
    meshes = [erect(site, recipe, rng).transformed(site.map_from_building) for site in sites]
    hulls = np.array([shapely.MultiPoint(mesh.vertices[:, :2].astype(np.float64)).convex_hull for mesh in meshes])
    first, second = shapely.STRtree(hulls).query(hulls, predicate="intersects")
    assert len(hulls) > 100
    assert (first == second).all()


def test_signal_lamps_carry_their_row_and_face_their_traffic(town: Mesh, network: RoadNetwork) -> None:
    lamps = (Material.SIGNAL_RED, Material.SIGNAL_YELLOW, Material.SIGNAL_GREEN)
    for row, signal in enumerate(network.signals):
        own = [(town.material == lamp) & (town.uv[:, 0] == row) for lamp in lamps]
        heights_m = [town.vertices[mask, 2].mean() for mask in own]
        assert heights_m[0] > heights_m[1] > heights_m[2]
        facing = np.array([np.cos(signal.yaw_rad), np.sin(signal.yaw_rad), 0.0])
        ahead_m = (town.vertices[own[1]].mean(axis=0) - signal.position_m) @ facing
        assert 0.05 < ahead_m < 0.2
        assert (town.normals[own[1]] @ facing).max() > 0.99


def test_street_lamps_carry_the_index_of_their_light(scene: StaticScene, town: Mesh) -> None:
    assert len(scene.street_lights) > 50
    for index, light in enumerate(scene.street_lights):
        own = (town.material == Material.STREET_LAMP) & (town.uv[:, 0] == index)
        assert np.linalg.norm(town.vertices[own].mean(axis=0) - light.position_m) < 0.1


def test_a_triangles_corners_share_their_attributes_and_its_winding_agrees_with_its_normals(town: Mesh) -> None:
    for column in (town.material, town.tag, town.part, *town.color.T):
        assert (column[town.triangles] == column[town.triangles[:, :1]]).all()
    corners = town.vertices[town.triangles].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ti,ti->t", faces, town.normals[town.triangles].sum(axis=1)) > -1e-5).all()
    assert np.abs(np.linalg.norm(town.normals, axis=1) - 1.0).max() < 1e-4


def test_ground_is_cut_at_the_tiles_borders(scene: StaticScene) -> None:
    for tile in scene.tiles:
        ground = tile.mesh.vertices[np.isin(tile.mesh.tag, (Tag.ROAD, Tag.SIDEWALK, Tag.ROAD_LINE)), :2]
        assert ground.size == 0 or np.abs(ground).max() <= TILE_M / 2.0 + 1e-3


def test_a_town_stays_within_its_budget_and_has_all_that_a_town_has(town: Mesh) -> None:
    assert len(town.triangles) < 370_000
    expected = {Tag.WALL, Tag.FENCE, Tag.POLE, Tag.TRAFFIC_LIGHT, Tag.TRAFFIC_SIGN, Tag.VEGETATION, Tag.STATIC}
    assert expected | {Tag.BUILDING, *GROUND_TAGS} <= {Tag(int(tag)) for tag in np.unique(town.tag)}


def test_another_seed_gives_other_surroundings(network: RoadNetwork, scene: StaticScene) -> None:
    assert _bytes(build_static_scene(network, recipe_of("Blocks").surroundings, seed=1)) != _bytes(scene)


def test_a_scene_built_again_and_a_cached_one_have_the_same_bytes(
    network: RoadNetwork, scene: StaticScene, cache: Path
) -> None:
    built, cached = load_static_scene(SPEC, network, cache), load_static_scene(SPEC, network, cache)
    assert _bytes(built) == _bytes(cached) == _bytes(scene)
    assert [tile.origin_m.tolist() for tile in cached.tiles] == [tile.origin_m.tolist() for tile in scene.tiles]
    assert len(list((cache / "surroundings").iterdir())) == 1


def test_a_cache_that_cannot_be_written_is_reported(network: RoadNetwork, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        load_static_scene(SPEC, network, blocker)
