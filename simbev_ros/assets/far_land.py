"""The land beyond what is loaded: coarse, so that no road ends in nothing."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.assets.land.covers import draw_crop, finish_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import Finish
from simbev_ros.assets.region_ground import LAND_HEIGHT_M
from simbev_ros.assets.static_scene import Tile
from simbev_ros.maps.features import MapFeatures
from simbev_ros.maps.membrane import places_m
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region, regions_of
from simbev_ros.maps.terrain import Terrain
from simbev_ros.random import stream
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array, Int32Array, Int64Array, UInt8Array

_CELL_M = 64.0
_FIELD_CELLS = 4
_HORIZON = 5
"""So many regions around those that are loaded."""
_SKIRT_M = 10.0
_WOODS = Finish(Material.GRASS, Tag.TERRAIN, (56, 68, 42))
_WATER = Finish(Material.WATER, Tag.WATER, (46, 74, 78))


@dataclass(frozen=True, slots=True)
class FarLand:
    """A map and its environs, region by region in cells.

    Attributes:
        first: South-western region.
        height_m: (I + 1, J + 1) heights of the cells' corners; the first index runs east, the second north.
        cover: (I, J) each cell's row of ``finish``.
        finish: (F, 5) uint8 material, tag, red, green, blue.
    """

    first: Region
    height_m: Float64Array
    cover: Int64Array
    finish: UInt8Array


def far_land(network: RoadNetwork, terrain: Terrain) -> FarLand:
    """All land of a map."""
    columns_rows = np.array(regions_of(network.layout))
    first = Region(*(columns_rows.min(axis=0) - _HORIZON).tolist())
    count = (np.ptp(columns_rows, axis=0) + 1 + 2 * _HORIZON) * round(REGION_M / _CELL_M)
    corner_m = places_m(np.array(first) * REGION_M, _CELL_M, count + 1)
    height_m = terrain.far_m(corner_m.reshape(-1, 2)).reshape(count + 1) + LAND_HEIGHT_M
    finishes = [_WATER]
    middle_m = (corner_m[:-1, :-1] + _CELL_M / 2.0).reshape(-1, 2)
    cover = _covers(network.features, network.seed, middle_m, finishes).reshape(count)
    table = np.array([(finish.material, finish.tag, *finish.color) for finish in finishes], np.uint8)
    return FarLand(first, height_m, cover, table)


def far_tiles(far: FarLand, loaded: Collection[Region]) -> Iterator[Tile]:
    """Tiles of a region's size around those that are loaded, with faces down along the border."""
    columns_rows = np.array(sorted(loaded))
    low, high = columns_rows.min(axis=0) - _HORIZON, columns_rows.max(axis=0) + _HORIZON
    for column in range(low[0], high[0] + 1):
        for row in range(low[1], high[1] + 1):
            region = Region(column, row)
            if region not in loaded:
                yield _tile(far, region, loaded)


def _covers(features: MapFeatures, seed: int, middle_m: Float64Array, finishes: list[Finish]) -> Int64Array:
    """(N,) index into ``finishes``, which grows, of the cover at (N, 2) places."""
    field = np.floor(middle_m / (_FIELD_CELLS * _CELL_M)).astype(np.int64)
    cover = np.zeros(len(middle_m), np.int64)
    everywhere = shapely.box(*middle_m.min(axis=0) - 1.0, *middle_m.max(axis=0) + 1.0)
    for surroundings, area in [
        (features.surroundings, everywhere),
        *((z.surroundings, z.area) for z in features.zones),
    ]:
        inside = shapely.contains_xy(area, middle_m[:, 0], middle_m[:, 1])
        if surroundings.use != "farmland":
            woods = surroundings.use == "woods"
            cover[inside] = _row(_WOODS if woods else finish_of("lawn", surroundings.plants), finishes)
            continue
        keys, which = np.unique(field[inside], axis=0, return_inverse=True)
        crops = [draw_crop(surroundings.plants, stream(seed, f"far_land.{i}.{j}")) for i, j in keys.tolist()]
        cover[inside] = np.array([_row(crop, finishes) for crop in crops])[which.reshape(-1)]
    for water in features.water:
        cover[shapely.contains_xy(water.area, middle_m[:, 0], middle_m[:, 1])] = 0
    return cover


def _row(finish: Finish, finishes: list[Finish]) -> int:
    if finish not in finishes:
        finishes.append(finish)
    return finishes.index(finish)


def _tile(far: FarLand, region: Region, loaded: Collection[Region]) -> Tile:
    """One region's cells."""
    side = round(REGION_M / _CELL_M)
    i, j = (np.array(region) - far.first) * side
    height_m = far.height_m[i : i + side + 1, j : j + side + 1]
    axis = np.arange(side + 1) * _CELL_M - REGION_M / 2.0
    corner_m = np.stack([*np.meshgrid(axis, axis, indexing="ij"), height_m], axis=-1)
    east, north = np.gradient(height_m, _CELL_M)
    normals = np.stack([-east, -north, np.ones_like(east)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    node = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)
    cover = far.cover[i : i + side, j : j + side].reshape(-1)
    positions, normals = corner_m.reshape(-1, 3), normals.reshape(-1, 3)
    meshes = []
    for row in np.unique(cover):
        chosen = quads[cover == row]
        corners = chosen.reshape(-1)
        faces = np.arange(len(corners)).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        meshes.append(_mesh(far, int(row), positions[corners], normals[corners], faces.astype(np.int32)))
    meshes += [
        _skirt(far, positions[line], int(cover[0]))
        for line, (east, north) in (
            (node[:, 0], (0, -1)),
            (node[-1], (1, 0)),
            (node[::-1, -1], (0, 1)),
            (node[0, ::-1], (-1, 0)),
        )
        if Region(region.column + east, region.row + north) in loaded
    ]
    center_m = np.array([(region.column + 0.5) * REGION_M, (region.row + 0.5) * REGION_M, 0.0])
    return Tile(center_m, Mesh.merged(meshes), {})


def _skirt(far: FarLand, line_m: Float64Array, row: int) -> Mesh:
    """Faces down from (N, 3) places, to be seen from their right."""
    below_m = line_m - [0.0, 0.0, _SKIRT_M]
    quads = np.stack([below_m[:-1], below_m[1:], line_m[1:], line_m[:-1]], axis=1).reshape(-1, 3)
    faces = np.arange(len(quads)).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)
    along = line_m[-1] - line_m[0]
    outward = np.array([along[1], -along[0], 0.0]) / np.hypot(along[0], along[1])
    return _mesh(far, row, quads, np.tile(outward, (len(quads), 1)), faces)


def _mesh(far: FarLand, row: int, positions: Float64Array, normals: Float64Array, faces: Int32Array) -> Mesh:
    material, tag, red, green, blue = far.finish[row].tolist()
    return Mesh.indexed(
        positions, faces, normals=normals, material=Material(material), tag=Tag(tag), color=(red, green, blue)
    )
