"""Objects in regions are consistent with the streets in plan, the ground's meshes and each other."""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import open3d
import pytest
import shapely
from analytic_maps import crossing, hilly_road

from simbev_ros.assets.land.furnish import Furnishing, furnish_region
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.regions.build import build_region
from simbev_ros.assets.regions.region_scene import RegionScene
from simbev_ros.assets.roads.ground import lay_land, lay_streets
from simbev_ros.config.weather import Season
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.land_features import Footprint, MapFeatures, Zone
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Sign, SignKind
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.schema.scene.map_spec import MapSpec

HOME = Region(0, 0)
RECIPES = {
    "downtown": {"building_height_m": {"uniform": [9, 40]}, "building_setback_m": 0.5},
    "residential": {"building_height_m": {"uniform": [6, 14]}},
    "suburb": {"building_setback_m": {"uniform": [4, 8]}},
    "industrial": {"building_setback_m": 6.0},
    "campus": {"building_height_m": {"uniform": [8, 20]}},
    "farmland": {"building_density": 1.0, "tree_spacing_m": 0, "street_light_spacing_m": 0},
    "woods": {"tree_spacing_m": 0, "street_light_spacing_m": 0},
    "park": {},
}
HILLY_TOO = ("residential", "campus", "farmland")
BUDGET = {"farmland": 75_000, "woods": 250_000}
UPRIGHT_TAGS = (Tag.TERRAIN, Tag.GROUND, Tag.WATER)
SLENDER_TAGS = (Tag.POLE, Tag.TRAFFIC_LIGHT, Tag.TRAFFIC_SIGN)


class PlacedObject(NamedTuple):
    """A placed object: its mesh in the map frame, and the position of its foot."""

    mesh: Mesh
    foot_m: Float64Array
    follows_land: bool


class Recorder(TileBuilder):
    """Tile builder that also records every object separately."""

    def __init__(self) -> None:
        super().__init__()
        self.objects: list[PlacedObject] = []

    def place(self, mesh: Mesh, map_from_mesh: Float64Array, level: int = 0) -> None:
        super().place(mesh, map_from_mesh, level)
        self.objects.append(PlacedObject(mesh.transform(map_from_mesh), map_from_mesh[:3, 3], False))

    def place_copies(self, thing, map_from_mesh, tint=None, follow_m=None) -> None:  # type: ignore[no-untyped-def]
        super().place_copies(thing, map_from_mesh, tint, follow_m)
        copies = getattr(thing, "mesh", thing).copies(map_from_mesh, tint)
        for copy, pose in zip(copies, map_from_mesh, strict=True):
            if follow_m is not None:
                copy.vertices[:, 2] += follow_m(copy.vertices[:, :2].astype(np.float64)).astype(np.float32)
            self.objects.append(PlacedObject(copy, pose[:3, 3], follow_m is not None))


class Town(NamedTuple):
    """A region with a record of all objects in it."""

    ground: RegionGround
    objects: Sequence[PlacedObject]
    furnishing: Furnishing

    @property
    def mesh(self) -> Mesh:
        return Mesh.merge([placed.mesh for placed in self.objects])

    def of_tag(self, tag: Tag) -> list[PlacedObject]:
        """Objects of one tag; buildings carry signs, goods and flowers of others."""
        least = any if tag is Tag.BUILDING else all
        return [placed for placed in self.objects if least((placed.mesh.tag == tag).tolist())]


@lru_cache(maxsize=1)
def blocks() -> RoadNetwork:
    return load_network(MapSpec(name="Blocks", seed=0))


def features(use: str, **changes: object) -> MapFeatures:
    return MapFeatures(SurroundingsRecipe(use=use, **{**RECIPES[use], **changes}))


def furnish(network: RoadNetwork, region: Region = HOME, season: Season = "summer") -> Town:
    ground = RegionGround.from_network(network, region, Terrain(network), season)
    recorder = Recorder()
    return Town(ground, recorder.objects, furnish_region(recorder, Claims(), ground))


@lru_cache(maxsize=8)
def town(use: str, season: Season = "summer") -> Town:
    return furnish(replace(blocks(), features=features(use)), season=season)


@lru_cache(maxsize=4)
def hills(use: str) -> Town:
    return furnish(
        replace(hilly_road(), features=replace(hilly_road().features, surroundings=features(use).surroundings))
    )


def in_plan(mesh: Mesh, chosen: BoolArray) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    polygons = shapely.polygons(mesh.vertices[mesh.triangles[chosen]].astype(np.float64)[:, :, :2])
    return np.asarray(polygons[shapely.area(polygons) > 1e-6])


def hull(vertices: np.ndarray) -> shapely.Polygon:
    return shapely.MultiPoint(vertices[:, :2].astype(np.float64)).convex_hull


def scene_bytes(scene: RegionScene) -> bytes:
    parts = [repr(scene.street_lights).encode()]
    for tile in scene.tiles:
        parts += [getattr(tile.mesh, field.name).tobytes() for field in fields(Mesh)]
    return b"".join(parts)


@pytest.mark.parametrize(
    ("use", "season"), [*((use, "summer") for use in RECIPES), ("suburb", "winter"), ("downtown", "autumn")]
)
def test_nothing_stands_on_the_road_or_in_the_middle_of_a_sidewalk(use: str, season: Season) -> None:
    built = town(use, season)
    mesh = built.mesh
    land_m = built.ground.land_m(mesh.vertices[:, :2].astype(np.float64))
    clearance_m = (mesh.vertices[:, 2] - land_m)[mesh.triangles].min(axis=1)
    low = ~np.isin(mesh.triangle_tag, UPRIGHT_TAGS) & (clearance_m < 2.0)
    road = shapely.buffer(built.ground.streets[0].road, -0.02)
    lines = [lane.centerline_m[:, :2] for lane in built.ground.network.lanes.values() if lane.kind is LaneKind.SIDEWALK]
    walks = shapely.union_all([shapely.LineString(line).buffer(0.3, cap_style="flat") for line in lines])
    for free in (road, walks):
        shapely.prepare(free)
        assert not shapely.intersects(free, in_plan(mesh, low)).any()


@pytest.mark.parametrize("use", RECIPES)
def test_buildings_stand_apart_and_nothing_passes_through_them(use: str) -> None:
    built = town(use)
    meshes = [placed.mesh for placed in built.of_tag(Tag.BUILDING)]
    buildings = np.array([hull(mesh.vertices[mesh.tag == Tag.BUILDING]) for mesh in meshes], object)  # without ivy
    assert len(buildings) > {"park": -1, "woods": -1, "farmland": 1}.get(use, 12)
    tree = shapely.STRtree(buildings)
    first, second = tree.query(buildings, predicate="intersects")
    assert (first == second).all()
    others = [placed for placed in built.objects if not (placed.mesh.tag == Tag.BUILDING).any()]
    mesh = Mesh.merge([placed.mesh for placed in others])
    inside, _ = tree.query(shapely.points(mesh.vertices[:, :2].astype(np.float64)), predicate="within")
    assert not [Tag(tag) for tag in np.unique(mesh.tag[inside])]


@pytest.mark.parametrize(
    "use",
    ["suburb", "industrial", "woods", *(pytest.param(use, marks=pytest.mark.slow) for use in HILLY_TOO)],
)
def test_all_feet_are_on_the_ground_in_hills(use: str) -> None:
    built = hills(use)
    tiles = TileBuilder()
    lay_streets(tiles, built.ground)
    lay_land(tiles, built.ground, built.furnishing.covers)
    scene = open3d.t.geometry.RaycastingScene()
    for tile in tiles.finish():
        scene.add_triangles(
            tile.mesh.vertices + tile.origin_m.astype(np.float32), tile.mesh.triangles.astype(np.uint32)
        )

    def ground_m(xy_m: Float64Array) -> Float64Array:
        rays = np.column_stack([xy_m, np.full(len(xy_m), 300.0), np.tile((0.0, 0.0, -1.0), (len(xy_m), 1))])
        return 300.0 - scene.cast_rays(rays.astype(np.float32))["t_hit"].numpy().astype(np.float64)

    feet_m = np.array(
        [p.foot_m for p in built.objects if not p.follows_land and not (p.mesh.tag == Tag.BUILDING).any()]
    )
    if len(feet_m):
        assert np.abs(feet_m[:, 2] - ground_m(feet_m[:, :2])).max() < 0.06
    for placed in built.of_tag(Tag.BUILDING):
        walls_m = placed.mesh.vertices[placed.mesh.vertices[:, 2] < placed.foot_m[2] + 0.5].astype(np.float64)
        below_m = ground_m(walls_m[:, :2])
        assert below_m.max() < placed.foot_m[2] + 0.3
        assert placed.mesh.vertices[:, 2].min() < below_m.min() - 0.1


@pytest.mark.parametrize("use", ["residential", "campus", "park"])
def test_crowns_keep_clear_of_signal_heads(use: str) -> None:
    built = town(use)
    heads_m = np.array([signal.position_m for signal in built.ground.network.signals])
    leaves_m = np.concatenate([placed.mesh.vertices for placed in built.of_tag(Tag.VEGETATION)])
    near, _ = shapely.STRtree(shapely.points(heads_m[:, :2])).query(
        shapely.points(leaves_m[:, :2].astype(np.float64)), predicate="dwithin", distance=1.9
    )
    assert len(heads_m) > 10
    assert len(near) == 0


@pytest.mark.parametrize("use", RECIPES)
def test_objects_on_land_stay_within_their_region(use: str) -> None:
    built = town(use)
    for placed in built.objects:
        if not np.isin(placed.mesh.tag, SLENDER_TAGS).any():
            low_m, high_m = placed.mesh.bounds_m[:, :2]
            assert (low_m >= 0.0).all(), Tag(placed.mesh.tag[0])
            assert (high_m <= REGION_M).all(), Tag(placed.mesh.tag[0])


@pytest.mark.parametrize("use", RECIPES)
def test_covers_fill_the_land_and_overlap_nowhere(use: str) -> None:
    built = town(use)
    covers = [cover.area for cover in built.furnishing.covers if cover.rise_m == 0.0]
    land = built.ground.land
    assert sum(cover.area for cover in covers) == pytest.approx(land.area, rel=1e-4)
    assert shapely.union_all(covers).symmetric_difference(land).area < 1e-4 * land.area


@pytest.mark.slow
def test_a_region_does_not_depend_on_regions_built_before() -> None:
    network = replace(blocks(), features=features("residential"))
    terrain = Terrain(network)
    alone = scene_bytes(build_region(network, HOME, terrain))
    build_region(network, Region(-1, 0), terrain)
    assert scene_bytes(build_region(network, HOME, terrain)) == alone
    other = replace(network, seed=network.seed + 1)
    assert scene_bytes(build_region(other, HOME, Terrain(other))) != alone


def test_all_tags_of_surroundings_are_used() -> None:
    used = set(np.concatenate([np.unique(town(use).mesh.tag) for use in RECIPES]).tolist())
    standing = {Tag.BUILDING, Tag.WALL, Tag.FENCE, Tag.POLE, Tag.TRAFFIC_LIGHT, Tag.VEGETATION}
    assert standing | {Tag.STATIC, Tag.DYNAMIC, Tag.OTHER, Tag.WATER, Tag.TERRAIN} <= {Tag(tag) for tag in used}
    covers = {cover.finish.tag for use in RECIPES for cover in town(use).furnishing.covers}
    assert covers == {Tag.TERRAIN, Tag.GROUND}


@pytest.mark.parametrize("use", RECIPES)
def test_a_region_stays_within_its_budget(use: str) -> None:
    assert len(town(use).mesh.triangles) < BUDGET.get(use, 400_000)


@pytest.mark.parametrize("use", ["residential", "woods"])
def test_lamps_carry_the_row_of_their_signal_and_face_their_traffic(use: str) -> None:
    built, mesh = town(use), town(use).mesh
    lamps = (Material.SIGNAL_RED, Material.SIGNAL_YELLOW, Material.SIGNAL_GREEN)
    seen = 0
    for row, signal in enumerate(built.ground.network.signals):
        own = [(mesh.material == lamp) & (mesh.uv[:, 0] == row) for lamp in lamps]
        assert own[0].any() == bool(built.ground.owns(signal.pole_m[None, :2])[0])
        if not own[0].any():
            continue
        seen += 1
        heights_m = [mesh.vertices[mask, 2].mean() for mask in own]
        assert heights_m[0] > heights_m[1] > heights_m[2]
        facing = np.array([np.cos(signal.yaw_rad), np.sin(signal.yaw_rad), 0.0])
        assert 0.05 < (mesh.vertices[own[1]].mean(axis=0) - signal.position_m) @ facing < 0.2
        assert (mesh.normals[own[1]] @ facing).max() > 0.99
    assert seen > 5


def test_street_lamps_carry_the_index_of_their_light() -> None:
    built, mesh = town("residential"), town("residential").mesh
    lights = built.furnishing.street_lights
    assert len(lights) > 20
    for index, light in enumerate(lights):
        own = (mesh.material == Material.STREET_LAMP) & (mesh.uv[:, 0] == index)
        assert np.linalg.norm(mesh.vertices[own].mean(axis=0) - light.position_m) < 0.1


def test_lights_of_a_bridge_stand_on_its_deck_and_those_below_on_the_land() -> None:
    road = crossing()
    surroundings = features("residential", street_light_spacing_m=25, building_density=0).surroundings
    built = furnish(replace(road, features=replace(road.features, surroundings=surroundings)))
    ground, elevation = built.ground, built.ground.terrain.elevation
    feet_m = np.array(
        [placed.foot_m for placed in built.objects if (placed.mesh.material == Material.STREET_LAMP).any()]
    )
    up = np.asarray(shapely.dwithin(ground.decks[1], shapely.points(feet_m[:, :2]), 0.01))
    assert up.sum() >= 2
    assert (~up).sum() > 3
    np.testing.assert_allclose(feet_m[up, 2], elevation.height_m(feet_m[up, :2], 1), atol=1e-6)
    np.testing.assert_allclose(feet_m[~up, 2], ground.sidewalk_m(feet_m[~up, :2]), atol=0.05)


def test_a_recipe_without_lights_and_trees_has_none() -> None:
    bare = furnish(replace(blocks(), features=features("residential", street_light_spacing_m=0, plant_density=0)))
    assert bare.furnishing.street_lights == ()
    assert not [placed for placed in bare.of_tag(Tag.VEGETATION) if placed.mesh.bounds_m[1, 2] > 2.5]


def test_signs_of_the_map_stand_where_it_says_and_look_at_their_traffic() -> None:
    place_m, yaw_rad = np.array([100.0, 80.0, 0.0]), 0.7
    signs = tuple(
        Sign(kind, place_m + np.array([4.0 * k, 0.0, 0.0]), yaw_rad, (), speed_mps=30 / 3.6)
        for k, kind in enumerate(SignKind)
    )
    network = blocks()
    network = replace(network, features=features("farmland"), layout=replace(network.layout, signs=signs))
    built = furnish(network)
    for sign in signs:
        own = next(placed for placed in built.objects if np.allclose(placed.foot_m, sign.foot_m))
        plate = own.mesh.material == Material.PLATE
        facing = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        assert (own.mesh.normals[plate] @ facing).max() > 0.99
        assert ((own.mesh.vertices[plate] - sign.foot_m) @ facing).min() > 0.0
        assert own.mesh.vertices[plate, 2].min() > 1.8


def test_prescribed_buildings_are_built_once_and_no_others() -> None:
    outlines = [
        shapely.box(95, 60, 125, 80).difference(shapely.box(105, 66, 112, 74)),
        shapely.box(-12, 60, 12, 75),  # across the border of two regions
    ]
    prescribed = tuple(Footprint(outline, height_m) for outline, height_m in zip(outlines, (21.0, 9.0), strict=True))
    network = replace(blocks(), features=replace(features("residential"), buildings=prescribed))
    found = [
        hull(placed.mesh.vertices)
        for region in (HOME, Region(-1, 0))
        for placed in furnish(network, region).of_tag(Tag.BUILDING)
    ]
    assert len(found) == 2
    for outline in outlines:
        own = max(found, key=lambda plan: plan.intersection(outline).area)
        assert own.symmetric_difference(outline.convex_hull).area < 0.12 * outline.convex_hull.area


def test_where_zones_overlap_the_last_one_applies() -> None:
    wood, square = features("woods").surroundings, shapely.box(60, 60, 160, 160)
    zones = (Zone(shapely.box(0, 0, 200, 200), wood), Zone(square, features("park").surroundings))
    built = furnish(replace(blocks(), features=replace(features("farmland"), zones=zones)))
    forest = [
        cover.area for cover in built.furnishing.covers if cover.finish.material is Material.SOIL and cover.rise_m == 0
    ]
    assert shapely.union_all(forest).intersection(square).area < 1.0
    expected = built.ground.land.intersection(zones[0].area).difference(square)
    assert shapely.union_all(forest).symmetric_difference(expected).area < 0.01 * expected.area
