"""A viaduct above a bridge above a street: the viaduct's level changes in mid-air without any change of its surface."""

from itertools import product

import numpy as np
import pytest
import shapely
from analytic_maps import ground_tiles, merged, stack

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Region
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.level_members import LevelGraph

MIDDLE_M = 256.0
TOPS_M = {"viaduct": 12.0, "bridge": 6.0, "street": 0.0}
UNDERSIDE_M = 12.0 - 1.1


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return stack()


@pytest.fixture(scope="module")
def ground(network: RoadNetwork) -> Mesh:
    return merged(ground_tiles(RegionGround.from_network(network, Region(0, 0), Terrain(network))))


def stretches(network: RoadNetwork, lane: str) -> list[Strip]:
    return [strip for strip in network.layout.strips if strip.lane == lane]


def seams_m(network: RoadNetwork) -> list[float]:
    """Values of x at which the viaduct's level changes."""
    return [float(strip.center_m[-1, 0]) for strip in stretches(network, "viaduct.1")[:-1]]


def heights_m(mesh: Mesh, tag: Tag, xy_m: Float64Array) -> list[Float64Array]:
    """Heights of all surfaces with a tag at each of (N, 2) points, in ascending order."""
    corners_m = mesh.vertices[mesh.triangles[mesh.triangle_tag == tag]].astype(np.float64)
    flat = shapely.polygons(corners_m[:, :, :2])
    corners_m, flat = corners_m[shapely.area(flat) > 1e-6], flat[shapely.area(flat) > 1e-6]
    place, triangle = shapely.STRtree(flat).query(shapely.points(xy_m), predicate="intersects")
    edges_m = corners_m[triangle, 1:] - corners_m[triangle, :1]
    normal = np.cross(edges_m[:, 0], edges_m[:, 1])
    step_m = xy_m[place] - corners_m[triangle, 0, :2]
    z_m = corners_m[triangle, 0, 2] - np.sum(normal[:, :2] * step_m, axis=1) / normal[:, 2]
    return [np.sort(z_m[place == number]) for number in range(len(xy_m))]


def test_levels_count_the_layers_beneath(network: RoadNetwork) -> None:
    levels = {lane: [s.level for s in stretches(network, f"{lane}.1")] for lane in TOPS_M}
    assert levels == {"viaduct": [1, 2, 1], "bridge": [0, 1, 0], "street": [0]}


def test_the_deck_has_no_gap_and_one_height_where_its_level_changes(network: RoadNetwork, ground: Mesh) -> None:
    for seam_m, lane_m in product(seams_m(network), (-3.4, 3.4)):
        x = np.arange(seam_m - 8.0, seam_m + 8.0, 0.13)
        xy_m = np.column_stack([x, np.full(len(x), MIDDLE_M + lane_m)])
        tops_m = np.array([found_m[-1] for found_m in heights_m(ground, Tag.ROAD, xy_m)])
        assert tops_m == pytest.approx(12.0, abs=0.02)
        under_m = [found_m[(found_m > 8.0) & (found_m < 12.0)] for found_m in heights_m(ground, Tag.BRIDGE, xy_m)]
        assert np.array([found_m.min() for found_m in under_m]) == pytest.approx(UNDERSIDE_M, abs=0.02)
        for level in (1, 2):
            assert network.elevation.height_m(np.array([[seam_m, MIDDLE_M + lane_m]]), level) == pytest.approx(
                12.0, abs=0.01
            )


def test_abutments_stand_where_structures_meet_the_ground_only(network: RoadNetwork, ground: Mesh) -> None:
    triangles = ground.triangles[ground.triangle_tag == Tag.WALL]
    triangles = triangles[ground.material[triangles[:, 0]] == Material.CONCRETE]  # slopes are of stone
    upright_m = ground.vertices[triangles].astype(np.float64).mean(axis=1)
    assert len(upright_m)
    assert (np.abs(upright_m[:, 0] - MIDDLE_M) < 8.0).all(), "below the bridge along y, not below the viaduct"
    landings_m = [strip.center_m[-1, 1] for strip in stretches(network, "bridge.1")[:-1]]
    assert np.abs(upright_m[:, 1, None] - landings_m).min(axis=1).max() < 4.0


@pytest.mark.parametrize("own", TOPS_M)
def test_of_three_roads_only_the_egos_belongs(network: RoadNetwork, own: str) -> None:
    graph = LevelGraph(network.layout)
    places_m = {road: np.array([[MIDDLE_M, MIDDLE_M, top_m]]) for road, top_m in TOPS_M.items()}
    members = graph.members(places_m[own][0])
    assert members is not None
    assert {road for road, place_m in places_m.items() if members.holds(place_m).all()} == {own}
