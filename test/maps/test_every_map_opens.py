"""Every map at hand opens, and what stands around its busiest position is built without covering the roads.

The maps are SUMO's own nets and, where they are there, maps of strangers.
"""

from pathlib import Path

import numpy as np
import open3d
import pytest
import sumo

from simbev_ros.assets.regions.build import build_region
from simbev_ros.assets.regions.region_scene import RegionScene
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.statistics import busiest_position

_SUMO = Path(sumo.__file__).parent
_SHARED = Path(__file__).parents[2].parent / "shared" / "maps"
_FOREIGN = [path for folder in ("foreign", "carla") for path in sorted((_SHARED / folder).glob("*.*"))]
_NOT_MAPS = (".md", ".txt")
_REFUSED = {
    "game/rail/net.net.xml": "has no lanes that cars may drive on",
    "game/rail_demo/net.net.xml": "has no lanes that cars may drive on",
}
"""End of the path → the reason why a map is refused."""
_LEAST_FREE = {"foreign/reversed.xodr": 0.7}  # x and y are exchanged: its lanes have 153 gaps
"""End of the path → the share of lanes that must be free, if it is not nearly all."""
_ABOVE_M = 0.4

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::RuntimeWarning")]


def _named(paths: list[Path], base: Path) -> list[object]:
    """Parameters with paths as their names; if there are none, one that is skipped."""
    found = [pytest.param(path, id=str(path.relative_to(base))) for path in paths if path.suffix not in _NOT_MAPS]
    return found or [pytest.param(base, marks=pytest.mark.skip(f"there is nothing in {base}"))]


@pytest.mark.parametrize(
    "path", [*_named(sorted(_SUMO.rglob("*.net.xml*")), _SUMO / "tools"), *_named(_FOREIGN, _SHARED)]
)
def test_the_map_opens_and_its_roads_are_free(path: Path, tmp_path: Path) -> None:
    reason = next((reason for end, reason in _REFUSED.items() if str(path).endswith(end)), "")
    if reason:
        with pytest.raises(InputError, match=reason) as refused:
            load_network(map_spec(str(path)), tmp_path)
        assert "\n" not in str(refused.value)
        return
    network = load_network(map_spec(str(path)), tmp_path)
    assert network.lanes_of(LaneKind.DRIVING)
    region = Region(*np.floor(busiest_position(network) / REGION_M).astype(int).tolist())
    terrain = Terrain(network)
    scene = build_region(network, region, terrain)
    least = next((share for end, share in _LEAST_FREE.items() if str(path).endswith(end)), 0.99)
    assert free_share(network, region, terrain, scene) > least


def free_share(network: RoadNetwork, region: Region, terrain: Terrain, scene: RegionScene) -> float:
    """Share of the points midway on the segments of lanes in a region where a ray from above meets the road first."""
    rays = []
    for strip in network.layout.strips_of(LaneKind.DRIVING):
        middle_m = (strip.center_m[1:, :2] + strip.center_m[:-1, :2]) / 2.0
        middle_m = middle_m[(np.floor(middle_m / REGION_M) == region).all(axis=1)]
        height_m = terrain.elevation.height_m(middle_m, strip.level)
        down = np.broadcast_to((0.0, 0.0, -1.0), (len(height_m), 3))
        rays.append(np.column_stack([middle_m, height_m + _ABOVE_M, down]))
    caster, tags = open3d.t.geometry.RaycastingScene(), []
    for tile in scene.tiles:
        vertices_m = (tile.mesh.vertices + tile.origin_m).astype(np.float32)
        caster.add_triangles(vertices_m, tile.mesh.triangles.astype(np.uint32))
        tags.append(tile.mesh.triangle_tag)
    hits = caster.cast_rays(np.concatenate(rays).astype(np.float32))
    mesh, triangle = hits["geometry_ids"].numpy(), hits["primitive_ids"].numpy()
    starts = np.cumsum([0, *(len(each) for each in tags)])
    hit = np.isfinite(hits["t_hit"].numpy())
    found = np.concatenate(tags)[starts[np.where(hit, mesh, 0)] + np.where(hit, triangle, 0)]
    return float(np.mean(hit & np.isin(found, (Tag.ROAD, Tag.ROAD_LINE))))
