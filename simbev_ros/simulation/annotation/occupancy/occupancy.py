"""Semantic occupancy: the semantic tag of each voxel in a box around the ego.

A ``WorldState`` enters, a (x, y, z) array of tags leaves. A voxel is occupied if and only if a surface passes through
it or it lies inside a closed solid (``Solids``). Actors, buildings, poles, trunks and the leaf clusters of crowns are
filled; ground, paint, bridge decks and single leaves are surfaces. The volume behind an open car door is empty, as in
the mesh.

The box is fixed to the ego frame (x ahead, y left, z up; origin on the ground below it), so it pitches and rolls with
the road and the vehicle, like lidar points and camera poses in that frame. Everything inside it counts, on every road
level.
"""

from collections.abc import Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.geometry.voxel_grid import VoxelGrid
from simbev_ros.foundation.on_demand import OnDemand
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, Int64Array, Table, UInt8Array
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.schema.voxels import VOXEL_DTYPE
from simbev_ros.simulation.annotation.occupancy.solids import Solids
from simbev_ros.simulation.annotation.occupancy.triangle_soup import GridShape, Soup
from simbev_ros.simulation.annotation.occupancy.voxel_solids import fill_solids
from simbev_ros.simulation.annotation.occupancy.voxel_surfaces import mark_surfaces

_PRIORITY = (
    *(Tag.BRIDGE, Tag.TERRAIN, Tag.GROUND, Tag.WATER, Tag.ROAD, Tag.RAIL_TRACK, Tag.SIDEWALK, Tag.ROAD_LINE),
    *(Tag.BUILDING, Tag.VEGETATION, Tag.WALL, Tag.FENCE, Tag.GUARD_RAIL, Tag.OTHER, Tag.STATIC, Tag.POLE),
    *(Tag.TRAFFIC_SIGN, Tag.TRAFFIC_LIGHT, Tag.DYNAMIC, Tag.TRAIN, Tag.BUS, Tag.TRUCK, Tag.CAR, Tag.MOTORCYCLE),
    *(Tag.BICYCLE, Tag.RIDER, Tag.PEDESTRIAN),
)
"""Tags in ascending priority: where several objects share a voxel, the last one wins.

Objects come after the surfaces that they stand on, moving ones after static ones, small ones after large ones. Bridges
come first so that the roads on their decks stay complete.
"""

_TAG_OF_RANK = np.array([Tag.UNLABELED, *_PRIORITY], np.uint8)
_RANK_OF_TAG = np.zeros(256, np.uint8)
_RANK_OF_TAG[_TAG_OF_RANK[1:]] = np.arange(1, len(_TAG_OF_RANK))

_ACTOR_MARGIN_M = 1.5  # open doors and legs extend this far beyond an actor's box


class OccupancyAnnotator:
    """Voxelizes a map and its actors around the ego. A tile is prepared when the ego first comes near it."""

    def __init__(self, static: StaticScene, models: Sequence[ActorModel], threads: int = 2) -> None:
        """Prepare the annotator.

        Args:
            static: The static scene.
            models: The catalog's models, indexed by blueprint.
            threads: Number of CPU cores to use.
        """
        self._tiles, self._threads = static.tiles, threads
        self._bounds_m = np.array([tile.mesh.bounds_m + tile.origin_m for tile in static.tiles]).reshape(-1, 2, 3)
        self._solids_of_tile: dict[int, Solids] = {}
        solids = OnDemand(len(models), lambda blueprint: Solids.from_mesh(models[blueprint].mesh))
        self._solids_of_model = solids
        self._models = OnDemand(len(models), lambda index: replace(models[index], mesh=_plain_mesh(solids[index])))

    def tags(self, state: WorldState, grid: VoxelGrid, hidden_ids: Set[int] = frozenset()) -> UInt8Array:
        """Semantic tags of the voxels around the ego.

        Args:
            state: The world state to label.
            grid: The voxel grid.
            hidden_ids: Ids of actors to leave out, for example the ego.

        Returns:
            (x, y, z) ``grid.shape`` uint8: semantic tag of each voxel, 0 where it is free.
        """
        map_from_ego = map_from_actors(state.ego[None])[0]
        grid_from_map = grid.grid_from_ego @ inverse(map_from_ego)
        tiles = self._tiles_near(apply(map_from_ego, grid.corners_ego))
        actors = _actors_near(state.actors[~np.isin(state.actors["id"], sorted(hidden_ids))], grid_from_map, grid)
        with ThreadPoolExecutor(self._threads) as pool:
            shares = [(tiles[k :: self._threads], actors[k :: self._threads]) for k in range(self._threads)]
            ranks = list(
                pool.map(
                    partial(self._ranks, grid_from_map=grid_from_map, origin_m=map_from_ego[:3, 3], shape=grid.shape),
                    shares,
                )
            )
        highest: UInt8Array = np.maximum.reduce(ranks)
        return _TAG_OF_RANK[highest]

    def _ranks(
        self, share: tuple[Int64Array, Table], grid_from_map: Float64Array, origin_m: Float64Array, shape: GridShape
    ) -> UInt8Array:
        """Ranks from one thread's share of the tiles and actors."""
        tiles, actors = share
        soups = [self._tile_soup(tile, grid_from_map) for tile in tiles.tolist()]
        return voxelize(Soup.merge([*soups, self._actor_soup(actors, grid_from_map, origin_m)]), shape)

    def _tiles_near(self, corners_m: Float64Array) -> Int64Array:
        """Indices of the tiles whose bounds overlap those of the box, given its (8, 3) corners in the map frame."""
        low_m, high_m = corners_m.min(axis=0), corners_m.max(axis=0)
        return np.flatnonzero(((self._bounds_m[:, 0] <= high_m) & (self._bounds_m[:, 1] >= low_m)).all(axis=1))

    def _tile_soup(self, index: int, grid_from_map: Float64Array) -> Soup:
        """Triangles of a tile in voxel coordinates."""
        tile = self._tiles[index]
        if index not in self._solids_of_tile:
            self._solids_of_tile[index] = Solids.from_mesh(tile.mesh)
        solids = self._solids_of_tile[index]
        points = _to_grid(grid_from_map, tile.origin_m, solids.points)
        return Soup(points, _RANK_OF_TAG[solids.tag], _corner_major(solids.triangles), solids.is_solid)

    def _actor_soup(self, actors: Table, grid_from_map: Float64Array, origin_m: Float64Array) -> Soup:
        """Triangles of posed actors in voxel coordinates; the nearby ``origin_m``, (3,), keeps float32 exact."""
        posed = pose_actors(self._models, actors, origin_m)
        solids = [self._solids_of_model[blueprint] for blueprint in actors["blueprint"].tolist()]
        rank = np.repeat(_RANK_OF_TAG[actors["tag"]], np.array([len(each.points) for each in solids], np.int64))
        is_solid = [each.is_solid for each in solids]
        points = _to_grid(grid_from_map, origin_m, posed.vertices)
        return Soup(points, rank, _corner_major(posed.triangles), np.concatenate([np.zeros(0, bool), *is_solid]))


def occupied_voxels(tags: UInt8Array, grid: VoxelGrid) -> Table:
    """(N,) ``VOXEL_DTYPE`` rows of the occupied voxels among (x, y, z) tags, x slowest."""
    voxel = np.flatnonzero(tags)
    table = np.empty(len(voxel), VOXEL_DTYPE)
    for axis, low_m, index in zip("xyz", grid.low_m, np.unravel_index(voxel, tags.shape), strict=True):
        table[f"i{axis}"] = index
        table[axis] = low_m + (index + 0.5) * grid.voxel_m
    table["tag"] = tags.reshape(-1)[voxel]
    return table


def _plain_mesh(solids: Solids) -> Mesh:
    """Mesh of the same points and triangles, without colors, materials and normals."""
    count = len(solids.points)
    color, material = np.zeros((count, 3), np.uint8), np.zeros(count, np.uint8)
    points = solids.points
    return Mesh(points, points, points[:, :2], color, material, solids.tag, solids.part, solids.triangles)


def _actors_near(actors: Table, grid_from_map: Float64Array, grid: VoxelGrid) -> Table:
    """Actors that may extend into the box."""
    center = apply(grid_from_map, np.stack([actors["x"], actors["y"], actors["z"]], axis=1))
    size_m = np.stack([actors["length"], actors["width"], actors["height"]], axis=1)
    reach = (np.linalg.norm(size_m, axis=1)[:, None] + _ACTOR_MARGIN_M) / grid.voxel_m
    return actors[((center > -reach) & (center < np.array(grid.shape) + reach)).all(axis=1)]


def _corner_major(triangles: Int32Array) -> Int64Array:
    """(3, T) int64 of (T, 3) triangles: the layout that indexes fastest."""
    return np.ascontiguousarray(triangles.T, np.int64)


def _to_grid(grid_from_map: Float64Array, origin_m: Float64Array, points: Float32Array) -> Float32Array:
    """(3, P) voxel coordinates, by axis, of (P, 3) points in meters relative to ``origin_m`` in the map frame."""
    linear, offset = grid_from_map[:3, :3].astype(np.float32), apply(grid_from_map, origin_m[None])[0]
    x, y, z = points.T
    # Written out: a matrix product's last bits may depend on how many points are in the batch.
    return np.stack([a * x + b * y + c * z + d for (a, b, c), d in zip(linear, offset.astype(np.float32), strict=True)])


def voxelize(soup: Soup, shape: GridShape) -> UInt8Array:
    """Highest rank of what is in each voxel, ``shape`` uint8; 0 where it is empty."""
    ranks = np.zeros(int(np.prod(shape)), np.uint8)
    fill_solids(ranks, soup, shape)
    mark_surfaces(ranks, soup, shape)
    return ranks.reshape(shape)
