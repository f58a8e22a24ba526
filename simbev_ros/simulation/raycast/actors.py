"""Casts rays against moving actors without building their meshes at every tick.

All rigid parts of all models lie in one immutable Embree scene (``PartStack``). A ray that passes through the box
around an actor's part in the world is transformed into the rest frame of that part, at the ray's own time, and cast
there. Building a scene of the posed actors at each tick instead would take several times as long as a whole scan.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices, ragged_starts
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, Int64Array, Table, UInt8Array
from simbev_ros.scene.interpolation import ActorHistory
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.simulation.raycast.boxes import CORNERS, PartBoxes, Passages
from simbev_ros.simulation.raycast.embree import relative_rays
from simbev_ros.simulation.raycast.part_stack import PartStack

_SAMPLES_PER_TICK = 8
"""Number of poses per tick at which moving parts are sampled; in between they move by less than their boxes' skin."""


@dataclass(frozen=True, slots=True)
class ActorHits:
    """Rays that hit an actor before anything else; each ray at most once.

    Attributes:
        ray: (H,) int64 index of the ray, ascending.
        range_m: (H,) float32 range of the hit.
        row: (H,) int32 row of the actor in the course given to ``update``.
        part: (H,) int32 rigid part of the actor.
        material: (H,) uint8 material.
        normal: (H, 3) float32 unit normal by the triangle's winding, map axes.
    """

    ray: Int64Array
    range_m: Float32Array
    row: Int32Array
    part: Int32Array
    material: UInt8Array
    normal: Float32Array


class ActorTriangles:
    """Actors of a scene as instances of the parts in a ``PartStack``; the parts of an actor are consecutive."""

    def __init__(self, stack: PartStack) -> None:
        self._stack = stack

    def update(self, course: ActorHistory, origin_m: Float64Array) -> None:
        """Update all poses to a tick.

        Args:
            course: States of the actors at this tick and at earlier ones that rays are cast at.
            origin_m: (3,) point of the map frame that rays are relative to.
        """
        self._course, self._origin_m = course, origin_m
        self._first, self._row, self._part = self._instances(course.now)
        self._poses = self._instance_poses(course.now)
        self._boxes = PartBoxes(self._corners_now() if len(course.lags_s) == 1 else self._corners_of_course())

    def _instances(self, actors: Table) -> tuple[Int64Array, Int64Array, Int64Array]:
        """(N,) first instance of each of (N,) rows, and per instance, actor by actor, its row and part in the stack."""
        first, blueprint = self._stack.first, actors["blueprint"].astype(np.int64)
        count = first[blueprint + 1] - first[blueprint]
        row, offset = ragged_indices(count)
        return ragged_starts(count), row, first[blueprint][row] + offset

    def _instance_poses(self, actors: Table) -> Float64Array:
        """(I, 4, 4) transforms of the instances of (N,) rows from the rest pose to the map axes about the origin."""
        _, row, part = self._instances(actors)
        owner, _ = self._stack.skeletons.rows(actors)
        posed = self._stack.skeletons.poses(actors)[np.searchsorted(owner, row) + self._stack.part[part]]
        poses = map_from_actors(actors)
        poses[:, :3, 3] -= self._origin_m
        return poses[row] @ posed

    def _corners_now(self) -> Float64Array:
        """(I, 8, 3) corners of the boxes around the parts at the tick."""
        rest_m = self._stack.center_m[self._part, None] + CORNERS * self._stack.half_m[self._part, None]
        return rest_m @ self._poses[:, :3, :3].swapaxes(1, 2) + self._poses[:, None, :3, 3]

    def _corners_of_course(self) -> Float64Array:
        """(I, 8, 3) corners of axis-aligned boxes that contain the parts' spheres throughout the course."""
        course = self._course
        moments = np.linspace(0.0, course.lags_s[-1], _SAMPLES_PER_TICK * (len(course.lags_s) - 1) + 1)
        actor = np.tile(np.arange(len(course.now)), len(moments))
        poses = self._instance_poses(course.at(actor, np.repeat(moments, len(course.now))))
        center_m = _transform_points(poses, np.tile(self._stack.center_m[self._part], (len(moments), 1)))
        center_m = center_m.reshape(len(moments), -1, 3)
        low_m, high_m = center_m.min(axis=0), center_m.max(axis=0)
        half_m = (high_m - low_m) / 2.0 + self._stack.radius_m[self._part, None]
        return (low_m + high_m)[:, None] / 2.0 + CORNERS * half_m[:, None]

    def cast(
        self,
        origins_m: Float64Array,
        directions: Float32Array,
        limit_m: Float32Array,
        lag_s: Float64Array | None = None,
    ) -> ActorHits:
        """Find the rays that hit an actor at a range below their limit.

        Args:
            origins_m: (N, 3) origins, or (1, 3) if shared, map frame.
            directions: (N, 3) unit vectors, map axes.
            limit_m: (N,) range at which each ray hits the static world.
            lag_s: (N,) time before the tick at which each ray is cast; None: all at the tick.
        """
        passages = self._boxes.passages(relative_rays(origins_m, self._origin_m, directions), limit_m)
        poses = self._poses[passages.box] if lag_s is None else self._poses_at_ray_times(passages, lag_s)
        origin_m = origins_m[passages.ray] if len(origins_m) > 1 else origins_m
        center_m = _transform_points(poses, self._stack.center_m[self._part[passages.box]])
        return self._cast_parts(passages, poses, origin_m - self._origin_m - center_m, directions, limit_m)

    def _poses_at_ray_times(self, passages: Passages, lag_s: Float64Array) -> Float64Array:
        """(K, 4, 4) poses of the parts of (K,) passages at the times of the rays."""
        row = self._row[passages.box]
        lags_s, moment = np.unique(lag_s[passages.ray], return_inverse=True)
        moved, inverse = np.unique(row * max(len(lags_s), 1) + moment, return_inverse=True)
        actor, moment = np.divmod(moved, max(len(lags_s), 1))
        poses = self._instance_poses(self._course.at(actor, lags_s[moment]))
        first, _, _ = self._instances(self._course.now[actor])
        return poses[first[inverse] + passages.box - self._first[row]]

    def _cast_parts(
        self,
        passages: Passages,
        poses: Float64Array,
        from_center_m: Float64Array,
        directions: Float32Array,
        limit_m: Float32Array,
    ) -> ActorHits:
        """Cast rays in the rest frames of the parts that they pass, and keep each ray's nearest hit.

        A ray starts where it enters the part's sphere: before, it might hit other parts of the stack.
        """
        stack, part, ray = self._stack, self._part[passages.box], passages.ray
        along = directions[ray].astype(np.float64)
        middle_m = -np.einsum("ni,ni->n", from_center_m, along)
        half_chord2_m2 = middle_m**2 + stack.radius_m[part] ** 2 - np.einsum("ni,ni->n", from_center_m, from_center_m)
        start_m = np.maximum(middle_m - np.sqrt(np.maximum(half_chord2_m2, 0.0)), 0.0)
        from_center_m = from_center_m + along * start_m[:, None]
        rotation = poses[:, :3, :3].astype(np.float32)
        rays = np.empty((len(part), 6), np.float32)
        rays[:, :3] = np.einsum("nji,nj->ni", rotation, from_center_m.astype(np.float32))
        rays[:, 2] += stack.height_m[part]
        rays[:, 3:] = np.einsum("nji,nj->ni", rotation, directions[ray])
        hits = stack.triangles.cast(rays)
        range_m = hits.range_m + start_m.astype(np.float32)
        own = (hits.triangle >= 0) & (stack.triangle_part[hits.triangle] == part)
        found = np.flatnonzero(own & (half_chord2_m2 > 0.0) & (range_m < limit_m[ray]))
        found = found[np.lexsort((range_m[found], ray[found]))]  # at equal ranges the first part wins
        kept = found[np.flatnonzero(np.diff(ray[found], prepend=-1))]
        return ActorHits(
            ray=ray[kept],
            range_m=range_m[kept],
            row=self._row[passages.box[kept]].astype(np.int32),
            part=stack.part[part[kept]].astype(np.int32),
            material=stack.triangle_material[hits.triangle[kept]],
            normal=np.einsum("nij,nj->ni", rotation[kept], hits.normal[kept]),
        )


def _transform_points(poses: Float64Array, points: Float64Array) -> Float64Array:
    """(N, 3) points transformed by (N, 4, 4) transforms."""
    return np.einsum("nij,nj->ni", poses[:, :3, :3], points) + poses[:, :3, 3]
