"""Points on the surfaces of maps, read by Open3D: they are on the meshes, in the frame of the Lanelet2 file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import open3d
import pytest

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.export.maps.conversion import write_map
from simbev_ros.export.maps.lanelet2_file import autoware_rise_m
from simbev_ros.export.maps.point_map import DENSITY_PM2, REACH_M, point_map_of, scanners_on
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.lanelet2.projector_info import datum_of_file
from simbev_ros.maps.region import Reach
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec

CORNERS_M = np.array([[[0, 0, 0], [30, 0, 3], [0, 20, 0]], [[0, 0, 9], [0.1, 0, 9], [0, 0.1, 9]]], np.float64)
"""A large triangle that rises along x, and one with an area of 0.005 m²."""
ORIGIN_M = np.array([1000.0, -2000.0, 50.0])
SCANNER_M = np.array([[1010.0, -1995.0, 70.0]])


def tile(corners_m: Float64Array = CORNERS_M) -> Tile:
    mesh = Mesh.flat(corners_m, material=Material.ASPHALT, tag=Tag.ROAD, color=(90, 90, 90))
    return Tile(ORIGIN_M, mesh, {})


def read(path: Path) -> Float64Array:
    return np.asarray(open3d.io.read_point_cloud(str(path)).points)


def test_points_lie_on_the_triangles_with_the_same_density_everywhere(tmp_path: Path) -> None:
    path = tmp_path / "pointcloud_map.pcd"
    path.write_bytes(b"".join(point_map_of([[tile()] * 100], SCANNER_M, rise_m=7.0)))
    x, y, z = (read(path) - ORIGIN_M - [0.0, 0.0, 7.0]).T
    is_small = z > 8.0
    assert np.allclose(z[~is_small], x[~is_small] / 10.0, atol=1e-3)
    assert (x > -1e-3).all() and (y > -1e-3).all() and (x[~is_small] / 30.0 + y[~is_small] / 20.0 < 1.0 + 1e-4).all()
    area_m2 = 300.0 * np.hypot(1.0, 0.1)
    assert np.sum(~is_small) == pytest.approx(100 * area_m2 * DENSITY_PM2, rel=0.001)
    half = np.sum(x[~is_small] / 30.0 + y[~is_small] / 20.0 < np.sqrt(0.5))  # half of the area
    assert half == pytest.approx(0.5 * np.sum(~is_small), rel=0.02)
    assert 3 < np.sum(is_small) < 30  # 12 are expected of 0.5 m² together: small triangles are not passed over


def test_the_same_map_gives_the_same_bytes() -> None:
    first, second = (b"".join(point_map_of([[tile()]], SCANNER_M)) for _ in range(2))
    assert first == second


def test_what_no_scanner_sees_has_no_points(tmp_path: Path) -> None:
    triangle_m = np.array([[0, 0, 0], [30, 0, 0], [0, 20, 0]], np.float64)
    below_m, far_m = triangle_m - [0.0, 0.0, 0.3], triangle_m + np.array([0.0, REACH_M + 30.0, 0.0])
    path = tmp_path / "pointcloud_map.pcd"
    path.write_bytes(b"".join(point_map_of([[tile(np.stack([triangle_m, below_m, far_m]))]], SCANNER_M)))
    x, y, z = (read(path) - ORIGIN_M).T
    assert np.abs(z).max() < 1e-3 and y.max() < 20.001
    assert len(x) == pytest.approx(300.0 * DENSITY_PM2, rel=0.02)


def test_a_scanner_looks_from_every_eight_meters_of_a_lane() -> None:
    scanners_m = scanners_on([np.array([[0.0, 0.0, 5.0], [100.0, 0.0, 5.0]])] * 2)
    assert np.array_equal(scanners_m, [[8.0 * step, 0.0, 7.0] for step in range(13)])


def test_heights_begin_where_those_of_autoware_do() -> None:
    local, utm = MapDatum(48.1, 11.5, 500.0), "+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs"
    assert autoware_rise_m(local) == 0.0
    assert autoware_rise_m(replace(local, projection=utm, false_easting_m=691_000.25)) == 500.0


@pytest.mark.slow
def test_roads_of_the_lanelet2_file_are_in_the_cloud_beside_it(tmp_path: Path) -> None:
    spec = map_spec("Blocks")
    network = load_network(spec)
    lanes = network.layout.strips_of(LaneKind.DRIVING)
    middle_m = np.mean(np.concatenate([lane.left_m for lane in lanes]), axis=0)
    tiles = load_static_scene(spec, network, reach=Reach((float(middle_m[0]), float(middle_m[1])), 30.0)).tiles
    for name in ("lanelet2_map.osm", "pointcloud_map.pcd"):
        write_map(network, tmp_path / name, [tiles])
    datum = datum_of_file(tmp_path / "lanelet2_map.osm")
    assert datum is not None
    cloud = open3d.t.geometry.PointCloud(read(tmp_path / "pointcloud_map.pcd").astype(np.float32))
    bounds_m = np.concatenate([lane.left_m for lane in lanes])
    bounds_m = bounds_m[np.abs(bounds_m[:, :2] - middle_m[:2]).max(axis=1) < 25.0]
    there_m = [datum.map_from_geodetic(*network.datum.geodetic_from_map(each)) for each in bounds_m]
    search = open3d.core.nns.NearestNeighborSearch(cloud.point.positions)
    search.knn_index()
    _, squared_m2 = search.knn_search(open3d.core.Tensor(np.array(there_m, np.float32)), 1)
    assert len(bounds_m) > 20 and np.sqrt(squared_m2.numpy().max()) < 1.0
