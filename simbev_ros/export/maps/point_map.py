"""The surfaces of a map as a cloud of points, ``pointcloud_map.pcd``, on which Autoware's localization runs."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float32Array, Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.plan.lines import length_m, points_at
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.simulation.raycast.embree import TriangleSet, relative_rays

DENSITY_PM2 = 25.0
"""Points per square meter: those that voxels of 0.2 m leave of a scan."""

REACH_M = 80.0
"""Greatest distance of a point from the scanner that sees it."""

_SCANNER_M = np.array([0.0, 0.0, 2.0])
_SPACING_M = 8.0
_LOOKS = 3
_TOLERANCE_M = 0.05


def scanners_on(lines_m: Iterable[Float64Array]) -> Float64Array:
    """(S, 3) positions of the scanner of a vehicle that drives along (N, 3) lines on the ground, one in each 8 m."""
    steps_m = [points_at(line_m, np.arange(0.0, length_m(line_m) + 1e-6, _SPACING_M)) for line_m in lines_m]
    places_m = np.concatenate(steps_m)
    _, first = np.unique(np.floor(places_m / _SPACING_M), axis=0, return_index=True)
    return np.asarray(places_m[first] + _SCANNER_M, np.float64)


def scanners_of(network: RoadNetwork) -> Float64Array:
    """(S, 3) positions of the scanner of a vehicle that drives along all lanes of a map."""
    return scanners_on((lane.left_m + lane.right_m) / 2.0 for lane in network.layout.strips_of(LaneKind.DRIVING))


def point_map_of(regions: Iterable[Sequence[Tile]], scanners_m: Float64Array, rise_m: float = 0.0) -> list[bytes]:
    """The pieces of a binary PCD file with x, y and z as float32, in meters; the same bytes for the same map.

    Points are drawn with the same density on all surfaces within 80 m of a scanner that one of the nearest three sees,
    so backs of buildings, and layers below the ground, have none. Vehicles and pedestrians are absent.

    Args:
        regions: The tiles of each region of the map; those of others do not hide points.
        scanners_m: (S, 3) positions of the scanners, map frame.
        rise_m: Height of the map frame's origin in the frame of the file, which has the same x and y.

    Returns:
        The header, and then the points of each tile.
    """
    origin_m = np.array([0.0, 0.0, rise_m])
    clouds = [(points_m + origin_m).astype("<f4") for tiles in regions for points_m in _seen(tiles, scanners_m)]
    count = sum(map(len, clouds))
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    )
    return [header.encode(), *(cloud.tobytes() for cloud in clouds)]


def _seen(tiles: Sequence[Tile], scanners_m: Float64Array) -> Iterator[Float64Array]:
    """(N, 3) points on each tile near a scanner that are seen, map frame."""
    nearest = cKDTree(scanners_m)

    def is_near(tile: Tile) -> bool:
        low_m, high_m = tile.mesh.bounds_m + tile.origin_m
        return bool(nearest.query((low_m + high_m) / 2.0)[0] < REACH_M + np.linalg.norm(high_m - low_m) / 2.0)

    if not (near := list(filter(is_near, tiles))):
        return
    center_m = near[0].origin_m
    first = np.cumsum([0, *(len(tile.mesh.vertices) for tile in near)])
    surfaces = TriangleSet(
        np.concatenate([tile.mesh.vertices + (tile.origin_m - center_m) for tile in near]).astype(np.float32),
        np.concatenate([tile.mesh.triangles + row for tile, row in zip(near, first, strict=False)]).astype(np.int32),
    )
    for number, tile in enumerate(near):
        points_m = _points_on(tile, number) + tile.origin_m
        range_m, scanner = nearest.query(points_m, np.arange(1, _LOOKS + 1), distance_upper_bound=REACH_M)
        is_seen = np.zeros(len(points_m), bool)
        for look in range(_LOOKS):
            rows = np.flatnonzero(~is_seen & np.isfinite(range_m[:, look]))
            from_m = scanners_m[scanner[rows, look]]
            directions = ((points_m[rows] - from_m) / range_m[rows, look, None]).astype(np.float32)
            hits = surfaces.cast(relative_rays(from_m, center_m, directions))
            is_seen[rows] = hits.range_m > range_m[rows, look] - _TOLERANCE_M
        yield points_m[is_seen]


def _points_on(tile: Tile, number: int) -> Float32Array:
    """(N, 3) random points on the mesh of the tile with a number, in meters from the tile's origin."""
    rng = stream(number, "map.points")
    corners_m = tile.mesh.vertices[tile.mesh.triangles]
    edges_m = corners_m[:, 1:] - corners_m[:, :1]
    area_m2 = np.linalg.norm(np.cross(edges_m[:, 0], edges_m[:, 1]), axis=1) / 2.0
    counts = np.floor(area_m2 * DENSITY_PM2 + rng.random(len(area_m2))).astype(np.int64)
    rows = np.repeat(np.arange(len(counts)), counts)
    share = rng.random((2, len(rows)), np.float32)
    share = np.where(share.sum(axis=0) > 1.0, 1.0 - share, share)  # of the parallelogram, the half that is the triangle
    return corners_m[rows, 0] + share[0, :, None] * edges_m[rows, 0] + share[1, :, None] * edges_m[rows, 1]
