"""The surfaces of a map as a cloud of points, ``pointcloud_map.pcd``, on which Autoware's localization runs."""

from collections.abc import Iterable

import numpy as np

from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float32Array

DENSITY_PM2 = 4.0
"""Points per square meter: Autoware's ndt_scan_matcher takes cells of 2 m, and needs at least 6 points in each."""


def point_map_of(tiles: Iterable[Tile], rise_m: float = 0.0) -> list[bytes]:
    """The pieces of a binary PCD file with x, y and z as float32, in meters; the same bytes for the same map.

    Points are drawn on all that rays hit, with the same density everywhere: roads, land, buildings, plants and
    furniture, also on sides that no vehicle sees.

    Args:
        tiles: The tiles of the map.
        rise_m: Height of the map frame's origin in the frame of the file, which has the same x and y.

    Returns:
        The header, and then the points of each tile.
    """
    origin_m = np.array([0.0, 0.0, rise_m])
    clouds = [(points_on(tile, row) + tile.origin_m + origin_m).astype("<f4") for row, tile in enumerate(tiles)]
    count = sum(map(len, clouds))
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    )
    return [header.encode(), *(cloud.tobytes() for cloud in clouds)]


def points_on(tile: Tile, number: int) -> Float32Array:
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
