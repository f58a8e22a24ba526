"""Static triangles around a point, as Embree scenes that are cached by grid cell."""

from copy import copy
from dataclasses import dataclass, replace
from weakref import WeakValueDictionary

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from simbev_ros.simulation.raycast.embree import TriangleSet

_CELL_M = 128.0
"""Edge length of the grid cells that centers are rounded to: rebuilds are rare, and hits do not depend on the path."""

_MAX_KEPT_CELLS = 3
"""Number of cells kept for a moving point, so that driving along a border or returning needs no rebuild."""

_Key = tuple[int, int, int, float]
"""Column, row and layer of a cell, and the distance from it up to which triangles are needed."""


@dataclass(frozen=True, slots=True, weakref_slot=True)
class NearTriangles:
    """Static triangles within reach of a cell.

    Attributes:
        origin_m: (3,) point of the map frame that the triangles are relative to.
        tag: (T + 1,) semantic tag per triangle, and 0 for triangle -1, which means no hit.
        material: (T + 1,) material per triangle, and 0 for triangle -1.
        corners: (T, 3) vertices of each triangle.
        uv: (V, 2) surface coordinates of the vertices.
        triangles: The triangles for Embree.
    """

    origin_m: Float64Array
    tag: UInt8Array
    material: UInt8Array
    corners: Int32Array
    uv: Float32Array
    triangles: TriangleSet


class StaticTriangles:
    """Provides the static triangles around a moving point; the result depends on the point alone, not on earlier calls.

    For other points that move elsewhere, ``another`` shares the cells: each one exists once, as long as it is kept for
    any of the points.
    """

    def __init__(self, static: StaticScene) -> None:
        self._tiles = static.tiles
        self._bounds_m = np.array([_bounds_m(tile) for tile in static.tiles]).reshape(-1, 2, 2)
        self._shared: WeakValueDictionary[_Key, NearTriangles] = WeakValueDictionary()
        self._kept: dict[_Key, NearTriangles] = {}

    def another(self) -> "StaticTriangles":
        """The same triangles for another moving point."""
        other = copy(self)
        other._kept = {}
        return other

    def triangles_around(self, center_m: Float64Array, radius_m: float) -> NearTriangles:
        """Triangles of all tiles within ``radius_m`` of the cell that contains (3,) ``center_m``, map frame; cached."""
        column, row, layer = _cell(center_m).tolist()
        key = column, row, layer, radius_m
        near = self._kept.pop(key, None) or self._shared.get(key) or self._build(center_m, radius_m)
        self._kept[key] = self._shared[key] = near  # last: dictionaries keep their order
        for old in list(self._kept)[:-_MAX_KEPT_CELLS]:
            del self._kept[old]
        return near

    def mesh_around(self, center_m: Float64Array, radius_m: float) -> tuple[Mesh, Float64Array]:
        """Merged mesh of the tiles of ``triangles_around``, and the (3,) point of the map frame it is relative to."""
        cell = _cell(center_m)
        low = cell[:2] * _CELL_M - radius_m
        high = low + _CELL_M + 2.0 * radius_m
        within = ((self._bounds_m[:, 0] <= high) & (self._bounds_m[:, 1] >= low)).all(axis=1)
        tiles = [self._tiles[index] for index in np.flatnonzero(within)]
        origin_m = (cell.astype(np.float64) + 0.5) * _CELL_M
        origins_m = np.array([tile.origin_m for tile in tiles]).reshape(-1, 3)
        mesh = Mesh.merge([tile.mesh for tile in tiles])
        shift_m = np.repeat(origins_m - origin_m, [len(tile.mesh.vertices) for tile in tiles], axis=0)
        return replace(mesh, vertices=(mesh.vertices + shift_m).astype(np.float32)), origin_m

    def _build(self, center_m: Float64Array, radius_m: float) -> NearTriangles:
        mesh, origin_m = self.mesh_around(center_m, radius_m)
        triangles = TriangleSet(mesh.vertices, mesh.triangles)
        triangles.build()
        material = mesh.material[mesh.triangles[:, 0]]
        return NearTriangles(
            origin_m,
            np.append(mesh.triangle_tag, np.uint8(0)),
            np.append(material, np.uint8(0)),
            mesh.triangles,
            mesh.uv,
            triangles,
        )


def _cell(center_m: Float64Array) -> Int64Array:
    """(3,) column, row and layer of the cell that a point lies in."""
    return np.floor(center_m / _CELL_M).astype(np.int64)


def _bounds_m(tile: Tile) -> Float64Array:
    """(2, 2) minimum and maximum x, y of a tile's mesh, map frame."""
    return (tile.mesh.bounds_m + tile.origin_m)[:, :2]
