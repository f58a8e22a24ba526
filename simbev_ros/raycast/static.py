"""Rays against the static tiles around a place."""

import numpy as np

from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.static_scene import StaticScene, Tile
from simbev_ros.raycast.embree import TriangleSet
from simbev_ros.types import Float32Array, Float64Array, UInt8Array

_CELL_M = 128.0
"""The place is known only to the cell of this size that it lies in, so that a rebuild is rare and leaves no trace."""


class StaticTriangles:
    """The tiles within reach. Which tiles, and their order, depends on the place alone, not on how it was reached.

    Attributes:
        origin_m: (3,) point of the map frame that the vertices in Embree are relative to.
        tag: (T,) semantic tag per triangle.
        material: (T,) material per triangle.
        triangles: The triangles for Embree.
    """

    def __init__(self, static: StaticScene) -> None:
        self._tiles = static.tiles
        self._bounds_m = np.array([_bounds_m(tile) for tile in static.tiles]).reshape(-1, 2, 2)
        self._chosen: tuple[int, ...] | None = None

    def update(self, center_m: Float64Array, radius_m: float) -> None:
        """Rebuilds if other tiles are now within ``radius_m`` of (3,) ``center_m`` (map frame), or may soon be."""
        low = np.floor(center_m[:2] / _CELL_M) * _CELL_M - radius_m
        high = low + _CELL_M + 2.0 * radius_m
        near = ((self._bounds_m[:, 0] <= high) & (self._bounds_m[:, 1] >= low)).all(axis=1)
        chosen = tuple(int(index) for index in np.flatnonzero(near))
        if chosen != self._chosen:
            self._chosen = chosen
            self._build([self._tiles[index] for index in chosen])

    def _build(self, tiles: list[Tile]) -> None:
        origins_m = np.array([tile.origin_m for tile in tiles]).reshape(-1, 3)
        self.origin_m: Float64Array = np.round(origins_m.mean(axis=0)) if tiles else np.zeros(3)
        mesh = Mesh.merged([tile.mesh for tile in tiles])
        shift_m = np.repeat(origins_m - self.origin_m, [len(tile.mesh.vertices) for tile in tiles], axis=0)
        vertices_m: Float32Array = (mesh.vertices + shift_m).astype(np.float32)
        self.tag: UInt8Array = mesh.triangle_tag
        self.material: UInt8Array = mesh.material[mesh.triangles[:, 0]]
        self.triangles = TriangleSet(vertices_m, mesh.triangles)


def _bounds_m(tile: Tile) -> Float64Array:
    """(2, 2) smallest and largest x, y of a tile's mesh, map frame."""
    return (tile.mesh.bounds_m + tile.origin_m)[:, :2]
