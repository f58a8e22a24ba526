"""Small signs can be read from the side that they face, face their traffic, and stand where nobody drives or walks."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import shapely

from simbev_ros.assets.land.furnish import furnish_region
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.street.barriers import PANEL_M, panel
from simbev_ros.assets.street.lettering import text_mesh, text_width_m
from simbev_ros.assets.street.sign_faces import VARIANTS, board, plate, sign_post, sign_table
from simbev_ros.assets.street.small_things import small_thing
from simbev_ros.foundation.semantics import SIGN_TYPES, Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.region import Region
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.schema.scene.map_spec import MapSpec

INK = Finish(Material.PLATE, Tag.TRAFFIC_SIGN, (0, 0, 0))


class Copies(TileBuilder):
    """Tile builder that remembers the copies of each mesh."""

    def __init__(self) -> None:
        super().__init__()
        self.copies: list[tuple[Mesh | GradedMesh, Float64Array]] = []

    def place_copies(self, thing, map_from_mesh, tint=None, follow_m=None) -> None:  # type: ignore[no-untyped-def]
        super().place_copies(thing, map_from_mesh, tint, follow_m)
        self.copies.append((thing, map_from_mesh))

    def poses_of(self, things: set[int]) -> Float64Array:
        """(N, 4, 4) poses of all copies of meshes with these ids."""
        return np.concatenate([np.empty((0, 4, 4)), *(poses for thing, poses in self.copies if id(thing) in things)])


@lru_cache(maxsize=3)
def furnished(use: str, fence_density: float = 0.5, furniture_density: float = 0.5) -> tuple[RegionGround, Copies]:
    recipe = SurroundingsRecipe(use=use, fence_density=fence_density, furniture_density=furniture_density)
    network = replace(load_network(MapSpec(name="Blocks", seed=0)), features=MapFeatures(recipe))
    ground, tiles = RegionGround.from_network(network, Region(0, 0), Terrain(network)), Copies()
    furnish_region(tiles, Claims(), ground)
    return ground, tiles


def all_posts(use: str) -> set[int]:
    entry = sign_table()["posts"][use]
    rows = [*entry["choices"], *entry["us"]]
    return {id(sign_post(tuple(row[1:]), variant)) for row in rows for variant in range(VARIANTS)}


def test_an_l_has_its_foot_on_the_readers_right_and_lies_in_front_of_the_plate() -> None:
    letter = text_mesh(INK, "L", 0.6, x_m=0.02)
    low = letter.vertices[letter.vertices[:, 2] < -0.2]
    high = letter.vertices[letter.vertices[:, 2] > 0.2]
    assert low[:, 1].max() > 0.15
    assert high[:, 1].max() < -0.1
    assert (letter.vertices[:, 0] == np.float32(0.02)).all()
    a, b, c = np.moveaxis(letter.vertices[letter.triangles], 1, 0)
    assert (np.cross(b - a, c - a)[:, 0] > 0.0).all()


def test_a_text_that_is_too_wide_becomes_narrower() -> None:
    assert text_width_m("STATION ROAD", 0.1) > 0.8
    mesh = text_mesh(INK, "STATION ROAD", 0.1, max_width_m=0.8)
    assert np.ptp(mesh.vertices[:, 1]) == pytest.approx(0.8, abs=0.03)
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(0.1, abs=0.03)


@pytest.mark.parametrize("name", sign_table()["faces"])
def test_marks_lie_on_their_plate(name: str) -> None:
    width_m, height_m = sign_table()["faces"][name]["size_m"]
    sign = plate(name, 3)
    low_m, high_m = sign.mesh.bounds_m
    assert high_m[1] - low_m[1] <= width_m + 0.02
    assert high_m[2] - low_m[2] <= 1.03 * height_m + 0.02
    assert set(sign.mesh.tag) == set(sign.coarse.tag) == {Tag.TRAFFIC_SIGN}
    assert (sign.mesh.normals[:, 0] < 0.0).any()
    assert (sign.mesh.normals[:, 0] > 0.0).any()


def test_no_plate_is_of_a_kind_that_has_boxes() -> None:
    assert not set(SIGN_TYPES) & set(sign_table()["faces"])


def test_plates_on_posts_are_above_the_heads_of_pedestrians() -> None:
    mesh = sign_post(("no_parking", "hours")).mesh
    assert mesh.vertices[mesh.tag == Tag.TRAFFIC_SIGN, 2].min() > 2.15
    twin_m = np.unique(np.round(board("directions").mesh.vertices[board("directions").mesh.tag == Tag.POLE, 1], 2))
    assert len(twin_m) == 4


@pytest.mark.parametrize("use", ["residential", "downtown"])
def test_posts_face_the_traffic_of_the_nearest_lane(use: str) -> None:
    ground, tiles = furnished(use)
    poses = tiles.poses_of(all_posts(use))
    assert len(poses) > 40
    lanes = [lane for lane in ground.network.lanes_of(LaneKind.DRIVING) if not lane.junction]
    lines = [shapely.LineString(lane.centerline_m[:, :2]) for lane in lanes]
    facing = []
    for pose in poses:
        point = shapely.Point(pose[:2, 3])
        line = min(lines, key=point.distance)
        s_m = line.project(point)
        ends_m = [np.array(line.interpolate(s).coords[0]) for s in (max(s_m - 1.0, 0.0), s_m + 1.0)]
        along = (ends_m[1] - ends_m[0]) / np.hypot(*(ends_m[1] - ends_m[0]))
        facing.append(-along @ pose[:2, 0])
    assert np.mean(np.array(facing) > 0.8) > 0.95


def test_a_recipe_without_fences_and_furniture_has_no_barriers_and_no_small_things() -> None:
    kinds = ("railing", "high_wall", "low_wall", "mesh", "boards", "picket")
    barriers = {id(panel(kind, variant)) for kind in kinds for variant in range(3)}
    things = {id(small_thing(name)) for name in ("bollard", "bins", "phone_box", "meter")}
    _, plain = furnished("residential")
    _, bare = furnished("residential", 0.0, 0.0)
    assert len(plain.poses_of(barriers)) > 50
    assert len(plain.poses_of(things)) > 20
    assert len(bare.poses_of(barriers)) == len(bare.poses_of(things)) == 0


def test_guard_rails_stand_between_sidewalk_and_road_beside_crosswalks() -> None:
    ground, tiles = furnished("residential")
    poses = tiles.poses_of({id(panel("guard", variant)) for variant in range(3)})
    assert len(poses) > 10
    ends_m = poses[:, :2, 3] + PANEL_M["guard"] * poses[:, :2, 0]
    rails = shapely.linestrings(np.stack([poses[:, :2, 3], ends_m], axis=1))
    streets = ground.streets[0]
    assert shapely.dwithin(streets.crosswalk, rails, 28.0).all()
    assert not shapely.intersects(streets.crosswalk, rails).any()
    assert not shapely.intersects(streets.road, rails).any()
    assert (shapely.distance(streets.road, rails) < 0.8).all()
