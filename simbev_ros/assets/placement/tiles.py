"""Collects meshes into tiles: objects go whole into the tile of their origin; the ground is cut at tile borders."""

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.drape import ByTile
from simbev_ros.assets.mesh.facet_cuts import Cut, cut_to_facets
from simbev_ros.assets.mesh.facets import TILE_M, Facets
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.types import Float64Array

_Key = tuple[int, int, int]
"""Level, column and row of a tile."""


def upright_pose(position_m: Sequence[float] | Float64Array, height_m: float, yaw_rad: float = 0.0) -> Float64Array:
    """(4, 4) pose, map frame, of an upright object at a position in plan, a height and a heading."""
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    rows = [cosine, -sine, 0.0, position_m[0]], [sine, cosine, 0.0, position_m[1]], [0.0, 0.0, 1.0, height_m]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


class TileBuilder:
    """Collects meshes by tile while a region is built; ``finish`` returns the tiles.

    Attributes:
        placed_objects: Meshes of objects of level 0, and the (N, 4, 4) poses of their copies, map frame.
    """

    def __init__(self) -> None:
        self.placed_objects: list[tuple[Mesh, Float64Array]] = []
        self._seen: dict[_Key, list[Mesh]] = defaultdict(list)
        self._graded: dict[_Key, list[GradedMesh]] = defaultdict(list)
        self._surfaces: dict[_Key, dict[str, list[Mesh]]] = defaultdict(lambda: defaultdict(list))

    def place(self, mesh: Mesh, map_from_mesh: Float64Array, level: int = 0) -> None:
        """Add an object at a (4, 4) pose, map frame; it goes into the tile of the pose's origin."""
        key = (level, math.floor(map_from_mesh[0, 3] / TILE_M), math.floor(map_from_mesh[1, 3] / TILE_M))
        tile_from_mesh = map_from_mesh.copy()
        tile_from_mesh[:3, 3] -= _origin(key)
        self._seen[key].append(mesh.transform(tile_from_mesh))
        if level == 0:
            self.placed_objects.append((mesh, map_from_mesh[None]))

    def place_copies(
        self,
        thing: Mesh | GradedMesh,
        map_from_mesh: Float64Array,
        tint: Float64Array | None = None,
        follow_m: Callable[[Float64Array], Float64Array] | None = None,
    ) -> None:
        """Add copies of an object.

        Args:
            thing: Mesh of the object.
            map_from_mesh: (N, 4, 4) poses, map frame.
            tint: (N, 3) factors of the copies' colors.
            follow_m: Function from (M, 2) points to heights that are added to those of the vertices there, so that
                long objects follow the ground.
        """
        index = np.floor(map_from_mesh[:, :2, 3] / TILE_M).astype(int)
        origin_m = (index + 0.5) * TILE_M
        tile_from_mesh = map_from_mesh.copy()
        tile_from_mesh[:, :2, 3] -= origin_m
        mesh = thing.mesh if isinstance(thing, GradedMesh) else thing
        keys: list[_Key] = [(0, column, row) for column, row in index.tolist()]
        copies = _tile_copies(mesh, tile_from_mesh, origin_m, tint, follow_m)
        if isinstance(thing, GradedMesh):
            stand_ins = _tile_copies(thing.coarse, tile_from_mesh, origin_m, tint, follow_m)
            for key, copy, stand_in in zip(keys, copies, stand_ins, strict=True):
                self._graded[key].append(GradedMesh(copy, stand_in))
        else:
            for key, copy in zip(keys, copies, strict=True):
                self._seen[key].append(copy)
        if follow_m is not None:  # their own height is above the land
            map_from_mesh = map_from_mesh.copy()
            map_from_mesh[:, 2, 3] += follow_m(map_from_mesh[:, :2, 3])
        self.placed_objects.append((mesh, map_from_mesh))

    def drape(
        self, area: BaseGeometry, facets: Facets, *builders: Callable[[Cut], ByTile], surface: str = "", level: int = 0
    ) -> None:
        """Cut an area to facets, and add the meshes that each builder makes of the pieces.

        Args:
            area: Area, map frame, meters.
            facets: Facets of the ground, which cover the area.
            builders: Functions from pieces to their meshes.
            surface: Name of a label-only surface; empty for visible meshes.
            level: Level of the roads that the area belongs to.
        """
        cut = cut_to_facets(area, facets)
        for build in builders:
            for (column, row), mesh in build(cut).items():
                key = (level, column, row)
                (self._surfaces[key][surface] if surface else self._seen[key]).append(mesh)

    def finish(self) -> tuple[Tile, ...]:
        """All tiles, by level, from south-west to north-east."""
        return tuple(self._tile(key) for key in sorted({*self._seen, *self._graded, *self._surfaces}))

    def _tile(self, key: _Key) -> Tile:
        """A tile, objects with a coarse stand-in last."""
        graded = GradedMesh.merge(self._graded[key])
        return Tile(
            _origin(key),
            Mesh.merge([*self._seen[key], graded.mesh]),
            {name: Mesh.merge(meshes) for name, meshes in sorted(self._surfaces[key].items())},
            level=key[0],
            coarse=graded.coarse,
            detail=len(graded.mesh.triangles),
        )


def _tile_copies(
    mesh: Mesh,
    tile_from_mesh: Float64Array,
    origin_m: Float64Array,
    tint: Float64Array | None,
    follow_m: Callable[[Float64Array], Float64Array] | None,
) -> list[Mesh]:
    """Copies as in ``TileBuilder.place_copies``, each relative to its tile's (N, 2) origin."""
    copies = mesh.copies(tile_from_mesh, tint)
    if follow_m is not None:
        xy_m = np.stack([copy.vertices[:, :2] for copy in copies]) + origin_m[:, None]
        heights_m = follow_m(xy_m.reshape(-1, 2)).reshape(xy_m.shape[:2])
        for copy, height_m in zip(copies, heights_m, strict=True):
            copy.vertices[:, 2] += height_m.astype(np.float32)
    return copies


def _origin(key: _Key) -> Float64Array:
    """(3,) origin of a tile: its center at height 0, map frame."""
    return np.array([(key[1] + 0.5) * TILE_M, (key[2] + 0.5) * TILE_M, 0.0])
