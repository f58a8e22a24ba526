"""Finds shop fronts in the meshes, for the light that falls from display windows onto the pavement.

Static tiles enter, ``FRONT_DTYPE`` rows leave; ``lamp_field`` draws their light.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.types import Table

FRONT_DTYPE = np.dtype(
    [
        ("at_m", "<f8", 3),  # map frame: center of the front, on the ground
        ("facing", "<f4", 2),  # unit vector, outward
        ("half_m", "<f4"),  # half its width
    ]
)
"""One row per front."""

_MAX_EDGE_SLOPE_M = 0.05
_MIN_WIDTH_M = 1.0


def find_shop_fronts(tiles: Sequence[Tile]) -> Table:
    """(N,) ``FRONT_DTYPE``: the foot of every wall that is a shop front."""
    return np.concatenate([np.zeros(0, FRONT_DTYPE), *(_tile_fronts(tile) for tile in tiles)])


def _tile_fronts(tile: Tile) -> Table:
    """Fronts of a tile. A wall is a rectangle of two triangles; the one with two corners below represents it."""
    mesh = tile.mesh
    triangles = mesh.triangles[mesh.material[mesh.triangles[:, 0]] == Material.SHOPFRONT]
    height_m = mesh.vertices[triangles][:, :, 2]
    low = height_m - height_m.min(axis=1, keepdims=True) < _MAX_EDGE_SLOPE_M
    triangles, low = triangles[low.sum(axis=1) == 2], low[low.sum(axis=1) == 2]
    feet_m = mesh.vertices[triangles[low].reshape(-1, 2)].astype(np.float64) + tile.origin_m
    fronts = np.zeros(len(feet_m), FRONT_DTYPE)
    fronts["at_m"] = feet_m.mean(axis=1)
    fronts["half_m"] = np.linalg.norm(feet_m[:, 1, :2] - feet_m[:, 0, :2], axis=1) / 2.0
    normal = mesh.normals[triangles[:, 0], :2]
    length = np.linalg.norm(normal, axis=1)
    fronts["facing"] = normal / np.maximum(length, 1e-6)[:, None]
    return fronts[(fronts["half_m"] > _MIN_WIDTH_M / 2.0) & (length > 0.5)]
