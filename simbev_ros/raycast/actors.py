"""Rays against moving actors, without building anything per tick.

All rigid parts of all models lie in one immutable Embree scene (``PartStack``). A ray that passes an actor's part in
the world is moved into the rest frame of that part and cast there. To build a scene of the posed actors at each tick
instead takes several times as long as a whole scan.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.actor_model import ActorModel, part_poses
from simbev_ros.raycast.part_stack import PartStack
from simbev_ros.scene.state import map_from_actors
from simbev_ros.types import Float32Array, Float64Array, Int64Array, Table, UInt8Array

_BLOCK = 8192
"""Rays that are tested at a time against all actors: the intermediate matrices then stay in the cache."""

_SLACK_M = 1e-3
"""Rounding of the float32 test of rays against actors' spheres (they are larger than the actor by more than that)."""


@dataclass(frozen=True, slots=True)
class ActorHits:
    """Rays that an actor is hit by before anything else; each ray at most once.

    Attributes:
        ray: (H,) int64 index of the ray.
        range_m: (H,) float32.
        row: (H,) int64 row of the actor in the table given to ``update``.
        material: (H,) uint8.
        normal: (H, 3) float32 unit normal by the triangle's winding, map axes.
    """

    ray: Int64Array
    range_m: Float32Array
    row: Int64Array
    material: UInt8Array
    normal: Float32Array


class ActorTriangles:
    """The actors of one tick: instances of the stack's parts, the parts of an actor one after the other."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        self._models = models
        self._stack = PartStack(models)

    def update(self, actors: Table, origin_m: Float64Array) -> None:
        """Places the parts of (N,) ``ACTOR_DTYPE`` rows relative to a (3,) origin in the map frame."""
        stack, blueprint = self._stack, actors["blueprint"].astype(np.int64)
        self._count = stack.first[blueprint + 1] - stack.first[blueprint]
        self._first = np.cumsum(self._count) - self._count
        self._row = np.repeat(np.arange(len(actors)), self._count)
        self._part = np.arange(len(self._row)) + (stack.first[blueprint] - self._first)[self._row]
        pose = map_from_actors(actors)[self._row]
        for index in np.unique(blueprint):
            parts = stack.part[stack.first[index] : stack.first[index + 1]]
            same = part_poses(self._models[index], actors[blueprint == index])[:, parts]
            mine = blueprint[self._row] == index
            pose[mine] = pose[mine] @ same.reshape(-1, 4, 4)
        self._rotation = pose[:, :3, :3].astype(np.float32)
        center_m = np.einsum("nij,nj->ni", pose[:, :3, :3], stack.center_m[self._part])
        self._center_m = center_m + (pose[:, :3, 3] - origin_m)
        self._radius_m = stack.radius_m[self._part]
        self._bound_actors(len(actors))

    def _bound_actors(self, count: int) -> None:
        """One sphere per actor around the spheres of its parts."""
        sums = np.stack([np.bincount(self._row, axis, count) for axis in self._center_m.T], axis=1)
        self._actor_center_m = sums / np.maximum(self._count, 1)[:, None]
        reach_m = np.linalg.norm(self._center_m - self._actor_center_m[self._row], axis=1) + self._radius_m
        self._actor_radius_m = np.zeros(count, np.float32)
        np.maximum.at(self._actor_radius_m, self._row, reach_m)

    def cast(self, origins_m: Float64Array, directions: Float32Array, limit_m: Float32Array) -> ActorHits:
        """Rays that hit an actor nearer than their limit.

        Args:
            origins_m: (N, 3), or (1, 3) when shared, relative to the origin of ``update``.
            directions: (N, 3) unit vectors, map axes.
            limit_m: (N,) range of what else the ray hits.
        """
        ray, actor = self._near_actors(origins_m, directions, limit_m)
        count = self._count[actor]
        instance = np.arange(count.sum()) + np.repeat(self._first[actor] - np.cumsum(count) + count, count)
        ray = np.repeat(ray, count)
        along_m, beside2_m2 = self._passage(origins_m, directions, ray, instance)
        half2_m2 = self._radius_m[instance] ** 2 - beside2_m2
        half_m = np.sqrt(np.maximum(half2_m2, 0.0))
        near = (half2_m2 > 0) & (along_m + half_m > 0) & (along_m - half_m < limit_m[ray])
        start_m = np.maximum(along_m[near] - half_m[near], 0.0)
        return self._cast_parts(origins_m, directions, limit_m, ray[near], instance[near], start_m)

    def _passage(
        self, origins_m: Float64Array, directions: Float32Array, ray: Int64Array, instance: Int64Array
    ) -> tuple[Float32Array, Float32Array]:
        """Where along each ray its part's centre is passed, and the square of the distance to it then."""
        x, y, z = (np.ascontiguousarray(axis)[instance] for axis in self._center_m.astype(np.float32).T)
        if len(origins_m) > 1:
            origin_x, origin_y, origin_z = (axis[ray] for axis in origins_m.astype(np.float32).T)
        else:
            origin_x, origin_y, origin_z = origins_m[0].astype(np.float32)
        x, y, z = x - origin_x, y - origin_y, z - origin_z
        dx, dy, dz = (np.ascontiguousarray(axis)[ray] for axis in directions.T)
        along_m = x * dx + y * dy + z * dz
        return along_m, (x - along_m * dx) ** 2 + (y - along_m * dy) ** 2 + (z - along_m * dz) ** 2

    def _near_actors(
        self, origins_m: Float64Array, directions: Float32Array, limit_m: Float32Array
    ) -> tuple[Int64Array, Int64Array]:
        """Pairs (ray, actor) in which the ray passes through the actor's sphere before its limit."""
        rays, actors = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        radius_m = self._actor_radius_m[:, None]
        for start in range(0, len(directions), _BLOCK):
            block = slice(start, start + _BLOCK)
            origin_m = origins_m[block] if len(origins_m) > 1 else origins_m
            to_center_m = self._actor_center_m[:, None] - origin_m
            if len(origin_m) > 1:
                along_m = np.einsum("mni,ni->mn", to_center_m, directions[block])
            else:
                along_m = to_center_m[:, 0].astype(np.float32) @ directions[block].T
            tangent2_m2 = np.einsum("mni,mni->mn", to_center_m, to_center_m) - radius_m**2
            tangent_m = np.where(tangent2_m2 > 0, np.sqrt(np.maximum(tangent2_m2, 0.0)), -np.inf)
            touched = np.flatnonzero(along_m >= tangent_m.astype(np.float32) - _SLACK_M)
            actor, ray = np.divmod(touched, along_m.shape[1])
            near = along_m.ravel()[touched] - self._actor_radius_m[actor] < limit_m[block][ray]
            rays.append(ray[near] + start)
            actors.append(actor[near])
        return np.concatenate(rays), np.concatenate(actors)

    def _cast_parts(
        self,
        origins_m: Float64Array,
        directions: Float32Array,
        limit_m: Float32Array,
        ray: Int64Array,
        instance: Int64Array,
        start_m: Float32Array,
    ) -> ActorHits:
        """Casts pairs (ray, instance) in the rest frames, from ``start_m`` on, and keeps each ray's nearest hit."""
        stack, part = self._stack, self._part[instance]
        rotation = self._rotation[instance]
        rays = np.empty((len(ray), 6), np.float32)
        origin_m = origins_m[ray] if len(origins_m) > 1 else origins_m
        from_center_m = directions[ray] * start_m[:, None].astype(np.float64) + (origin_m - self._center_m[instance])
        rays[:, :3] = np.einsum("nji,nj->ni", rotation, from_center_m.astype(np.float32))
        rays[:, 2] += stack.height_m[part]
        rays[:, 3:] = np.einsum("nji,nj->ni", rotation, directions[ray])
        hits = stack.triangles.cast(rays)
        range_m = hits.range_m + start_m
        own = (hits.triangle >= 0) & (stack.triangle_part[hits.triangle] == part) & (range_m < limit_m[ray])
        nearest_m = np.full(len(directions), np.inf, np.float32)
        np.minimum.at(nearest_m, ray[own], range_m[own])
        first = np.full(len(directions), -1)
        best = np.flatnonzero(own & (range_m == nearest_m[ray]))
        first[ray[best[::-1]]] = best[::-1]  # of equal ranges the first pair wins
        kept = first[first >= 0]
        return ActorHits(
            ray=ray[kept],
            range_m=range_m[kept],
            row=self._row[instance[kept]],
            material=stack.triangle_material[hits.triangle[kept]],
            normal=np.einsum("nij,nj->ni", rotation[kept], hits.normal[kept]),
        )
