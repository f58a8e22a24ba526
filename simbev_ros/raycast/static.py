"""Rays against the static tiles around a place."""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.raycast.embree import TriangleSet
from simbev_ros.types import Float64Array, Int64Array, UInt8Array

_CELL_M = 128.0
"""The place is known only to the cell of this size that it lies in, so that a rebuild is rare and leaves no trace."""

_KEPT = 3
"""So many cells' triangles are kept: who drives along a border, or comes back, needs no rebuild."""

_Key = tuple[int, int, int, float]
"""Column, row and storey of a cell, and how far from it triangles are wanted."""


@dataclass(frozen=True, slots=True)
class Near:
    """What can be hit from a cell.

    Attributes:
        origin_m: (3,) point of the map frame that the triangles are relative to.
        tag: (T + 1,) semantic tag per triangle, and 0 for triangle -1, which is none.
        material: (T + 1,) material, in the same way.
        triangles: The triangles for Embree.
    """

    origin_m: Float64Array
    tag: UInt8Array
    material: UInt8Array
    triangles: TriangleSet


class StaticTriangles:
    """The tiles within reach, all of which, and their order, depends on the place alone, not on how it was reached."""

    def __init__(self, static: StaticScene) -> None:
        self._tiles = static.tiles
        self._bounds_m = np.array([_bounds_m(tile) for tile in static.tiles]).reshape(-1, 2, 2)
        self._near: dict[_Key, Near] = {}

    def around(self, center_m: Float64Array, radius_m: float) -> Near:
        """All tiles within ``radius_m`` of (3,) ``center_m``, map frame, and of the rest of its cell; kept or built."""
        column, row, storey = _cell(center_m).tolist()
        key = column, row, storey, radius_m
        near = self._near.pop(key, None) or self._build(center_m, radius_m)
        self._near[key] = near  # last: dictionaries keep their order
        for old in list(self._near)[:-_KEPT]:
            del self._near[old]
        return near

    def mesh_around(self, center_m: Float64Array, radius_m: float) -> tuple[Mesh, Float64Array]:
        """The tiles of ``around`` as one mesh, and the (3,) point of the map frame that it is relative to."""
        cell = _cell(center_m)
        low = cell[:2] * _CELL_M - radius_m
        high = low + _CELL_M + 2.0 * radius_m
        within = ((self._bounds_m[:, 0] <= high) & (self._bounds_m[:, 1] >= low)).all(axis=1)
        tiles = [self._tiles[index] for index in np.flatnonzero(within)]
        origin_m = (cell.astype(np.float64) + 0.5) * _CELL_M
        origins_m = np.array([tile.origin_m for tile in tiles]).reshape(-1, 3)
        mesh = Mesh.merged([tile.mesh for tile in tiles])
        shift_m = np.repeat(origins_m - origin_m, [len(tile.mesh.vertices) for tile in tiles], axis=0)
        return replace(mesh, vertices=(mesh.vertices + shift_m).astype(np.float32)), origin_m

    def _build(self, center_m: Float64Array, radius_m: float) -> Near:
        mesh, origin_m = self.mesh_around(center_m, radius_m)
        triangles = TriangleSet(mesh.vertices, mesh.triangles)
        triangles.build()
        material = mesh.material[mesh.triangles[:, 0]]
        return Near(origin_m, np.append(mesh.triangle_tag, np.uint8(0)), np.append(material, np.uint8(0)), triangles)


def _cell(center_m: Float64Array) -> Int64Array:
    """(3,) column, row and storey of the cell that a place lies in."""
    return np.floor(center_m / _CELL_M).astype(np.int64)


def _bounds_m(tile: Tile) -> Float64Array:
    """(2, 2) smallest and largest x, y of a tile's mesh, map frame."""
    return (tile.mesh.bounds_m + tile.origin_m)[:, :2]
