"""Cuts the world into tiles: objects go whole into the tile of their origin, ground is cut at the tiles' borders."""

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.static_scene import Tile
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.types import Float64Array

TILE_M = 64.0

_Index = tuple[int, int]


def standing(place_m: Sequence[float] | Float64Array, height_m: float, yaw_rad: float = 0.0) -> Float64Array:
    """(4, 4) pose of something upright at x, y of the map."""
    return matrices_from_xyz_rpy(np.array([place_m[0], place_m[1], height_m]), np.array([0.0, 0.0, yaw_rad]))


class TileBuilder:
    """Collects meshes by tile."""

    def __init__(self) -> None:
        self._seen: dict[_Index, list[Mesh]] = defaultdict(list)
        self._surfaces: dict[_Index, dict[str, list[Mesh]]] = defaultdict(lambda: defaultdict(list))
        self._apart: list[Mesh] = []

    def place(self, mesh: Mesh, map_from_mesh: Float64Array) -> None:
        """Add an object by its (4, 4) pose; the tile is that of the pose's origin."""
        index = _tile_of(map_from_mesh[0, 3], map_from_mesh[1, 3])
        tile_from_mesh = map_from_mesh.copy()
        tile_from_mesh[:3, 3] -= _origin(index)
        self._seen[index].append(mesh.transformed(tile_from_mesh))

    def place_apart(self, mesh_map: Mesh) -> None:
        """Add something too large for one tile, in the map frame, as a tile of its own."""
        self._apart.append(mesh_map)

    def cover(self, area: BaseGeometry, make: Callable[[shapely.Polygon], Mesh], surface: str | None = None) -> None:
        """Cut an area into tiles and add what ``make`` builds of each piece.

        Args:
            area: Map frame, metres.
            make: From a polygon in the map frame to its mesh in the map frame.
            surface: Name of the surface that is labelled only; None for what is seen.
        """
        for index, pieces in _cut(area).items():
            tile_from_map = np.eye(4)
            tile_from_map[:3, 3] = -_origin(index)
            meshes = [make(piece).transformed(tile_from_map) for piece in pieces]
            (self._seen[index] if surface is None else self._surfaces[index][surface]).extend(meshes)

    def finish(self) -> tuple[Tile, ...]:
        """All tiles, from south-west to north-east, then what stands apart."""
        indices = sorted({*self._seen, *self._surfaces})
        tiles = [
            Tile(
                _origin(index),
                Mesh.merged(self._seen[index]),
                {name: Mesh.merged(meshes) for name, meshes in sorted(self._surfaces[index].items())},
            )
            for index in indices
        ]
        return (*tiles, *(Tile(np.zeros(3), mesh, {}) for mesh in self._apart))


def _tile_of(x_m: float, y_m: float) -> _Index:
    return math.floor(x_m / TILE_M), math.floor(y_m / TILE_M)


def _origin(index: _Index) -> Float64Array:
    """(3,) middle of a tile, map frame."""
    return np.array([(index[0] + 0.5) * TILE_M, (index[1] + 0.5) * TILE_M, 0.0])


def _cut(area: BaseGeometry) -> dict[_Index, list[shapely.Polygon]]:
    """The area's polygons in each tile that it touches."""
    parts = shapely.get_parts(area)
    if len(parts) == 0:
        return {}
    low, high = np.floor(shapely.bounds(parts)[:, :2] / TILE_M), np.floor(shapely.bounds(parts)[:, 2:] / TILE_M)
    pieces: dict[_Index, list[shapely.Polygon]] = defaultdict(list)
    for part, (i0, j0), (i1, j1) in zip(parts, low.astype(int), high.astype(int), strict=True):
        i, j = (grid.reshape(-1) for grid in np.meshgrid(np.arange(i0, i1 + 1), np.arange(j0, j1 + 1), indexing="ij"))
        squares = shapely.box(i * TILE_M, j * TILE_M, (i + 1) * TILE_M, (j + 1) * TILE_M)
        shapely.prepare(part)
        inside, touched = shapely.contains(part, squares), shapely.intersects(part, squares)
        for k in np.flatnonzero(touched):
            cut = squares[k] if inside[k] else shapely.intersection(part, squares[k])
            polygons = [piece for piece in shapely.get_parts(cut) if piece.geom_type == "Polygon" and piece.area > 1e-6]
            pieces[int(i[k]), int(j[k])].extend(polygons)
    return pieces
