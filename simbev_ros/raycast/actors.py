"""Rays against moving actors, with next to nothing to build per tick.

All rigid parts of all models lie in one immutable Embree scene (``PartStack``). A ray that passes the box around an
actor's part in the world is moved into the rest frame of that part, as it is at the ray's own time, and cast there. To
build a scene of the posed actors at each tick instead takes several times as long as a whole scan.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.actor_model import ActorModel, part_poses
from simbev_ros.raycast.between import Course
from simbev_ros.raycast.boxes import CORNERS, Boxes, Passages
from simbev_ros.raycast.part_stack import PartStack
from simbev_ros.scene.state import map_from_actors
from simbev_ros.types import Float32Array, Float64Array, Int32Array, Int64Array, Table, UInt8Array

_SAMPLES_PER_TICK = 8
"""So often in a tick it is looked where parts are; in between they swing by less than the skin of their boxes."""


@dataclass(frozen=True, slots=True)
class ActorHits:
    """Rays that an actor is hit by before anything else; each ray at most once.

    Attributes:
        ray: (H,) int64 index of the ray, ascending.
        range_m: (H,) float32.
        row: (H,) int32 row of the actor in the course given to ``update``.
        part: (H,) int32 rigid part of it.
        material: (H,) uint8.
        normal: (H, 3) float32 unit normal by the triangle's winding, map axes.
    """

    ray: Int64Array
    range_m: Float32Array
    row: Int32Array
    part: Int32Array
    material: UInt8Array
    normal: Float32Array


class ActorTriangles:
    """Actors as instances of the stack's parts, the parts of an actor one after the other."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        self._models = models
        self._stack = PartStack(models)

    def update(self, course: Course, origin_m: Float64Array) -> None:
        """Moves to a tick.

        Args:
            course: Of the actors up to then.
            origin_m: (3,) point of the map frame that rays are relative to.
        """
        self._course, self._origin_m = course, origin_m
        blueprint = course.now["blueprint"].astype(np.int64)
        count = self._stack.first[blueprint + 1] - self._stack.first[blueprint]
        self._first = np.cumsum(count) - count
        self._row = np.repeat(np.arange(len(blueprint)), count)
        self._part = np.arange(len(self._row)) + (self._stack.first[blueprint] - self._first)[self._row]
        self._poses = self._placed(course.now)
        self._boxes = Boxes(self._corners_now() if len(course.lags_s) == 1 else self._corners_of_course())

    def _placed(self, actors: Table) -> Float64Array:
        """(I, 4, 4) poses of the parts at rest of (N,) rows, relative to the origin, actor by actor."""
        first, blueprint = self._stack.first, actors["blueprint"].astype(np.int64)
        row = np.repeat(np.arange(len(actors)), first[blueprint + 1] - first[blueprint])
        poses = map_from_actors(actors)
        poses[:, :3, 3] -= self._origin_m
        poses = poses[row]
        for index in np.unique(blueprint):
            parts = self._stack.part[first[index] : first[index + 1]]
            same = part_poses(self._models[index], actors[blueprint == index])[:, parts]
            mine = blueprint[row] == index
            poses[mine] = poses[mine] @ same.reshape(-1, 4, 4)
        return poses

    def _corners_now(self) -> Float64Array:
        """(I, 8, 3) corners of the boxes around the parts."""
        rest_m = self._stack.center_m[self._part, None] + CORNERS * self._stack.half_m[self._part, None]
        corners_m: Float64Array = rest_m @ self._poses[:, :3, :3].swapaxes(1, 2) + self._poses[:, None, :3, 3]
        return corners_m

    def _corners_of_course(self) -> Float64Array:
        """(I, 8, 3) corners of the upright boxes that the parts' spheres have not left."""
        course = self._course
        moments = np.linspace(0.0, course.lags_s[-1], _SAMPLES_PER_TICK * (len(course.lags_s) - 1) + 1)
        actor = np.tile(np.arange(len(course.now)), len(moments))
        poses = self._placed(course.at(actor, np.repeat(moments, len(course.now))))
        center_m = _moved(poses, np.tile(self._stack.center_m[self._part], (len(moments), 1)))
        center_m = center_m.reshape(len(moments), -1, 3)
        low_m, high_m = center_m.min(axis=0), center_m.max(axis=0)
        half_m = (high_m - low_m) / 2.0 + self._stack.radius_m[self._part, None]
        corners_m: Float64Array = (low_m + high_m)[:, None] / 2.0 + CORNERS * half_m[:, None]
        return corners_m

    def cast(
        self,
        origins_m: Float64Array,
        directions: Float32Array,
        limit_m: Float32Array,
        lag_s: Float64Array | None = None,
    ) -> ActorHits:
        """Rays that hit an actor nearer than their limit.

        Args:
            origins_m: (N, 3), or (1, 3) when shared, map frame.
            directions: (N, 3) unit vectors, map axes.
            limit_m: (N,) range of what else the ray hits.
            lag_s: (N,) how long before the tick each ray is cast; None: at the tick.
        """
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3] = origins_m - self._origin_m
        rays[:, 3:] = directions
        passages = self._boxes.passages(rays, limit_m)
        poses = self._poses[passages.box] if lag_s is None else self._poses_then(passages, lag_s)
        origin_m = origins_m[passages.ray] if len(origins_m) > 1 else origins_m
        return self._cast_parts(passages, poses, origin_m - self._origin_m, directions[passages.ray], limit_m)

    def _poses_then(self, passages: Passages, lag_s: Float64Array) -> Float64Array:
        """(K, 4, 4) poses of the passed parts at the times of the rays."""
        row = self._row[passages.box]
        lags_s, moment = np.unique(lag_s[passages.ray], return_inverse=True)
        moved, place = np.unique(row * max(len(lags_s), 1) + moment, return_inverse=True)
        actor, moment = np.divmod(moved, max(len(lags_s), 1))
        poses = self._placed(self._course.at(actor, lags_s[moment]))
        blueprint = self._course.now["blueprint"][actor].astype(np.int64)
        count = self._stack.first[blueprint + 1] - self._stack.first[blueprint]
        first = np.cumsum(count) - count
        chosen: Float64Array = poses[first[place] + passages.box - self._first[row]]
        return chosen

    def _cast_parts(
        self,
        passages: Passages,
        poses: Float64Array,
        origins_m: Float64Array,
        directions: Float32Array,
        limit_m: Float32Array,
    ) -> ActorHits:
        """Casts rays in the rest frames of the parts that they pass, and keeps each ray's nearest hit."""
        stack, part = self._stack, self._part[passages.box]
        rotation = poses[:, :3, :3].astype(np.float32)
        start_m = directions * passages.entry_m[:, None].astype(np.float64) + origins_m
        from_center_m = (start_m - _moved(poses, stack.center_m[part])).astype(np.float32)
        rays = np.empty((len(part), 6), np.float32)
        rays[:, :3] = np.einsum("nji,nj->ni", rotation, from_center_m)
        rays[:, 2] += stack.height_m[part]
        rays[:, 3:] = np.einsum("nji,nj->ni", rotation, directions)
        hits = stack.triangles.cast(rays)
        range_m = hits.range_m + passages.entry_m
        own = (hits.triangle >= 0) & (stack.triangle_part[hits.triangle] == part) & (range_m < limit_m[passages.ray])
        found = np.flatnonzero(own)
        found = found[np.lexsort((range_m[found], passages.ray[found]))]  # of equal ranges the first part wins
        kept = found[np.flatnonzero(np.diff(passages.ray[found], prepend=-1))]
        return ActorHits(
            ray=passages.ray[kept],
            range_m=range_m[kept],
            row=self._row[passages.box[kept]].astype(np.int32),
            part=stack.part[part[kept]].astype(np.int32),
            material=stack.triangle_material[hits.triangle[kept]],
            normal=np.einsum("nij,nj->ni", rotation[kept], hits.normal[kept]),
        )


def _moved(poses: Float64Array, points: Float64Array) -> Float64Array:
    """(N, 3) points after (N, 4, 4) transforms."""
    moved: Float64Array = np.einsum("nij,nj->ni", poses[:, :3, :3], points) + poses[:, :3, 3]
    return moved
