"""Coarse land around the loaded regions and beyond the map, so that cameras see ground up to the horizon."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from simbev_ros.assets.land.covers import draw_crop, finish_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.facets import TILE_M
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.region_ground import LAND_HEIGHT_M
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.config.weather import Season
from simbev_ros.foundation.geometry.plan_view import points_inside
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, UInt8Array
from simbev_ros.maps.land.membrane import node_positions_m
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region, regions_of

_CELLS = round(REGION_M / TILE_M)
_FIELD_CELLS = 4
_HORIZON = 5
"""Number of regions of coarse land around the loaded ones."""
_SKIRT_M = 10.0
_PLAIN_M, _SLOPE_M = 250.0, 1000.0
"""Width of the plain around a map and its waters, and of the slopes from there up to the hills."""
_WAVES, _WOODED_M = 24, 25.0
"""Number of waves that hills are the sum of, and the height from which woods cover them."""
_WATER = Finish(Material.WATER, Tag.WATER, (40, 54, 50))


@dataclass(frozen=True, slots=True)
class FarLand:
    """Coarse land of a map and its surroundings, in cells as large as tiles.

    Attributes:
        first: South-western region.
        height_m: (I + 1, J + 1) heights of the cells' corners; the first index runs east, the second north.
        cover: (I, J) row of each cell in ``finish``.
        finish: (F, 5) material, tag, red, green, blue of each ground cover.
    """

    first: Region
    height_m: Float64Array
    cover: Int64Array
    finish: UInt8Array


def far_land(network: RoadNetwork, terrain: Terrain, season: Season = "summer") -> FarLand:
    """Compute the coarse land of a whole map in a season."""
    columns_rows = np.array(regions_of(network.layout))
    first = Region(*(columns_rows.min(axis=0) - _HORIZON).tolist())
    count = (np.ptp(columns_rows, axis=0) + 1 + 2 * _HORIZON) * _CELLS
    corner_m = node_positions_m(np.array(first) * REGION_M, TILE_M, (count + 1).tolist())
    height_m = terrain.far_m(corner_m.reshape(-1, 2)).reshape(count + 1) + LAND_HEIGHT_M
    finishes = [_WATER]
    middle_m = (corner_m[:-1, :-1] + TILE_M / 2.0).reshape(-1, 2)
    cover = _covers(network.features, network.seed, middle_m, finishes, season).reshape(count)
    hills_m = _hills_m(network.seed, corner_m, cover == 0)
    cover[hills_m[:-1, :-1] > _WOODED_M] = _finish_row(
        finish_of("far_woods", network.features.surroundings.plants, season), finishes
    )
    table = np.array([(finish.material, finish.tag, *finish.color) for finish in finishes], np.uint8)
    return FarLand(first, height_m + hills_m, cover, table)


def cells_of(far: FarLand, tiles: Iterable[Tile]) -> BoolArray:
    """(I, J) whether any of the regions' tiles lies in each cell."""
    cells = np.full(far.cover.shape, False)
    places_m = np.array([tile.origin_m[:2] for tile in tiles]).reshape(-1, 2) - np.array(far.first) * REGION_M
    cells[tuple(np.floor(places_m / TILE_M).astype(int).T)] = True
    return cells


def far_tiles(far: FarLand, loaded: BoolArray) -> Iterator[Tile]:
    """Build tiles of a region's size around the loaded cells, with faces down along the loaded area's border.

    Args:
        far: Coarse land of the map.
        loaded: (I, J) whether each cell is loaded in detail; at least one is.
    """
    regions = np.argwhere(loaded) // _CELLS
    first = np.maximum(regions.min(axis=0) - _HORIZON, 0)
    last = np.minimum(regions.max(axis=0) + _HORIZON, np.array(loaded.shape) // _CELLS - 1)
    around = np.pad(loaded, 1)
    for i in range(first[0] * _CELLS, last[0] * _CELLS + 1, _CELLS):
        for j in range(first[1] * _CELLS, last[1] * _CELLS + 1, _CELLS):
            window = around[i : i + _CELLS + 2, j : j + _CELLS + 2]
            if not window[1:-1, 1:-1].all():
                yield _tile(far, window, i, j)


def _hills_m(seed: int, corner_m: Float64Array, water: BoolArray) -> Float64Array:
    """(I, J) heights of hills at the horizon: waves of random directions, beyond a plain around the map and water."""
    rng = stream(seed, "hills")
    plain = np.pad(water, ((0, 1), (0, 1)), mode="edge")
    plain[_HORIZON * _CELLS : -_HORIZON * _CELLS, _HORIZON * _CELLS : -_HORIZON * _CELLS] = True
    distance_m = TILE_M * np.asarray(distance_transform_edt(~plain))
    angle_rad, phase_rad = rng.uniform(0.0, 2.0 * np.pi, (2, _WAVES))
    length_m = np.exp(rng.uniform(np.log(400.0), np.log(2500.0), _WAVES))
    along = 2.0 * np.pi / length_m * np.stack([np.cos(angle_rad), np.sin(angle_rad)])
    waves = np.cos(corner_m @ along + phase_rad) @ (length_m / np.sqrt(np.sum(length_m**2) / 2.0))
    share = np.clip((distance_m - _PLAIN_M) / _SLOPE_M, 0.0, 1.0)
    height_m = rng.uniform(50.0, 150.0) * np.maximum(1.0 + 0.6 * waves, 0.0)
    return np.asarray(share * share * (3.0 - 2.0 * share) * height_m)


def _covers(
    features: MapFeatures, seed: int, middle_m: Float64Array, finishes: list[Finish], season: Season
) -> Int64Array:
    """(N,) index into ``finishes`` of the cover at (N, 2) points; new finishes are appended."""
    field = np.floor(middle_m / (_FIELD_CELLS * TILE_M)).astype(np.int64)
    cover = np.zeros(len(middle_m), np.int64)
    zoned = points_inside([zone.area for zone in features.zones], middle_m)
    recipes = [features.surroundings, *(zone.surroundings for zone in features.zones)]
    for surroundings, inside in zip(recipes, [np.arange(len(middle_m)), *zoned], strict=True):
        if surroundings.use != "farmland":
            woods = surroundings.use == "woods"
            cover[inside] = _finish_row(
                finish_of("far_woods" if woods else "lawn", surroundings.plants, season), finishes
            )
            continue
        keys, which = np.unique(field[inside], axis=0, return_inverse=True)
        crops = [draw_crop(surroundings.plants, stream(seed, f"far_land.{i}.{j}"), season) for i, j in keys.tolist()]
        cover[inside] = np.array([_finish_row(crop, finishes) for crop in crops])[which.reshape(-1)]
    for inside in points_inside([water.area for water in features.water], middle_m):
        cover[inside] = 0
    return cover


def _finish_row(finish: Finish, finishes: list[Finish]) -> int:
    if finish not in finishes:
        finishes.append(finish)
    return finishes.index(finish)


def _tile(far: FarLand, loaded: BoolArray, i: int, j: int) -> Tile:
    """The cells that are not loaded of the region from cell i, j on; ``loaded`` has one more cell on every side."""
    cells, nodes = (slice(i, i + _CELLS), slice(j, j + _CELLS)), (slice(i, i + _CELLS + 1), slice(j, j + _CELLS + 1))
    cover, height_m = far.cover[cells], far.height_m[nodes]
    plain = not loaded.any() and not np.ptp(cover) and not np.ptp(height_m)
    step = _CELLS if plain else 1
    axis = (np.arange(0, _CELLS + 1, step) - _CELLS / 2.0) * TILE_M
    height_m, cover, bare = height_m[::step, ::step], cover[::step, ::step], ~loaded[1:-1:step, 1:-1:step]
    node_m = np.stack([*np.meshgrid(axis, axis, indexing="ij"), height_m], axis=-1)
    east, north = np.gradient(height_m, step * TILE_M)
    normal = np.stack([-east, -north, np.ones_like(east)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    corners_m, normals = _corners(node_m), _corners(normal)
    meshes = [
        _quads(far.finish[row], corners_m[bare & (cover == row)], normals[bare & (cover == row)])
        for row in np.unique(cover[bare])
    ]
    for side, neighbors in enumerate((loaded[1:-1, :-2], loaded[2:, 1:-1], loaded[1:-1, 2:], loaded[:-2, 1:-1])):
        edge_m = corners_m[bare & neighbors[::step, ::step]][:, [side, (side + 1) % 4]]
        if len(edge_m):
            meshes.append(_skirt(far.finish[cover[bare][0]], edge_m))
    center_m = np.array([*(np.array(far.first) + (np.array([i, j]) / _CELLS + 0.5)), 0.0]) * REGION_M
    return Tile(center_m, Mesh.merge(meshes), {})


def _corners(node: Float64Array) -> Float64Array:
    """(I, J, 4, 3) values at the corners of cells, counter-clockwise from the south-west, from values at nodes."""
    return np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=2)


def _skirt(finish: UInt8Array, edge_m: Float64Array) -> Mesh:
    """Faces down from (N, 2, 3) edges, visible from the right of the edges."""
    quads_m = np.concatenate([edge_m - [0.0, 0.0, _SKIRT_M], edge_m[:, ::-1]], axis=1)
    along = edge_m[0, 1] - edge_m[0, 0]
    outward = np.array([along[1], -along[0], 0.0]) / np.hypot(along[0], along[1])
    return _quads(finish, quads_m, np.broadcast_to(outward, quads_m.shape))


def _quads(finish: UInt8Array, corners_m: Float64Array, normals: Float64Array) -> Mesh:
    """Mesh of quads with (N, 4, 3) corners and normals."""
    material, tag, red, green, blue = finish.tolist()
    return Mesh.indexed(
        corners_m.reshape(-1, 3),
        (4 * np.arange(len(corners_m))[:, None] + [0, 1, 2, 0, 2, 3]).astype(np.int32),
        normals=normals.reshape(-1, 3),
        material=Material(material),
        tag=Tag(tag),
        color=(red, green, blue),
    )
